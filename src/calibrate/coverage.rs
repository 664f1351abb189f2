//! Where in the picture the board was seen, and how it was turned.

use nalgebra::Vector3;

use super::evidence::Evidence;
use crate::geometry::CameraFromBoard;

/// Cells of the picture along its sides.
pub const CELLS: [usize; 2] = [8, 6];

/// How many points were seen in each cell of the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Coverage {
    /// Points by cell, rows from the top, [`CELLS`] in all.
    pub points: Vec<usize>,
    /// Share of the cells with a point.
    pub share: f64,
}

impl Coverage {
    pub(super) fn of(evidence: &Evidence<'_>) -> Self {
        let [columns, rows] = CELLS;
        let mut points = vec![0; columns * rows];
        let sides = [evidence.camera.width(), evidence.camera.height()].map(f64::from);
        for pixel in evidence.pixels() {
            let column = cell(pixel.x, sides[0], columns);
            let row = cell(pixel.y, sides[1], rows);
            points[row * columns + column] += 1;
        }
        let covered = points.iter().filter(|count| **count > 0).count();
        Self { share: covered as f64 / points.len() as f64, points }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the picture")]
fn cell(pixel: f64, side_px: f64, cells: usize) -> usize {
    (((pixel + 0.5) / side_px * cells as f64).max(0.0) as usize).min(cells - 1)
}

/// How the board stood in one view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stance {
    /// Angle between the board's normal and the ray to its middle.
    pub tilt_rad: f64,
    /// Distance of its middle, m.
    pub range_m: f64,
    /// The board's normal, towards the camera, in the camera's space.
    pub normal: Vector3<f64>,
}

impl Stance {
    pub(super) fn of(pose: &CameraFromBoard, middle: &Vector3<f64>) -> Self {
        let centre = pose.rotation * middle + pose.translation;
        let normal = -(pose.rotation * Vector3::z());
        let range_m = centre.norm();
        let cosine = if range_m > 0.0 { -normal.dot(&centre) / range_m } else { 1.0 };
        Self { tilt_rad: cosine.clamp(-1.0, 1.0).acos(), range_m, normal }
    }
}

/// The largest angle between the normals of two views.
pub(super) fn widest_turn_rad(stances: &[Stance]) -> f64 {
    let cosine = stances
        .iter()
        .enumerate()
        .flat_map(|(index, one)| stances[..index].iter().map(move |other| one.normal.dot(&other.normal)))
        .fold(1.0, f64::min);
    cosine.clamp(-1.0, 1.0).acos()
}
