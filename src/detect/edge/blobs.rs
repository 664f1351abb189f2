//! Connected edges with their statistics, in one pass over words of 64 pixels, two rows at a time.
//!
//! Where two rows have a pixel in each of some neighbouring columns, these pixels are one piece of 8-connected edge, whatever they look
//! like; a frame of noise has half as many such pieces as single rows have runs. Pieces are joined where the rows between two strips
//! touch. C. Grana et al., "Optimized block-based connected components labeling with decision trees", IEEE Transactions on Image
//! Processing 2010, has blocks of two rows; here they are as long as they go. What is asked of a component is counted bit by bit in
//! whole words while its pieces pass, and only those are kept that a row meets. The cost is a look at each word and a step for each piece.

mod open;
mod runs;
mod strip;
mod sum;

use super::super::sobel::Bits;
use crate::frame::Region;
use open::Open;
use runs::Runs;
use strip::Strip;

/// An 8-connected piece of edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Blob {
    /// Pixels.
    pub pixels: u64,
    /// Its area as Matlab's `bwarea` has it, in eighths of a pixel: a little more than its pixels where its outline has corners.
    pub area_eighths: u64,
    /// The pixels that it spans.
    pub bounds: Region,
    /// The sum of its pixels' columns.
    pub(super) columns_total: u64,
    /// The sum of its pixels' rows.
    pub(super) rows_total: u64,
}

impl Blob {
    /// Some pixels within bounds, for tests of what is done with blobs.
    #[cfg(test)]
    pub(super) const fn square(bounds: Region, pixels: u64) -> Self {
        Self { pixels, area_eighths: 8 * pixels, bounds, columns_total: 0, rows_total: 0 }
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
        (self.columns_total as f64 / pixels, self.rows_total as f64 / pixels)
    }
}

/// The components, in the order of their last row.
#[must_use]
pub fn blobs(bits: &Bits) -> Vec<Blob> {
    let mut found = Vec::new();
    each(&mut Joining::default(), bits, |blob| found.push(blob));
    found
}

/// Not yet known.
const NO_LABEL: u32 = u32::MAX;

/// What pieces are joined in, picture after picture.
#[derive(Default)]
pub(super) struct Joining {
    strip: Strip,
    above: Runs,
    here: Runs,
    /// Pixels of a strip that touch the one above.
    touching: Runs,
    labels_above: Vec<u32>,
    labels: Vec<u32>,
    open: Open,
}

/// Hands out every component as soon as it has ended, so that only those are kept that a row meets: a frame of noise has a
/// hundred thousand, of which a few hundred are open at a time.
#[multiversion::multiversion(targets("x86_64+popcnt+bmi1+bmi2+lzcnt", "x86_64+popcnt"))]
pub(super) fn each<F: FnMut(Blob)>(joining: &mut Joining, bits: &Bits, mut ended: F) {
    let Joining { strip, above, here, touching, labels_above, labels, open } = joining;
    strip.begin(bits);
    for runs in [&mut *above, &mut *here, &mut *touching] {
        runs.begin(strip.words());
    }
    labels_above.clear();
    open.clear();
    for (y, rows) in (0..).step_by(2).zip(bits.words.chunks(2 * bits.stride().max(1))) {
        strip.next(rows);
        here.read(strip.columns());
        labels.clear();
        labels.resize(here.len(), NO_LABEL);
        if !labels_above.is_empty() {
            touching.read(strip.touching());
            for touch in touching.iter() {
                let label = &mut labels[here.holding(touch[0])];
                let [first, last] = strip.touched(touch).map(|place| above.holding(place));
                let next = labels_above[first];
                if first == last && (*label == NO_LABEL || *label == next) {
                    *label = next;
                    continue;
                }
                let known = if *label == NO_LABEL { next } else { *label };
                *label = labels_above[first..=last].iter().fold(known, |known, next| open.join(known, *next));
            }
        }
        if !labels.is_empty() {
            strip.find_squares();
        }
        for (run, label) in here.iter().zip(&mut *labels) {
            let sum = strip.sum(run, y);
            *label = if *label == NO_LABEL { open.start(sum, y) } else { open.grow(*label, &sum, y) };
        }
        open.close(labels_above, y, |sum| ended(sum.blob()));
        std::mem::swap(above, here);
        std::mem::swap(labels_above, labels);
    }
    open.close(labels_above, u32::MAX, |sum| ended(sum.blob()));
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
                        columns_total: total(|p| p.0, piece),
                        rows_total: total(|p| p.1, piece),
                    }
                })
                .collect();
            for list in [&mut found, &mut pieces] {
                list.sort_by_key(|blob| (blob.bounds.y, blob.bounds.x, blob.pixels, blob.columns_total, blob.rows_total));
            }
            prop_assert_eq!(found, pieces);
        }
    }
}
