//! What a constellation is good for before anybody glues its markers: how well its pose can be known over range and aspect,
//! how often the wrong one of two poses wins, to what range its markers can be told apart, what is wrong with it, and which
//! marker to move.
//!
//! Standard deviations are the Cramer-Rao bound; rates are counted on simulated noise through the very functions that answer
//! requests. The noise is the same for each cell and each variant of the target, so the answer is the same every time, and
//! differences are not chance.

mod advice;
mod budget;
mod cell;
mod congruence;
mod draws;
mod score;
mod sight;
mod stage;
mod warning;

use crate::camera::Camera;
use crate::detect::ColorOptions;
use crate::geometry::{CameraFromTarget, PoseCovariance};
use crate::identify::IdentifyOptions;
use crate::target::Target;
use draws::Draw;
use nalgebra::Vector3;
use sight::Sight;
use stage::Stage;

pub use advice::{Advice, Figures};
pub use cell::Cell;
pub use congruence::{Congruence, congruences};
pub use warning::Warning;

/// What is asked.
#[derive(Clone, Debug, PartialEq)]
pub struct AssessOptions {
    /// Standard deviation of a centroid per axis, px, with all that camera and target model add.
    pub pixel_sigma: f64,
    /// Distances from the camera to the centre of the markers, positive; if empty, from where the target just fits into the
    /// picture to where it is 8 px wide.
    pub ranges_m: Vec<f64>,
    /// Angles between the line of sight and the front of the target, from 0 to pi.
    pub aspects_rad: Vec<f64>,
    /// Whether markers are to stay in their plane.
    pub keep_flat: bool,
    /// Other targets that fly in the same sky.
    pub others: Vec<Target>,
    /// How markers are told apart.
    pub identify: IdentifyOptions,
}

impl Default for AssessOptions {
    fn default() -> Self {
        Self {
            pixel_sigma: 0.3,
            ranges_m: Vec::new(),
            aspects_rad: [0.0_f64, 15.0, 30.0, 45.0, 60.0, 75.0].map(f64::to_radians).to_vec(),
            keep_flat: false,
            others: Vec::new(),
            // What is stated for the pixels is all.
            identify: IdentifyOptions { model_sigma_px: 0.0, ..IdentifyOptions::default() },
        }
    }
}

/// What a constellation is good for.
#[derive(Clone, Debug, PartialEq)]
pub struct Assessment {
    /// Unit vector in the target's space: the direction from which it is seen face on.
    pub front: Vector3<f64>,
    /// The ranges, rising.
    pub ranges_m: Vec<f64>,
    /// The aspects, rising.
    pub aspects_rad: Vec<f64>,
    /// For each aspect its cells by rising range.
    pub cells: Vec<Vec<Cell>>,
    /// Simulated noises for each cell.
    pub draws: usize,
    /// Of these, noises in which markers are told apart, in the cells that have such rates; 0 if there are too many markers.
    pub identified_draws: usize,
    /// For each aspect how far the target serves.
    pub reach: Vec<Reach>,
    /// How far it serves at the mean of all aspects.
    pub mean_reach: Reach,
    /// What is wrong with it, the worst first.
    pub warnings: Vec<Warning>,
    /// The range at which moves of markers were compared.
    pub advice_range_m: f64,
    /// The figures there as the target is.
    pub figures: Figures,
    /// Moves that better it, the best first.
    pub advice: Vec<Advice>,
}

/// To what range a target serves for what; `None` where it does at no range that was assessed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reach {
    /// Even the smallest marker is large enough for the colour detector; `None` also where no radius is known. Bright beacons
    /// are found farther away.
    pub detected_m: Option<f64>,
    /// Its markers are told apart in at least nine draws of ten.
    pub identified_m: Option<f64>,
    /// Its pose, markers being known, is the wrong one of two in at most one draw of twenty.
    pub unambiguous_m: Option<f64>,
    /// The error of its attitude is at most five degrees, root mean square, the right one of two poses being taken.
    pub attitude_m: Option<f64>,
}

/// Share of draws from which on a target counts as identified.
pub const IDENTIFIED_FROM: f64 = 0.9;

/// Share of draws up to which a pose counts as unambiguous.
pub const AMBIGUOUS_FROM: f64 = 0.05;

/// Up to here an attitude is of use, rad: five degrees.
const USEFUL_ATTITUDE_RAD: f64 = 0.087_266_462_599_716_47;

/// Most noises for each cell of a single row.
const MOST_ROW_DRAWS: usize = 24;

/// Ranges of the default grid.
const RANGES: usize = 10;

/// Says what `target` is good for before `camera`.
#[must_use]
pub fn assess(camera: &Camera, target: &Target, options: &AssessOptions) -> Assessment {
    let stage = Stage::of(camera, target);
    let ranges_m =
        rising(if options.ranges_m.is_empty() { default_ranges_m(&stage) } else { options.ranges_m.clone() });
    let aspects_rad = rising(options.aspects_rad.clone());
    let budget = budget::grid(target, advice::stays_flat(target, options), ranges_m.len(), aspects_rad.len());
    let draws = Draw::first(budget.draws, target.markers().len());
    let measured = |range: usize, aspect: usize| {
        let is_told_apart = budget.is_told_apart(ranges_m.len() - 1 - range, aspect);
        let identified_draws = if is_told_apart { budget.identified_draws } else { 0 };
        cell::measure(&stage, ranges_m[range], aspects_rad[aspect], &draws, identified_draws, options)
    };
    let cells: Vec<Vec<Cell>> = (0..aspects_rad.len())
        .map(|aspect| (0..ranges_m.len()).map(|range| measured(range, aspect)).collect())
        .collect();
    let at_range = |index: usize| -> Vec<Cell> { cells.iter().map(|row| row[index]).collect() };
    let means: Vec<Figures> = (0..ranges_m.len()).map(|index| Figures::of(&at_range(index))).collect();
    let mean_areas: Vec<Option<f64>> = (0..ranges_m.len()).map(|index| mean_area_px(&at_range(index))).collect();
    let mean_reach = reach(&ranges_m, &means, &mean_areas);
    let compared = compared_at(&ranges_m, &mean_reach);
    let advice_range_m = ranges_m.get(compared).copied().unwrap_or_default();
    let (figures, advice) = advice::advice(&stage, advice_range_m, &aspects_rad, options);
    Assessment {
        front: stage.front,
        reach: cells.iter().map(|row| reach_of(&ranges_m, row)).collect(),
        mean_reach,
        warnings: warning::warnings(&stage, &options.others, &ranges_m, options.pixel_sigma, &options.identify),
        advice,
        advice_range_m,
        figures,
        draws: budget.draws,
        identified_draws: budget.identified_draws,
        ranges_m,
        aspects_rad,
        cells,
    }
}

/// What is to be expected at these ranges and one aspect: the cells of an assessment without its warnings and advice.
#[must_use]
pub fn cells_at(
    camera: &Camera,
    target: &Target,
    ranges_m: &[f64],
    aspect_rad: f64,
    options: &AssessOptions,
) -> Vec<Cell> {
    let stage = Stage::of(camera, target);
    let budget = budget::grid(target, advice::stays_flat(target, options), ranges_m.len(), 1);
    let draws = Draw::first(budget.draws.min(MOST_ROW_DRAWS), target.markers().len());
    let measured = |(index, range_m): (usize, &f64)| {
        let is_told_apart = budget.is_told_apart(ranges_m.len() - 1 - index, 0);
        let identified_draws = if is_told_apart { budget.identified_draws.min(draws.len()) } else { 0 };
        cell::measure(&stage, *range_m, aspect_rad, &draws, identified_draws, options)
    };
    ranges_m.iter().enumerate().map(measured).collect()
}

/// A pose of the target in the middle of the picture, its front turned away by `aspect_rad`, and the least covariance that it can have
/// (Cramer-Rao). `None` where too few markers are seen to fix it.
#[must_use]
pub fn pose_at(
    camera: &Camera,
    target: &Target,
    range_m: f64,
    aspect_rad: f64,
    options: &AssessOptions,
) -> Option<(CameraFromTarget, PoseCovariance)> {
    let stage = Stage::of(camera, target);
    let pose = stage.pose(range_m, aspect_rad, &Draw::numbered(0, target.markers().len()));
    let covariance = Sight::at(&stage, pose, options.identify.max_tilt_rad).covariance(options.pixel_sigma)?;
    Some((pose, covariance))
}

/// From where a target just fits into the picture to where it is 8 px wide, m.
#[must_use]
pub fn range_limits_m(camera: &Camera, target: &Target) -> [f64; 2] {
    Stage::of(camera, target).range_limits_m()
}

fn rising(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// Equal ratios from where the target fits to where it is too small.
fn default_ranges_m(stage: &Stage<'_>) -> Vec<f64> {
    let [nearest, farthest] = stage.range_limits_m();
    (0..RANGES).map(|index| nearest * (farthest / nearest).powf(index as f64 / (RANGES - 1) as f64)).collect()
}

/// The last range at which the mean target is identified: a little further is what a better constellation would gain.
fn compared_at(ranges_m: &[f64], mean_reach: &Reach) -> usize {
    let identified = mean_reach.identified_m.and_then(|reach_m| ranges_m.iter().rposition(|range| *range <= reach_m));
    identified.unwrap_or(ranges_m.len() / 2)
}

/// How far a target serves at the aspect of these cells.
fn reach_of(ranges_m: &[f64], row: &[Cell]) -> Reach {
    let figures: Vec<Figures> = row.iter().map(|cell| Figures::of(&[*cell])).collect();
    let areas: Vec<Option<f64>> = row.iter().map(|cell| cell.smallest_area_px).collect();
    reach(ranges_m, &figures, &areas)
}

/// How far figures and smallest areas of markers at rising ranges serve.
fn reach(ranges_m: &[f64], figures: &[Figures], areas_px: &[Option<f64>]) -> Reach {
    let margins = |margin: &dyn Fn(&Figures) -> Option<f64>| {
        furthest(&ranges_m.iter().zip(figures).filter_map(|(range, f)| Some((*range, margin(f)?))).collect::<Vec<_>>())
    };
    // An area falls with the square of the range, so its logarithm evenly.
    let needed_px = ColorOptions::default().blobs.min_area_px;
    let area_margin = |(range, area): (&f64, &Option<f64>)| Some((*range, ((*area)? / needed_px).ln()));
    Reach {
        detected_m: furthest(&ranges_m.iter().zip(areas_px).filter_map(area_margin).collect::<Vec<_>>()),
        identified_m: margins(&|figures| Some(figures.identified_rate? - IDENTIFIED_FROM)),
        unambiguous_m: margins(&|figures| Some(AMBIGUOUS_FROM - figures.flip_rate)),
        attitude_m: margins(&|figures| Some(USEFUL_ATTITUDE_RAD - figures.attitude_error_rad.unwrap_or(f64::MAX))),
    }
}

/// The mean of the areas of one range; `None` where none is known.
fn mean_area_px(cells: &[Cell]) -> Option<f64> {
    let areas: Vec<f64> = cells.iter().filter_map(|cell| cell.smallest_area_px).collect();
    (!areas.is_empty()).then(|| areas.iter().sum::<f64>() / areas.len() as f64)
}

/// Of rising ranges with their margins: from the first with a margin that is not negative on, how far it stays so; between two
/// ranges the margin is taken to change evenly with the logarithm of the range.
fn furthest(margins: &[(f64, f64)]) -> Option<f64> {
    // A rate of 0.9 out of counted draws is 0.9.
    let holds = |(_, margin): &(f64, f64)| *margin >= -1e-9;
    let first = margins.iter().position(holds)?;
    let beyond = margins[first..].iter().position(|margin| !holds(margin)).map(|count| first + count);
    let Some(beyond) = beyond else { return margins.last().map(|(range_m, _)| *range_m) };
    let [(near_m, near), (far_m, far)] = [margins[beyond - 1], margins[beyond]];
    let share = (near / (near - far)).clamp(0.0, 1.0);
    Some(near_m * (far_m / near_m).powf(share))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::scene::models::{demo_camera, wing_six};
    use crate::target::Marker;

    /// Markers at these places, which are seen from everywhere.
    pub(crate) fn target(places: &[[f64; 3]]) -> Target {
        let marker = |(index, position): (usize, &[f64; 3])| Marker {
            id: index.to_string(),
            position: (*position).into(),
            radius_m: None,
            normal: None,
        };
        Target::checked("t", places.iter().enumerate().map(marker).collect()).expect("a good target")
    }

    /// In the plane z = 0, facing -z or any way.
    pub(crate) fn flat_target(places: &[[f64; 2]], one_sided: bool) -> Target {
        let flat: Vec<[f64; 3]> = places.iter().map(|[x, y]| [*x, *y, 0.0]).collect();
        let normal = one_sided.then(|| -Vector3::z());
        let markers = target(&flat).markers().iter().map(|marker| Marker { normal, ..marker.clone() }).collect();
        Target::checked("t", markers).expect("a good target")
    }

    pub(crate) fn kinds(warnings: &[Warning]) -> Vec<&'static str> {
        warnings.iter().map(Warning::kind).collect()
    }

    fn raised(target: &Target, marker: usize, by_m: f64) -> Target {
        let mut markers = target.markers().to_vec();
        markers[marker].position.coords.z -= by_m;
        Target::checked(target.name(), markers).expect("a good target")
    }

    /// Over draws that no assessment uses.
    fn fresh(target: &Target, range_m: f64, aspects_rad: &[f64]) -> Figures {
        let camera = demo_camera();
        let stage = Stage::of(&camera, target).facing(-Vector3::z());
        let draws: Vec<Draw> = (1000..1064).map(|index| Draw::numbered(index, target.markers().len())).collect();
        let options = AssessOptions::default();
        let cells: Vec<Cell> = aspects_rad
            .iter()
            .map(|aspect| cell::measure(&stage, range_m, *aspect, &draws, draws.len(), &options))
            .collect();
        Figures::of(&cells)
    }

    #[test]
    fn the_wing_is_seen_near_and_lost_far_away() {
        let found = assess(&demo_camera(), &wing_six(), &AssessOptions::default());
        assert!((found.front + Vector3::z()).norm() < 1e-12, "its markers face -z");
        assert_eq!((found.cells.len(), found.cells[0].len()), (6, RANGES));
        // Discs of 30 mm before a focal length of 1000 px cover 4 px at 1000 x 0.03 x sqrt(pi / 4) m.
        let detected_m = found.reach[0].detected_m.expect("its radii are known");
        assert!((detected_m / 26.6 - 1.0).abs() < 0.01, "{detected_m}");
        for row in &found.cells[..5] {
            let (near, far) = (&row[1], &row[RANGES - 1]);
            assert!(near.flip_rate < far.flip_rate, "{near:?} {far:?}");
            for pair in row.windows(2) {
                assert!(pair[0].range_sigma_m < pair[1].range_sigma_m, "{pair:?}");
            }
            for cell in row {
                let rates = [cell.identified_rate, cell.unsure_rate, cell.refused_rate, cell.mistaken_rate];
                assert!((rates.iter().flatten().sum::<f64>() - 1.0).abs() < 1e-9, "{cell:?}");
            }
        }
        assert_eq!(kinds(&found.warnings), ["flat"]);
    }

    #[test]
    fn the_same_question_has_the_same_answer() {
        let options = AssessOptions { ranges_m: vec![3.0, 12.0], ..AssessOptions::default() };
        let answer = || assess(&demo_camera(), &wing_six(), &options);
        assert_eq!(answer(), answer());
    }

    #[test]
    fn flips_become_fewer_when_a_marker_leaves_the_plane() {
        let aspects = [0.3, 0.6];
        let rate = |by_m: f64| fresh(&raised(&wing_six(), 4, by_m), 15.0, &aspects).flip_rate;
        let rates = [0.0, 0.05, 0.2].map(rate);
        assert!(rates[0] > 0.1 && rates[1] < rates[0] && rates[2] < 0.3 * rates[0], "{rates:?}");
    }

    #[test]
    fn advice_holds_on_noise_that_it_has_not_seen() {
        let found = assess(&demo_camera(), &wing_six(), &AssessOptions::default());
        let best = found.advice.first().expect("a flat target can be bettered");
        let mut markers = wing_six().markers().to_vec();
        markers[best.marker].position = best.to;
        let moved = Target::checked("moved", markers).expect("a good target");
        let before = fresh(&wing_six(), found.advice_range_m, &found.aspects_rad);
        let after = fresh(&moved, found.advice_range_m, &found.aspects_rad);
        assert!(after.flip_rate < before.flip_rate, "{before:?} {after:?}");
        assert!(after.identified_rate > before.identified_rate.map(|rate| rate - 0.05), "{before:?} {after:?}");
    }

    #[test]
    fn advice_keeps_a_flat_target_flat_where_that_is_asked_for() {
        let places = [[0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.3, -0.3], [0.0, 0.0]];
        let options = AssessOptions { keep_flat: true, ranges_m: vec![4.0], ..AssessOptions::default() };
        let found = assess(&demo_camera(), &flat_target(&places, true), &options);
        assert_eq!(found.figures.identified_rate, Some(0.0), "the turns of a square cannot be told apart");
        assert!(!found.advice.is_empty());
        for advice in &found.advice {
            assert!(advice.to.coords.z.abs() < 1e-12, "{advice:?}");
            assert!(advice.after.identified_rate > Some(0.5), "{advice:?}");
        }
    }

    #[test]
    fn a_reach_is_where_the_margin_ends() {
        assert_eq!(furthest(&[(1.0, 0.1), (4.0, 0.1), (16.0, 0.0)]), Some(16.0));
        assert_eq!(furthest(&[(1.0, 0.1), (4.0, 0.1), (16.0, -0.1)]), Some(8.0));
        assert_eq!(furthest(&[(1.0, -0.1), (4.0, 0.1), (16.0, -0.1)]), Some(8.0), "too near is no reach");
        assert_eq!(furthest(&[(1.0, -0.1), (4.0, -0.1)]), None);
    }

    #[test]
    fn where_a_pose_is_reliable_simulated_attitudes_err_as_the_bound_says() {
        let options = AssessOptions { ranges_m: vec![4.0], aspects_rad: vec![0.7], ..AssessOptions::default() };
        let cell = assess(&demo_camera(), &wing_six(), &options).cells[0][0];
        let ratio = cell.attitude_error_rad.expect("poses") / cell.attitude_sigma_rad.expect("a bound");
        // The root mean square of 64 angles of about two degrees of freedom is known to 9 %.
        assert!((0.75..1.3).contains(&ratio), "{ratio}: {cell:?}");
    }

    #[test]
    fn seen_face_on_the_attitude_is_better_than_its_bound() {
        let options = AssessOptions { ranges_m: vec![40.0], aspects_rad: vec![0.0], ..AssessOptions::default() };
        let cell = assess(&demo_camera(), &wing_six(), &options).cells[0][0];
        assert!(cell.attitude_sigma_rad > Some(2.0) && cell.attitude_error_rad < Some(0.5), "{cell:?}");
    }
}
