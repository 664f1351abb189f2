//! Where a border is, roughly: of all directions and places the one that best parts the samples in two.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instructions of the function that calls it"
)]

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x8};
use nalgebra::Vector2;

use super::{Border, ENDLESS_PX, Edge, MIN_SAMPLES, Split};
use crate::detect::ground::Sample;
use crate::detect::locate::lanes::LANES;
use crate::detect::{MACHINE, single, whole};

/// Directions that are tried, over half a turn, and samples that are looked at in each, at most.
const DIRECTIONS: usize = 16;
const MAX_SAMPLES: usize = 120;

/// Of the samples that an edge should have beyond it one in so many may lie before it, by noise; and where it is between two samples, px.
const BEFORE: usize = 40;
const BETWEEN_PX: f64 = 0.25;

/// Places along a direction that are tried, in a pixel. A line reaches over as many of them as there are lanes at most.
const PLACES_PER_PX: f32 = 2.0;

/// Looks for the border that parts some of the samples.
#[derive(Default)]
pub(super) struct Searcher {
    /// Values are from their mean.
    samples: Vec<Sample>,
    mean: f64,
    /// Sum of the squares about it.
    squares: f64,
    /// How far they lie from the origin at most, px.
    reach: f32,
    /// At each place along a direction, how many samples lie before it, and their sum.
    counts: Vec<f32>,
    sums: Vec<f32>,
}

/// From which place to which samples are parted from the others, and how much less is left of their squares.
#[derive(Clone, Copy)]
struct Stretch {
    from: usize,
    to: usize,
    gained: f32,
}

impl Searcher {
    /// The split that leaves the least of the samples' squares, of which there must be some.
    pub(super) fn best(&mut self, samples: &[Sample]) -> Option<Split> {
        self.take(samples);
        (0..DIRECTIONS).filter_map(|index| self.split(index)).min_by(|a, b| a.left.total_cmp(&b.left))
    }

    fn take(&mut self, samples: &[Sample]) {
        self.samples.clear();
        self.samples.extend(samples.iter().step_by(samples.len().div_ceil(MAX_SAMPLES)));
        let count = self.samples.len();
        self.mean = self.samples.iter().map(|sample| f64::from(sample.value)).sum::<f64>() / count as f64;
        (self.squares, self.reach) = (0.0, 0.0);
        for sample in &mut self.samples {
            sample.value -= single(self.mean);
            self.squares += f64::from(sample.value * sample.value);
            self.reach = self.reach.max(sample.x.hypot(sample.y));
        }
    }

    /// Counts them at the places along a direction.
    fn count(&mut self, [right, down]: [f32; 2]) {
        let places = whole(f64::from(2.0 * self.reach * PLACES_PER_PX)) + 3;
        for of in [&mut self.counts, &mut self.sums] {
            of.clear();
            // Behind the last place there is nothing more, however far one looks.
            of.resize(places + LANES, 0.0);
        }
        for sample in &self.samples {
            // Those before the first place are none.
            let place = 1 + whole(f64::from((sample.x * right + sample.y * down + self.reach) * PLACES_PER_PX));
            self.counts[place] += 1.0;
            self.sums[place] += sample.value;
        }
        for of in [&mut self.counts, &mut self.sums] {
            let mut before = 0.0;
            for place in of {
                before += *place;
                *place = before;
            }
        }
    }

    /// How far along a direction a place is, px.
    fn distance(&self, place: usize) -> f64 {
        f64::from(place as f32 / PLACES_PER_PX - self.reach)
    }

    /// The best split of the samples across a direction.
    fn split(&mut self, index: usize) -> Option<Split> {
        let normal = direction(index);
        self.count([normal.x, normal.y].map(single));
        let all = self.samples.len() as f32;
        let Stretch { from, to, gained } = dispatch!(*MACHINE, simd => best_stretch(simd, &self.counts, &self.sums))?;
        let (level, height) = self.codes([from, to]);
        let border = |normal, place, width, height| {
            let edge = Edge { normal, distance: place };
            Border { edge, width, corner: None, height, misfit: 0.0 }
        };
        let [begin, end] = [from, to].map(|place| self.distance(place));
        let (border, level) = if from > 0 {
            (border(normal, begin, end - begin, height), level)
        } else if 2.0 * self.counts[to] <= all {
            // The other ground is the one of which there is less.
            (border(-normal, -end, ENDLESS_PX, height), level)
        } else {
            (border(normal, end, ENDLESS_PX, -height), level + height)
        };
        Some(Split { border, level, left: self.squares - f64::from(gained) })
    }

    /// The code of what is not between two places, and how much higher what is between them is.
    fn codes(&self, [from, to]: [usize; 2]) -> (f64, f64) {
        let all = self.samples.len() as f64;
        let (n, sum) = (f64::from(self.counts[to] - self.counts[from]), f64::from(self.sums[to] - self.sums[from]));
        (self.mean - sum / (all - n), sum / n + sum / (all - n))
    }

    /// The corner that best has the samples of one ground on one side of it and those of the other on the other, of the samples that were
    /// looked at last and that `split` parts by a straight border. In each direction an edge that has a ground beyond it can only be where
    /// that begins.
    pub(super) fn corner(&mut self, split: &Split) -> Option<Split> {
        let middle = single(split.level + 0.5 * split.border.height - self.mean);
        let higher = mask(&self.samples, |sample| sample.value > middle);
        let all = mask(&self.samples, |_| true);
        let mut best: Option<(u32, u128, [Edge; 2])> = None;
        for ground in [higher, all & !higher] {
            if (ground.count_ones() as usize) < MIN_SAMPLES || ((all & !ground).count_ones() as usize) < MIN_SAMPLES {
                return None;
            }
            let mut edges = [(Edge { normal: Vector2::zeros(), distance: 0.0 }, 0); 2 * DIRECTIONS];
            for (index, edge) in edges.iter_mut().enumerate() {
                *edge = self.beginning(direction(index), ground);
            }
            for (index, (edge, beyond)) in edges.iter().enumerate() {
                for (other, beyond_other) in &edges[..index] {
                    let wrong = ((beyond & beyond_other) ^ ground).count_ones();
                    if best.is_none_or(|(least, ..)| wrong < least) {
                        best = Some((wrong, beyond & beyond_other, [*edge, *other]));
                    }
                }
            }
        }
        let (_, beyond, [edge, other]) = best?;
        let of = |part: u128| {
            let values = (0..self.samples.len()).filter(|index| part >> index & 1 == 1).map(|k| self.samples[k].value);
            (part != 0).then(|| self.mean + f64::from(values.sum::<f32>()) / f64::from(part.count_ones()))
        };
        let (level, height) = (of(all & !beyond)?, of(beyond)? - of(all & !beyond)?);
        let border = Border { edge, width: ENDLESS_PX, corner: Some(other), height, misfit: 0.0 };
        Some(Split { border, level, left: f64::INFINITY })
    }

    /// Where a ground begins along a direction, and which samples are beyond that.
    fn beginning(&mut self, normal: Vector2<f64>, ground: u128) -> (Edge, u128) {
        let Self { samples, counts, .. } = self;
        let along = |sample: &Sample| sample.x * single(normal.x) + sample.y * single(normal.y);
        counts.clear();
        counts.extend((0..samples.len()).filter(|index| ground >> index & 1 == 1).map(|index| along(&samples[index])));
        let before = counts.len() / BEFORE;
        let (_, begin, _) = counts.select_nth_unstable_by(before, f32::total_cmp);
        let edge = Edge { normal, distance: f64::from(*begin) - BETWEEN_PX };
        let distance = single(edge.distance);
        (edge, mask(samples, |sample| along(sample) > distance))
    }
}

/// Which of the samples are so, of which there are [`MAX_SAMPLES`] at most.
fn mask(samples: &[Sample], is_so: impl Fn(&Sample) -> bool) -> u128 {
    samples.iter().enumerate().fold(0, |mask, (index, sample)| mask | u128::from(is_so(sample)) << index)
}

/// A direction that is tried.
fn direction(index: usize) -> Vector2<f64> {
    let (sine, cosine) = (std::f64::consts::PI * index as f64 / DIRECTIONS as f64).sin_cos();
    Vector2::new(cosine, sine)
}

/// The best of all borders, which part what is before a place, and of all lines, which part what is between two and less than the rest.
#[inline(always)]
fn best_stretch<S: Simd>(simd: S, counts: &[f32], sums: &[f32]) -> Option<Stretch> {
    let places = counts.len() - LANES;
    let all = counts[places];
    let zero = f32x8::splat(simd, 0.0);
    let mut best = Best { gained: zero, from: zero, to: zero };
    for to in (1..places).step_by(LANES) {
        best.look(simd, counts, sums, [0, to], all);
    }
    for from in 1..places {
        best.look(simd, counts, sums, [from, from + 1], 0.5 * all);
    }
    // The first of equal ones.
    let (lane, gained) = best.gained.iter().copied().enumerate().rev().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (gained > 0.0).then(|| Stretch {
        from: whole(best.from[lane].into()),
        to: whole(best.to[lane].into()) + lane,
        gained,
    })
}

/// The best stretch of each lane; where it ends is a place further with each lane.
struct Best<S: Simd> {
    gained: f32x8<S>,
    from: f32x8<S>,
    to: f32x8<S>,
}

impl<S: Simd> Best<S> {
    /// Looks at the stretches from one place to each of eight, of which none is to have more than `most` samples.
    #[inline(always)]
    fn look(&mut self, simd: S, counts: &[f32], sums: &[f32], [from, to]: [usize; 2], most: f32) {
        let n = f32x8::from_slice(simd, &counts[to..to + LANES]) - counts[from];
        let sum = f32x8::from_slice(simd, &sums[to..to + LANES]) - sums[from];
        let others = -n + counts[counts.len() - 1];
        // Of both means, of the stretch and of the rest, about that of all.
        let gained = sum * sum * counts[counts.len() - 1] / (n * others).max(1.0);
        let is_enough = n.simd_ge(MIN_SAMPLES as f32) & others.simd_ge(MIN_SAMPLES as f32);
        let is_better = is_enough & n.simd_le(most) & gained.simd_gt(self.gained);
        self.gained = is_better.select(gained, self.gained);
        self.from = is_better.select(f32x8::splat(simd, from as f32), self.from);
        self.to = is_better.select(f32x8::splat(simd, to as f32), self.to);
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::random::case;

    /// Stretch after stretch.
    fn slow(counts: &[f32], sums: &[f32]) -> f32 {
        let places = counts.len() - LANES;
        let all = counts[places];
        let mut most = 0.0_f32;
        for from in 0..places {
            let (farthest, most_within) = if from == 0 { (places, all) } else { (from + LANES, 0.5 * all) };
            for to in from + 1..=farthest.min(places) {
                let (n, sum) = (counts[to] - counts[from], sums[to] - sums[from]);
                if n.min(all - n) >= MIN_SAMPLES as f32 && n <= most_within {
                    most = most.max(sum * sum * all / (n * (all - n)));
                }
            }
        }
        most
    }

    #[test]
    fn the_best_stretch_is_that_of_all_in_all_registers() {
        for index in 0..200 {
            let mut rng = case("stretches", index);
            let places: usize = rng.random_range(3..70);
            let (mut counts, mut sums) = (vec![0.0; places + LANES], vec![0.0; places + LANES]);
            for place in 1..places {
                let n: u8 = rng.random_range(0..5);
                counts[place] = f32::from(n);
                sums[place] = f32::from(n) * rng.random_range(-40.0..40.0);
            }
            for of in [&mut counts, &mut sums] {
                (1..of.len()).for_each(|place| of[place] += of[place - 1]);
            }
            let most = slow(&counts, &sums);
            for level in [*MACHINE, fearless_simd::Level::baseline()] {
                let found = dispatch!(level, simd => best_stretch(simd, &counts, &sums));
                let Some(Stretch { from, to, gained }) = found else {
                    assert!(most <= 0.0, "{index}: {most}");
                    continue;
                };
                assert_eq!(gained.to_bits(), most.to_bits(), "{index}: {gained} {most}");
                let (n, sum, all) = (counts[to] - counts[from], sums[to] - sums[from], counts[places]);
                assert_eq!((sum * sum * all / (n * (all - n))).to_bits(), most.to_bits(), "{index}: {from} {to}");
            }
        }
    }
}
