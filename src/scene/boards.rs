//! Boards held before a camera at random, for studies and tests of calibration.

use nalgebra::{Rotation3, Vector2, Vector3};
use rand::{Rng, RngExt};

use crate::board::Board;
use crate::camera::{Camera, Distortion};
use crate::geometry::{CameraFromBoard, rotation};

/// A board of every pattern.
pub const STUDY_BOARDS: [&str; 5] = [
    "chessboard:9x6:0.025",
    "circles:7x5:0.03",
    "asymmetric-circles:4x11:0.02",
    "dots:120:0.25x0.18:0.003",
    "aprilgrid:6x4:0.03",
];

/// A lens of every model, each bent as real ones are.
pub const STUDY_LENSES: [Distortion; 4] = [
    Distortion::None,
    Distortion::PlumbBob([-0.28, 0.09, 0.0012, -0.0006, 0.02]),
    Distortion::RationalPolynomial([0.6, 0.12, 0.0008, -0.0004, 0.01, 0.95, 0.25, 0.03]),
    Distortion::Equidistant([-0.02, 0.006, -0.003, 0.001]),
];

/// A VGA camera with this lens.
#[must_use]
#[expect(clippy::missing_panics_doc, clippy::expect_used, reason = "the numbers are a camera's, as its test shows")]
pub fn study_camera(lens: Distortion) -> Camera {
    let focal = if matches!(lens, Distortion::Equidistant(_)) { 270.0 } else { 530.0 };
    Camera::checked([640, 480], [focal, 1.01 * focal], [323.0, 236.0], lens).expect("a camera")
}

/// The board held into the picture, all of it, tilted by 6 to 52 degrees in any direction.
#[must_use]
pub fn pose_in_view(camera: &Camera, board: &Board, rng: &mut impl Rng) -> CameraFromBoard {
    let [least, greatest] = board.sheet();
    let middle = 0.5 * (least + greatest);
    let width = (greatest - least).max();
    let sides = Vector2::new(f64::from(camera.width()), f64::from(camera.height()));
    loop {
        let direction = rng.random_range(0.0..std::f64::consts::TAU);
        let tilt = rng.random_range(0.1..0.9_f64);
        let turn = rotation::exp(&(Vector3::new(direction.cos(), direction.sin(), 0.0) * tilt))
            * Rotation3::from_axis_angle(&Vector3::z_axis(), rng.random_range(-0.4..0.4));
        let pixel = Vector2::new(rng.random_range(0.12..0.88), rng.random_range(0.12..0.88)).component_mul(&sides);
        let depth = rng.random_range(0.9..2.2) * width * camera.focal_lengths()[0] / 500.0;
        let Some(ray) = camera.unproject(&pixel) else { continue };
        let centre = Vector3::new(ray.x, ray.y, 1.0).normalize() * depth;
        let pose = CameraFromBoard::new(turn, centre - turn * middle.push(0.0));
        let inside =
            |pixel: &Vector2<f64>| (5.0..sides.x - 6.0).contains(&pixel.x) && (5.0..sides.y - 6.0).contains(&pixel.y);
        if board.points().iter().all(|point| camera.project(&(pose * *point)).is_some_and(|pixel| inside(&pixel))) {
            return pose;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::named;

    #[test]
    fn every_board_can_be_held_before_every_camera() {
        for text in STUDY_BOARDS {
            let board: Board = text.parse().expect("a board");
            for lens in STUDY_LENSES {
                let camera = study_camera(lens);
                let pose = pose_in_view(&camera, &board, &mut named("a board in view"));
                assert!(pose.translation.z > 0.0, "{text} {}", lens.name());
            }
        }
    }
}
