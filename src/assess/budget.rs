//! How much is simulated, so that the answer comes within a second whatever is asked.
//!
//! There is no clock here: the work is bounded by what the parts are known to take.

use crate::target::Target;

/// Poses that may be computed for the grid, of targets of up to [`QUICK_MARKERS`] markers.
const POSES: usize = 1440;

/// Beyond this number of markers a pose takes longer, in proportion.
const QUICK_MARKERS: usize = 8;

/// However large the grid, no fewer noises than this for each cell; however small, no more than the second.
const DRAWS: [usize; 2] = [8, 64];

/// Time for telling markers apart over the grid, when moves are sorted, and when the best are measured.
const GRID_US: f64 = 450_000.0;
const SORTING_US: f64 = 150_000.0;
const MEASURING_US: f64 = 200_000.0;

/// Fewer noises than this make no rate.
const LEAST_IDENTIFIED: usize = 6;

/// Markers told apart at fewer ranges than this do not show how far that goes.
const LEAST_RANGES: usize = 3;

/// Variants of the target that are measured: as it is, and the best moves.
pub(super) const MEASURED: usize = 5;

/// Noises for each aspect when a move is measured.
const MEASURING_DRAWS: usize = 16;

/// Turns at which moves are sorted by how well markers are told apart.
const SORTING_TURNS: usize = 6;

/// How many noises are simulated, and in which cells markers are told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Budget {
    /// Noises for each cell.
    pub draws: usize,
    /// Of these, noises in which markers are told apart; 0 for none, as there are too many of them.
    pub identified_draws: usize,
    /// Markers are told apart at every so many-th range, the farthest among them ...
    pub range_stride: usize,
    /// ... and every so many-th aspect.
    pub aspect_stride: usize,
}

impl Budget {
    /// Whether markers are told apart in the cell at these indices.
    pub(super) const fn is_told_apart(&self, range_from_farthest: usize, aspect: usize) -> bool {
        // Of few aspects the middle ones: face on is a special case.
        range_from_farthest.is_multiple_of(self.range_stride) && aspect % self.aspect_stride == self.aspect_stride / 2
    }
}

/// For the whole grid, where moves of markers can change whether the target is flat or not.
pub(super) fn grid(target: &Target, stays_flat: bool, ranges: usize, aspects: usize) -> Budget {
    let poses = POSES * QUICK_MARKERS / target.markers().len().max(QUICK_MARKERS);
    let draws = (poses / (ranges * aspects).max(1)).clamp(DRAWS[0], DRAWS[1]);
    // What advice has no use for is spent here.
    let spared = measuring(target, stays_flat, MEASURED, aspects).identified_draws == 0;
    let time_us = if spared { GRID_US + SORTING_US + MEASURING_US } else { GRID_US };
    let affordable = affordable(time_us, identification_us(target, target.spread().is_coplanar()));
    // From every cell on, fewer and fewer.
    strides(ranges, aspects)
        .map(|(range_stride, aspect_stride)| {
            let cells = ranges.div_ceil(range_stride) * aspects.div_ceil(aspect_stride);
            let identified_draws = (affordable / cells.max(1)).min(draws);
            Budget { draws, identified_draws, range_stride, aspect_stride }
        })
        .find(|budget| budget.identified_draws >= LEAST_IDENTIFIED)
        .unwrap_or(Budget { draws, identified_draws: 0, range_stride: 1, aspect_stride: 1 })
}

/// Strides over ranges and aspects, growing in turn: the ranges until so few are left that they show nothing, the aspects to
/// the last.
fn strides(ranges: usize, aspects: usize) -> impl Iterator<Item = (usize, usize)> {
    let coarsest = (1..=ranges).rev().find(|stride| ranges.div_ceil(*stride) >= LEAST_RANGES).unwrap_or(1);
    (1..=coarsest.max(aspects)).flat_map(move |k| {
        [(k.saturating_sub(1).clamp(1, coarsest), k.min(aspects)), (k.min(coarsest), k.min(aspects))]
    })
}

/// For measuring so many variants of the target at one range: noises for each aspect, and of these such in which markers are
/// told apart.
pub(super) fn measuring(target: &Target, stays_flat: bool, variants: usize, aspects: usize) -> Budget {
    let affordable = affordable(MEASURING_US, identification_us(target, stays_flat)) / (variants * aspects).max(1);
    let identified_draws = if affordable >= LEAST_IDENTIFIED { affordable.min(MEASURING_DRAWS) } else { 0 };
    let draws = MEASURING_DRAWS.min(POSES / (variants * aspects).max(1)).max(DRAWS[0]);
    Budget { draws, identified_draws: identified_draws.min(draws), range_stride: 1, aspect_stride: 1 }
}

/// Turns at which so many moves are sorted by how well markers are told apart.
pub(super) fn sorting_turns(target: &Target, stays_flat: bool, moves: usize) -> usize {
    (affordable(SORTING_US, identification_us(target, stays_flat)) / moves.max(1)).min(SORTING_TURNS)
}

/// What telling the markers apart takes on one core, about: three markers are tried on every three blobs. For a flat target
/// most trials end at once.
fn identification_us(target: &Target, is_flat: bool) -> f64 {
    let triples = (target.markers().len() as f64).powi(3);
    if is_flat { 150.0 + 0.5 * triples } else { 100.0 + 2.3 * triples }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count that is not negative")]
fn affordable(time_us: f64, each_us: f64) -> usize {
    (time_us / each_us) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assess::tests::target;
    use crate::scene::models::wing_six;

    fn cloud(markers: u32) -> Target {
        let place = |i: u32| [f64::from(i * i % 7), f64::from(i), f64::from(i % 5)];
        target(&(0..markers).map(place).collect::<Vec<_>>())
    }

    fn of(target: &Target, ranges: usize, aspects: usize) -> Budget {
        grid(target, false, ranges, aspects)
    }

    #[test]
    fn the_default_grid_of_a_small_target_is_simulated_in_every_cell() {
        let budget = of(&wing_six(), 10, 6);
        assert_eq!((budget.draws, budget.range_stride, budget.aspect_stride), (24, 1, 1));
        assert!(budget.identified_draws >= 16, "{budget:?}");
    }

    #[test]
    fn whatever_is_asked_the_time_is_bounded() {
        for markers in [4, 6, 8, 12, 16, 24, 40, 64] {
            for (ranges, aspects) in [(1, 1), (10, 6), (24, 12)] {
                let cloud = cloud(markers);
                let budget = of(&cloud, ranges, aspects);
                let told_apart =
                    (0..ranges * aspects).filter(|i| budget.is_told_apart(i / aspects, i % aspects)).count();
                assert!(told_apart > 0);
                let each_us = identification_us(&cloud, cloud.spread().is_coplanar());
                let time_us = (told_apart * budget.identified_draws) as f64 * each_us;
                assert!(time_us <= GRID_US + SORTING_US + MEASURING_US, "{markers} {ranges} {aspects}: {budget:?}");
                assert!(budget.identified_draws == 0 || budget.identified_draws >= LEAST_IDENTIFIED);
                let poses = ranges * aspects * budget.draws;
                assert!(poses <= POSES.max(ranges * aspects * DRAWS[0]), "{markers} {ranges} {aspects}: {poses}");
            }
        }
    }

    #[test]
    fn of_a_larger_target_fewer_cells_are_simulated_and_of_a_huge_one_none() {
        let larger = of(&cloud(12), 10, 6);
        assert!(larger.aspect_stride > 1 && larger.identified_draws >= LEAST_IDENTIFIED, "{larger:?}");
        let ranges = (0..10).filter(|range| of(&cloud(24), 10, 6).is_told_apart(*range, 3)).count();
        assert!(ranges >= LEAST_RANGES, "{ranges}");
        assert_eq!(of(&cloud(64), 10, 6).identified_draws, 0);
    }
}
