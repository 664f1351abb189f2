//! What a constellation is good for before anybody glues its markers: how well its pose can be known over range and aspect,
//! how often the wrong one of two poses wins, to what range its markers can be told apart, what is wrong with it, and which
//! marker to move.
//!
//! Standard deviations are the Cramer-Rao bound; rates are counted on simulated noise through the very functions that answer
//! requests. The noise is the same for each cell and each variant of the target, so the answer is the same every time, and
//! differences are not chance.

mod advice;
mod cell;
mod congruence;
mod draws;
mod score;
mod sight;
mod stage;
mod warning;

use crate::camera::Camera;
use crate::identify::IdentifyOptions;
use crate::target::Target;
use draws::Draw;
use nalgebra::Vector3;
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
    /// Its markers are told apart in at least nine draws of ten.
    pub identified_m: Option<f64>,
    /// Its pose, markers being known, is the wrong one of two in at most one draw of twenty.
    pub unambiguous_m: Option<f64>,
    /// The standard deviation of its attitude is at most five degrees.
    pub attitude_m: Option<f64>,
}

/// Share of draws from which on a target counts as identified.
const IDENTIFIED_FROM: f64 = 0.9;

/// Share of draws up to which a pose counts as unambiguous.
const AMBIGUOUS_FROM: f64 = 0.05;

/// Up to here an attitude is of use, rad: five degrees.
const USEFUL_ATTITUDE_RAD: f64 = 0.087_266_462_599_716_47;

/// Ranges of the default grid.
const RANGES: usize = 12;

/// Noises simulated for each cell of a grid as large as the default one.
const DRAWS: usize = 32;

/// Poses and identifications simulated for the whole grid: what keeps the answer below a second.
const MAX_SIMULATIONS: usize = DRAWS * RANGES * 6;

/// However large the grid, no fewer noises than this for each cell.
const LEAST_DRAWS: usize = 8;

/// Identification takes longer the more markers there are; from this number on fewer noises are simulated.
const QUICK_MARKERS: usize = 8;

/// Says what `target` is good for before `camera`.
#[must_use]
pub fn assess(camera: &Camera, target: &Target, options: &AssessOptions) -> Assessment {
    let stage = Stage::of(camera, target);
    let ranges_m =
        rising(if options.ranges_m.is_empty() { default_ranges_m(&stage) } else { options.ranges_m.clone() });
    let aspects_rad = rising(options.aspects_rad.clone());
    let draws =
        Draw::first(draw_count(ranges_m.len() * aspects_rad.len(), target.markers().len()), target.markers().len());
    let cells: Vec<Vec<Cell>> = aspects_rad
        .iter()
        .map(|aspect| ranges_m.iter().map(|range| cell::measure(&stage, *range, *aspect, &draws, options)).collect())
        .collect();
    let at_range = |index: usize| -> Vec<Cell> { cells.iter().map(|row| row[index]).collect() };
    let means: Vec<Figures> = (0..ranges_m.len()).map(|index| Figures::of(&at_range(index))).collect();
    let mean_reach = reach(&ranges_m, &means);
    let compared = compared_at(&ranges_m, &mean_reach);
    let advice_range_m = ranges_m.get(compared).copied().unwrap_or_default();
    let figures = means.get(compared).copied().unwrap_or_else(|| Figures::of(&[]));
    Assessment {
        front: stage.front,
        reach: cells
            .iter()
            .map(|row| reach(&ranges_m, &row.iter().map(|c| Figures::of(&[*c])).collect::<Vec<_>>()))
            .collect(),
        mean_reach,
        warnings: warning::warnings(&stage, &options.others, &ranges_m, options.pixel_sigma, &options.identify),
        advice: advice::advice(&stage, advice_range_m, &aspects_rad, &draws, figures, options),
        advice_range_m,
        figures,
        draws: draws.len(),
        ranges_m,
        aspects_rad,
        cells,
    }
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

fn draw_count(cells: usize, markers: usize) -> usize {
    let simulations = MAX_SIMULATIONS * QUICK_MARKERS / markers.max(QUICK_MARKERS);
    (simulations / cells.max(1)).clamp(LEAST_DRAWS, DRAWS)
}

/// The last range at which the mean target is identified: a little further is what a better constellation would gain.
fn compared_at(ranges_m: &[f64], mean_reach: &Reach) -> usize {
    let identified = mean_reach.identified_m.and_then(|reach_m| ranges_m.iter().rposition(|range| *range <= reach_m));
    identified.unwrap_or(ranges_m.len() / 2)
}

fn reach(ranges_m: &[f64], figures: &[Figures]) -> Reach {
    let furthest = |level: f64, of: &dyn Fn(&Figures) -> f64| {
        furthest(ranges_m, &figures.iter().map(|figures| level - of(figures)).collect::<Vec<_>>())
    };
    Reach {
        identified_m: furthest(-IDENTIFIED_FROM, &|figures| -figures.identified_rate),
        unambiguous_m: furthest(AMBIGUOUS_FROM, &|figures| figures.flip_rate),
        attitude_m: furthest(USEFUL_ATTITUDE_RAD, &|figures| figures.attitude_sigma_rad.unwrap_or(f64::MAX)),
    }
}

/// From the first range with a margin that is not negative on, how far it stays so; between two ranges the margin is taken to
/// change evenly with the logarithm of the range.
fn furthest(ranges_m: &[f64], margins: &[f64]) -> Option<f64> {
    // A rate of 0.9 out of counted draws is 0.9.
    let holds = |margin: &f64| *margin >= -1e-9;
    let first = margins.iter().position(holds)?;
    let beyond = margins[first..].iter().position(|margin| !holds(margin)).map(|count| first + count);
    let Some(beyond) = beyond else { return ranges_m.last().copied() };
    let [near, far] = [beyond - 1, beyond].map(|index| margins[index]);
    let share = (near / (near - far)).clamp(0.0, 1.0);
    Some(ranges_m[beyond - 1] * (ranges_m[beyond] / ranges_m[beyond - 1]).powf(share))
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
        let stage = Stage::of(&camera, target).from_front(-Vector3::z());
        let draws: Vec<Draw> = (1000..1064).map(|index| Draw::numbered(index, target.markers().len())).collect();
        let options = AssessOptions::default();
        let cells: Vec<Cell> =
            aspects_rad.iter().map(|aspect| cell::measure(&stage, range_m, *aspect, &draws, &options)).collect();
        Figures::of(&cells)
    }

    #[test]
    fn the_wing_is_seen_near_and_lost_far_away() {
        let found = assess(&demo_camera(), &wing_six(), &AssessOptions::default());
        for row in &found.cells {
            for c in row {
                println!("{c:?}");
            }
        }
        println!("{:?} {:?} {:?} {:?}", found.reach, found.mean_reach, found.advice, found.figures);
        assert!((found.front + Vector3::z()).norm() < 1e-12, "its markers face -z");
        assert_eq!((found.cells.len(), found.cells[0].len()), (6, RANGES));
        for row in &found.cells[..5] {
            let (near, far) = (&row[1], &row[RANGES - 1]);
            assert!(near.identified_rate > 0.9 && far.identified_rate < 0.1, "{near:?} {far:?}");
            assert!(near.flip_rate < far.flip_rate, "{near:?} {far:?}");
            for pair in row.windows(2) {
                assert!(pair[0].range_sigma_m < pair[1].range_sigma_m, "{pair:?}");
            }
            for cell in row {
                let sum = cell.identified_rate + cell.unsure_rate + cell.refused_rate + cell.mistaken_rate;
                assert!((sum - 1.0).abs() < 1e-9, "{cell:?}");
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
        assert!(after.flip_rate - after.identified_rate < before.flip_rate - before.identified_rate, "{after:?}");
    }

    #[test]
    fn advice_keeps_a_flat_target_flat_where_that_is_asked_for() {
        let places = [[0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.3, -0.3], [0.0, 0.0]];
        let options = AssessOptions { keep_flat: true, ranges_m: vec![4.0], ..AssessOptions::default() };
        let found = assess(&demo_camera(), &flat_target(&places, true), &options);
        assert_eq!(found.figures.identified_rate, 0.0, "the turns of a square cannot be told apart");
        assert!(!found.advice.is_empty());
        for advice in &found.advice {
            assert!(advice.to.coords.z.abs() < 1e-12, "{advice:?}");
            assert!(advice.after.identified_rate > 0.5, "{advice:?}");
        }
    }

    #[test]
    fn a_reach_is_where_the_margin_ends() {
        assert_eq!(furthest(&[1.0, 4.0, 16.0], &[0.1, 0.1, 0.0]), Some(16.0));
        assert_eq!(furthest(&[1.0, 4.0, 16.0], &[0.1, 0.1, -0.1]), Some(8.0));
        assert_eq!(furthest(&[1.0, 4.0, 16.0], &[-0.1, 0.1, -0.1]), Some(8.0), "too near is no reach");
        assert_eq!(furthest(&[1.0, 4.0], &[-0.1, -0.1]), None);
    }

    #[test]
    fn large_grids_and_large_targets_are_bounded() {
        assert_eq!(draw_count(72, 6), DRAWS);
        assert!(draw_count(24 * 12, 6) * 24 * 12 <= 2 * MAX_SIMULATIONS);
        assert_eq!(draw_count(72, 64), LEAST_DRAWS);
    }
}
