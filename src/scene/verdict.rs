//! How an answer is judged against the truth, and the figures of many.

use nalgebra::Vector3;

use super::protocols::Trial;
use crate::geometry::{CameraFromTarget, PoseCovariance, rotation};
use crate::refine::information;

/// An answer turned by more than this is a flip; one within it, and within [`MAX_GOOD_TRANSLATION_RATIO`], is good.
pub const MAX_GOOD_ROTATION_DEG: f64 = 20.0;

/// Error of a good answer's translation as a share of the range.
pub const MAX_GOOD_TRANSLATION_RATIO: f64 = 0.1;

/// The bound is sharp, so that errors can be compared with it, up to this deviation of the rotation (root of the summed
/// variances about the three axes).
pub const MAX_SHARP_ROTATION_DEG: f64 = 5.0;

/// The bound is sharp up to this deviation of the range as a share of the range.
pub const MAX_SHARP_RANGE_RATIO: f64 = 0.05;

/// The bound is sharp only if every point stands this far before the camera's plane, as a share of the range: nearer, the image
/// of a point runs off to infinity within its own error.
pub const MIN_SHARP_DEPTH_RATIO: f64 = 0.05;

/// One answer against its truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// Angle between the rotations.
    pub rotation_deg: f64,
    /// Distance between the translations over the true range.
    pub translation_ratio: f64,
    /// Difference of the ranges over the true range.
    pub range_ratio: f64,
    /// Squared error in units of the Cramer-Rao bound at the truth, 6 on average for an estimate that reaches it; `None` where
    /// the bound is not sharp.
    pub normalized_error_squared: Option<f64>,
}

impl Verdict {
    /// Of `answer` to `trial`.
    #[must_use]
    pub fn of(trial: &Trial, bound: Option<&PoseCovariance>, answer: &CameraFromTarget) -> Self {
        let truth = &trial.case.camera_from_target;
        let range_m = truth.translation.norm();
        Self {
            rotation_deg: rotation::angle_between_rad(&answer.rotation, &truth.rotation).to_degrees(),
            translation_ratio: (answer.translation - truth.translation).norm() / range_m,
            range_ratio: (answer.translation.norm() - range_m).abs() / range_m,
            normalized_error_squared: bound.map(|bound| bound.normalized_error_squared(answer, truth)),
        }
    }

    /// Near the truth.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.rotation_deg <= MAX_GOOD_ROTATION_DEG && self.translation_ratio <= MAX_GOOD_TRANSLATION_RATIO
    }

    /// The wrong attitude.
    #[must_use]
    pub fn is_flip(&self) -> bool {
        self.rotation_deg > MAX_GOOD_ROTATION_DEG
    }
}

/// The Cramer-Rao bound of a trial's right pairs at the true pose, where it is sharp. Elsewhere (far, small, nearly face on)
/// errors are not Gaussian and a comparison with it says nothing.
#[must_use]
pub fn sharp_bound(trial: &Trial) -> Option<PoseCovariance> {
    let truth = &trial.case.camera_from_target;
    let information = information(&trial.case.camera, &trial.right_correspondences(), truth).ok()?;
    let bound = PoseCovariance::from_information(&information)?;
    let covariance = bound.matrix();
    let rotation_deg = covariance.fixed_view::<3, 3>(3, 3).trace().sqrt().to_degrees();
    let sight: Vector3<f64> = truth.translation.normalize();
    let range_m = (covariance.fixed_view::<3, 3>(0, 0) * sight).dot(&sight).sqrt();
    let nearest_m = trial.case.points.iter().map(|point| (*truth * *point).coords.z).fold(f64::INFINITY, f64::min);
    let is_sharp = nearest_m > MIN_SHARP_DEPTH_RATIO * truth.translation.norm()
        && rotation_deg < MAX_SHARP_ROTATION_DEG
        && range_m < MAX_SHARP_RANGE_RATIO * truth.translation.norm();
    is_sharp.then_some(bound)
}

/// The figures of a method in a study.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Share of good answers among all trials.
    pub good_ratio: f64,
    /// Share of flips among all trials. What is neither has no answer, or the right attitude in the wrong place.
    pub flip_ratio: f64,
    /// Median angle of error, an answer that is missing counting as the worst.
    pub median_rotation_deg: f64,
    /// Median error of the range as a share of it, likewise.
    pub median_range_ratio: f64,
    /// Root mean square error over the Cramer-Rao bound: `sqrt(mean(normalized_error_squared) / 6)` over the answers that are
    /// no flips, where the bound is sharp; 1 reaches the bound. `NaN` where there are none.
    pub over_bound_ratio: f64,
}

impl Figures {
    /// Of the answers of one method to all trials of a study, `None` where it had none.
    #[must_use]
    pub fn of(verdicts: &[Option<Verdict>]) -> Self {
        let share = |what: fn(&Verdict) -> bool| {
            verdicts.iter().flatten().filter(|verdict| what(verdict)).count() as f64 / verdicts.len() as f64
        };
        let compared: Vec<f64> = verdicts
            .iter()
            .flatten()
            .filter(|verdict| !verdict.is_flip())
            .filter_map(|verdict| verdict.normalized_error_squared)
            .collect();
        Self {
            good_ratio: share(Verdict::is_good),
            flip_ratio: share(Verdict::is_flip),
            median_rotation_deg: median(verdicts, |verdict| verdict.rotation_deg),
            median_range_ratio: median(verdicts, |verdict| verdict.range_ratio),
            over_bound_ratio: (compared.iter().sum::<f64>() / compared.len() as f64 / 6.0).sqrt(),
        }
    }
}

fn median(verdicts: &[Option<Verdict>], of: impl Fn(&Verdict) -> f64) -> f64 {
    let mut values: Vec<f64> = verdicts.iter().map(|verdict| verdict.as_ref().map_or(f64::INFINITY, &of)).collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::*;
    use crate::random::{self, normal};
    use crate::scene::protocols::Protocol;

    #[test]
    fn the_truth_is_good_and_its_error_nothing() {
        for protocol in Protocol::ALL {
            let trial = protocol.trial(0);
            let verdict = Verdict::of(&trial, sharp_bound(&trial).as_ref(), &trial.case.camera_from_target);
            assert!(verdict.is_good() && !verdict.is_flip());
            assert!(verdict.rotation_deg < 1e-6 && verdict.translation_ratio < 1e-9 && verdict.range_ratio < 1e-9);
            assert!(verdict.normalized_error_squared.is_none_or(|squared| squared < 1e-9));
        }
    }

    #[test]
    fn a_turn_by_more_than_twenty_degrees_is_a_flip_and_a_tenth_too_far_is_neither_good_nor_a_flip() {
        let trial = Protocol::Nonplanar.trial(0);
        let truth = trial.case.camera_from_target;
        let turned = |deg: f64| truth.perturbed(&Vector6::new(0.0, 0.0, 0.0, deg.to_radians(), 0.0, 0.0));
        assert!(Verdict::of(&trial, None, &turned(21.0)).is_flip());
        assert!(Verdict::of(&trial, None, &turned(19.0)).is_good());
        let farther = CameraFromTarget::new(truth.rotation, truth.translation * 1.11);
        let verdict = Verdict::of(&trial, None, &farther);
        assert!(!verdict.is_good() && !verdict.is_flip());
    }

    #[test]
    fn errors_drawn_from_the_bound_are_once_the_bound() {
        let mut rng = random::named("errors of the bound");
        let verdicts: Vec<Option<Verdict>> = (0..2000)
            .map(|index| {
                let trial = Protocol::Visible.trial(index);
                let bound = sharp_bound(&trial)?;
                let root = bound.matrix().cholesky()?.l();
                let error = root * Vector6::from_fn(|_, _| normal(&mut rng));
                Some(Verdict::of(&trial, Some(&bound), &trial.case.camera_from_target.perturbed(&error)))
            })
            .collect();
        let ratio = Figures::of(&verdicts).over_bound_ratio;
        // The mean of n chi-squares of six degrees of freedom over 6 deviates by sqrt(1 / 3 n), its root by half of that.
        let count = verdicts.iter().flatten().count() as f64;
        assert!(count > 500.0, "{count} trials with a sharp bound");
        assert!((ratio - 1.0).abs() < 4.0 * 0.5 / (3.0 * count).sqrt(), "{ratio} over {count}");
    }

    #[test]
    fn a_missing_answer_is_neither_good_nor_a_flip_and_the_worst_in_the_median() {
        let trial = Protocol::Nonplanar.trial(0);
        let good = Verdict::of(&trial, None, &trial.case.camera_from_target);
        let figures = Figures::of(&[Some(good), None, None]);
        assert!((figures.good_ratio - 1.0 / 3.0).abs() < 1e-12);
        assert!(figures.flip_ratio.abs() < 1e-12);
        assert!(figures.median_rotation_deg.is_infinite());
    }
}
