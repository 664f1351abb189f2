//! Where a border is, roughly: of all directions and places the one that best parts the samples in two.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instructions of the function that calls it"
)]

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x8};
use nalgebra::Vector2;

use super::{Border, ENDLESS_PX, MIN_SAMPLES, Split};
use crate::detect::ground::Sample;
use crate::detect::locate::lanes::LANES;
use crate::detect::{MACHINE, single, whole};

/// Directions that are tried, over half a turn, and samples that are looked at in each, at most.
const DIRECTIONS: usize = 16;
const MAX_SAMPLES: usize = 120;

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

    /// The best split of the samples across a direction.
    fn split(&mut self, index: usize) -> Option<Split> {
        let (sine, cosine) = (std::f64::consts::PI * index as f64 / DIRECTIONS as f64).sin_cos();
        self.count([cosine, sine].map(single));
        let Stretch { from, to, gained } = dispatch!(*MACHINE, simd => best_stretch(simd, &self.counts, &self.sums))?;
        let all = self.samples.len() as f64;
        let (n, sum) = (f64::from(self.counts[to] - self.counts[from]), f64::from(self.sums[to] - self.sums[from]));
        let (inside, outside) = (self.mean + sum / n, self.mean - sum / (all - n));
        let distance = |place: usize| f64::from(place as f32 / PLACES_PER_PX - self.reach);
        let normal = Vector2::new(cosine, sine);
        let (border, level) = if from > 0 {
            let width = distance(to) - distance(from);
            (Border { normal, distance: distance(from), width, height: inside - outside }, outside)
        } else if 2.0 * n <= all {
            // The other ground is the one of which there is less.
            (Border { normal: -normal, distance: -distance(to), width: ENDLESS_PX, height: inside - outside }, outside)
        } else {
            (Border { normal, distance: distance(to), width: ENDLESS_PX, height: outside - inside }, inside)
        };
        Some(Split { border, level, left: self.squares - f64::from(gained) })
    }
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
