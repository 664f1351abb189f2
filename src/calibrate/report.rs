//! How far to trust a calibration, and what would better it.

use std::fmt;

use super::SeenPoint;
use super::coverage::{Coverage, Stance, widest_turn_rad};
use super::estimate::{CalibrateOptions, Calibration};
use super::evidence::{Evidence, ray_sigmas_px};
use super::held_out::Trials;
use super::next_view::{NextView, next_view};
use super::watch::Watch;
use crate::board::Board;

/// The judgement of a calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Where in the picture points were seen.
    pub coverage: Coverage,
    /// How the board stood in each view that was given; `None` without a pose.
    pub stances: Vec<Option<Stance>>,
    /// The largest angle between the board's normals in two views.
    pub widest_turn_rad: f64,
    /// Standard deviation per axis, px, of the pixels of rays through the cells of [`CELLS`](super::coverage::CELLS), row by row.
    pub ray_sigmas_px: Vec<Option<f64>>,
    /// Held-out errors of this and of other lens models.
    pub trials: Trials,
    /// Views that are better left out: their error stands out.
    pub drop: Vec<usize>,
    /// The view that would help most.
    pub next_view: Option<NextView>,
    /// What is missing for a camera to trust; none if the set is good.
    pub weaknesses: Vec<Weakness>,
}

/// What a set of views lacks. The display tells the numbers and what to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Weakness {
    /// Too few views.
    FewViews {
        /// How many count.
        found: usize,
        /// How many are wanted.
        need: usize,
    },
    /// The board is turned alike in all views: focal length and distance stand for each other.
    AllAlike {
        /// The largest angle between its normals in two views.
        widest_rad: f64,
        /// What is wanted.
        need_rad: f64,
    },
    /// Points in a part of the picture only: what the lens does elsewhere is a guess.
    LittleCoverage {
        /// Share of the cells with a point.
        share: f64,
        /// What is wanted.
        need: f64,
    },
    /// The focal length is poorly known.
    FocalLength {
        /// Its standard deviation as a share of itself.
        ratio: f64,
        /// What is wanted.
        need: f64,
    },
}

/// Fewest views: two fix a camera, the third says whether they agree.
const MIN_VIEWS: usize = 3;

/// Least angle between two views.
const MIN_TURN_RAD: f64 = 0.17;

/// Least share of the picture.
const MIN_COVERAGE: f64 = 0.3;

/// Largest deviation of the focal length.
const MAX_FOCAL_RATIO: f64 = 0.01;

/// A view's error stands out from this many times the median on.
const DROP_RATIO: f64 = 2.0;

/// But nothing below this does, px.
const LEAST_DROP_PX: f64 = 0.05;

impl fmt::Display for Weakness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FewViews { found, need } => {
                write!(f, "{found} views count: take at least {need}, better 10 to 20")
            }
            Self::AllAlike { widest_rad, need_rad } => write!(
                f,
                "the board is turned alike in all views, by {:.0} degrees at most: tilt it by 30 to 45 degrees to each side, at least {:.0}",
                widest_rad.to_degrees(),
                need_rad.to_degrees()
            ),
            Self::LittleCoverage { share, need } => write!(
                f,
                "points lie in {:.0} % of the picture: bring the board to its sides and corners until at least {:.0} % is covered",
                100.0 * share,
                100.0 * need
            ),
            Self::FocalLength { ratio, need } => write!(
                f,
                "the focal length is known to {:.1} % only, {:.1} % is wanted: take tilted views, near by",
                100.0 * ratio,
                100.0 * need
            ),
        }
    }
}

/// The judgement of what [`calibrate`](super::estimate::calibrate) found of these views.
#[must_use]
pub fn report(
    board: &Board,
    views: &[Vec<SeenPoint>],
    options: &CalibrateOptions,
    found: &Calibration,
    watch: &Watch<'_>,
) -> Report {
    let evidence = Evidence::of(board, views, options, found);
    let [least, greatest] = board.sheet();
    let middle = (0.5 * (least + greatest)).push(0.0);
    let stances: Vec<Option<Stance>> =
        found.views.iter().map(|view| view.camera_from_board.map(|pose| Stance::of(&pose, &middle))).collect();
    let counted: Vec<Stance> = evidence.poses.iter().map(|pose| Stance::of(pose, &middle)).collect();
    let coverage = Coverage::of(&evidence);
    let widest_turn_rad = widest_turn_rad(&counted);
    let [columns, rows] = super::coverage::CELLS;
    #[expect(clippy::cast_possible_truncation, reason = "a handful of cells")]
    let cells = [columns as u32, rows as u32];
    let sigmas = found
        .camera
        .parameter_covariance()
        .map(|covariance| ray_sigmas_px(&found.camera, covariance.matrix(), cells))
        .unwrap_or_default();
    Report {
        weaknesses: weaknesses(found, evidence.views.len(), widest_turn_rad, coverage.share),
        coverage,
        stances,
        widest_turn_rad,
        ray_sigmas_px: sigmas,
        trials: Trials::of(&evidence, options, found, watch),
        drop: views_to_drop(found),
        next_view: next_view(&evidence),
    }
}

fn weaknesses(found: &Calibration, views: usize, widest_rad: f64, share: f64) -> Vec<Weakness> {
    let mut weaknesses = Vec::new();
    if views < MIN_VIEWS {
        weaknesses.push(Weakness::FewViews { found: views, need: MIN_VIEWS });
    }
    if !(widest_rad >= MIN_TURN_RAD) {
        weaknesses.push(Weakness::AllAlike { widest_rad, need_rad: MIN_TURN_RAD });
    }
    if share < MIN_COVERAGE {
        weaknesses.push(Weakness::LittleCoverage { share, need: MIN_COVERAGE });
    }
    let focal = found.camera.focal_lengths();
    let ratio = (0..2).map(|axis| found.standard_deviations[axis] / focal[axis]).fold(0.0, f64::max);
    if !(ratio <= MAX_FOCAL_RATIO) {
        weaknesses.push(Weakness::FocalLength { ratio, need: MAX_FOCAL_RATIO });
    }
    weaknesses
}

/// Views whose error stands out, and those that do not count at all.
fn views_to_drop(found: &Calibration) -> Vec<usize> {
    let mut errors: Vec<f64> = found.views.iter().filter(|view| view.counts()).map(|view| view.rms_px).collect();
    let limit = (DROP_RATIO * super::start::median(&mut errors)).max(LEAST_DROP_PX);
    let stands_out = |index: &usize| {
        let view = &found.views[*index];
        view.camera_from_board.is_some() && (!view.counts() || view.rms_px > limit)
    };
    (0..found.views.len()).filter(stands_out).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;
    use crate::calibrate::estimate::calibrate;
    use crate::calibrate::estimate::tests::{SIZE, chessboard, lenses, options, truth, views};
    use crate::calibrate::held_out::Fit;
    use crate::camera::Distortion;
    use crate::random::named;

    fn judged(views: &[Vec<SeenPoint>], options: &CalibrateOptions) -> (Calibration, Report) {
        let board = chessboard();
        let found = calibrate(SIZE, &board, views, options).expect("a camera");
        let shares = std::cell::RefCell::new(Vec::new());
        let tell = |share| shares.borrow_mut().push(share);
        let report = report(&board, views, options, &found, &Watch::new(&|| true, &tell));
        let shares = shares.into_inner();
        assert!(shares.is_sorted() && shares.last() == Some(&1.0), "{shares:?}");
        (found, report)
    }

    #[test]
    fn a_good_set_is_called_good_and_its_model_right() {
        let lens = lenses()[1];
        let seen = views(&truth(lens), &chessboard(), 14, 0.15, &mut named("a good set"));
        let (found, report) = judged(&seen, &options(lens));
        assert_eq!(report.weaknesses, []);
        assert!(report.drop.is_empty(), "{:?}", report.drop);
        assert!(report.coverage.share > 0.5, "{}", report.coverage.share);
        let held_out = report.trials.all[0].held_out_rms_px.expect("enough views");
        // Held-out points are off by their own noise and by what six numbers of a pose do not take up.
        assert!((held_out / found.rms_px - 1.0).abs() < 0.2, "{held_out} {}", found.rms_px);
        assert!(!matches!(report.trials.fit, Fit::TooSmall { .. } | Fit::Unknown), "{:?}", report.trials.fit);
        let next = report.next_view.expect("a view");
        assert!(next.ray_sigma_px[1] < next.ray_sigma_px[0]);
        assert!(report.ray_sigmas_px.iter().flatten().all(|sigma| *sigma < 3.0), "{:?}", report.ray_sigmas_px);
    }

    #[test]
    fn too_small_and_too_large_a_model_are_told() {
        let bent = views(&truth(lenses()[1]), &chessboard(), 12, 0.1, &mut named("a bent lens"));
        let (_, report) = judged(&bent, &options(Distortion::None));
        assert!(matches!(report.trials.fit, Fit::TooSmall { ratio, .. } if ratio < 0.3), "{:?}", report.trials.fit);
        let straight = views(&truth(Distortion::None), &chessboard(), 12, 0.1, &mut named("a straight lens"));
        let (_, report) = judged(&straight, &options(lenses()[1]));
        assert!(
            matches!(&report.trials.fit, Fit::TooLarge { enough, .. } if enough == "none"),
            "{:?}",
            report.trials.fit
        );
    }

    #[test]
    fn weak_sets_are_told_what_they_lack() {
        let camera = truth(Distortion::None);
        let seen = views(&camera, &chessboard(), 1, 0.1, &mut named("weak sets"));
        // One view four times, moved a little in the picture.
        let alike: Vec<Vec<SeenPoint>> = (0..4)
            .map(|k| {
                let moved = |s: &SeenPoint| SeenPoint { pixel: s.pixel + Vector2::new(2.0 * f64::from(k), 0.0), ..*s };
                seen[0].iter().map(moved).collect()
            })
            .collect();
        let (_, report) = judged(&alike, &options(Distortion::None));
        let lacks = |report: &Report, what: fn(&Weakness) -> bool| report.weaknesses.iter().any(what);
        assert!(lacks(&report, |w| matches!(w, Weakness::AllAlike { .. })), "{:?}", report.weaknesses);
        // The upper left corner of the picture only.
        let corner: Vec<Vec<SeenPoint>> = views(&camera, &chessboard(), 30, 0.1, &mut named("one corner"))
            .into_iter()
            .map(|view| view.into_iter().filter(|s| s.pixel.x < 240.0 && s.pixel.y < 200.0).collect())
            .collect();
        let (_, report) = judged(&corner, &options(Distortion::None));
        assert!(lacks(&report, |w| matches!(w, Weakness::LittleCoverage { .. })), "{:?}", report.weaknesses);
        for weakness in &report.weaknesses {
            assert!(weakness.to_string().len() > 30, "{weakness}");
        }
    }
}
