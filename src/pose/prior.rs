//! What is known of a pose before it is seen, by Bayes' rule.

use nalgebra::{Matrix3, Unit, Vector3};

use super::{NoPose, PoseAnswer, PoseEstimate};
use crate::geometry::{CameraFromTarget, EulerAngles, Point, PoseCovariance, rotation, space};
use crate::statistics::normal_share_below;

/// What the caller knows. Everything that is stated counts as independent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PosePrior {
    /// The camera sees the target from this side: a direction of the target that points into the half space of the camera.
    pub visible_side: Option<Unit<Vector3<f64>>>,
    /// Limits of roll, pitch and yaw, rad: from the first to the second, upwards, across the seam if the second is smaller.
    pub euler_limits_rad: [Option<[f64; 2]>; 3],
    /// The pose with its uncertainty, as predicted from before.
    pub predicted: Option<(CameraFromTarget, PoseCovariance)>,
}

/// Poses that the prior makes less probable than this are left out.
const NEGLIGIBLE: f64 = 1e-4;

/// If no pose has a larger share than this of what a prior without objection would leave it, image and prior contradict.
const CONTRADICTION: f64 = 1e-6;

/// A predicted pose that is further away than this from every pose seen contradicts: chi-square with six degrees of freedom
/// exceeds it once in a million.
const MAX_DISTANCE_SQUARED: f64 = 39.0;

impl PoseAnswer {
    /// The answer after `prior`: each pose weighed by how probable the prior makes it, and moved towards the predicted pose as
    /// far as the covariances say. `middle` is that of the target's points.
    ///
    /// # Errors
    /// [`NoPose::HighResidual`] if every pose that explains the points contradicts the prior.
    pub fn given(mut self, prior: &PosePrior, middle: &Point<space::Target>) -> Result<Self, NoPose> {
        let mut weighed: Vec<PoseEstimate> = Vec::new();
        let mut agrees = false;
        let mut total = 0.0;
        for estimate in std::iter::once(self.best).chain(std::mem::take(&mut self.alternatives)) {
            let share = prior.share_allowed(&estimate, middle);
            let (fused, density, is_near) = prior.fused(&estimate);
            agrees |= share > CONTRADICTION && is_near;
            let probability = estimate.probability * share * density;
            total += probability;
            weighed.push(PoseEstimate { probability, ..fused });
        }
        if !agrees || !(total > 0.0) {
            return Err(NoPose::HighResidual {
                detail: "every pose that explains the points contradicts the prior".into(),
            });
        }
        for estimate in &mut weighed {
            estimate.probability /= total;
        }
        weighed.retain(|estimate| estimate.probability >= NEGLIGIBLE);
        weighed.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        let mut weighed = weighed.into_iter();
        let best = weighed.next().unwrap_or(self.best);
        let ln_evidence = self.ln_evidence + total.ln();
        Ok(Self { best, alternatives: weighed.collect(), ln_evidence, ..self })
    }
}

impl PosePrior {
    /// Probability that a pose of this uncertainty keeps within the limits.
    fn share_allowed(&self, estimate: &PoseEstimate, middle: &Point<space::Target>) -> f64 {
        let pose = &estimate.camera_from_target;
        let turning: Matrix3<f64> = estimate.covariance.matrix().fixed_view::<3, 3>(3, 3).into();
        let deviation = |slope: &Vector3<f64>| slope.dot(&(turning * slope)).max(0.0).sqrt().max(1e-9);
        let mut share = 1.0;
        if let Some(side) = &self.visible_side {
            let normal = pose.rotation * side.into_inner();
            let sight = (*pose * *middle).coords.normalize();
            // d(w x n . s) = w . (n x s)
            share *= normal_share_below(-normal.dot(&sight) / deviation(&normal.cross(&sight)));
        }
        let angles = euler(pose);
        for (axis, limits) in self.euler_limits_rad.iter().enumerate() {
            let Some([from, to]) = *limits else { continue };
            let slope = Vector3::from_fn(|i, _| {
                let step = 1e-6 * Vector3::ith(i, 1.0);
                let moved = |sign: f64| {
                    let turned = rotation::exp(&(step * sign)) * pose.rotation;
                    euler(&CameraFromTarget::new(turned, pose.translation))[axis]
                };
                wrapped(moved(1.0) - moved(-1.0)) / 2e-6
            });
            let sigma = deviation(&slope);
            // About the middle of the allowed arc, so that the seam does not matter.
            let half = 0.5 * (to - from).rem_euclid(std::f64::consts::TAU);
            let off = wrapped(angles[axis] - from - half);
            share *= normal_share_below((half - off) / sigma) - normal_share_below((-half - off) / sigma);
        }
        share.max(0.0)
    }

    /// The estimate with the prediction in it, the density of their difference (up to a constant), and whether they can be
    /// the same pose at all.
    fn fused(&self, estimate: &PoseEstimate) -> (PoseEstimate, f64, bool) {
        let Some((predicted, covariance)) = &self.predicted else { return (*estimate, 1.0, true) };
        let difference = estimate.camera_from_target.difference_to(predicted);
        let own = estimate.covariance.matrix();
        let Some(sum) = PoseCovariance::checked(own + covariance.matrix()) else { return (*estimate, 0.0, false) };
        let Some(factored) = sum.matrix().cholesky() else { return (*estimate, 0.0, false) };
        let distance_squared = difference.dot(&factored.solve(&difference));
        let density = (-0.5 * (distance_squared + sum.ln_determinant())).exp();
        let gain = own * factored.inverse();
        let left = own - gain * own;
        let fused =
            PoseCovariance::checked((left + left.transpose()) * 0.5).map_or(*estimate, |covariance| PoseEstimate {
                camera_from_target: estimate.camera_from_target.perturbed(&(gain * difference)),
                covariance,
                ..*estimate
            });
        (fused, density, distance_squared < MAX_DISTANCE_SQUARED)
    }
}

fn euler(pose: &CameraFromTarget) -> [f64; 3] {
    let EulerAngles { roll_rad, pitch_rad, yaw_rad } = EulerAngles::from_rotation(&pose.rotation);
    [roll_rad, pitch_rad, yaw_rad]
}

/// To within half a turn of zero.
fn wrapped(angle_rad: f64) -> f64 {
    angle_rad - std::f64::consts::TAU * (angle_rad / std::f64::consts::TAU).round()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Vector6};

    use super::*;
    use crate::solve::Solver;

    fn estimate(turn: Vector3<f64>, probability: f64) -> PoseEstimate {
        PoseEstimate {
            camera_from_target: CameraFromTarget::new(rotation::exp(&turn), Vector3::new(0.0, 0.0, 5.0)),
            covariance: PoseCovariance::checked(Matrix6::from_diagonal(&Vector6::repeat(1e-4))).expect("positive"),
            covariance_reliable: true,
            reprojection_rms_px: 0.3,
            probability,
        }
    }

    fn two() -> PoseAnswer {
        PoseAnswer {
            best: estimate(Vector3::new(0.6, 0.0, 0.0), 0.6),
            alternatives: vec![estimate(Vector3::new(-0.6, 0.0, 0.0), 0.4)],
            solver: Solver::Ippe,
            noise_scale: 1.0,
            ln_evidence: 0.0,
        }
    }

    fn probabilities(answer: &PoseAnswer) -> Vec<f64> {
        std::iter::once(&answer.best).chain(&answer.alternatives).map(|e| e.probability).collect()
    }

    #[test]
    fn nothing_known_changes_nothing() {
        assert_eq!(two().given(&PosePrior::default(), &Point::from([0.0; 3])), Ok(two()));
    }

    #[test]
    fn limits_choose_among_the_poses() {
        let roll_below_zero = PosePrior { euler_limits_rad: [Some([-1.0, 0.0]), None, None], ..PosePrior::default() };
        let answer = two().given(&roll_below_zero, &Point::from([0.0; 3])).expect("one is allowed");
        assert_eq!(probabilities(&answer), [1.0]);
        assert!(euler(&answer.best.camera_from_target)[0] < 0.0);
        // On the limit half of the error lies inside.
        let at_the_edge = PosePrior { euler_limits_rad: [Some([0.6, -0.59]), None, None], ..PosePrior::default() };
        let [first, second] = probabilities(&two().given(&at_the_edge, &Point::from([0.0; 3])).expect("both"))[..]
        else {
            panic!("two")
        };
        // -0.6 lies one deviation inside the far end, 0.6 on the near one: 0.4 * 0.841 to 0.6 * 0.5.
        assert!((first / second - 0.4 * 0.8413 / 0.3).abs() < 1e-3, "{first} {second}");
    }

    #[test]
    fn a_side_that_cannot_be_seen_is_not_seen() {
        let from_behind = PosePrior { visible_side: Some(Vector3::z_axis()), ..PosePrior::default() };
        assert!(two().given(&from_behind, &Point::from([0.0; 3])).is_err());
        let from_before = PosePrior { visible_side: Some(-Vector3::z_axis()), ..PosePrior::default() };
        assert_eq!(two().given(&from_before, &Point::from([0.0; 3])).expect("both").alternatives.len(), 1);
    }

    #[test]
    fn a_prediction_of_the_same_quality_halves_the_variance_and_the_way() {
        let predicted = estimate(Vector3::new(-0.58, 0.0, 0.0), 1.0);
        let prior =
            PosePrior { predicted: Some((predicted.camera_from_target, predicted.covariance)), ..PosePrior::default() };
        let answer = two().given(&prior, &Point::from([0.0; 3])).expect("one is near");
        assert_eq!(probabilities(&answer), [1.0]);
        assert!((euler(&answer.best.camera_from_target)[0] + 0.59).abs() < 1e-9);
        assert!((answer.best.covariance.matrix() - Matrix6::from_diagonal(&Vector6::repeat(5e-5))).amax() < 1e-15);
        let elsewhere = estimate(Vector3::new(2.0, 0.0, 0.0), 1.0);
        let prior =
            PosePrior { predicted: Some((elsewhere.camera_from_target, elsewhere.covariance)), ..PosePrior::default() };
        assert!(matches!(two().given(&prior, &Point::from([0.0; 3])), Err(NoPose::HighResidual { .. })));
    }
}
