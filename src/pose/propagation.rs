//! A named method alone: its own pose, with the covariance that its own arithmetic gives to the noise of the pixels.

use nalgebra::Matrix6;

use super::{NoPose, PoseAnswer, PoseEstimate};
use crate::camera::Camera;
use crate::geometry::{CameraFromTarget, PoseCovariance, rotation};
use crate::random;
use crate::refine::Correspondence;
use crate::solve::{Pair, Solver};

/// Noisy images on which the method is tried.
const TRIALS: u32 = 64;

/// A method whose pose is further than this from the minimum that its points have, in squared standard deviations of its
/// own, has failed.
const MAX_DISTANCE_SQUARED: f64 = 100.0;

/// The method's pose in place of the refined one nearest to it; the other minima stay as alternatives.
pub(super) fn unrefined(
    camera: &Camera,
    correspondences: &[Correspondence],
    solver: Solver,
    pairs: &[Pair],
    mut refined: PoseAnswer,
) -> Result<PoseAnswer, NoPose> {
    let pose = solver.solve(pairs)?[0];
    let mut minima = vec![refined.best];
    minima.append(&mut refined.alternatives);
    let minimum = minima.remove(nearest(&minima, &pose));
    let covariance = tried(camera, correspondences, solver, &minimum, &minima).ok_or_else(|| {
        NoPose::DegenerateGeometry(format!("{} is not stable under the noise of these points", solver.name()))
    })?;
    let distance_squared = covariance.normalized_error_squared(&pose, &minimum.camera_from_target);
    if !(distance_squared <= MAX_DISTANCE_SQUARED) {
        return Err(NoPose::HighResidual {
            detail: format!(
                "the pose of {} is {:.0} of its standard deviations away from any that explains the points",
                solver.name(),
                distance_squared.sqrt()
            ),
        });
    }
    let best = PoseEstimate {
        camera_from_target: pose,
        covariance,
        covariance_reliable: minimum.covariance_reliable,
        reprojection_rms_px: rms_px(camera, correspondences, &pose),
        probability: minimum.probability,
    };
    Ok(PoseAnswer { best, alternatives: minima, solver, ..refined })
}

/// The position of the minimum whose attitude is nearest.
fn nearest(minima: &[PoseEstimate], pose: &CameraFromTarget) -> usize {
    let angle = |m: &PoseEstimate| rotation::angle_between_rad(&m.camera_from_target.rotation, &pose.rotation);
    (0..minima.len()).min_by(|&a, &b| angle(&minima[a]).total_cmp(&angle(&minima[b]))).unwrap_or(0)
}

/// Mean square error of the method, bias included, on noisy images of the minimum's pose: closed forms minimise no
/// reprojection error, so the curvature of that error says nothing about them. Trials that fall to another minimum are left
/// out, as the probabilities speak of those.
fn tried(
    camera: &Camera,
    correspondences: &[Correspondence],
    solver: Solver,
    minimum: &PoseEstimate,
    others: &[PoseEstimate],
) -> Option<PoseCovariance> {
    let truth = minimum.camera_from_target;
    let mut rng = random::named("trials of a method");
    let mut sum = Matrix6::zeros();
    let mut count = 0.0;
    let mut all = vec![*minimum];
    all.extend_from_slice(others);
    for _ in 0..TRIALS {
        let noisy: Option<Vec<Pair>> = correspondences
            .iter()
            .map(|seen| {
                let exact = camera.project(&(truth * seen.point))?;
                let ray = camera.unproject(&(exact + random::normal2(&mut rng) * seen.sigma_px))?;
                Some(Pair { point: seen.point, ray })
            })
            .collect();
        let Some(found) = noisy.and_then(|pairs| solver.solve(&pairs).ok()) else { continue };
        let error = found
            .iter()
            .filter(|pose| nearest(&all, pose) == 0)
            .map(|pose| pose.difference_to(&truth))
            .min_by(|a, b| a.norm().total_cmp(&b.norm()));
        if let Some(error) = error {
            sum += error * error.transpose();
            count += 1.0;
        }
    }
    // The inverse of a covariance that is itself estimated is too large on average by count / (count - 7).
    (count >= 0.5 * f64::from(TRIALS)).then(|| PoseCovariance::checked(sum / (count - 7.0))).flatten()
}

fn rms_px(camera: &Camera, correspondences: &[Correspondence], pose: &CameraFromTarget) -> f64 {
    let squares: f64 = correspondences
        .iter()
        .map(|seen| camera.project(&(*pose * seen.point)).map_or(f64::INFINITY, |p| (p - seen.pixel).norm_squared()))
        .sum();
    let count = correspondences.len() as f64;
    (squares / count).sqrt()
}
