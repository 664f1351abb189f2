//! Keeping the number of hypotheses small.

use super::mixture::{Hypothesis, Weighed};
use super::motion::{Matrix12, Motion};
use super::options::TrackOptions;

/// Two motions nearer than this are one: a squared distance in units of both their covariances, of twelve numbers, so that they
/// differ by half a deviation in each. Two of the same weight then have a sum without a dent.
const SAME_SQUARED: f64 = 3.0;

/// The hypotheses that are kept, by falling probability, with a sum of one.
pub(super) fn reduced(mut weighed: Vec<Weighed>, options: &TrackOptions) -> Vec<Hypothesis> {
    weighed.retain(|one| one.ln_weight.is_finite());
    weighed.sort_by(|a, b| b.ln_weight.total_cmp(&a.ln_weight));
    let Some(largest) = weighed.first().map(|one| one.ln_weight) else { return Vec::new() };
    let mut left: Vec<Hypothesis> = weighed
        .iter()
        .map(|one| Hypothesis { motion: one.motion, probability: (one.ln_weight - largest).exp() })
        .filter(|one| one.probability >= options.min_branch_probability)
        .collect();
    let mut kept: Vec<Hypothesis> = Vec::with_capacity(options.max_branches);
    // From the heaviest on, as Salmond has it: what is near to it goes into it.
    while !left.is_empty() && kept.len() < options.max_branches {
        let mut heaviest = left.remove(0);
        left.retain(|other| match merged(&heaviest, other) {
            Some(both) => {
                heaviest = both;
                false
            }
            None => true,
        });
        kept.push(heaviest);
    }
    let total: f64 = kept.iter().map(|one| one.probability).sum();
    for one in &mut kept {
        one.probability /= total;
    }
    kept.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    kept
}

/// Both as one with the mean and the covariance of their sum, if they are near.
/// Salmond, "Mixture reduction algorithms for target tracking in clutter", SPIE 1305, 1990.
fn merged(heavier: &Hypothesis, lighter: &Hypothesis) -> Option<Hypothesis> {
    let difference = heavier.motion.difference_to(&lighter.motion);
    let (own, other) = (heavier.motion.covariance(), lighter.motion.covariance());
    // Cheap first: no single number may differ by more than all of them together.
    if (0..12).any(|i| difference[i].powi(2) > SAME_SQUARED * (own[(i, i)] + other[(i, i)])) {
        return None;
    }
    let sum: Matrix12 = own + other;
    if !(difference.dot(&sum.cholesky()?.solve(&difference)) < SAME_SQUARED) {
        return None;
    }
    let probability = heavier.probability + lighter.probability;
    let share = lighter.probability / probability;
    let covariance =
        own * (1.0 - share) + other * share + difference * difference.transpose() * (share * (1.0 - share));
    let motion: Motion = heavier.motion.moved(&(difference * share), &covariance)?;
    Some(Hypothesis { motion, probability })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::geometry::CameraFromTarget;

    fn at(x_m: f64, ln_weight: f64) -> Weighed {
        let pose = CameraFromTarget::new(nalgebra::Rotation3::identity(), Vector3::new(x_m, 0.0, 5.0));
        let motion = Motion::checked(pose, Vector3::zeros(), Vector3::zeros(), &Matrix12::identity());
        Weighed { motion: motion.expect("good numbers"), ln_weight }
    }

    #[test]
    fn near_ones_become_one_with_the_moments_of_both() {
        let kept = reduced(vec![at(0.0, 0.0), at(1.0, 0.0)], &TrackOptions::default());
        assert_eq!(kept.len(), 1);
        assert!((kept[0].motion.camera_from_target().translation.x - 0.5).abs() < 1e-12);
        assert!((kept[0].motion.covariance()[(0, 0)] - 1.25).abs() < 1e-12);
        assert!((kept[0].probability - 1.0).abs() < 1e-12);
    }

    #[test]
    fn far_ones_stay_apart_up_to_the_limit_and_the_improbable_go() {
        let far: Vec<Weighed> = (0..6).map(|i| at(10.0 * f64::from(i), -f64::from(i))).collect();
        let kept = reduced(far, &TrackOptions::default());
        assert_eq!(kept.len(), 4);
        assert!((kept.iter().map(|one| one.probability).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(kept.windows(2).all(|pair| pair[0].probability >= pair[1].probability));
        assert_eq!(reduced(vec![at(0.0, 0.0), at(10.0, -20.0)], &TrackOptions::default()).len(), 1);
        assert!(reduced(vec![at(0.0, f64::NAN)], &TrackOptions::default()).is_empty());
    }
}
