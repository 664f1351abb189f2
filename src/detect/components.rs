//! Connected components by runs.
//!
//! Rows are cut into runs of foreground pixels; runs that touch are joined (union-find). The cost is one pass over the
//! pixels plus the number of runs, however the components wind.

use fearless_simd::dispatch;
use fearless_simd::prelude::*;

use super::{MACHINE, bits};
use crate::frame::Region;

/// Which pixels touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Connectivity {
    /// Those that share a side.
    Four,
    /// Those that share a side or a corner.
    Eight,
}

/// A stretch of foreground pixels `start .. end` of one row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// The row.
    pub y: u32,
    /// First column.
    pub start: u32,
    /// Column after the last.
    pub end: u32,
}

impl Run {
    /// What of it lies in a window.
    #[must_use]
    pub fn within(self, window: Region) -> Option<Self> {
        let start = self.start.max(window.x);
        let end = self.end.min(window.x + window.width);
        let is_inside = start < end && (window.y..window.y + window.height).contains(&self.y);
        is_inside.then_some(Self { start, end, ..self })
    }
}

/// The components of a picture: their runs, one component after the other, each in reading order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Components {
    runs: Vec<Run>,
    /// Where each component's runs begin in `runs`, and the end of the last.
    starts: Vec<usize>,
}

/// Finds components, picture after picture, in the same memory.
#[derive(Clone, Debug, Default)]
pub struct Labeling {
    /// The runs of a picture, in reading order.
    runs: Vec<Run>,
    /// For each run an earlier one of its component, or itself; in the end the component's number.
    parents: Vec<u32>,
    components: Components,
}

impl Labeling {
    /// As [`Components::of`].
    pub fn of(
        &mut self,
        samples: &[u8],
        width: usize,
        window: Region,
        threshold: u8,
        connectivity: Connectivity,
    ) -> &Components {
        self.within(samples, width, &[window], threshold, connectivity)
    }

    /// The same of several windows, as if all between them were background: windows of the same rows stand side by side, from
    /// left to right and with a gap between; those of other rows below.
    pub fn within(
        &mut self,
        samples: &[u8],
        width: usize,
        windows: &[Region],
        threshold: u8,
        connectivity: Connectivity,
    ) -> &Components {
        let Self { runs, parents, .. } = self;
        runs.clear();
        parents.clear();
        let reach = u32::from(connectivity == Connectivity::Eight);
        let (mut above_start, mut above_end, mut above_y) = (0, 0, 0);
        let bands = windows.chunk_by(|a, b| a.y == b.y);
        for (band, y) in bands.flat_map(|band| (band[0].y..band[0].y + band[0].height).map(move |y| (band, y))) {
            let row_start = runs.len();
            for window in band {
                let offset = y as usize * width + window.x as usize;
                push_runs(&samples[offset..offset + window.width as usize], threshold, window.x, y, runs);
            }
            if above_y + 1 != y {
                above_start = above_end;
            }
            // Merge with the row above: both lists are sorted, so one walk suffices.
            let mut above = above_start;
            for index in row_start..runs.len() {
                parents.push(as_u32(index));
                let run: Run = runs[index];
                while above < above_end && runs[above].end + reach <= run.start {
                    above += 1;
                }
                let mut touching = above;
                while touching < above_end && runs[touching].start < run.end + reach {
                    join(parents, as_u32(index), as_u32(touching));
                    touching += 1;
                }
            }
            (above_start, above_end, above_y) = (row_start, runs.len(), y);
        }
        self.group();
        &self.components
    }

    /// Sorts the runs by component (counting sort, stable).
    fn group(&mut self) {
        let Components { runs: sorted, starts } = &mut self.components;
        // Where a component's next run goes stands one place on, so that in the end the next one's beginning stands there.
        starts.clear();
        starts.extend([0, 0]);
        for index in 0..self.runs.len() {
            let parent = self.parents[index] as usize;
            // An earlier run has its number already.
            let number = if parent == index {
                starts.push(0);
                as_u32(starts.len() - 3)
            } else {
                self.parents[parent]
            };
            self.parents[index] = number;
            starts[number as usize + 2] += 1;
        }
        let mut before = 0;
        for start in &mut *starts {
            before += *start;
            *start = before;
        }
        sorted.clear();
        sorted.resize(self.runs.len(), Run { y: 0, start: 0, end: 0 });
        for (run, number) in self.runs.iter().zip(&self.parents) {
            let next = &mut starts[*number as usize + 1];
            sorted[*next] = *run;
            *next += 1;
        }
        starts.pop();
    }
}

impl Components {
    /// The components of the pixels of `window` whose sample is at least `threshold`, in reading order of their first pixel.
    /// `samples` are rows of `width`; runs are in its coordinates.
    #[must_use]
    pub fn of(samples: &[u8], width: usize, window: Region, threshold: u8, connectivity: Connectivity) -> Self {
        let mut labeling = Labeling::default();
        labeling.of(samples, width, window, threshold, connectivity);
        labeling.components
    }

    /// The runs of a component.
    #[must_use]
    pub fn runs(&self, number: usize) -> &[Run] {
        &self.runs[self.starts[number]..self.starts[number + 1]]
    }

    /// Number of components.
    #[must_use]
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The runs of each component.
    pub fn iter(&self) -> impl Iterator<Item = &[Run]> + Clone {
        self.starts.windows(2).map(|ends| &self.runs[ends[0]..ends[1]])
    }
}

/// Whether the first pixel of `part` lies on `runs`, which are in reading order. Components of two levels are one inside the other or apart,
/// so of a component of a higher level this tells it of all.
#[must_use]
pub fn holds(runs: &[Run], part: &[Run]) -> bool {
    let Some(first) = part.first() else { return false };
    let before = runs.partition_point(|run| (run.y, run.start) <= (first.y, first.start));
    runs[..before].last().is_some_and(|run| run.y == first.y && first.start < run.end)
}

/// Number of pixels of some runs.
#[must_use]
pub fn area(runs: &[Run]) -> usize {
    runs.iter().map(|run| (run.end - run.start) as usize).sum()
}

/// The smallest region that holds all runs; a single pixel at the origin for none.
#[must_use]
pub fn bounds(runs: &[Run]) -> Region {
    let x = runs.iter().map(|run| run.start).min().unwrap_or(0);
    let end = runs.iter().map(|run| run.end).max().unwrap_or(1);
    let y = runs.first().map_or(0, |run| run.y);
    let last = runs.last().map_or(0, |run| run.y);
    Region { x, y, width: end - x, height: last + 1 - y }
}

/// Mean position of the pixels.
#[must_use]
pub fn mean_position(runs: &[Run]) -> (f64, f64) {
    let (mut count, mut sum_x, mut sum_y) = (0.0, 0.0, 0.0);
    for run in runs {
        let length = f64::from(run.end - run.start);
        count += length;
        sum_x += length * 0.5 * f64::from(run.start + run.end - 1);
        sum_y += length * f64::from(run.y);
    }
    (sum_x / f64::max(count, 1.0), sum_y / f64::max(count, 1.0))
}

/// The runs of one row.
fn push_runs(row: &[u8], threshold: u8, x: u32, y: u32, runs: &mut Vec<Run>) {
    dispatch!(*MACHINE, simd => push_runs_by(simd, row, threshold, [x, y], runs));
}

#[expect(clippy::inline_always, reason = "only inside its caller can it be compiled for its instructions")]
#[inline(always)]
fn push_runs_by<S: Simd>(simd: S, row: &[u8], threshold: u8, [x, y]: [u32; 2], runs: &mut Vec<Run>) {
    let (mut last, mut start) = (0, None);
    for (number, place) in (0..row.len().div_ceil(bits::SAMPLES)).zip((x..).step_by(bits::SAMPLES)) {
        let word = bits::at_least(simd, row, number, threshold);
        // Where a sample differs from the one before it a run begins or ends.
        let mut changes = word ^ (word << 1 | last);
        last = word >> 63;
        while changes != 0 {
            let at = place + changes.trailing_zeros();
            changes &= changes - 1;
            match start.take() {
                Some(start) => runs.push(Run { y, start, end: at }),
                None => start = Some(at),
            }
        }
    }
    if let Some(start) = start {
        runs.push(Run { y, start, end: x + as_u32(row.len()) });
    }
}

#[expect(clippy::cast_possible_truncation, reason = "columns and numbers of runs stay below the pixel limit")]
const fn as_u32(index: usize) -> u32 {
    index as u32
}

fn find(parents: &mut [u32], mut node: u32) -> u32 {
    while parents[node as usize] != node {
        // Path halving.
        parents[node as usize] = parents[parents[node as usize] as usize];
        node = parents[node as usize];
    }
    node
}

/// The earlier run becomes the root, so roots stand in reading order.
fn join(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(parents, a), find(parents, b));
    parents[a.max(b) as usize] = a.min(b);
}

#[cfg(test)]
pub(crate) mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Flood fill from every pixel: the slow, obvious way. Sets of pixels in reading order of their first.
    pub(crate) fn slow_components(mask: &[u8], width: usize, connectivity: Connectivity) -> Vec<Vec<(usize, usize)>> {
        let height = mask.len() / width;
        let mut seen = vec![false; mask.len()];
        let mut found = Vec::new();
        for first in 0..mask.len() {
            if seen[first] || mask[first] == 0 {
                continue;
            }
            seen[first] = true;
            let mut stack = vec![(first % width, first / width)];
            let mut pixels = Vec::new();
            while let Some((x, y)) = stack.pop() {
                pixels.push((x, y));
                for ny in y.saturating_sub(1)..(y + 2).min(height) {
                    for nx in x.saturating_sub(1)..(x + 2).min(width) {
                        let diagonal = nx != x && ny != y;
                        if mask[ny * width + nx] != 0
                            && !seen[ny * width + nx]
                            && !(diagonal && connectivity == Connectivity::Four)
                        {
                            seen[ny * width + nx] = true;
                            stack.push((nx, ny));
                        }
                    }
                }
            }
            pixels.sort_by_key(|&(x, y)| (y, x));
            found.push(pixels);
        }
        found
    }

    fn pixels(runs: &[Run]) -> Vec<(usize, usize)> {
        runs.iter().flat_map(|r| (r.start..r.end).map(|x| (x as usize, r.y as usize))).collect()
    }

    proptest! {
        #[test]
        fn components_are_those_of_flood_fill(
            width in 1_usize..60, rows in 1_usize..12, density in 1_u8..9, eight in any::<bool>(), seed in any::<u64>()
        ) {
            let mut state = seed | 1;
            let mask: Vec<u8> = (0..width * rows)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    u8::from((state >> 60) as u8 % 10 < density)
                })
                .collect();
            let connectivity = if eight { Connectivity::Eight } else { Connectivity::Four };
            let side = |length: usize| u32::try_from(length).expect("a small mask");
            let window = Region { x: 0, y: 0, width: side(width), height: side(rows) };
            let fast: Vec<_> =
                Components::of(&mask, width, window, 1, connectivity).iter().map(pixels).collect();
            prop_assert_eq!(fast, slow_components(&mask, width, connectivity));
        }
    }

    #[test]
    fn several_windows_are_one_picture_with_background_between_them() {
        let (width, height) = (60, 40);
        let mut state = 3_u64;
        let mut samples: Vec<u8> = (0..width * height)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                u8::from(state >> 62 == 0)
            })
            .collect();
        let windows = [[2, 0, 20, 7], [23, 0, 30, 7], [0, 7, 9, 10], [30, 7, 30, 10], [10, 20, 40, 20]]
            .map(|[x, y, width, height]| Region { x, y, width, height });
        let within = Labeling::default().within(&samples, width, &windows, 1, Connectivity::Eight).clone();
        for (index, sample) in (0_u32..).zip(&mut samples) {
            let (x, y) = (index % 60, index / 60);
            let holds = |w: &Region| (w.x..w.x + w.width).contains(&x) && (w.y..w.y + w.height).contains(&y);
            *sample *= u8::from(windows.iter().any(holds));
        }
        let whole = Region { x: 0, y: 0, width: 60, height: 40 };
        assert_eq!(within, Components::of(&samples, width, whole, 1, Connectivity::Eight));
    }

    #[test]
    fn what_was_labelled_before_leaves_nothing_behind() {
        let mut labeling = Labeling::default();
        let (whole, part) = (Region { x: 0, y: 0, width: 4, height: 3 }, Region { x: 1, y: 1, width: 2, height: 1 });
        let samples = [9, 0, 9, 0, 0, 9, 0, 0, 9, 0, 0, 9];
        for window in [whole, part, whole] {
            for threshold in [5, 10] {
                let once = Components::of(&samples, 4, window, threshold, Connectivity::Four);
                assert_eq!(labeling.of(&samples, 4, window, threshold, Connectivity::Four), &once);
                assert_eq!(
                    (0..once.len()).map(|number| once.runs(number)).collect::<Vec<_>>(),
                    once.iter().collect::<Vec<_>>()
                );
            }
        }
    }

    #[test]
    fn of_two_levels_components_are_one_inside_the_other_or_apart() {
        let samples = [9, 5, 9, 0, 9, 9, 0, 5, 5, 0, 9, 0];
        let window = Region { x: 0, y: 0, width: 6, height: 2 };
        let low = Components::of(&samples, 6, window, 5, Connectivity::Eight);
        let high = Components::of(&samples, 6, window, 9, Connectivity::Eight);
        let held = |runs| high.iter().map(|part| holds(runs, part)).collect::<Vec<_>>();
        assert_eq!(low.iter().map(held).collect::<Vec<_>>(), [[true, true, false], [false, false, true]]);
        assert!(!holds(high.runs(0), low.runs(1)) && !holds(&[], low.runs(0)) && !holds(low.runs(0), &[]));
    }

    #[test]
    fn what_of_a_run_lies_in_a_window_is_a_run() {
        let window = Region { x: 3, y: 2, width: 4, height: 2 };
        let within = |y, start, end| Run { y, start, end }.within(window);
        assert_eq!(within(2, 0, 9), Some(Run { y: 2, start: 3, end: 7 }));
        assert_eq!(within(3, 4, 6), Some(Run { y: 3, start: 4, end: 6 }));
        assert_eq!([within(1, 0, 9), within(4, 0, 9), within(2, 0, 3), within(2, 7, 9)], [None; 4]);
    }

    #[test]
    fn a_window_sees_only_its_own_pixels() {
        let window = Region { x: 1, y: 1, width: 2, height: 1 };
        let components = Components::of(&[9; 12], 4, window, 5, Connectivity::Eight);
        let runs: Vec<&[Run]> = components.iter().collect();
        assert_eq!(runs, [[Run { y: 1, start: 1, end: 3 }]]);
        assert_eq!((area(runs[0]), bounds(runs[0]), mean_position(runs[0])), (2, window, (1.5, 1.0)));
    }
}
