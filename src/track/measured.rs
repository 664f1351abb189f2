//! One answer as the filter takes it: its poses with the covariances that the filter counts with.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Matrix6};

use super::options::TrackOptions;
use crate::geometry::{CameraFromTarget, PoseCovariance};
use crate::pose::{PoseAnswer, PoseEstimate};

/// Poses of an answer beyond these are left out: a plane has two minima, four points off a plane up to four.
pub(super) const MAX_POSES: usize = 4;

/// A pose that an answer holds possible.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    pub camera_from_target: CameraFromTarget,
    pub covariance: PoseCovariance,
    pub probability: f64,
}

/// The poses of `answer`, their probabilities brought to a sum of one; empty if none is finite and positive.
pub(super) fn measured(answer: &PoseAnswer, options: &TrackOptions) -> ArrayVec<Measured, MAX_POSES> {
    let mut poses: ArrayVec<Measured, MAX_POSES> = std::iter::once(&answer.best)
        .chain(&answer.alternatives)
        .filter(|estimate| estimate.probability > 0.0 && estimate.probability <= 1.0)
        .filter(|estimate| estimate.camera_from_target.is_finite() && is_rotation(&estimate.camera_from_target))
        .filter_map(|estimate| {
            let covariance = PoseCovariance::checked(counted_with(estimate, options))?;
            let PoseEstimate { camera_from_target, probability, .. } = *estimate;
            Some(Measured { camera_from_target, covariance, probability })
        })
        .take(MAX_POSES)
        .collect();
    let total: f64 = poses.iter().map(|pose| pose.probability).sum();
    for pose in &mut poses {
        pose.probability /= total;
    }
    poses
}

/// Whether lengths stay what they are.
fn is_rotation(pose: &CameraFromTarget) -> bool {
    let matrix = pose.rotation.matrix();
    (matrix * matrix.transpose() - Matrix3::identity()).amax() < 1e-6
}

/// The covariance as stated where it is reliable. Elsewhere the error is not normal, its tails are heavier and the stated size
/// goes along with the error itself, so that the filter would trust lucky answers too much: the variances are raised.
fn counted_with(estimate: &PoseEstimate, options: &TrackOptions) -> Matrix6<f64> {
    let factor = if estimate.covariance_reliable { 1.0 } else { options.unreliable_variance_factor };
    estimate.covariance.matrix() * factor
}
