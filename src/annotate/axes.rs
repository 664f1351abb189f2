//! A target's axes as the camera sees them.

use nalgebra::Vector3;

use super::canvas::{Box, Canvas, Ink};
use super::label::{Label, Labels};
use super::marks::{HALO, halo_width, stroke};
use super::palette::AXES;
use super::scale::Scale;
use crate::camera::{Camera, Pixel};
use crate::geometry::{CameraFromTarget, Point};
use crate::pose::PoseAnswer;
use crate::target::Target;

/// An axis is drawn in this many pieces: the lens bends it, and its far end may lie behind the camera.
const PIECES: u32 = 16;

/// Axes of the best pose in solid lines, of every alternative that matters in dashed ones.
pub(super) fn draw(
    canvas: &mut Canvas,
    labels: &mut Labels,
    scale: Scale,
    camera: &Camera,
    target: &Target,
    answer: &PoseAnswer,
) {
    let length_m = length(target, camera, &answer.best.camera_from_target, scale);
    // The axis that points away is drawn first, under the others.
    let pose = &answer.best.camera_from_target;
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| pose.rotation.matrix()[(2, b)].total_cmp(&pose.rotation.matrix()[(2, a)]));
    for axis in order {
        let path = path(camera, pose, axis, length_m);
        let width = 1.4 * scale.line_px;
        canvas.lines(pieces(&path), halo_width(width), HALO);
        canvas.lines(pieces(&path), width, Ink::solid(AXES[axis]));
        for (a, b) in pieces(&path) {
            labels.keep_clear(Box::about(&((a + b) * 0.5), scale.line_px));
        }
        if let Some(Some(end)) = path.last() {
            labels.add(Label {
                anchor: *end,
                reach_px: scale.line_px,
                text: ["x", "y", "z"][axis].to_owned(),
                letters: scale.remarks,
                ink: Ink::solid(AXES[axis]),
                away_from: None,
                is_optional: true,
            });
        }
    }
    for alternative in answer.alternatives.iter().rev() {
        if alternative.probability >= PoseAnswer::AMBIGUOUS_FROM {
            for (axis, rgb) in AXES.into_iter().enumerate() {
                let path = path(camera, &alternative.camera_from_target, axis, length_m);
                dashed(canvas, &path, scale, Ink { rgb, opacity: 0.75 });
            }
        }
    }
}

/// Length of an axis, m: nearly to the outer markers, and longer where that were too small to see.
fn length(target: &Target, camera: &Camera, pose: &CameraFromTarget, scale: Scale) -> f64 {
    let centre = target.spread().centre;
    let extent_m = target.markers().iter().map(|m| (m.position.coords - centre).norm()).fold(0.0, f64::max);
    let [focal_px, _] = camera.focal_lengths();
    (0.85 * extent_m).max(scale.axis_px * pose.translation.z / focal_px)
}

/// Places along an axis from the origin on; `None` where there is no image.
fn path(camera: &Camera, pose: &CameraFromTarget, axis: usize, length_m: f64) -> Vec<Option<Pixel>> {
    let place = |piece: u32| {
        let mut point = Vector3::zeros();
        point[axis] = length_m * f64::from(piece) / f64::from(PIECES);
        camera.project(&(*pose * Point::from(point)))
    };
    (0..=PIECES).map(place).collect()
}

/// The straight pieces of a path.
fn pieces(path: &[Option<Pixel>]) -> impl Iterator<Item = (Pixel, Pixel)> {
    path.windows(2).filter_map(|ends| Some((ends[0]?, ends[1]?)))
}

/// Draws every other stretch of the path.
fn dashed(canvas: &mut Canvas, path: &[Option<Pixel>], scale: Scale, ink: Ink) {
    let dash_px = 3.0 * scale.line_px;
    let mut gone_px = 0.0;
    for (a, b) in pieces(path) {
        let piece_px = (b - a).norm();
        // So long a piece leaves the frame at once; also false for NaN.
        if !(piece_px > 0.0 && piece_px < 1e5) {
            continue;
        }
        let mut from_px = 0.0;
        while from_px < piece_px {
            let phase = (gone_px + from_px) % (2.0 * dash_px);
            let left = if phase < dash_px { dash_px - phase } else { 2.0 * dash_px - phase };
            // Rounding must not keep the walk on the spot.
            let to_px = (from_px + left.max(1e-3)).min(piece_px);
            if phase < dash_px {
                let at = |px: f64| a + (b - a) * (px / piece_px);
                stroke(canvas, at(from_px), at(to_px), 0.8 * scale.line_px, ink);
            }
            from_px = to_px;
        }
        gone_px += piece_px;
    }
}
