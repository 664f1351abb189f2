//! Many sightings of a board in, a camera out.
//!
//! A start in closed form, then camera and poses together in the least reprojection error, first with a loss that a few wrong
//! points or a wrong picture hardly move, then, without these, in least squares. The noise of the points is what they state, or what is
//! left over where that is more, and the covariance of the parameters follows from it.

use nalgebra::Vector2;
use thiserror::Error;

use super::SeenPoint;
use super::bundle::{Bundle, Loss, State};
use super::freedom::{Fixed, Freedom, Parameters};
use super::start::{median, middle, pose, starts, state_of};
use crate::board::Board;
use crate::camera::{Camera, CameraError, Distortion};
use crate::geometry::CameraFromBoard;

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
    /// What is left over in units of both, at least 1: that of the covariance.
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
    /// Whether the camera rests on it.
    pub counts: bool,
    /// Seen minus predicted for each of its points, px; `None` where the camera does not see the point.
    pub residuals_px: Vec<Option<Vector2<f64>>>,
    /// Which of its points count.
    pub inliers: Vec<bool>,
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
    /// What came out is no camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
}

/// Points that a view needs: four fix its pose, and one more than that says something.
pub const MIN_POINTS: usize = 8;

/// Points farther from their prediction than this, in units of the measured noise, do not count; of good ones 4 in 100,000 are.
const GATE: f64 = 4.5;

/// A view does not count where its median error is this many times that of all views.
const VIEW_GATE: f64 = 6.0;

/// A fit that leaves more than this, px, is none.
const MAX_RMS_PX: f64 = 8.0;

/// Median of the distance of a point in a plane, in standard deviations per axis.
const MEDIAN_DISTANCE: f64 = 1.177_41;

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
    let useful: Vec<usize> = (0..views.len()).filter(|index| views[*index].len() >= MIN_POINTS).collect();
    let freedom = freedom_of(size, options)?;
    // A view gives two equations about the camera.
    let need = freedom.count().min(4).div_ceil(2).max(1);
    if useful.len() < need {
        return Err(CalibrateError::TooFewViews { found: useful.len(), need, min_points: MIN_POINTS });
    }
    let all: Vec<&[SeenPoint]> = useful.iter().map(|index| views[*index].as_slice()).collect();
    let prior = Parameters::zeros();
    let bundle = Bundle { size, board, views: &all, lens: options.lens, freedom, loss: Loss::Squares, prior };
    let robust = robust_fit(&bundle, options)?;
    let kept = without_what_is_wrong(&bundle, robust)?;
    kept.calibration(views, &useful)
}

pub(super) fn freedom_of(size: [u32; 2], options: &CalibrateOptions) -> Result<Freedom, CalibrateError> {
    if let Some(guess) = &options.guess
        && [guess.width(), guess.height()] != size
    {
        return Err(
            CameraError::Size { width: guess.width(), height: guess.height(), max: size[0].max(size[1]) }.into()
        );
    }
    let aspect_ratio = options.guess.map_or(1.0, |guess| guess.focal_lengths()[0] / guess.focal_lengths()[1]);
    Ok(Freedom::of(&options.lens, &options.fixed, aspect_ratio))
}

/// Held values that a start need not have.
fn held(size: [u32; 2], options: &CalibrateOptions, camera: &Camera) -> Result<Camera, CameraError> {
    let mut parameters: Parameters = super::freedom::parameters_of(camera);
    if options.guess.is_none() {
        if options.fixed.aspect_ratio {
            let mean = (parameters[0] * parameters[1]).sqrt();
            (parameters[0], parameters[1]) = (mean, mean);
        }
        if options.fixed.principal_point {
            parameters.fixed_rows_mut::<2>(2).copy_from(&middle(size));
        }
    }
    super::freedom::camera_of(size, &options.lens, &parameters)
}

/// A fit that a few wrong points or views hardly move, with a pose for every view that has one, and its noise ratio.
fn robust_fit(bundle: &Bundle<'_>, options: &CalibrateOptions) -> Result<Fit, CalibrateError> {
    let mut best: Option<Fit> = None;
    for (camera, poses) in starts(bundle, options.guess.as_ref()).into_iter().take(3) {
        let camera = held(bundle.size, options, &camera)?;
        let Some(fit) = robust_fit_from(bundle, &camera, poses) else { continue };
        let is_better = best.as_ref().is_none_or(|best| fit.scale < 0.9 * best.scale);
        if is_better {
            best = Some(fit);
        }
        // A good fit is a good fit; other starts are for when there is none.
        if best.as_ref().is_some_and(|best| best.scale_px < 1.0) {
            break;
        }
    }
    match best {
        Some(fit) if fit.scale_px < MAX_RMS_PX => Ok(fit),
        Some(fit) => Err(CalibrateError::NoFit { rms_px: fit.scale_px }),
        None => Err(CalibrateError::NoFit { rms_px: f64::INFINITY }),
    }
}

/// A camera, which of the views it has poses for, and these.
struct Fit {
    places: Vec<usize>,
    state: State,
    /// Robust noise ratio.
    scale: f64,
    /// The same, px.
    scale_px: f64,
}

fn robust_fit_from(bundle: &Bundle<'_>, camera: &Camera, poses: Vec<Option<CameraFromBoard>>) -> Option<Fit> {
    let places: Vec<usize> = (0..poses.len()).filter(|place| poses[*place].is_some()).collect();
    let views: Vec<&[SeenPoint]> = places.iter().map(|place| bundle.views[*place]).collect();
    let mut state = state_of(camera, poses.into_iter().flatten().collect());
    // First what bends most: one focal length and the first coefficient.
    let held = Fixed {
        principal_point: true,
        coefficients: [false, true, true, true, true, true, true, true],
        aspect_ratio: true,
    };
    let aspect = camera.focal_lengths()[0] / camera.focal_lengths()[1];
    let mut fit = Bundle { views: &views, freedom: Freedom::of(&bundle.lens, &held, aspect), ..*bundle };
    let mut scale = f64::INFINITY;
    for round in 0..8 {
        let before = scale;
        scale = noise_of(&fit, &state)?.0;
        fit.prior = prior(camera, scale);
        // The first round is far off: everything is an outlier.
        fit.loss = Loss::Cauchy { c: 2.5 * scale.max(1e-9) };
        state = fit.refined(state)?;
        if round == 1 {
            fit.freedom = bundle.freedom;
        }
        if round > 2 && (before / scale - 1.0).abs() < 0.02 {
            break;
        }
    }
    let (scale, scale_px) = noise_of(&fit, &state)?;
    Some(Fit { places, state, scale, scale_px })
}

/// Standard deviation of a lens' term at the picture's corner before anything is seen, in units of the ray's own length.
const TERM: f64 = 1.0;

/// The same for terms below the fraction bar of a rational lens: beside those above, small ones do as well as large ones.
const DENOMINATOR_TERM: f64 = 0.6;

/// What is known of a lens before anything is seen. `scale` is the noise of the residuals in their units.
pub(super) fn prior(camera: &Camera, scale: f64) -> Parameters {
    let [fx, fy] = camera.focal_lengths();
    let corner = middle([camera.width(), camera.height()]).component_div(&Vector2::new(fx, fy)).norm();
    let square = corner * corner;
    let powers = match camera.distortion() {
        Distortion::None => [0; 8],
        Distortion::PlumbBob(_) | Distortion::RationalPolynomial(_) => [2, 4, 1, 1, 6, 2, 4, 6],
        Distortion::Equidistant(_) => [2, 4, 6, 8, 0, 0, 0, 0],
    };
    let mut prior = Parameters::zeros();
    for (index, power) in powers.into_iter().enumerate().take(camera.distortion().coefficients().len()) {
        let is_denominator = matches!(camera.distortion(), Distortion::RationalPolynomial(_)) && index >= 5;
        let deviation = if is_denominator { DENOMINATOR_TERM } else { TERM };
        prior[4 + index] = square.powi(power) * (scale / deviation).powi(2);
    }
    prior
}

/// Robust standard deviation of all residuals per axis: in units of their own, and px.
fn noise_of(bundle: &Bundle<'_>, state: &State) -> Option<(f64, f64)> {
    let mut ratios = Vec::new();
    let mut distances = Vec::new();
    for (view, pose) in bundle.views.iter().zip(&state.poses) {
        for seen in *view {
            let distance = bundle.residual(&state.camera, pose, seen).map_or(f64::INFINITY, |r| r.norm());
            ratios.push(distance / seen.sigma_px);
            distances.push(distance);
        }
    }
    let (ratio, distance) = (median(&mut ratios) / MEDIAN_DISTANCE, median(&mut distances) / MEDIAN_DISTANCE);
    ratio.is_finite().then_some((ratio.max(1e-9), distance))
}

/// Points by view, those that count only, their deviations with what the model lacks.
struct Kept<'a> {
    bundle: Bundle<'a>,
    /// Position in the bundle's views of each that counts.
    places: Vec<usize>,
    views: Vec<Vec<SeenPoint>>,
    state: State,
    scale: f64,
    model_error_px: f64,
}

/// The point, less certain by what the model lacks.
pub(super) fn less_certain(seen: &SeenPoint, model_error_px: f64) -> SeenPoint {
    SeenPoint { sigma_px: seen.sigma_px.hypot(model_error_px), ..*seen }
}

fn without_what_is_wrong<'a>(bundle: &Bundle<'a>, fit: Fit) -> Result<Kept<'a>, CalibrateError> {
    let Fit { mut places, mut state, mut scale, .. } = fit;
    let mut model_error_px = 0.0;
    let mut views: Vec<Vec<SeenPoint>> = Vec::new();
    for _ in 0..8 {
        let before: Vec<usize> = views.iter().map(Vec::len).collect();
        // A view that another camera took, or of another board, is wrong as a whole.
        let good = places.iter().zip(&state.poses).filter_map(|(place, pose)| {
            let seen: Vec<SeenPoint> =
                bundle.views[*place].iter().map(|seen| less_certain(seen, model_error_px)).collect();
            let distance = |seen: &SeenPoint| {
                bundle.residual(&state.camera, pose, seen).map_or(f64::INFINITY, |r| r.norm() / seen.sigma_px)
            };
            let all: Vec<f64> = seen.iter().map(distance).collect();
            let is_right = median(&mut all.clone()) / MEDIAN_DISTANCE <= VIEW_GATE * scale;
            let counts = seen.iter().zip(&all).filter(|(_, distance)| **distance <= GATE * scale);
            let inliers: Vec<SeenPoint> = counts.map(|(seen, _)| *seen).collect();
            (is_right && inliers.len() >= MIN_POINTS).then_some((*place, *pose, inliers))
        });
        let good: Vec<_> = good.collect();
        places = good.iter().map(|(place, ..)| *place).collect();
        state.poses = good.iter().map(|(_, pose, _)| *pose).collect();
        views = good.into_iter().map(|(.., inliers)| inliers).collect();
        let slices: Vec<&[SeenPoint]> = views.iter().map(Vec::as_slice).collect();
        let prior = prior(&state.camera, scale);
        let least_squares = Bundle { views: &slices, loss: Loss::Squares, prior, ..*bundle };
        state = least_squares.refined(state).ok_or(CalibrateError::Open)?;
        let freedom = degrees_of_freedom(&least_squares).ok_or(CalibrateError::Open)?;
        scale = (least_squares.cost(&state) / freedom).sqrt().max(1e-9);
        let more_px = lacking_px(&least_squares, &state, freedom);
        if more_px == 0.0 && views.iter().map(Vec::len).eq(before) {
            break;
        }
        model_error_px = model_error_px.hypot(more_px);
        for seen in views.iter_mut().flatten() {
            *seen = less_certain(seen, more_px);
        }
        if more_px > 0.0 {
            scale = 1.0;
        }
    }
    Ok(Kept { bundle: Bundle { loss: Loss::Squares, ..*bundle }, places, views, state, scale, model_error_px })
}

/// What must be added to every point's own deviation for the residuals to be of the size that they are to have, px; 0 where they are
/// not larger (Mandel and Paule 1970, "Interlaboratory evaluation of a material with unequal numbers of replicates").
fn lacking_px(bundle: &Bundle<'_>, state: &State, freedom: f64) -> f64 {
    let mut squares = Vec::new();
    for (view, pose) in bundle.views.iter().zip(&state.poses) {
        for seen in *view {
            let square = bundle.residual(&state.camera, pose, seen).map_or(0.0, |residual| residual.norm_squared());
            squares.push((square, seen.sigma_px * seen.sigma_px));
        }
    }
    let excess = |added: f64| squares.iter().map(|(square, own)| square / (own + added)).sum::<f64>() - freedom;
    // Within a thousandth there is nothing to be added.
    if excess(0.0) <= 2e-3 * freedom {
        return 0.0;
    }
    let (mut least, mut most) = (0.0, squares.iter().map(|(square, _)| square).sum::<f64>() / freedom);
    for _ in 0..60 {
        let middle = 0.5 * (least + most);
        if excess(middle) > 0.0 {
            least = middle;
        } else {
            most = middle;
        }
    }
    most.sqrt()
}

/// Equations less unknowns; `None` if there are not more.
fn degrees_of_freedom(bundle: &Bundle<'_>) -> Option<f64> {
    let points: usize = bundle.views.iter().map(|view| view.len()).sum();
    let unknown = bundle.freedom.count() + 6 * bundle.views.len();
    (2 * points > unknown).then(|| (2 * points - unknown) as f64)
}

impl Kept<'_> {
    fn calibration(&self, all: &[Vec<SeenPoint>], useful: &[usize]) -> Result<Calibration, CalibrateError> {
        let slices: Vec<&[SeenPoint]> = self.views.iter().map(Vec::as_slice).collect();
        let bundle = Bundle { views: &slices, prior: prior(&self.state.camera, self.scale), ..self.bundle };
        let freedom = degrees_of_freedom(&bundle).ok_or(CalibrateError::Open)?;
        // Less than the pictures told is no reason to be surer: what neighbouring points have in common, as what a lens hides between
        // its pixels, bends the camera and leaves little over.
        let scale = self.scale.max(1.0);
        let covariance = bundle.covariance(&self.state).ok_or(CalibrateError::Open)? * scale.powi(2);
        let size = 4 + self.bundle.lens.coefficients().len();
        let rows: Vec<Vec<f64>> = (0..size).map(|r| (0..size).map(|c| covariance[(r, c)]).collect()).collect();
        let camera = self.state.camera.with_parameter_covariance(&rows)?;
        let squares = |view: &[SeenPoint], pose: &CameraFromBoard| -> f64 {
            view.iter().filter_map(|seen| bundle.residual(&camera, pose, seen)).map(|r| r.norm_squared()).sum()
        };
        // In units of what was told, before anything was added.
        let told = |view: usize| all[useful[self.places[view]]].as_slice();
        let mut surprise = 0.0;
        for (view, pose) in self.state.poses.iter().enumerate() {
            for seen in slices[view] {
                let own =
                    told(view).iter().find(|own| own.point == seen.point).map_or(seen.sigma_px, |own| own.sigma_px);
                let residual = bundle.residual(&camera, pose, seen).map_or(0.0, |residual| residual.norm_squared());
                surprise += residual / (own * own);
            }
        }
        let total: f64 = slices.iter().zip(&self.state.poses).map(|(view, pose)| squares(view, pose)).sum();
        let points: usize = slices.iter().map(|view| view.len()).sum();
        let mut views = Vec::with_capacity(all.len());
        for (index, seen) in all.iter().enumerate() {
            let place = useful.iter().position(|useful| *useful == index);
            let kept = place.and_then(|place| self.places.iter().position(|kept| *kept == place));
            let pose = match kept {
                Some(kept) => Some(self.state.poses[kept]),
                None => pose_alone(&self.bundle, &camera, seen),
            };
            let seen: Vec<SeenPoint> = seen.iter().map(|seen| less_certain(seen, self.model_error_px)).collect();
            views.push(fitted(&bundle, &camera, pose, &seen, kept.map(|_| GATE * self.scale)));
        }
        Ok(Calibration {
            camera,
            rms_px: (total / points as f64).sqrt(),
            pixel_sigma_px: (total / freedom).sqrt(),
            noise_ratio: (surprise / freedom).sqrt(),
            model_error_px: self.model_error_px,
            scale,
            standard_deviations: (0..size).map(|i| covariance[(i, i)].max(0.0).sqrt()).collect(),
            views,
        })
    }
}

/// The best pose of a view under a camera that does not rest on it.
pub(super) fn pose_alone(bundle: &Bundle<'_>, camera: &Camera, view: &[SeenPoint]) -> Option<CameraFromBoard> {
    let start = pose(bundle, camera, view)?;
    let views = [view];
    let alone = Bundle { views: &views, freedom: Freedom::none(), ..*bundle };
    // Points outside the lens' range leave no cost to lower; the start is what there is.
    Some(alone.refined(state_of(camera, vec![start])).map_or(start, |state| state.poses[0]))
}

/// Root mean square distance, px, of the points of a view from where a camera that does not rest on it predicts them, in the best pose.
pub(super) fn rms_of_view_alone(board: &Board, camera: &Camera, view: &[SeenPoint]) -> Option<f64> {
    let bundle = Bundle {
        size: [camera.width(), camera.height()],
        board,
        views: &[],
        lens: *camera.distortion(),
        freedom: Freedom::none(),
        loss: Loss::Squares,
        prior: Parameters::zeros(),
    };
    let pose = pose_alone(&bundle, camera, view)?;
    let squares: Option<Vec<f64>> =
        view.iter().map(|seen| bundle.residual(camera, &pose, seen).map(|r| r.norm_squared())).collect();
    squares.map(|squares| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// The view under the camera; `gate` where it counts.
fn fitted(
    bundle: &Bundle<'_>,
    camera: &Camera,
    pose: Option<CameraFromBoard>,
    view: &[SeenPoint],
    gate: Option<f64>,
) -> FittedView {
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
    FittedView { camera_from_board: pose, rms_px, counts: gate.is_some(), residuals_px, inliers }
}

#[cfg(test)]
pub(super) mod tests;
