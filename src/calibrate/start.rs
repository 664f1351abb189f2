//! Where the search for a camera begins.
//!
//! In closed form from the homographies of the views: Zhang 2000, "A flexible new technique for camera calibration", with the
//! skew left out, and with the principal point in the middle of the picture, where one view is enough for a focal length. A strong
//! lens bends what these assume to be straight, so a few usual fields of view are tried too; the camera under which the views
//! look most like pictures of the board is where the search begins.

use nalgebra::{Matrix3, SMatrix, SVector, Vector2};

use super::SeenPoint;
use super::bundle::{Bundle, State};
use super::freedom::{Parameters, camera_of};
use crate::camera::Camera;
use crate::geometry::{CameraFromBoard, CameraFromTarget, Point};
use crate::solve::{Pair, Solver, homography::direct_linear_transform, is_in_front, spread_of, squared_ray_error};

/// Focal lengths tried besides, in units of the picture's larger side: from fisheye to telephoto.
const FOCAL_RATIOS: [f64; 7] = [0.3, 0.45, 0.65, 0.9, 1.3, 2.0, 3.5];

/// Cameras to begin with, the most likely first, each with a pose for every view. Views of which no camera makes a pose are left out of
/// none: a pose is `None` there.
pub(super) fn starts(bundle: &Bundle<'_>, guess: Option<&Camera>) -> Vec<(Camera, Vec<Option<CameraFromBoard>>)> {
    let mut cameras: Vec<Parameters> = guess.map(super::freedom::parameters_of).into_iter().collect();
    if guess.is_none() {
        let homographies: Vec<Matrix3<f64>> = bundle.views.iter().filter_map(|view| homography(bundle, view)).collect();
        let middle = middle(bundle.size);
        cameras.extend(zhang(&homographies, bundle.size));
        cameras.extend(middle_focal_length(&homographies, middle).map(|f| pinhole([f, f], middle)));
        let side = f64::from(bundle.size[0].max(bundle.size[1]));
        cameras.extend(FOCAL_RATIOS.map(|ratio| pinhole([ratio * side; 2], middle)));
    }
    let mut scored: Vec<(f64, Camera, Vec<Option<CameraFromBoard>>)> = cameras
        .iter()
        .filter_map(|parameters| camera_of(bundle.size, &bundle.lens, parameters).ok())
        .map(|camera| {
            let poses: Vec<Option<CameraFromBoard>> =
                bundle.views.iter().map(|view| poses(bundle, &camera, view).into_iter().next()).collect();
            (badness(bundle, &camera, &poses), camera, poses)
        })
        .filter(|(badness, ..)| badness.is_finite())
        .collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    scored.into_iter().map(|(_, camera, poses)| (camera, poses)).collect()
}

/// The middle of the picture, px.
pub(super) fn middle(size: [u32; 2]) -> Vector2<f64> {
    Vector2::from(size.map(|side| 0.5 * (f64::from(side) - 1.0)))
}

fn pinhole(focal: [f64; 2], centre: Vector2<f64>) -> Parameters {
    let mut parameters = Parameters::zeros();
    parameters.fixed_rows_mut::<4>(0).copy_from_slice(&[focal[0], focal[1], centre.x, centre.y]);
    parameters
}

/// A view's points as the solvers take them; to them a board is a target.
fn pairs(bundle: &Bundle<'_>, view: &[SeenPoint], ray: impl Fn(&SeenPoint) -> Option<Vector2<f64>>) -> Vec<Pair> {
    view.iter()
        .filter_map(|seen| Some(Pair { point: Point::from(bundle.board.points()[seen.point].coords), ray: ray(seen)? }))
        .collect()
}

/// From a plane of unit axes to pixels.
fn homography(bundle: &Bundle<'_>, view: &[SeenPoint]) -> Option<Matrix3<f64>> {
    let pairs = pairs(bundle, view, |seen| Some(seen.pixel));
    direct_linear_transform(&pairs, &spread_of(&pairs))
}

/// The poses of a view under this camera: of the two that a plane allows, the one first that explains it better.
pub(super) fn poses(bundle: &Bundle<'_>, camera: &Camera, view: &[SeenPoint]) -> Vec<CameraFromBoard> {
    let pairs = pairs(bundle, view, |seen| camera.unproject(&seen.pixel));
    // Most of a view must have rays: under a camera that does not reach its border, it has none there.
    if pairs.len() < 4 || 2 * pairs.len() < view.len() {
        return Vec::new();
    }
    let Ok(solutions) = Solver::Ippe.solve(&pairs) else { return Vec::new() };
    let error = |pose: &CameraFromTarget| squared_ray_error(&pairs, pose);
    let mut poses: Vec<&CameraFromTarget> = solutions.iter().filter(|pose| is_in_front(&pairs, pose)).collect();
    poses.sort_by(|a, b| error(a).total_cmp(&error(b)));
    poses.into_iter().map(|pose| CameraFromBoard::new(pose.rotation, pose.translation)).collect()
}

/// Median over the views of the median distance between seen and predicted points, px; a view without a pose, and a point without
/// an image, are as far off as can be.
fn badness(bundle: &Bundle<'_>, camera: &Camera, poses: &[Option<CameraFromBoard>]) -> f64 {
    let mut views: Vec<f64> = bundle
        .views
        .iter()
        .zip(poses)
        .map(|(view, pose)| {
            let Some(pose) = pose else { return f64::INFINITY };
            let distance = |seen| bundle.residual(camera, pose, seen).map_or(f64::INFINITY, |r| r.norm());
            let mut distances: Vec<f64> = view.iter().map(distance).collect();
            median(&mut distances)
        })
        .collect();
    median(&mut views)
}

/// The middle one; infinite for none.
pub(super) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::INFINITY;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Focal lengths and principal point from three or more homographies: with the image `w` of the absolute conic,
/// `h1' w h2 = 0` and `h1' w h1 = h2' w h2`.
fn zhang(homographies: &[Matrix3<f64>], size: [u32; 2]) -> Option<Parameters> {
    if homographies.len() < 3 {
        return None;
    }
    // Coordinates of the size of one, so that the equations are balanced.
    let scale = 0.5 * f64::from(size[0].max(size[1]));
    let origin = middle(size);
    let normalize =
        Matrix3::new(1.0 / scale, 0.0, -origin.x / scale, 0.0, 1.0 / scale, -origin.y / scale, 0.0, 0.0, 1.0);
    let mut gram = SMatrix::<f64, 5, 5>::zeros();
    for homography in homographies {
        let h = normalize * homography;
        let h = h / h.norm();
        // Unknown: w11, w22, w13, w23, w33.
        let row = |i: usize, j: usize| {
            let (a, b) = (h.column(i), h.column(j));
            SVector::<f64, 5>::new(
                a[0] * b[0],
                a[1] * b[1],
                a[0] * b[2] + a[2] * b[0],
                a[1] * b[2] + a[2] * b[1],
                a[2] * b[2],
            )
        };
        for row in [row(0, 1), row(0, 0) - row(1, 1)] {
            gram += row * row.transpose();
        }
    }
    let eigen = gram.symmetric_eigen();
    let w = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let [w11, w22, w13, w23, w33] = w.into();
    let (x, y) = (-w13 / w11, -w23 / w22);
    let lambda = w33 - (w13 * w13 / w11 + w23 * w23 / w22);
    let focal = [lambda / w11, lambda / w22].map(f64::sqrt);
    let sensible = focal.iter().all(|f| (0.1..100.0).contains(f)) && x.abs() < 2.0 && y.abs() < 2.0;
    sensible.then(|| pinhole(focal.map(|f| f * scale), Vector2::new(x, y) * scale + origin))
}

/// The median of the focal lengths that each view gives by itself, pixels square and the principal point at `middle`.
fn middle_focal_length(homographies: &[Matrix3<f64>], middle: Vector2<f64>) -> Option<f64> {
    let mut found: Vec<f64> = homographies
        .iter()
        .filter_map(|homography| {
            let to = Matrix3::new(1.0, 0.0, -middle.x, 0.0, 1.0, -middle.y, 0.0, 0.0, 1.0);
            let h = to * homography;
            let (a, b) = (h.column(0), h.column(1));
            // (a1 b1 + a2 b2) s + a3 b3 = 0 and (a1^2 + a2^2 - b1^2 - b2^2) s + a3^2 - b3^2 = 0 with s = 1 / f^2.
            let equations = [
                (a[0] * b[0] + a[1] * b[1], a[2] * b[2]),
                (a[0] * a[0] + a[1] * a[1] - b[0] * b[0] - b[1] * b[1], a[2] * a[2] - b[2] * b[2]),
            ];
            let (above, below) =
                equations.iter().fold((0.0, 0.0), |sum, (by, rest)| (sum.0 - by * rest, sum.1 + by * by));
            let focal = (below / above).sqrt();
            focal.is_finite().then_some(focal)
        })
        .collect();
    let focal = median(&mut found);
    focal.is_finite().then_some(focal)
}

/// A state of which every view has a pose.
pub(super) fn state_of(camera: &Camera, poses: Vec<CameraFromBoard>) -> State {
    State { camera: *camera, parameters: super::freedom::parameters_of(camera), poses }
}
