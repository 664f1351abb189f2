//! The hypotheses of one track: a weighted sum of motions, one for each attitude that the answers so far leave possible.

use arrayvec::ArrayVec;
use nalgebra::Vector3;

use super::measured::{MAX_POSES, Measured};
use super::merge::reduced;
use super::motion::{Matrix12, Motion};
use super::options::TrackOptions;
use super::update::{Innovation, PlaceInnovation};
use crate::geometry::CameraFromTarget;
use crate::statistics::chi_square_quantile;

/// A motion and the probability that it is the right one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hypothesis {
    /// The motion.
    pub motion: Motion,
    /// That this one and none of the others is right.
    pub probability: f64,
}

/// A hypothesis before weights are brought to a sum of one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weighed {
    pub motion: Motion,
    pub ln_weight: f64,
}

/// Hypotheses by falling probability, never none, their probabilities with a sum of one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Mixture(Vec<Hypothesis>);

/// Logarithm of the density of attitudes that are all equally likely: `1 / (8 pi^2)`.
const LN_ANY_ATTITUDE: f64 = -4.368_901_313_378_636;

impl Mixture {
    /// A new target: each pose of its first answer, at any speed.
    pub(super) fn born(poses: &[Measured], options: &TrackOptions) -> Option<Self> {
        let mut begun = Vec::with_capacity(poses.len());
        for pose in poses {
            let mut covariance = Matrix12::zeros();
            covariance.fixed_view_mut::<6, 6>(0, 0).copy_from(pose.covariance.matrix());
            covariance.fixed_view_mut::<3, 3>(6, 6).fill_diagonal(options.speed_sigma_mps.powi(2));
            covariance.fixed_view_mut::<3, 3>(9, 9).fill_diagonal(options.turn_rate_sigma_radps.powi(2));
            let motion = Motion::checked(pose.camera_from_target, Vector3::zeros(), Vector3::zeros(), &covariance);
            begun.extend(motion.map(|motion| Weighed { motion, ln_weight: pose.probability.ln() }));
        }
        Self::of(begun, options)
    }

    /// Of weighed motions: the improbable given up, like ones merged.
    fn of(weighed: Vec<Weighed>, options: &TrackOptions) -> Option<Self> {
        let kept = reduced(weighed, options);
        (!kept.is_empty()).then_some(Self(kept))
    }

    /// By falling probability.
    pub(super) fn hypotheses(&self) -> &[Hypothesis] {
        &self.0
    }

    /// The most probable.
    pub(super) fn best(&self) -> &Hypothesis {
        &self.0[0]
    }

    /// All of them later; `None` if none of them can be told any more.
    pub(super) fn predicted(&self, dt_s: f64, options: &TrackOptions) -> Option<Self> {
        let later: Vec<Weighed> = self
            .0
            .iter()
            .filter_map(|one| {
                let motion = one.motion.predicted(dt_s, options)?;
                Some(Weighed { motion, ln_weight: one.probability.ln() })
            })
            .collect();
        Self::of(later, options)
    }

    /// Logarithm of the density of an answer's position, whatever its attitudes; `None` if it lies outside every gate. The
    /// position tells which target an answer is of; its attitude may be the mirrored one.
    pub(super) fn ln_place_density(&self, poses: &[Measured], options: &TrackOptions) -> Option<f64> {
        let gate = chi_square_quantile(3.0, options.gate_z);
        let mut total = 0.0;
        let mut largest = f64::NEG_INFINITY;
        for one in &self.0 {
            for pose in poses {
                let Some(place) = PlaceInnovation::of(&one.motion, pose) else { continue };
                if place.squared <= gate {
                    let ln = place.ln_density + (one.probability * pose.probability).ln();
                    // Of a running sum in logarithms the larger part is taken out.
                    if ln > largest {
                        total = total * (largest - ln).exp() + 1.0;
                        largest = ln;
                    } else {
                        total += (ln - largest).exp();
                    }
                }
            }
        }
        (total > 0.0).then(|| largest + total.ln())
    }

    /// The hypotheses after an answer: every motion with every pose that lies in its gate, by Bayes' rule; a motion without one
    /// goes on unseen at a low weight, and a pose without one begins an attitude of its own at a lower one. `None` if the answer
    /// agrees with nothing.
    pub(super) fn updated(&self, poses: &[Measured], options: &TrackOptions) -> Option<Self> {
        let gate = chi_square_quantile(6.0, options.gate_z);
        let mut weighed = Vec::with_capacity(self.0.len() * (poses.len() + 1));
        let mut is_explained: ArrayVec<bool, MAX_POSES> = poses.iter().map(|_| false).collect();
        for one in &self.0 {
            let ln_prior = one.probability.ln();
            let mut is_seen = false;
            let mut ln_peak = f64::NEG_INFINITY;
            for (pose, explained) in poses.iter().zip(&mut is_explained) {
                let Some(innovation) = Innovation::of(&one.motion, pose) else { continue };
                ln_peak = ln_peak.max(innovation.ln_peak);
                if innovation.squared > gate {
                    continue;
                }
                if let Some(motion) = innovation.updated(&one.motion, pose) {
                    let ln_weight = ln_prior + pose.probability.ln() + innovation.ln_density;
                    weighed.push(Weighed { motion, ln_weight });
                    is_seen = true;
                    *explained = true;
                }
            }
            if !is_seen && ln_peak.is_finite() {
                let ln_weight = ln_prior + options.missed_minimum_probability.ln() + ln_peak;
                weighed.push(Weighed { motion: one.motion, ln_weight });
            }
        }
        let place_gate = chi_square_quantile(3.0, options.gate_z);
        for (pose, _) in poses.iter().zip(&is_explained).filter(|(_, explained)| !**explained) {
            weighed.extend(self.jumped(pose, place_gate, options));
        }
        Self::of(weighed, options)
    }

    /// The best motion turned to an attitude that no hypothesis has, its place and velocity kept.
    fn jumped(&self, pose: &Measured, place_gate: f64, options: &TrackOptions) -> Option<Weighed> {
        let Hypothesis { motion, probability } = self.best();
        let place = PlaceInnovation::of(motion, pose).filter(|place| place.squared <= place_gate)?;
        let mut covariance = *motion.covariance();
        for (at, sigma_rad) in [(3, std::f64::consts::PI), (9, options.turn_rate_sigma_radps)] {
            covariance.fixed_rows_mut::<3>(at).fill(0.0);
            covariance.fixed_columns_mut::<3>(at).fill(0.0);
            covariance.fixed_view_mut::<3, 3>(at, at).fill_diagonal(sigma_rad.powi(2));
        }
        let turned = CameraFromTarget::new(pose.camera_from_target.rotation, motion.camera_from_target().translation);
        let turned = Motion::checked(turned, *motion.velocity_mps(), Vector3::zeros(), &covariance)?;
        let motion = Innovation::of(&turned, pose)?.updated(&turned, pose)?;
        let ln_prior = (probability * pose.probability * options.jump_probability).ln();
        Some(Weighed { motion, ln_weight: ln_prior + place.ln_density + LN_ANY_ATTITUDE })
    }
}
