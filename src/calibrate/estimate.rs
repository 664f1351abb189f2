//! Many sightings of a board in, a camera out.
//!
//! A start in closed form, then camera and poses together in the least reprojection error, first with a loss that a few wrong
//! points or a wrong picture hardly move, then, without these, in least squares. The noise of the points is what they state, or what is
//! left over where that is more, and the covariance of the parameters follows from it.

mod kept;
mod left_out;
mod minima;
mod prior;
mod robust;
mod shared;
mod valley;
mod view;

use nalgebra::Vector2;
use thiserror::Error;

use super::SeenPoint;
use super::bundle::{Bundle, Loss};
use super::freedom::{Fixed, Freedom, Parameters};
use super::watch::Watch;
use crate::board::Board;
use crate::camera::{Camera, CameraError, Distortion};
use crate::geometry::CameraFromBoard;

pub(super) use kept::less_certain;
pub use left_out::LeftOut;
pub(super) use prior::prior;
pub(super) use view::rms_of_view_alone;

/// What is sought and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrateOptions {
    /// The model of the lens; its coefficients are not looked at.
    pub lens: Distortion,
    /// What is held.
    pub fixed: Fixed,
    /// A camera to begin with, from which held values come; without one a start is found.
    pub guess: Option<Camera>,
}

impl Default for CalibrateOptions {
    fn default() -> Self {
        Self { lens: Distortion::PlumbBob([0.0; 5]), fixed: Fixed::default(), guess: None }
    }
}

/// A calibrated camera with the evidence.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// The camera, with the covariance of its parameters.
    pub camera: Camera,
    /// Root mean square distance of the points that count from where they are predicted, px.
    pub rms_px: f64,
    /// Standard deviation of a point's place per axis, px, measured: what is left over, for so many free parameters.
    pub pixel_sigma_px: f64,
    /// What is left over in units of what the pictures told of their noise: 1 where that is all there is.
    pub noise_ratio: f64,
    /// Standard deviation per axis, px, of what is there besides: a board that is not flat, a lens that no model has. It was added to
    /// every point's own.
    pub model_error_px: f64,
    /// How many times the variances of the parameters are those that as many points with independent errors would leave, on average: 1
    /// where the errors of a view do not go together. The covariance has it, and each direction its own.
    pub design_effect: f64,
    /// What is left over in units of both, at least 1, with the root of the design effect.
    pub(super) scale: f64,
    /// Standard deviations of fx, fy, cx, cy and the coefficients; zero for what is held.
    pub standard_deviations: Vec<f64>,
    /// The views in their order.
    pub views: Vec<FittedView>,
}

/// A view under the calibrated camera.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedView {
    /// Where the board was; `None` where no pose explains the view.
    pub camera_from_board: Option<CameraFromBoard>,
    /// Root mean square distance of its points that count, px; of all its points where the view does not count.
    pub rms_px: f64,
    /// Why the camera does not rest on it; `None` where it does.
    pub left_out: Option<LeftOut>,
    /// Seen minus predicted for each of its points, px; `None` where the camera does not see the point.
    pub residuals_px: Vec<Option<Vector2<f64>>>,
    /// Which of its points count.
    pub inliers: Vec<bool>,
}

impl FittedView {
    /// Whether the camera rests on it.
    #[must_use]
    pub const fn counts(&self) -> bool {
        self.left_out.is_none()
    }
}

/// Why there is no camera.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CalibrateError {
    /// Too few views with enough points.
    #[error("{found} views with {min_points} points or more: a calibration needs at least {need}")]
    TooFewViews {
        /// How many there are.
        found: usize,
        /// How many are needed.
        need: usize,
        /// Points that a view needs to count.
        min_points: usize,
    },
    /// No camera explains the views.
    #[error("no camera explains these views: the best leaves {rms_px:.1} px")]
    NoFit {
        /// What it leaves, px.
        rms_px: f64,
    },
    /// Parameters that the views leave open, as the focal length where all of them are seen squarely.
    #[error("the views leave some parameters open: show the board tilted, in different directions")]
    Open,
    /// The camera to begin with is of other pictures.
    #[error("the camera to begin with is of {} x {} px, the pictures are of {} x {} px", .guess[0], .guess[1], .pictures[0], .pictures[1])]
    GuessSize {
        /// Its size, px.
        guess: [u32; 2],
        /// Theirs, px.
        pictures: [u32; 2],
    },
    /// Who waited for it has had enough.
    #[error("the calibration was cancelled")]
    Unwanted,
    /// What came out is no camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
}

/// Points that a view needs: four fix its pose, and one more than that says something.
pub const MIN_POINTS: usize = 8;

/// The camera of pictures of `size` px that explains the views best.
///
/// # Errors
/// [`CalibrateError`] says why there is none. A camera that is poorly determined is not refused here: see its standard deviations.
pub fn calibrate(
    size: [u32; 2],
    board: &Board,
    views: &[Vec<SeenPoint>],
    options: &CalibrateOptions,
) -> Result<Calibration, CalibrateError> {
    calibrate_watched(size, board, views, options, &Watch::nobody())
}

/// The same while somebody waits, who is told how far it is and may say that it is not wanted any more.
///
/// # Errors
/// [`CalibrateError`].
pub fn calibrate_watched(
    size: [u32; 2],
    board: &Board,
    views: &[Vec<SeenPoint>],
    options: &CalibrateOptions,
    watch: &Watch<'_>,
) -> Result<Calibration, CalibrateError> {
    let found = of_these(size, board, views, options, watch);
    watch.done(1.0);
    // What was broken off says nothing about the views.
    if watch.is_wanted() { found } else { Err(CalibrateError::Unwanted) }
}

/// The camera that explains these views best, without its covariance, where one near `camera` with these poses is known: that of more
/// views than these, or the like. None of them is looked for from afar, and none is taken for a repeated one.
pub(super) fn camera_near(
    board: &Board,
    views: &[&[SeenPoint]],
    options: &CalibrateOptions,
    camera: &Camera,
    poses: Vec<CameraFromBoard>,
    watch: &Watch<'_>,
) -> Option<Camera> {
    let size = [camera.width(), camera.height()];
    let freedom = freedom_of(size, options).ok()?;
    let (loss, prior) = (Loss::Squares, Parameters::zeros());
    let bundle = Bundle { size, board, views, lens: options.lens, freedom, loss, prior, watch: *watch };
    let state = super::start::state_of(camera, poses);
    let (scale, scale_px) = robust::noise_of(&bundle, &state)?;
    let fit = robust::Fit { places: (0..views.len()).collect(), state, scale, scale_px };
    Some(*kept::without_what_is_wrong(&bundle, fit).ok()?.camera())
}

fn of_these(
    size: [u32; 2],
    board: &Board,
    views: &[Vec<SeenPoint>],
    options: &CalibrateOptions,
    watch: &Watch<'_>,
) -> Result<Calibration, CalibrateError> {
    let useful = useful(views);
    let freedom = freedom_of(size, options)?;
    // A view gives two equations about the camera.
    let need = freedom.count().min(4).div_ceil(2).max(1);
    if useful.len() < need {
        return Err(CalibrateError::TooFewViews { found: useful.len(), need, min_points: MIN_POINTS });
    }
    let all: Vec<&[SeenPoint]> = useful.iter().map(|index| views[*index].as_slice()).collect();
    let prior = Parameters::zeros();
    let bundle =
        Bundle { size, board, views: &all, lens: options.lens, freedom, loss: Loss::Squares, prior, watch: *watch };
    let robust = robust::robust_fit(&bundle, options)?;
    let kept = kept::without_what_is_wrong(&bundle, robust)?;
    if kept.view_count() < need {
        return Err(CalibrateError::TooFewViews { found: kept.view_count(), need, min_points: MIN_POINTS });
    }
    kept.calibration(views, &useful)
}

/// Views with points enough in which something has moved since each before: the errors of a picture taken twice are the same ones, so
/// that it would only seem to make them smaller.
fn useful(views: &[Vec<SeenPoint>]) -> Vec<usize> {
    let mut useful: Vec<usize> = Vec::with_capacity(views.len());
    for (index, view) in views.iter().enumerate() {
        if view.len() >= MIN_POINTS && !useful.iter().any(|before| is_repeated(view, &views[*before])) {
            useful.push(index);
        }
    }
    useful
}

/// Of a board that stands still, points move by less than this, px.
const STILL_PX: f64 = 0.5;

fn is_repeated(view: &[SeenPoint], before: &[SeenPoint]) -> bool {
    let moved = |seen: &SeenPoint| {
        before.iter().find(|other| other.point == seen.point).map(|other| (other.pixel - seen.pixel).norm())
    };
    let mut moves: Vec<f64> = view.iter().filter_map(moved).collect();
    2 * moves.len() > view.len() && super::start::median(&mut moves) < STILL_PX
}

pub(super) fn freedom_of(size: [u32; 2], options: &CalibrateOptions) -> Result<Freedom, CalibrateError> {
    if let Some(guess) = &options.guess
        && [guess.width(), guess.height()] != size
    {
        return Err(CalibrateError::GuessSize { guess: [guess.width(), guess.height()], pictures: size });
    }
    let aspect_ratio = options.guess.map_or(1.0, |guess| guess.focal_lengths()[0] / guess.focal_lengths()[1]);
    Ok(Freedom::of(&options.lens, &options.fixed, aspect_ratio))
}

#[cfg(test)]
pub(super) mod tests;
