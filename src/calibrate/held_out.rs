//! How well a camera predicts views that it does not rest on, and whether another lens model would do better.
//!
//! The views are dealt into a few parts; each part is predicted, up to the poses of its views, by a camera of the others
//! (cross-validation; Stone 1974). A model with too few terms predicts worse, and so does one with so many that they fit noise.

use super::SeenPoint;
use super::estimate::{CalibrateOptions, Calibration, calibrate_watched, camera_near, rms_of_view_alone};
use super::evidence::Evidence;
use super::freedom::Fixed;
use super::watch::Watch;
use crate::camera::{Camera, Distortion};
use crate::geometry::CameraFromBoard;

/// Parts into which the views are dealt.
const PARTS: usize = 5;

/// Share of a trial that the camera of all views takes.
const WHOLE_SHARE: f64 = 0.5;

/// Views that a camera must rest on.
const MIN_VIEWS: usize = 3;

/// A lens model that was tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The model and its free terms, as `plumb_bob k1 k2`.
    pub name: String,
    /// The model alone.
    lens: &'static str,
    /// Free terms of the lens.
    pub terms: usize,
    /// Root mean square error of held-out points, px; `None` where no camera could be had.
    pub held_out_rms_px: Option<f64>,
    /// Mean squared error of each view, px^2.
    squares: Vec<f64>,
}

/// What the trials say of the chosen model.
#[derive(Clone, Debug, PartialEq)]
pub enum Fit {
    /// None of the others is better, none of the smaller ones as good.
    Right,
    /// A larger one predicts better by more than chance.
    TooSmall {
        /// Its name.
        better: String,
        /// Its held-out error over that of the chosen model.
        ratio: f64,
    },
    /// One of another kind predicts better by more than chance.
    OtherKind {
        /// Its name.
        better: String,
        /// Its held-out error over that of the chosen model.
        ratio: f64,
    },
    /// A smaller one predicts as well.
    TooLarge {
        /// Its name.
        enough: String,
        /// Its held-out error over that of the chosen model.
        ratio: f64,
    },
    /// Too few views to tell.
    Unknown,
}

/// Held-out errors of the chosen model and of the usual others.
#[derive(Clone, Debug, PartialEq)]
pub struct Trials {
    /// The first is the chosen one.
    pub all: Vec<Trial>,
    /// What they say.
    pub fit: Fit,
}

/// A smaller model is as good if it predicts worse by less than this.
const AS_GOOD_RATIO: f64 = 1.005;

/// A model is far better that takes away more than this share of the squared error.
const FAR_SHARE: f64 = 0.75;

impl Trials {
    /// Tries them while they are wanted.
    pub(super) fn of(
        evidence: &Evidence<'_>,
        options: &CalibrateOptions,
        found: &Calibration,
        watch: &Watch<'_>,
    ) -> Self {
        let chosen = (options.lens, options.fixed);
        let usual = usual_models(&options.fixed).into_iter().filter(|model| !is_same(model, &chosen));
        let models: Vec<(Distortion, Fixed)> = std::iter::once(chosen).chain(usual).collect();
        let mut all = Vec::with_capacity(models.len());
        for (index, (lens, fixed)) in models.iter().enumerate() {
            if !watch.is_wanted() {
                break;
            }
            let known = (index == 0).then(|| Whole::of(evidence, found));
            let share = |index: usize| index as f64 / models.len() as f64;
            let watch = watch.part(share(index), share(index + 1));
            all.push(trial(evidence, &CalibrateOptions { lens: *lens, fixed: *fixed, ..*options }, known, &watch));
            watch.done(1.0);
        }
        let fit = judge(&all);
        Self { all, fit }
    }
}

/// The models that people use, from small to large, with whatever else is held.
fn usual_models(held: &Fixed) -> Vec<(Distortion, Fixed)> {
    let plumb_bob = Distortion::PlumbBob([0.0; 5]);
    let fixed = |coefficients: [bool; 8]| Fixed { coefficients, ..*held };
    vec![
        (Distortion::None, fixed([false; 8])),
        (plumb_bob, fixed([false, true, true, true, true, false, false, false])),
        (plumb_bob, fixed([false, false, true, true, true, false, false, false])),
        (plumb_bob, fixed([false, false, false, false, true, false, false, false])),
        (plumb_bob, fixed([false; 8])),
        (Distortion::RationalPolynomial([0.0; 8]), fixed([false; 8])),
        (Distortion::Equidistant([0.0; 4]), fixed([false; 8])),
    ]
}

fn is_same((lens, fixed): &(Distortion, Fixed), (other, other_fixed): &(Distortion, Fixed)) -> bool {
    let terms = lens.coefficients().len();
    lens.name() == other.name() && fixed.coefficients[..terms] == other_fixed.coefficients[..terms]
}

/// As `plumb_bob k1 k2`.
fn name_of(lens: &Distortion, fixed: &Fixed) -> (String, usize) {
    let free: Vec<&str> = lens
        .coefficient_names()
        .iter()
        .zip(fixed.coefficients)
        .filter(|(_, held)| !held)
        .map(|(name, _)| *name)
        .collect();
    let name = std::iter::once(lens.name()).chain(free.iter().copied()).collect::<Vec<_>>().join(" ");
    (name, free.len())
}

fn trial(evidence: &Evidence<'_>, options: &CalibrateOptions, known: Option<Whole>, watch: &Watch<'_>) -> Trial {
    let (name, terms) = name_of(&options.lens, &options.fixed);
    let squares = held_out_squares(evidence, options, known, watch).unwrap_or_default();
    let points = evidence.views.iter().map(Vec::len);
    let (sum, count) = squares
        .iter()
        .zip(points)
        .fold((0.0, 0.0), |(sum, count), (square, points)| (sum + square * points as f64, count + points as f64));
    let rms = (sum / count).sqrt();
    Trial { name, lens: options.lens.name(), terms, held_out_rms_px: rms.is_finite().then_some(rms), squares }
}

/// The camera of all views together, and their poses: where the search of each part begins, not what it ends with.
struct Whole {
    camera: Camera,
    poses: Vec<CameraFromBoard>,
}

impl Whole {
    /// That is known.
    fn of(evidence: &Evidence<'_>, found: &Calibration) -> Self {
        Self { camera: found.camera, poses: evidence.poses.clone() }
    }

    /// That of another lens; `None` where there is none.
    fn sought(evidence: &Evidence<'_>, options: &CalibrateOptions, watch: &Watch<'_>) -> Option<Self> {
        let size = [evidence.camera.width(), evidence.camera.height()];
        let found = calibrate_watched(size, evidence.board, &evidence.views, options, watch).ok()?;
        let poses = found.views.iter().map(|view| view.camera_from_board).collect::<Option<_>>()?;
        Some(Self { camera: found.camera, poses })
    }
}

/// Mean squared error of each view under a camera that rests on others.
fn held_out_squares(
    evidence: &Evidence<'_>,
    options: &CalibrateOptions,
    known: Option<Whole>,
    watch: &Watch<'_>,
) -> Option<Vec<f64>> {
    let count = evidence.views.len();
    let parts = PARTS.min(count);
    if count < MIN_VIEWS + count.div_ceil(parts.max(1)) {
        return None;
    }
    let from = if known.is_some() { 0.0 } else { WHOLE_SHARE };
    let whole = match known {
        Some(whole) => whole,
        None => Whole::sought(evidence, options, &watch.part(0.0, WHOLE_SHARE))?,
    };
    let mut squares = vec![0.0; count];
    for part in 0..parts {
        let others = || (0..count).filter(|index| index % parts != part);
        let views: Vec<&[SeenPoint]> = others().map(|index| evidence.views[index].as_slice()).collect();
        let poses = others().map(|index| whole.poses[index]).collect();
        let camera = camera_near(evidence.board, &views, options, &whole.camera, poses, &watch.silent())?;
        for index in (part..count).step_by(parts) {
            squares[index] = rms_of_view_alone(evidence.board, &camera, &evidence.views[index])?.powi(2);
        }
        watch.done(from + (1.0 - from) * (part + 1) as f64 / parts as f64);
    }
    Some(squares)
}

fn judge(all: &[Trial]) -> Fit {
    let Some((chosen, others)) = all.split_first() else { return Fit::Unknown };
    let Some(chosen_rms) = chosen.held_out_rms_px else { return Fit::Unknown };
    let ratio = |other: &Trial| other.held_out_rms_px.map(|rms| rms / chosen_rms);
    let better = others
        .iter()
        .filter(|other| is_better(&other.squares, &chosen.squares))
        .filter_map(|other| Some((other, ratio(other)?)))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    match better {
        Some((other, ratio)) if is_other_kind(other.lens, chosen.lens) => {
            return Fit::OtherKind { better: other.name.clone(), ratio };
        }
        Some((other, ratio)) if other.terms >= chosen.terms => {
            return Fit::TooSmall { better: other.name.clone(), ratio };
        }
        // It has less of the same, which is told as such.
        Some(_) | None => {}
    }
    let enough = others
        .iter()
        .filter(|other| other.terms < chosen.terms)
        .filter_map(|other| Some((other, ratio(other)?)))
        .filter(|(_, ratio)| *ratio < AS_GOOD_RATIO)
        .min_by_key(|(other, _)| other.terms);
    match enough {
        Some((enough, ratio)) => Fit::TooLarge { enough: enough.name.clone(), ratio },
        None => Fit::Right,
    }
}

/// Whether neither of these models is the other with more terms: a fisheye lens is no polynomial of the ideal image.
fn is_other_kind(one: &str, other: &str) -> bool {
    let fisheye = Distortion::Equidistant([0.0; 4]).name();
    let none = Distortion::None.name();
    one != none && other != none && (one == fisheye) != (other == fisheye)
}

/// Whether the squared errors of `one` are smaller, view by view, by more than two standard deviations of their mean difference, and by
/// one in a hundred.
fn is_better(one: &[f64], other: &[f64]) -> bool {
    if one.len() != other.len() || one.len() < 2 {
        return false;
    }
    let count = one.len() as f64;
    let differences: Vec<f64> = one.iter().zip(other).map(|(one, other)| other - one).collect();
    let (mean, before) = (differences.iter().sum::<f64>() / count, other.iter().sum::<f64>() / count);
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let wins = differences.iter().filter(|difference| **difference > 0.0).count() as f64;
    // Where a model fails in a part of the picture, few views have nearly all of the error: there signs tell more than means.
    let is_far_better = mean > FAR_SHARE * before && 2.0 * wins - count > 2.0 * count.sqrt();
    is_far_better || mean > 2.0 * (variance / count).sqrt() && mean > 0.01 * before
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_that_fails_in_few_views_is_worse_all_the_same() {
        let (good, mut bad) = (vec![1e-4; 12], vec![2e-4; 12]);
        (bad[2], bad[7]) = (5.0, 0.3);
        assert!(is_better(&good, &bad) && !is_better(&bad, &good));
        // Few views that differ by chance say nothing.
        let mut one = good.clone();
        one[3] = 5.0;
        assert!(!is_better(&good, &one));
    }
}
