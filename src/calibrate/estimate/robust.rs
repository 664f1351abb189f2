//! A first camera that a few wrong points or pictures hardly move.

use super::minima::in_deeper_minima;
use super::prior::prior;
use super::{CalibrateError, CalibrateOptions};
use crate::calibrate::SeenPoint;
use crate::calibrate::bundle::{Bundle, Loss, State};
use crate::calibrate::freedom::{Fixed, Freedom, camera_of, parameters_of};
use crate::calibrate::start::{median, middle, starts, state_of};
use crate::camera::{Camera, CameraError};
use crate::geometry::CameraFromBoard;

/// A fit that leaves more than this, px, is none.
const MAX_RMS_PX: f64 = 8.0;

/// Starts that are tried at most.
const STARTS: usize = 3;

/// Times that the loss is fitted to the noise at most.
const ROUNDS: u32 = 9;

/// Share of a calibration that this is.
const ROBUST_SHARE: f64 = 0.8;

/// Of the parameters, the first that stands below a fraction bar; only rational lenses have it.
const FIRST_DENOMINATOR: usize = 9;

/// Median of the distance of a point in a plane, in standard deviations per axis.
pub(super) const MEDIAN_DISTANCE: f64 = 1.177_41;

/// Held values that a start need not have.
fn held(size: [u32; 2], options: &CalibrateOptions, camera: &Camera) -> Result<Camera, CameraError> {
    let mut parameters = parameters_of(camera);
    if options.guess.is_none() {
        if options.fixed.aspect_ratio {
            let mean = (parameters[0] * parameters[1]).sqrt();
            (parameters[0], parameters[1]) = (mean, mean);
        }
        if options.fixed.principal_point {
            parameters.fixed_rows_mut::<2>(2).copy_from(&middle(size));
        }
        for (index, _) in options.fixed.coefficients.iter().enumerate().filter(|(_, fixed)| **fixed) {
            parameters[4 + index] = 0.0;
        }
    }
    camera_of(size, &options.lens, &parameters)
}

/// A fit that a few wrong points or views hardly move, with a pose for every view that has one, and its noise ratio.
pub(super) fn robust_fit(bundle: &Bundle<'_>, options: &CalibrateOptions) -> Result<Fit, CalibrateError> {
    let mut best: Option<Fit> = None;
    for (index, (camera, poses)) in starts(bundle, options.guess.as_ref()).into_iter().take(STARTS).enumerate() {
        let camera = held(bundle.size, options, &camera)?;
        let share = |index: usize| ROBUST_SHARE * index as f64 / STARTS as f64;
        let bundle = Bundle { watch: bundle.watch.part(share(index), share(index + 1)), ..*bundle };
        let Some(fit) = robust_fit_from(&bundle, &camera, poses, &options.fixed) else { continue };
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
pub(super) struct Fit {
    pub places: Vec<usize>,
    pub state: State,
    /// Robust noise ratio.
    pub scale: f64,
    /// The same, px.
    pub scale_px: f64,
}

fn robust_fit_from(
    bundle: &Bundle<'_>,
    camera: &Camera,
    poses: Vec<Option<CameraFromBoard>>,
    fixed: &Fixed,
) -> Option<Fit> {
    let places: Vec<usize> = (0..poses.len()).filter(|place| poses[*place].is_some()).collect();
    let views: Vec<&[SeenPoint]> = places.iter().map(|place| bundle.views[*place]).collect();
    let mut state = state_of(camera, poses.into_iter().flatten().collect());
    // First what bends most: one focal length and the first coefficient.
    let held = Fixed {
        principal_point: true,
        coefficients: [fixed.coefficients[0], true, true, true, true, true, true, true],
        aspect_ratio: true,
    };
    let aspect = camera.focal_lengths()[0] / camera.focal_lengths()[1];
    let mut fit = Bundle { views: &views, freedom: Freedom::of(&bundle.lens, &held, aspect), ..*bundle };
    let mut scale = f64::INFINITY;
    for round in 0..ROUNDS {
        let before = scale;
        scale = noise_of(&fit, &state)?.0;
        fit.prior = prior(camera, scale);
        // The first round is far off: everything is an outlier.
        fit.loss = Loss::Cauchy { c: 2.5 * scale.max(1e-9) };
        state = fit.refined(state)?;
        fit.watch.done(f64::from(round + 1) / f64::from(ROUNDS));
        // Then all but what stands below a fraction bar: from afar such terms run to where they may go no further, and stay there.
        if round == 1 {
            fit.freedom = bundle.freedom.below(FIRST_DENOMINATOR);
        }
        if round == 2 {
            fit.freedom = bundle.freedom;
        }
        if round > 3 && (before / scale - 1.0).abs() < 0.02 {
            break;
        }
    }
    if let Some(mended) = in_deeper_minima(&fit, &state) {
        state = fit.refined(mended)?;
    }
    let (scale, scale_px) = noise_of(&fit, &state)?;
    Some(Fit { places, state, scale, scale_px })
}

/// Robust standard deviation of all residuals per axis: in units of their own, and px.
pub(super) fn noise_of(bundle: &Bundle<'_>, state: &State) -> Option<(f64, f64)> {
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
