//! Which view to take next: of many ways to hold the board, the one after which rays are known best.
//!
//! As in Peng and Sturm 2019, "Calibration wizard", but judged in pixels over the whole picture rather than by the parameters.

use nalgebra::{Rotation3, Vector2, Vector3};

use super::SeenPoint;
use super::coverage::Stance;
use super::evidence::Evidence;
use crate::camera::Pixel;
use crate::geometry::{CameraFromBoard, rotation};

/// A way to hold the board.
#[derive(Clone, Debug, PartialEq)]
pub struct NextView {
    /// Where the board is to be.
    pub camera_from_board: CameraFromBoard,
    /// How it stands there.
    pub stance: Stance,
    /// The corners of the sheet in the picture, px: around it, from its first.
    pub outline_px: Vec<Pixel>,
    /// Standard deviation of rays all over the picture, px: before and after that view.
    pub ray_sigma_px: [f64; 2],
}

/// Where in the picture the board's middle is tried, shares of its sides.
const PLACES: [f64; 3] = [0.25, 0.5, 0.75];

/// How far it is tilted.
const TILTS_RAD: [f64; 2] = [0.0, 0.7];

/// How much of the picture's smaller side it fills.
const FILLED: [f64; 2] = [0.4, 0.7];

/// The view that helps most; `None` where none can be found.
pub(super) fn next_view(evidence: &Evidence<'_>) -> Option<NextView> {
    let known = evidence.information()?;
    let before = evidence.ray_sigma_px(&known)?;
    let sigma_px = typical_sigma_px(evidence);
    let mut best: Option<(f64, CameraFromBoard)> = None;
    for pose in candidates(evidence) {
        let Some(view) = view_of(evidence, &pose, sigma_px) else { continue };
        let after = evidence
            .information_of_view(view, pose)
            .and_then(|information| evidence.ray_sigma_px(&(known + information)));
        if let Some(after) = after
            && best.as_ref().is_none_or(|(least, _)| after < *least)
        {
            best = Some((after, pose));
        }
    }
    let (after, pose) = best?;
    let outline_px = corners(evidence)
        .iter()
        .filter_map(|corner| evidence.camera.project(&(pose * crate::geometry::Point::new(corner.x, corner.y, 0.0))))
        .collect();
    let [least, greatest] = evidence.board.sheet();
    let stance = Stance::of(&pose, &(0.5 * (least + greatest)).push(0.0));
    Some(NextView { camera_from_board: pose, stance, outline_px, ray_sigma_px: [before, after] })
}

fn corners(evidence: &Evidence<'_>) -> [Vector2<f64>; 4] {
    let [least, greatest] = evidence.board.sheet();
    [least, Vector2::new(greatest.x, least.y), greatest, Vector2::new(least.x, greatest.y)]
}

fn typical_sigma_px(evidence: &Evidence<'_>) -> f64 {
    let mut sigmas: Vec<f64> = evidence.views.iter().flatten().map(|seen| seen.sigma_px).collect();
    super::start::median(&mut sigmas)
}

fn candidates(evidence: &Evidence<'_>) -> Vec<CameraFromBoard> {
    let camera = evidence.camera;
    let sides = Vector2::new(f64::from(camera.width()), f64::from(camera.height()));
    let [least, greatest] = evidence.board.sheet();
    let middle = Vector3::new(0.5 * (least.x + greatest.x), 0.5 * (least.y + greatest.y), 0.0);
    let extent = (greatest - least).max();
    let focal = camera.focal_lengths()[0];
    let mut poses = Vec::new();
    for (x, y) in PLACES.into_iter().flat_map(|x| PLACES.map(|y| (x, y))) {
        let Some(ray) = camera.unproject(&Vector2::new(x * sides.x, y * sides.y)) else { continue };
        let ray = Vector3::new(ray.x, ray.y, 1.0).normalize();
        // Towards the camera first, then tilted.
        let Some(facing) = Rotation3::rotation_between(&Vector3::z(), &ray) else { continue };
        for filled in FILLED {
            let centre = ray * (focal * extent / (filled * sides.min()));
            for tilt in TILTS_RAD {
                let directions = if tilt > 0.0 { 4 } else { 1 };
                for direction in 0..directions {
                    let angle = f64::from(direction) * std::f64::consts::FRAC_PI_2;
                    let turn = facing * rotation::exp(&(Vector3::new(angle.cos(), angle.sin(), 0.0) * tilt));
                    poses.push(CameraFromBoard::new(turn, centre - turn * middle));
                }
            }
        }
    }
    poses
}

/// The points as they would be seen; `None` unless the whole board is in the picture.
fn view_of(evidence: &Evidence<'_>, pose: &CameraFromBoard, sigma_px: f64) -> Option<Vec<SeenPoint>> {
    let points = evidence.board.points().iter().enumerate();
    points
        .map(|(point, place)| {
            let pixel = evidence.camera.project(&(*pose * *place)).filter(|pixel| evidence.camera.contains(pixel))?;
            Some(SeenPoint { point, pixel, sigma_px })
        })
        .collect()
}
