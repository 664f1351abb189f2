//! Boards before cameras, for tests: what is seen and where it is in truth.

use nalgebra::{Rotation3, Unit, Vector2, Vector3};

use super::{NoBoard, find};
use crate::board::Board;
use crate::calibrate::SeenPoint;
use crate::camera::{Camera, Distortion, Pixel};
use crate::frame::Frame;
use crate::geometry::CameraFromBoard;
use crate::random;
use crate::scene::render::{Optics, Rays, Sheet, render_sheet};

/// A camera and a board before it.
pub(super) struct View {
    pub board: Board,
    pub camera: Camera,
    pub rays: Rays,
    pub focal_px: f64,
    pub sheet: Sheet,
    pub optics: Optics,
    /// How much of the picture's width the board's diagonal takes, and where its middle is, shares of the picture from its middle.
    pub fill: f64,
    pub middle: [f64; 2],
    /// Of the board's normal against the line of sight, and which way; of the board in its plane.
    pub tilt_deg: f64,
    pub way_deg: f64,
    pub turn_deg: f64,
}

pub(super) const PINHOLE: (f64, Distortion) = (500.0, Distortion::None);
pub(super) const BARREL: (f64, Distortion) = (380.0, Distortion::PlumbBob([-0.35, 0.12, 0.0, 0.0, 0.0]));
pub(super) const FISHEYE: (f64, Distortion) = (210.0, Distortion::Equidistant([0.0; 4]));

impl View {
    pub(super) fn of(board: &str, (focal_px, lens): (f64, Distortion)) -> Self {
        let board: Board = board.parse().expect("a board");
        let camera = Camera::checked([520, 400], [focal_px; 2], [260.3, 199.6], lens).expect("a camera");
        let sheet = Sheet::of(&board);
        let optics = Optics { bayer: None, ..Optics::default() };
        Self {
            board,
            rays: Rays::of(&camera),
            camera,
            focal_px,
            sheet,
            optics,
            fill: 0.75,
            middle: [0.0; 2],
            tilt_deg: 0.0,
            way_deg: 20.0,
            turn_deg: 10.0,
        }
    }

    fn pose(&self) -> CameraFromBoard {
        let way = self.way_deg.to_radians();
        let axis = Unit::new_normalize(Vector3::new(way.cos(), way.sin(), 0.0));
        let rotation = Rotation3::from_axis_angle(&axis, self.tilt_deg.to_radians())
            * Rotation3::from_axis_angle(&Vector3::z_axis(), self.turn_deg.to_radians());
        let [least, greatest] = self.board.sheet();
        let depth_m = self.focal_px * (greatest - least).norm() / (self.fill * f64::from(self.camera.width()));
        let size = [self.camera.width(), self.camera.height()].map(f64::from);
        let aside = [0, 1].map(|k| self.middle[k] * size[k] * depth_m / self.focal_px);
        let middle = (least + greatest) / 2.0;
        let translation = Vector3::new(aside[0], aside[1], depth_m) - rotation * middle.push(0.0);
        CameraFromBoard::new(rotation, translation)
    }

    pub(super) fn frame(&self, seed: u64) -> Frame {
        render_sheet(&self.rays, &self.pose(), &self.sheet, &self.optics, &mut random::case("views of boards", seed))
    }

    pub(super) fn seen(&self, seed: u64) -> Result<Vec<SeenPoint>, NoBoard> {
        find(&self.frame(seed), &self.board)
    }

    /// Where each point is seen in truth.
    pub(super) fn truth(&self) -> Vec<Option<Pixel>> {
        let pose = self.pose();
        let normal = pose.rotation * Vector3::z();
        let radius = self.board.disc_radius_m().expect("discs");
        self.board.points().iter().map(|point| self.camera.disc_centroid(&(pose * *point), &normal, radius)).collect()
    }

    /// How many points lie well within the picture.
    pub(super) fn in_view(&self) -> usize {
        let far = [self.camera.width(), self.camera.height()].map(|side| f64::from(side) - 12.0);
        let is_in = |pixel: &&Pixel| pixel.min() > 12.0 && pixel.x < far[0] && pixel.y < far[1];
        self.truth().iter().flatten().filter(is_in).count()
    }

    /// Errors of what is seen against the truth, px, and in standard deviations.
    pub(super) fn errors(&self, seen: &[SeenPoint]) -> Vec<(Vector2<f64>, Vector2<f64>)> {
        let truth = self.truth();
        let error = |seen: &SeenPoint| {
            let error = seen.pixel - truth[seen.point].expect("in view");
            (error, error / seen.sigma_px)
        };
        seen.iter().map(error).collect()
    }
}

/// Mean square of a coordinate's errors, in standard deviations, and the largest error, px.
pub(super) fn judged(errors: &[(Vector2<f64>, Vector2<f64>)]) -> (f64, f64) {
    let squares: f64 = errors.iter().map(|(_, relative)| relative.norm_squared()).sum();
    let largest = errors.iter().map(|(error, _)| error.norm()).fold(0.0, f64::max);
    (squares / (2 * errors.len()) as f64, largest)
}

/// A picture of nothing but noise.
pub(super) fn noise() -> Frame {
    use crate::frame::{Coding, Pixels};
    use rand::RngExt;
    let mut rng = random::named("a picture of noise");
    let samples = (0..520 * 400).map(|_| rng.random::<u8>()).collect();
    Frame::checked(520, 400, Pixels::Luma(samples), Coding::LOSSLESS).expect("a frame")
}
