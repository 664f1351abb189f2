//! One picture under a camera.

use nalgebra::Vector2;

use super::minima::best_pose;
use super::{FittedView, LeftOut};
use crate::board::Board;
use crate::calibrate::SeenPoint;
use crate::calibrate::bundle::{Bundle, Loss};
use crate::calibrate::freedom::{Freedom, Parameters};
use crate::calibrate::watch::Watch;
use crate::camera::Camera;
use crate::geometry::CameraFromBoard;

/// Root mean square distance, px, of the points of a view from where a camera that does not rest on it predicts them, in the best pose.
pub(in crate::calibrate) fn rms_of_view_alone(board: &Board, camera: &Camera, view: &[SeenPoint]) -> Option<f64> {
    let bundle = Bundle {
        size: [camera.width(), camera.height()],
        board,
        views: &[],
        lens: *camera.distortion(),
        freedom: Freedom::none(),
        loss: Loss::Squares,
        prior: Parameters::zeros(),
        watch: Watch::nobody(),
    };
    let pose = best_pose(&bundle, camera, view)?;
    let squares: Option<Vec<f64>> =
        view.iter().map(|seen| bundle.residual(camera, &pose, seen).map(|r| r.norm_squared())).collect();
    squares.map(|squares| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// The view under the camera: the gate of its points where it counts, or why it does not.
pub(super) fn fitted(
    bundle: &Bundle<'_>,
    camera: &Camera,
    pose: Option<CameraFromBoard>,
    view: &[SeenPoint],
    counts: Result<f64, LeftOut>,
) -> FittedView {
    let gate = counts.ok();
    let residuals_px: Vec<Option<Vector2<f64>>> =
        view.iter().map(|seen| pose.and_then(|pose| bundle.residual(camera, &pose, seen))).collect();
    let inliers: Vec<bool> = residuals_px
        .iter()
        .zip(view)
        .map(|(residual, seen)| {
            gate.zip(*residual).is_some_and(|(gate, residual)| residual.norm() <= gate * seen.sigma_px)
        })
        .collect();
    let counted: Vec<f64> = residuals_px
        .iter()
        .zip(&inliers)
        .filter(|(_, inlier)| **inlier || gate.is_none())
        .filter_map(|(residual, _)| residual.map(|r| r.norm_squared()))
        .collect();
    let rms_px = (counted.iter().sum::<f64>() / counted.len().max(1) as f64).sqrt();
    FittedView { camera_from_board: pose, rms_px, left_out: counts.err(), residuals_px, inliers }
}
