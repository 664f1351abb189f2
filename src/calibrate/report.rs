//! How far to trust a calibration, and what would better it.

use std::fmt;

use super::SeenPoint;
use super::coverage::{Coverage, Stance, widest_turn_rad};
use super::estimate::{CalibrateOptions, Calibration, LeftOut};
use super::evidence::{Evidence, ray_sigmas_px};
use super::held_out::{Fit, Trials};
use super::next_view::{NextView, next_view};
use super::pattern_error::PatternError;
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
    /// What the same points of the board have in common in all views.
    pub pattern_error: Option<PatternError>,
    /// What is missing for a camera to trust; none if the set is good.
    pub weaknesses: Vec<Weakness>,
}

/// What a set of views lacks. The display tells the numbers and what to do.
#[derive(Clone, Debug, PartialEq)]
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
    /// The lens model does not fit, and so nothing is well known.
    Lens {
        /// The model that fits better.
        better: String,
        /// Its held-out error over that of the chosen model.
        ratio: f64,
        /// Standard deviation of the focal length as a share of itself.
        focal_ratio: f64,
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

/// Another lens model is what is missing where its held-out error is less than this share.
const FAR_BETTER: f64 = 0.5;

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
            Self::Lens { better, ratio, focal_ratio, need } => write!(
                f,
                "the lens model does not fit, which leaves the focal length known to {:.1} % only, {:.1} % is wanted: {better} predicts other views with {:.0} % of the error",
                100.0 * focal_ratio,
                100.0 * need,
                100.0 * ratio
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
    let trials = Trials::of(&evidence, options, found, watch);
    Report {
        weaknesses: weaknesses(found, evidence.views.len(), widest_turn_rad, coverage.share, &trials.fit),
        coverage,
        stances,
        widest_turn_rad,
        ray_sigmas_px: sigmas,
        trials,
        drop: views_to_drop(found),
        next_view: next_view(&evidence),
        pattern_error: PatternError::of(&evidence),
    }
}

impl Report {
    /// Whether another lens model is what is missing, rather than anything else that would make errors smaller.
    #[must_use]
    pub fn lacks_other_lens(&self) -> bool {
        matches!(&self.trials.fit, Fit::TooSmall { ratio, .. } | Fit::OtherKind { ratio, .. } if *ratio < FAR_BETTER)
    }
}

fn weaknesses(found: &Calibration, views: usize, widest_rad: f64, share: f64, fit: &Fit) -> Vec<Weakness> {
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
        let need = MAX_FOCAL_RATIO;
        match fit {
            // Its errors are what leaves the focal length open, and no further view mends them.
            Fit::TooSmall { better, ratio: error } | Fit::OtherKind { better, ratio: error } if *error < FAR_BETTER => {
                let better = better.clone();
                weaknesses.insert(0, Weakness::Lens { better, ratio: *error, focal_ratio: ratio, need });
            }
            _ => weaknesses.push(Weakness::FocalLength { ratio, need }),
        }
    }
    weaknesses
}

/// Views whose error stands out, and those that do not count for it.
fn views_to_drop(found: &Calibration) -> Vec<usize> {
    let mut errors: Vec<f64> = found.views.iter().filter(|view| view.counts()).map(|view| view.rms_px).collect();
    let limit = (DROP_RATIO * super::start::median(&mut errors)).max(LEAST_DROP_PX);
    let stands_out = |index: &usize| {
        let view = &found.views[*index];
        match view.left_out {
            None => view.rms_px > limit,
            Some(reason) => matches!(reason, LeftOut::DoesNotFit { .. } | LeftOut::FewFit { .. }),
        }
    };
    (0..found.views.len()).filter(stands_out).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;
    use crate::board::{AprilGrid, Pattern};
    use crate::calibrate::estimate::tests::{SIZE, chessboard, lenses, options, truth, views};
    use crate::calibrate::estimate::{CalibrateError, calibrate, calibrate_watched};
    use crate::camera::{Camera, Distortion};
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
    fn nothing_is_computed_that_is_not_wanted_any_more() {
        let (board, options) = (chessboard(), options(lenses()[1]));
        let seen = views(&truth(lenses()[1]), &board, 12, 0.1, &mut named("a cancelled calibration"));
        let found = calibrate(SIZE, &board, &seen, &options).expect("a camera");
        for patience in [0, 1, 20, 60] {
            let asked = std::cell::Cell::new(0);
            let is_wanted = || asked.replace(asked.get() + 1) < patience;
            let watch = Watch::new(&is_wanted, &|_| {});
            let refused = calibrate_watched(SIZE, &board, &seen, &options, &watch);
            // A fit of few steps may have come to its end.
            assert!(refused == Err(CalibrateError::Unwanted) || patience == 60 && refused.is_ok(), "{patience}");
            asked.set(0);
            let judged = report(&board, &seen, &options, &found, &watch);
            assert!(judged.trials.all.len() < 3, "{patience}: {:?}", judged.trials.all);
            // Each loop that is left asks once more.
            assert!(asked.get() < patience + 60, "{patience}: {}", asked.get());
        }
    }

    #[test]
    fn a_lens_of_another_kind_is_no_larger_one() {
        let fisheye = Distortion::Equidistant([0.0; 4]);
        // Not so wide that no polynomial comes near it.
        let camera = Camera::checked(SIZE, [400.0; 2], [320.0, 240.0], fisheye).expect("a camera");
        let seen = views(&camera, &chessboard(), 20, 0.01, &mut named("a fisheye"));
        let (_, report) = judged(&seen, &options(Distortion::PlumbBob([0.0; 5])));
        let fit = &report.trials.fit;
        assert!(
            matches!(fit, Fit::OtherKind { better, ratio } if better.starts_with("equi") && *ratio < 0.9),
            "{fit:?}"
        );
    }

    #[test]
    fn a_focal_length_that_a_wrong_lens_leaves_open_is_the_lens_fault() {
        let seen = views(&truth(lenses()[1]), &chessboard(), 12, 0.1, &mut named("a bent lens"));
        let (mut found, _) = judged(&seen, &options(lenses()[1]));
        found.standard_deviations[0] = 0.02 * found.camera.focal_lengths()[0];
        let better = || "plumb_bob k1".to_owned();
        let told = |fit: Fit| weaknesses(&found, 12, 1.0, 1.0, &fit);
        assert!(matches!(told(Fit::Right)[..], [Weakness::FocalLength { .. }]));
        assert!(matches!(told(Fit::TooSmall { better: better(), ratio: 0.9 })[..], [Weakness::FocalLength { .. }]));
        for fit in [Fit::TooSmall { better: better(), ratio: 0.1 }, Fit::OtherKind { better: better(), ratio: 0.1 }] {
            let told = told(fit);
            assert!(matches!(told[..], [Weakness::Lens { .. }]), "{told:?}");
            assert!(told[0].to_string().contains("plumb_bob k1 predicts other views with 10 %"), "{}", told[0]);
        }
    }

    #[test]
    fn a_repeated_view_is_not_said_to_stand_out() {
        let lens = lenses()[1];
        let mut seen = views(&truth(lens), &chessboard(), 10, 0.1, &mut named("a repeated view"));
        seen.push(seen[3].clone());
        let (found, report) = judged(&seen, &options(lens));
        assert_eq!((found.views[10].left_out, &report.drop[..]), (Some(LeftOut::Repeated), &[][..]));
    }

    #[test]
    fn what_is_wrong_with_the_description_is_the_same_in_all_views() {
        let with_gap = |gap_m| {
            let grid = AprilGrid { columns: 6, rows: 5, tag_m: 0.03, gap_m };
            Board::checked(Pattern::AprilGrid(grid)).expect("a board")
        };
        let (board, lens) = (with_gap(0.009), lenses()[1]);
        let seen = views(&truth(lens), &board, 12, 0.02, &mut named("a wrong gap"));
        for (gap_m, is_wrong) in [(0.009, false), (0.012, true)] {
            let described = with_gap(gap_m);
            let found = calibrate(SIZE, &described, &seen, &options(lens)).expect("a camera");
            let report = report(&described, &seen, &options(lens), &found, &Watch::nobody());
            let error = report.pattern_error.expect("points that all views show");
            assert_eq!(error.share > 0.5, is_wrong, "{gap_m}: {error:?}");
            assert_eq!(found.noise_ratio > 3.0, is_wrong, "{gap_m}: {}", found.noise_ratio);
        }
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
