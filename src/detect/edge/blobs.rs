//! Connected edges with their statistics, in one pass over words of 64 pixels.
//!
//! Only the runs of two rows are kept at a time, and only the components that they belong to; what is asked of a component is
//! summed while its runs pass, under labels that are joined where runs meet (union-find). The cost is a look at each word and a step for each run.

use super::super::sobel::Bits;
use crate::frame::Region;

/// An 8-connected piece of edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Blob {
    /// Pixels.
    pub pixels: u64,
    /// Its area as Matlab's `bwarea` has it, in eighths of a pixel: a little more than its pixels where its outline has corners.
    pub area_eighths: u64,
    /// The pixels that it spans.
    pub bounds: Region,
    /// Twice the sum of its pixels' columns.
    doubled_columns: u64,
    /// The sum of its pixels' rows.
    rows_total: u64,
}

impl Blob {
    /// Some pixels within bounds, for tests of what is done with blobs.
    #[cfg(test)]
    pub(super) const fn square(bounds: Region, pixels: u64) -> Self {
        Self { pixels, area_eighths: 8 * pixels, bounds, doubled_columns: 0, rows_total: 0 }
    }

    /// Its area as Matlab's `bwarea` has it.
    #[must_use]
    pub const fn area_px(&self) -> f64 {
        self.area_eighths as f64 / 8.0
    }

    /// Mean position of its pixels.
    #[must_use]
    pub const fn mean_position(&self) -> (f64, f64) {
        let pixels = self.pixels as f64;
        (self.doubled_columns as f64 / (2.0 * pixels), self.rows_total as f64 / pixels)
    }
}

/// What is known of a label so far. Corners are inclusive.
#[derive(Clone, Copy)]
struct Sum {
    parent: u32,
    first: [u32; 2],
    last: [u32; 2],
    pixels: u64,
    corners: u64,
    doubled_columns: u64,
    rows_total: u64,
}

/// A stretch `start .. end` of a row and its label.
#[derive(Clone, Copy)]
struct Labelled {
    start: u32,
    end: u32,
    label: u32,
}

/// The components, in the order of their last row.
#[must_use]
pub fn blobs(bits: &Bits) -> Vec<Blob> {
    let mut found = Vec::new();
    each(bits, |blob| found.push(blob));
    found
}

/// Hands out every component as soon as it has ended, so that only those are kept that a row meets: a frame of noise has a
/// hundred thousand, of which a few hundred are open at a time.
pub(super) fn each(bits: &Bits, mut ended: impl FnMut(Blob)) {
    // A label is a place in `open`; `kept` takes those that go on, and `places` says where.
    let (mut open, mut kept): (Vec<Sum>, Vec<Sum>) = (Vec::new(), Vec::new());
    let mut places: Vec<u32> = Vec::new();
    let (mut above, mut here): (Vec<Labelled>, Vec<Labelled>) = (Vec::new(), Vec::new());
    for (y, words) in (0..).zip(bits.words.chunks_exact(bits.stride().max(1))) {
        here.clear();
        push_runs(words, bits.width, &mut here);
        if here.is_empty() && open.is_empty() {
            continue;
        }
        let mut next = 0;
        for run in &mut here {
            while next < above.len() && above[next].end < run.start {
                next += 1;
            }
            let mut corners = 0;
            for upper in above[next..].iter().take_while(|upper| upper.start <= run.end) {
                corners += corner_eighths(*upper, *run);
                if run.label == u32::MAX {
                    run.label = upper.label;
                } else if run.label != upper.label {
                    run.label = join(&mut open, run.label, upper.label);
                }
            }
            add(&mut open, run, y, corners);
        }
        // Parents come before their children, so a walk from the back hands every sum up to its root.
        for label in (0..open.len()).rev() {
            let sum = open[label];
            if sum.parent as usize != label {
                open[sum.parent as usize].take(&sum);
            }
        }
        places.clear();
        places.resize(open.len(), u32::MAX);
        kept.clear();
        for run in &mut here {
            let root = root(&mut open, run.label) as usize;
            if places[root] == u32::MAX {
                places[root] = as_u32(kept.len());
                kept.push(Sum { parent: places[root], ..open[root] });
            }
            run.label = places[root];
        }
        for (label, sum) in open.iter().enumerate() {
            if sum.parent as usize == label && places[label] == u32::MAX {
                ended(sum.blob());
            }
        }
        std::mem::swap(&mut open, &mut kept);
        std::mem::swap(&mut above, &mut here);
    }
    for sum in &open {
        ended(sum.blob());
    }
}

#[expect(clippy::cast_possible_truncation, reason = "fewer labels than pixels")]
const fn as_u32(index: usize) -> u32 {
    index as u32
}

/// The runs of a row: a bit that differs from the one before it begins or ends one.
fn push_runs(words: &[u64], width: usize, runs: &mut Vec<Labelled>) {
    let mut before = 0;
    let mut start = None;
    for (base, word) in (0_u32..).step_by(64).zip(words) {
        let mut changes = word ^ (word << 1 | before);
        before = word >> 63;
        while changes != 0 {
            let at = base + changes.trailing_zeros();
            changes &= changes - 1;
            start = match start {
                None => Some(at),
                Some(start) => {
                    runs.push(Labelled { start, end: at, label: u32::MAX });
                    None
                }
            };
        }
    }
    if let Some(start) = start {
        #[expect(clippy::cast_possible_truncation, reason = "a frame counts its columns in u32")]
        runs.push(Labelled { start, end: width as u32, label: u32::MAX });
    }
}

/// What `bwarea` adds to the pixels where two runs meet. It weighs each square of four pixels by what of it is set: a quarter for
/// one, half for two side by side, three quarters for two across, seven eighths for three, one for four. Summed, that is the
/// number of pixels, and a quarter more for each square of two across, and an eighth more for each of three.
fn corner_eighths(upper: Labelled, lower: Labelled) -> u64 {
    let across = u64::from(upper.end == lower.start) + u64::from(lower.end == upper.start);
    let inside = |place: u32, run: Labelled| u64::from(run.start < place && place < run.end);
    let three =
        inside(upper.start, lower) + inside(upper.end, lower) + inside(lower.start, upper) + inside(lower.end, upper);
    2 * across + three
}

fn add(sums: &mut Vec<Sum>, run: &mut Labelled, y: u32, corners: u64) {
    let pixels = u64::from(run.end - run.start);
    let sum = Sum {
        parent: run.label,
        first: [run.start, y],
        last: [run.end - 1, y],
        pixels,
        corners,
        doubled_columns: pixels * u64::from(run.start + run.end - 1),
        rows_total: pixels * u64::from(y),
    };
    if run.label == u32::MAX {
        run.label = as_u32(sums.len());
        sums.push(Sum { parent: run.label, ..sum });
    } else {
        sums[run.label as usize].take(&sum);
    }
}

impl Sum {
    fn take(&mut self, other: &Self) {
        self.first = [self.first[0].min(other.first[0]), self.first[1].min(other.first[1])];
        self.last = [self.last[0].max(other.last[0]), self.last[1].max(other.last[1])];
        self.pixels += other.pixels;
        self.corners += other.corners;
        self.doubled_columns += other.doubled_columns;
        self.rows_total += other.rows_total;
    }

    const fn blob(&self) -> Blob {
        Blob {
            pixels: self.pixels,
            area_eighths: 8 * self.pixels + self.corners,
            bounds: Region {
                x: self.first[0],
                y: self.first[1],
                width: self.last[0] + 1 - self.first[0],
                height: self.last[1] + 1 - self.first[1],
            },
            doubled_columns: self.doubled_columns,
            rows_total: self.rows_total,
        }
    }
}

fn root(sums: &mut [Sum], mut label: u32) -> u32 {
    while sums[label as usize].parent != label {
        // Path halving.
        let parent = sums[label as usize].parent;
        sums[label as usize].parent = sums[parent as usize].parent;
        label = sums[label as usize].parent;
    }
    label
}

/// The earlier label becomes the root.
fn join(sums: &mut [Sum], a: u32, b: u32) -> u32 {
    let (a, b) = (root(sums, a), root(sums, b));
    sums[a.max(b) as usize].parent = a.min(b);
    a.min(b)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use proptest::prelude::*;

    use super::*;
    use crate::detect::components::{Connectivity, tests::slow_components};

    /// `bwarea` by its definition: every square of four pixels that touches the piece.
    fn slow_area_eighths(piece: &[(usize, usize)]) -> u64 {
        let set: HashSet<_> = piece.iter().map(|(x, y)| (x + 1, y + 1)).collect();
        let (most_x, most_y) = set.iter().fold((0, 0), |(a, b), (x, y)| (a.max(*x), b.max(*y)));
        let mut area = 0;
        for (x, y) in (0..=most_x).flat_map(|x| (0..=most_y).map(move |y| (x, y))) {
            let [a, b, c, d] = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|place| set.contains(&place));
            area += match [a, b, c, d].iter().filter(|on| **on).count() {
                0 => 0,
                1 => 2,
                2 if (a && d) || (b && c) => 6,
                2 => 4,
                3 => 7,
                _ => 8,
            };
        }
        area
    }

    proptest! {
        #[test]
        fn blobs_are_those_of_flood_fill_and_areas_those_of_bwarea(
            width in 1_usize..150, height in 1_usize..12, tenths in 1_u8..10, seed in any::<u64>()
        ) {
            let mut state = seed | 1;
            let mask: Vec<u8> = (0..width * height)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    u8::from((state >> 60) as u8 % 10 < tenths)
                })
                .collect();
            let mut bits = Bits { width, height, words: vec![0; width.div_ceil(64) * height] };
            for index in (0..mask.len()).filter(|index| mask[*index] != 0) {
                bits.words[index / width * width.div_ceil(64) + index % width / 64] |= 1 << (index % width % 64);
            }
            let mut found = blobs(&bits);
            let total = |of: fn(&(usize, usize)) -> usize, piece: &[(usize, usize)]| piece.iter().map(of).sum::<usize>() as u64;
            let ends = |of: fn(&(usize, usize)) -> usize, piece: &[(usize, usize)]| {
                let [least, most] = [piece.iter().map(of).min(), piece.iter().map(of).max()].map(|end| end.expect("some"));
                [least, most + 1 - least].map(|side| u32::try_from(side).expect("small"))
            };
            let mut pieces: Vec<Blob> = slow_components(&mask, width, Connectivity::Eight)
                .iter()
                .map(|piece| {
                    let ([x, width], [y, height]) = (ends(|p| p.0, piece), ends(|p| p.1, piece));
                    Blob {
                        pixels: piece.len() as u64,
                        area_eighths: slow_area_eighths(piece),
                        bounds: Region { x, y, width, height },
                        doubled_columns: 2 * total(|p| p.0, piece),
                        rows_total: total(|p| p.1, piece),
                    }
                })
                .collect();
            for list in [&mut found, &mut pieces] {
                list.sort_by_key(|blob| (blob.bounds.y, blob.bounds.x, blob.pixels, blob.doubled_columns, blob.rows_total));
            }
            prop_assert_eq!(found, pieces);
        }
    }
}
