//! The camera of what is right: points and pictures that do not fit are left out, and what noise does not explain is added to the
//! deviation of every point.

use super::minima::best_pose;
use super::prior::prior;
use super::robust::{Fit, MEDIAN_DISTANCE};
use super::shared::Shared;
use super::valley;
use super::view::fitted;
use super::{CalibrateError, Calibration, LeftOut, MIN_POINTS};
use crate::calibrate::SeenPoint;
use crate::calibrate::bundle::{Bundle, Loss, State, covariance_of};
use crate::calibrate::start::median;
use crate::camera::Camera;
use crate::geometry::CameraFromBoard;

/// Points farther from their prediction than this, in units of the measured noise, do not count; of good ones 4 in 100,000 are.
const GATE: f64 = 4.5;

/// A view does not count where its median error is this many times that of all views.
const VIEW_GATE: f64 = 6.0;

/// A view counts where this share of its points fits.
const LEAST_FITTING: f64 = 2.0 / 3.0;

/// The noise that gates stand by: what is within the deviation that its picture told is not wrong, however little the others scatter.
const fn gate_scale(scale: f64) -> f64 {
    scale.max(1.0)
}

/// Points by view, those that count only, their deviations with what the model lacks.
pub(super) struct Kept<'a> {
    bundle: Bundle<'a>,
    /// Position in the bundle's views of each that counts.
    places: Vec<usize>,
    views: Vec<Vec<SeenPoint>>,
    /// Why the others do not, by their position in the bundle's views; those that never had a pose are not among them.
    left_out: Vec<(usize, LeftOut)>,
    state: State,
    scale: f64,
    model_error_px: f64,
}

/// The point, less certain by what the model lacks.
pub(in crate::calibrate) fn less_certain(seen: &SeenPoint, model_error_px: f64) -> SeenPoint {
    SeenPoint { sigma_px: seen.sigma_px.hypot(model_error_px), ..*seen }
}

pub(super) fn without_what_is_wrong<'a>(bundle: &Bundle<'a>, fit: Fit) -> Result<Kept<'a>, CalibrateError> {
    let Fit { mut places, mut state, mut scale, .. } = fit;
    let mut model_error_px = 0.0;
    let mut views: Vec<Vec<SeenPoint>> = Vec::new();
    let mut left_out = Vec::new();
    for _ in 0..8 {
        let before: Vec<usize> = views.iter().map(Vec::len).collect();
        // A view that another camera took, or of another board, is wrong as a whole.
        let mut good = Vec::with_capacity(places.len());
        for (place, pose) in places.iter().zip(&state.poses) {
            let seen: Vec<SeenPoint> =
                bundle.views[*place].iter().map(|seen| less_certain(seen, model_error_px)).collect();
            let distance = |seen: &SeenPoint| {
                bundle.residual(&state.camera, pose, seen).map_or(f64::INFINITY, |r| r.norm() / seen.sigma_px)
            };
            let all: Vec<f64> = seen.iter().map(distance).collect();
            let counts = seen.iter().zip(&all).filter(|(_, distance)| **distance <= GATE * gate_scale(scale));
            let inliers: Vec<SeenPoint> = counts.map(|(seen, _)| *seen).collect();
            let points = seen.len();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "no more than there are points"
            )]
            let need = MIN_POINTS.max((LEAST_FITTING * points as f64).ceil() as usize);
            let reason = if median(&mut all.clone()) / MEDIAN_DISTANCE > VIEW_GATE * gate_scale(scale) {
                let distance_px = |seen| bundle.residual(&state.camera, pose, seen).map_or(f64::INFINITY, |r| r.norm());
                let mut all_px: Vec<f64> = seen.iter().map(distance_px).collect();
                Some(LeftOut::DoesNotFit { median_px: median(&mut all_px) })
            } else if inliers.len() < need {
                Some(LeftOut::FewFit { inliers: inliers.len(), points, need })
            } else if bundle.leaves_pose_open(&state.camera, pose, &inliers) {
                Some(LeftOut::PoseOpen { inliers: inliers.len() })
            } else {
                None
            };
            match reason {
                Some(reason) => left_out.push((*place, reason)),
                None => good.push((*place, *pose, inliers)),
            }
        }
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
    let bundle = Bundle { loss: Loss::Squares, ..*bundle };
    Ok(Kept { bundle, places, views, left_out, state, scale, model_error_px })
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
    /// The camera as it is, without its covariance.
    pub const fn camera(&self) -> &Camera {
        &self.state.camera
    }

    /// How many views count.
    pub const fn view_count(&self) -> usize {
        self.views.len()
    }

    /// Why a view of so many points that has this position in the bundle's views, if it has one, does not count.
    fn reason(&self, place: Option<usize>, points: usize) -> LeftOut {
        let Some(place) = place else {
            return if points < MIN_POINTS {
                LeftOut::TooFewPoints { points, need: MIN_POINTS }
            } else {
                LeftOut::Repeated
            };
        };
        let told = self.left_out.iter().find(|(left, _)| *left == place);
        told.map_or(LeftOut::NoPose, |(_, reason)| *reason)
    }

    /// The camera with the evidence; `all` are the views that were given, `useful` those of them that the bundle has.
    pub fn calibration(&self, all: &[Vec<SeenPoint>], useful: &[usize]) -> Result<Calibration, CalibrateError> {
        let slices: Vec<&[SeenPoint]> = self.views.iter().map(Vec::as_slice).collect();
        let bundle = Bundle { views: &slices, prior: prior(&self.state.camera, self.scale), ..self.bundle };
        let freedom = degrees_of_freedom(&bundle).ok_or(CalibrateError::Open)?;
        // Less than the pictures told is no reason to be surer: what neighbouring points have in common, as what a lens hides between
        // its pixels, bends the camera and leaves little over.
        let scale = self.scale.max(1.0);
        let Shared { information, design_effect } =
            Shared::of(&bundle, &self.state, scale).ok_or(CalibrateError::Open)?;
        let straight = covariance_of(&information, &self.bundle.freedom).ok_or(CalibrateError::Open)?;
        let variance = scale * scale * design_effect;
        let covariance = straight + valley::widening(&bundle, &self.state, &straight) * variance;
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
                None => best_pose(&self.bundle, &camera, seen),
            };
            let seen: Vec<SeenPoint> = seen.iter().map(|seen| less_certain(seen, self.model_error_px)).collect();
            let counts = kept.map(|_| GATE * gate_scale(self.scale)).ok_or_else(|| self.reason(place, seen.len()));
            views.push(fitted(&bundle, &camera, pose, &seen, counts));
        }
        Ok(Calibration {
            camera,
            rms_px: (total / points as f64).sqrt(),
            pixel_sigma_px: (total / freedom).sqrt(),
            noise_ratio: (surprise / freedom).sqrt(),
            model_error_px: self.model_error_px,
            design_effect,
            scale: scale * design_effect.sqrt(),
            standard_deviations: (0..size).map(|i| covariance[(i, i)].max(0.0).sqrt()).collect(),
            views,
        })
    }
}
