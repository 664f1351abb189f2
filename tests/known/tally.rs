//! What became of frames with a target in them, and how far centroids were off.

use skypose::camera::Pixel;
use skypose::geometry::{CameraFromTarget, rotation};
use skypose::pipeline::TargetEstimate;
use skypose::pose::{PoseAnswer, PoseEstimate};

/// What the project promises of a frame in which six markers are seen: attitude within this, rad,
const RIGHT_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;
/// and position within this share of the range. The mirrored minimum of a flat target is off by twice its tilt.
const RIGHT_RANGE_RATIO: f64 = 0.05;

/// An answer this probable is one to act on.
pub const CONFIDENT: f64 = 0.95;

fn is_right(estimate: &PoseEstimate, truth: &CameraFromTarget) -> bool {
    let found = &estimate.camera_from_target;
    rotation::angle_between_rad(&found.rotation, &truth.rotation) < RIGHT_RAD
        && (found.translation - truth.translation).norm() < RIGHT_RANGE_RATIO * truth.translation.norm()
}

/// What became of a frame with a target in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The best pose is the right one.
    Right,
    /// The right one is among the alternatives, and the answer calls itself ambiguous.
    Flagged,
    /// There is no pose.
    Missed,
    /// The right one is nowhere, or the answer does not warn of it.
    Wrong,
}

/// How the answer stands to the truth.
pub fn outcome(found: &TargetEstimate, truth: &CameraFromTarget) -> Outcome {
    let right = |estimate: &PoseEstimate| is_right(estimate, truth);
    match &found.answer {
        Err(_) => Outcome::Missed,
        Ok(answer) if right(&answer.best) => Outcome::Right,
        Ok(answer) if answer.is_ambiguous() && answer.alternatives.iter().any(right) => Outcome::Flagged,
        Ok(_) => Outcome::Wrong,
    }
}

/// Counts of outcomes, and the errors of the centroids in units of their stated deviation.
#[derive(Debug, Default)]
pub struct Tally {
    pub frames: u32,
    pub right: u32,
    pub flagged: u32,
    pub missed: u32,
    pub wrong: u32,
    pub markers: u32,
    pub normalized_squared: f64,
    pub beyond_four: u32,
    pub squared_px: f64,
    /// Right poses, and their squared errors in units of their covariance.
    pub poses: u32,
    pub pose_squared: f64,
}

impl Tally {
    pub fn add(&mut self, outcome: Outcome) {
        self.frames += 1;
        *match outcome {
            Outcome::Right => &mut self.right,
            Outcome::Flagged => &mut self.flagged,
            Outcome::Missed => &mut self.missed,
            Outcome::Wrong => &mut self.wrong,
        } += 1;
    }

    pub fn add_centroid(&mut self, found: &Pixel, sigma_px: f64, truth: &Pixel) {
        let squared = (found - truth).norm_squared();
        self.markers += 1;
        self.normalized_squared += squared / sigma_px.powi(2);
        self.squared_px += squared;
        self.beyond_four += u32::from(squared > (4.0 * sigma_px).powi(2));
    }

    /// How far the right one of the poses is off, in units of what it says.
    #[allow(dead_code, reason = "not every test asks")]
    pub fn add_pose(&mut self, answer: &PoseAnswer, truth: &CameraFromTarget) {
        let Some(right) = std::iter::once(&answer.best).chain(&answer.alternatives).find(|pose| is_right(pose, truth))
        else {
            return;
        };
        let error = right.camera_from_target.difference_to(truth);
        let solved = right.covariance.matrix().cholesky().expect("a covariance").solve(&error);
        self.poses += 1;
        self.pose_squared += error.dot(&solved);
    }

    /// Mean squared normalised error of the poses by its six coordinates: 1 where covariances hold.
    pub fn pose_mean_square(&self) -> f64 {
        self.pose_squared / f64::from(6 * self.poses)
    }

    pub fn merge(&mut self, other: &Self) {
        self.frames += other.frames;
        self.right += other.right;
        self.flagged += other.flagged;
        self.missed += other.missed;
        self.wrong += other.wrong;
        self.poses += other.poses;
        self.pose_squared += other.pose_squared;
        self.markers += other.markers;
        self.normalized_squared += other.normalized_squared;
        self.squared_px += other.squared_px;
        self.beyond_four += other.beyond_four;
    }

    /// Mean of the squared normalised errors per axis: 1 where the stated deviations hold.
    pub fn mean_square(&self) -> f64 {
        self.normalized_squared / f64::from(2 * self.markers)
    }

    /// Root mean square error per axis, px.
    pub fn rms_px(&self) -> f64 {
        (self.squared_px / f64::from(2 * self.markers)).sqrt()
    }

    pub fn head() {
        println!(
            "{:<12}{:>8}{:>8}{:>10}{:>8}{:>8}{:>10}{:>12}{:>14}{:>10}",
            "suite", "frames", "right", "flagged", "missed", "wrong", "markers", "rms px", "(err/sigma)^2", "of poses"
        );
    }

    pub fn print(&self, suite: &str) {
        let rms_px = self.rms_px();
        println!(
            "{suite:<12}{:>8}{:>8}{:>10}{:>8}{:>8}{:>10}{rms_px:>12.3}{:>14.2}{:>10.2}",
            self.frames,
            self.right,
            self.flagged,
            self.missed,
            self.wrong,
            self.markers,
            self.mean_square(),
            self.pose_mean_square()
        );
    }
}
