//! Where a target is, how it is turned, and how both change, with their joint covariance.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::options::TrackOptions;
use super::process_noise::process_noise;
use crate::geometry::left_jacobian::left_jacobian;
use crate::geometry::{CameraFromTarget, PoseCovariance, rotation};

/// Covariance of a motion.
pub(super) type Matrix12 = SMatrix<f64, 12, 12>;

/// Error of a motion.
pub(super) type Vector12 = SVector<f64, 12>;

/// A motion as seen from the camera: what the camera itself does is in it.
///
/// Every number is finite and the covariance positive definite by construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    camera_from_target: CameraFromTarget,
    velocity_mps: Vector3<f64>,
    angular_velocity_radps: Vector3<f64>,
    pose_covariance: PoseCovariance,
    covariance: Matrix12,
}

impl Motion {
    /// The motion, or `None` if a number is not finite or the covariance not positive definite.
    pub(super) fn checked(
        camera_from_target: CameraFromTarget,
        velocity_mps: Vector3<f64>,
        angular_velocity_radps: Vector3<f64>,
        covariance: &Matrix12,
    ) -> Option<Self> {
        let covariance = (covariance + covariance.transpose()) * 0.5;
        let is_finite = camera_from_target.is_finite()
            && velocity_mps.iter().chain(&angular_velocity_radps).chain(&covariance).all(|x| x.is_finite());
        if !is_finite || covariance.cholesky().is_none() {
            return None;
        }
        let pose_covariance = PoseCovariance::checked(covariance.fixed_view::<6, 6>(0, 0).into_owned())?;
        Some(Self { camera_from_target, velocity_mps, angular_velocity_radps, pose_covariance, covariance })
    }

    /// The pose.
    #[must_use]
    pub const fn camera_from_target(&self) -> &CameraFromTarget {
        &self.camera_from_target
    }

    /// Of the pose, for the error `(t_true - t, Log(R_true R^T))`.
    #[must_use]
    pub const fn pose_covariance(&self) -> &PoseCovariance {
        &self.pose_covariance
    }

    /// Velocity of the target's origin along the camera's axes, m/s.
    #[must_use]
    pub const fn velocity_mps(&self) -> &Vector3<f64> {
        &self.velocity_mps
    }

    /// Of the velocity, (m/s)^2.
    #[must_use]
    pub fn velocity_covariance(&self) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(6, 6).into_owned()
    }

    /// Angular velocity about the camera's axes, rad/s.
    #[must_use]
    pub const fn angular_velocity_radps(&self) -> &Vector3<f64> {
        &self.angular_velocity_radps
    }

    /// Of the angular velocity, (rad/s)^2.
    #[must_use]
    pub fn angular_velocity_covariance(&self) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(9, 9).into_owned()
    }

    /// Of everything, in the order x, y, z, rotation about camera x, y, z, velocity, angular velocity.
    #[must_use]
    pub const fn covariance(&self) -> &SMatrix<f64, 12, 12> {
        &self.covariance
    }

    /// Largest standard deviation of the position in any direction, m.
    #[must_use]
    pub fn position_sigma_m(&self) -> f64 {
        let place: Matrix3<f64> = self.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        place.symmetric_eigenvalues().max().max(0.0).sqrt()
    }

    /// The motion after an error of this size.
    pub(super) fn moved(&self, step: &Vector12, covariance: &Matrix12) -> Option<Self> {
        Self::checked(
            self.camera_from_target.perturbed(&step.fixed_rows::<6>(0).into_owned()),
            self.velocity_mps + step.fixed_rows::<3>(6),
            self.angular_velocity_radps + step.fixed_rows::<3>(9),
            covariance,
        )
    }

    /// The error that leads from here to `other`.
    pub(super) fn difference_to(&self, other: &Self) -> Vector12 {
        let mut difference = Vector12::zeros();
        difference.fixed_rows_mut::<6>(0).copy_from(&self.camera_from_target.difference_to(&other.camera_from_target));
        difference.fixed_rows_mut::<3>(6).copy_from(&(other.velocity_mps - self.velocity_mps));
        difference.fixed_rows_mut::<3>(9).copy_from(&(other.angular_velocity_radps - self.angular_velocity_radps));
        difference
    }

    /// Squared error of this motion against a true one in units of its covariance: chi-square with twelve degrees of freedom.
    #[must_use]
    pub fn normalized_error_squared(
        &self,
        truth: &CameraFromTarget,
        velocity_mps: &Vector3<f64>,
        angular_velocity_radps: &Vector3<f64>,
    ) -> f64 {
        let mut error = Vector12::zeros();
        error.fixed_rows_mut::<6>(0).copy_from(&self.camera_from_target.difference_to(truth));
        error.fixed_rows_mut::<3>(6).copy_from(&(velocity_mps - self.velocity_mps));
        error.fixed_rows_mut::<3>(9).copy_from(&(angular_velocity_radps - self.angular_velocity_radps));
        self.covariance.cholesky().map_or(f64::INFINITY, |factored| error.dot(&factored.solve(&error)))
    }

    /// The motion `dt_s` later: both velocities kept, the covariance grown by white accelerations. `None` if it leaves what
    /// numbers can tell.
    pub(super) fn predicted(&self, dt_s: f64, options: &TrackOptions) -> Option<Self> {
        let turn_rad = self.angular_velocity_radps * dt_s;
        let by = transition(&turn_rad, dt_s);
        let covariance = by * self.covariance * by.transpose() + process_noise(&turn_rad, dt_s, options);
        let turned = rotation::exp(&turn_rad) * self.camera_from_target.rotation;
        // By way of a unit quaternion, so that rounding does not gather over many frames.
        let pose = CameraFromTarget::new(
            rotation::from_quaternion(&rotation::to_quaternion(&turned)),
            self.camera_from_target.translation + self.velocity_mps * dt_s,
        );
        Self::checked(pose, self.velocity_mps, self.angular_velocity_radps, &covariance)
    }
}

/// How the error after `dt_s` depends on that before: `Log(R_true R^T)` turns along with the target, and an error of the angular
/// velocity goes in through the left Jacobian of the turn.
fn transition(turn_rad: &Vector3<f64>, dt_s: f64) -> Matrix12 {
    let mut by = Matrix12::identity();
    by.fixed_view_mut::<3, 3>(0, 6).fill_diagonal(dt_s);
    by.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation::exp(turn_rad).matrix());
    by.fixed_view_mut::<3, 3>(3, 9).copy_from(&(left_jacobian(turn_rad) * dt_s));
    by
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn motion(v: [f64; 12]) -> Motion {
        let part = |at: usize| Vector3::new(v[at], v[at + 1], v[at + 2]);
        let pose = CameraFromTarget::new(rotation::exp(&(part(0) * 1.5)), part(3) * 10.0);
        Motion::checked(pose, part(6) * 20.0, part(9) * 3.0, &Matrix12::identity()).expect("good numbers")
    }

    proptest! {
        #[test]
        fn the_transition_agrees_with_central_differences(v in proptest::array::uniform12(-1.0..1.0_f64), dt_s in 0.01..0.5_f64) {
            let (motion, options) = (motion(v), TrackOptions::default());
            let later = motion.predicted(dt_s, &options).expect("finite");
            let by = transition(&(motion.angular_velocity_radps * dt_s), dt_s);
            let step = 1e-5;
            for axis in 0..12 {
                let moved = |size: f64| {
                    let moved = motion.moved(&Vector12::ith(axis, size), &motion.covariance).expect("finite");
                    later.difference_to(&moved.predicted(dt_s, &options).expect("finite"))
                };
                let slope = (moved(step) - moved(-step)) / (2.0 * step);
                prop_assert!((slope - by.column(axis)).amax() < 1e-8, "axis {axis}: {slope} {}", by.column(axis));
            }
        }

        #[test]
        fn two_half_steps_are_one_whole(v in proptest::array::uniform12(-1.0..1.0_f64), dt_s in 0.01..0.5_f64) {
            let (motion, options) = (motion(v), TrackOptions::default());
            let whole = motion.predicted(dt_s, &options).expect("finite");
            let halves = motion.predicted(dt_s / 2.0, &options).and_then(|m| m.predicted(dt_s / 2.0, &options)).expect("finite");
            prop_assert!(whole.difference_to(&halves).amax() < 1e-12);
            prop_assert!((whole.covariance - halves.covariance).amax() < 1e-9);
        }
    }
}
