//! A named method alone: its own pose, with the covariance that its own arithmetic gives to the noise of the pixels.

use nalgebra::{Matrix6, SMatrix, SVector};

use super::{NoPose, PoseAnswer, PoseEstimate};
use crate::camera::Camera;
use crate::camera::parameters::{MAX_PARAMETERS, ParameterCovariance};
use crate::geometry::{CameraFromTarget, PoseCovariance, rotation};
use crate::random;
use crate::refine::Correspondence;
use crate::solve::{Pair, Solver};

/// Noisy images on which the method is tried.
const TRIALS: u32 = 64;

/// A method whose pose is further than this from the minimum that its points have, in squared standard deviations of its
/// own, has failed.
const MAX_DISTANCE_SQUARED: f64 = 100.0;

/// The method's pose in place of the refined one nearest to it; the other minima stay as alternatives. The stated deviations
/// of the points are too small by `sigma_factor`.
pub(super) fn unrefined(
    camera: &Camera,
    correspondences: &[Correspondence],
    sigma_factor: f64,
    solver: Solver,
    pairs: &[Pair],
    mut refined: PoseAnswer,
) -> Result<PoseAnswer, NoPose> {
    let pose = solver.solve(pairs)?[0];
    let mut minima = vec![refined.best];
    minima.append(&mut refined.alternatives);
    let minimum = minima.remove(nearest(&minima, &pose));
    let noise = Noise { sigma_factor, camera_root: camera.parameter_covariance().map(ParameterCovariance::root) };
    let covariance = tried(camera, correspondences, solver, &minimum, &minima, &noise).ok_or_else(|| {
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

/// What a picture is uncertain by.
struct Noise {
    /// On the stated deviations of the points.
    sigma_factor: f64,
    /// Root of the covariance of the camera's parameters, where they are uncertain.
    camera_root: Option<SMatrix<f64, MAX_PARAMETERS, MAX_PARAMETERS>>,
}

type ByMany = SVector<f64, MAX_PARAMETERS>;

/// Mean square error of the method, bias included, on noisy images of the minimum's pose: closed forms minimise no
/// reprojection error, so the curvature of that error says nothing about them. Trials that fall to another minimum are left
/// out, as the probabilities speak of those.
fn tried(
    camera: &Camera,
    correspondences: &[Correspondence],
    solver: Solver,
    minimum: &PoseEstimate,
    others: &[PoseEstimate],
    noise: &Noise,
) -> Option<PoseCovariance> {
    let truth = minimum.camera_from_target;
    let mut rng = random::named("trials of a method");
    let mut sum = Matrix6::zeros();
    let mut count = 0.0;
    let mut all = vec![*minimum];
    all.extend_from_slice(others);
    for _ in 0..TRIALS {
        // One camera takes all points of a picture.
        let camera_error = noise.camera_root.map(|root| root * ByMany::from_fn(|_, _| random::normal(&mut rng)));
        let noisy: Option<Vec<Pair>> = correspondences
            .iter()
            .map(|seen| {
                let point = truth * seen.point;
                let mut image = camera.project(&point)?;
                if let Some(error) = &camera_error {
                    image += camera.pixel_by_parameters(&point)? * error;
                }
                image += random::normal2(&mut rng) * seen.sigma_px * noise.sigma_factor;
                let ray = camera.unproject(&image)?;
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

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::camera::Distortion;
    use crate::geometry::Point;
    use crate::pose::{self, PoseOptions, estimate_pose};
    use crate::refine::calibration::from_camera;

    /// A plane of six points, tilted, seen with little noise, times `loud`.
    fn seen(camera: &Camera, loud: f64) -> Vec<Correspondence> {
        let truth = CameraFromTarget::new(rotation::exp(&Vector3::new(0.7, -0.5, 0.2)), Vector3::new(0.3, -0.2, 2.5));
        let points = [[0.3, 0.0], [-0.1, -0.4], [-0.2, 0.3], [-0.4, -0.1], [0.1, 0.1], [0.35, -0.3]];
        let mut rng = random::named("a plane that is measured");
        let seen = points.map(|[x, y]| {
            let point = Point::new(x, y, 0.0);
            let pixel = camera.project(&(truth * point)).expect("in view") + random::normal2(&mut rng) * 0.1 * loud;
            Correspondence { point, pixel, sigma_px: 0.1 }
        });
        seen.to_vec()
    }

    fn alone(solver: Solver, noise: pose::Noise) -> PoseOptions {
        PoseOptions { solver: Some(solver), refine: false, noise, ..PoseOptions::default() }
    }

    #[test]
    fn an_uncertain_camera_makes_the_methods_own_pose_uncertain() {
        let exact = Camera::checked([640, 480], [608.0; 2], [320.0, 240.0], Distortion::None).expect("a camera");
        let mut rows = vec![vec![0.0; 4]; 4];
        (rows[0][0], rows[1][1], rows[0][1], rows[1][0]) = (36.0, 36.0, 35.0, 35.0);
        let uncertain = exact.with_parameter_covariance(&rows).expect("a covariance");
        let seen = seen(&exact, 1.0);
        for solver in [Solver::Ippe, Solver::Epnp, Solver::Homography] {
            let options = alone(solver, pose::Noise::Stated);
            let of = |camera: &Camera| estimate_pose(camera, &seen, &options).expect("a pose").best;
            let (sure, unsure) = (of(&exact), of(&uncertain));
            let added = unsure.covariance.matrix()[(2, 2)] - sure.covariance.matrix()[(2, 2)];
            // What the refined pose has added; the methods differ, and 64 trials tell a variance to a fifth.
            let refined = estimate_pose(&exact, &seen, &PoseOptions::default()).expect("a pose").best;
            let expected = from_camera(&uncertain, &seen, &refined.camera_from_target, &refined.covariance)
                .expect("uncertain")[(2, 2)];
            assert!((0.4..2.5).contains(&(added / expected)), "{}: {added} {expected}", solver.name());
        }
    }

    #[test]
    fn louder_points_make_it_uncertain_whether_their_noise_is_stated_or_not() {
        let camera = Camera::checked([640, 480], [608.0; 2], [320.0, 240.0], Distortion::None).expect("a camera");
        let quiet =
            estimate_pose(&camera, &seen(&camera, 1.0), &alone(Solver::Ippe, pose::Noise::Stated)).expect("a pose");
        for noise in [pose::Noise::Stated, pose::Noise::Estimated] {
            let loud = estimate_pose(&camera, &seen(&camera, 5.0), &alone(Solver::Ippe, noise)).expect("a pose");
            let ratio = loud.best.covariance.matrix()[(2, 2)] / quiet.best.covariance.matrix()[(2, 2)];
            let expected = (loud.noise_scale / quiet.noise_scale).powi(2);
            assert!(loud.noise_scale > 2.0 && ratio > 0.5 * expected, "{noise:?}: {ratio} {expected}");
        }
    }
}
