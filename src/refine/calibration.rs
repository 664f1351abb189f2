//! What the camera's own uncertainty adds to that of a pose.

use nalgebra::{Matrix6, SMatrix};

use super::{Correspondence, project_with_pose_jacobian};
use crate::camera::Camera;
use crate::camera::parameters::MAX_PARAMETERS;
use crate::geometry::{CameraFromTarget, PoseCovariance};

/// The covariance that errors of the camera's parameters give to a pose refined with them, to first order: the minimum moves
/// by `-C J^T W K` for parameters that are off by one, with the covariance `C` of the pose, and the derivatives `J` and `K`
/// of the pixels by the pose and by the parameters. `None` if the camera counts as exact.
#[must_use]
pub fn from_camera(
    camera: &Camera,
    correspondences: &[Correspondence],
    pose: &CameraFromTarget,
    covariance: &PoseCovariance,
) -> Option<Matrix6<f64>> {
    let parameters = camera.parameter_covariance()?;
    let mut mixed = SMatrix::<f64, 6, MAX_PARAMETERS>::zeros();
    for seen in correspondences {
        let (_, by_pose) = project_with_pose_jacobian(camera, pose, seen)?;
        let by_parameters = camera.pixel_by_parameters(&(*pose * seen.point))?;
        mixed += by_pose.transpose() * by_parameters / (seen.sigma_px * seen.sigma_px);
    }
    let moved = covariance.matrix() * mixed;
    Some(moved * parameters.matrix() * moved.transpose())
}

#[cfg(test)]
mod tests {
    use nalgebra::{Vector3, Vector6};

    use super::*;
    use crate::camera::Distortion;
    use crate::geometry::{Point, rotation};
    use crate::refine::{RefineOptions, refine};

    const LENS: [f64; 5] = [-0.2, 0.05, 0.001, -0.0005, 0.0];

    fn camera(off: &[f64; 5]) -> Camera {
        let [fx, fy, cx, cy, k1] = *off;
        let lens = Distortion::PlumbBob([LENS[0] + k1, LENS[1], LENS[2], LENS[3], LENS[4]]);
        Camera::checked([640, 480], [608.0 + fx, 610.0 + fy], [314.0 + cx, 230.0 + cy], lens).expect("a camera")
    }

    #[test]
    fn a_pose_moves_with_the_camera_as_its_covariance_says() {
        let pose = CameraFromTarget::new(rotation::exp(&Vector3::new(0.5, -0.4, 0.2)), Vector3::new(0.3, -0.2, 2.5));
        let exact = camera(&[0.0; 5]);
        let points = [[0.3, 0.0, 0.1], [-0.1, -0.4, 0.0], [-0.2, 0.3, -0.1], [-0.4, -0.1, 0.2], [0.1, 0.1, 0.0]];
        let seen: Vec<_> = points
            .into_iter()
            .map(|p| {
                let point = Point::from(p);
                Correspondence { point, pixel: exact.project(&(pose * point)).expect("in view"), sigma_px: 0.5 }
            })
            .collect();
        let minimum = |camera: &Camera| refine(camera, &seen, &pose, &RefineOptions::default()).expect("in view");
        // One parameter uncertain at a time: the pose moves along one direction, by so much.
        for (parameter, place) in [0, 1, 2, 3, 4].into_iter().zip([0, 1, 2, 3, 4]) {
            let sigma = if parameter < 4 { 0.5 } else { 1e-3 };
            let mut rows = vec![vec![0.0; 9]; 9];
            rows[place][place] = sigma * sigma;
            let uncertain = exact.with_parameter_covariance(&rows).expect("a covariance");
            let added = from_camera(&uncertain, &seen, &pose, &minimum(&exact).covariance).expect("uncertain");
            let mut off = [0.0; 5];
            off[parameter] = sigma;
            let moved: Vector6<f64> = pose.difference_to(&minimum(&camera(&off)).camera_from_target);
            let expected = moved * moved.transpose();
            assert!((added - expected).amax() < 0.03 * expected.amax(), "{parameter}: {added} {expected}");
        }
        assert_eq!(from_camera(&exact, &seen, &pose, &minimum(&exact).covariance), None);
    }
}
