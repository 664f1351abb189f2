//! Where a border is, roughly: of all directions and places the one that best parts the samples in two.

use nalgebra::Vector2;

use super::{Border, ENDLESS_PX, MIN_SAMPLES, Split};
use crate::detect::ground::Sample;
use crate::detect::single;

/// Directions that are tried, over half a turn, and samples that are looked at in each, at most.
const DIRECTIONS: usize = 16;
const MAX_SAMPLES: usize = 120;

/// Places along a direction that are tried, in a pixel, and over how many of them a line may reach.
const PLACES_PER_PX: f32 = 2.0;
const WIDEST_LINE: usize = 8;

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
    /// Of so many samples on one side, what the square of their sum is worth; zero where they are too few.
    worth: Vec<f32>,
    /// At each place along a direction, how many samples lie before it, and their sum.
    before: Vec<(usize, f32)>,
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
        // Of both means, of a stretch and of the rest, about that of all.
        let worth = |n: usize| {
            if n.min(count - n) < MIN_SAMPLES { 0.0 } else { (n as f32).recip() + ((count - n) as f32).recip() }
        };
        self.worth.clear();
        self.worth.extend((0..=count).map(worth));
    }

    /// Counts them at the places along a direction.
    fn count(&mut self, [right, down]: [f32; 2]) {
        self.before.clear();
        self.before.resize(whole(2.0 * self.reach * PLACES_PER_PX) + 3, (0, 0.0));
        for sample in &self.samples {
            // Those before the first place are none.
            let place = &mut self.before[1 + whole((sample.x * right + sample.y * down + self.reach) * PLACES_PER_PX)];
            *place = (place.0 + 1, place.1 + sample.value);
        }
        let (mut count, mut sum) = (0, 0.0);
        for place in &mut self.before {
            (count, sum) = (count + place.0, sum + place.1);
            *place = (count, sum);
        }
    }

    /// The best split of the samples across a direction.
    fn split(&mut self, index: usize) -> Option<Split> {
        let (sine, cosine) = (std::f64::consts::PI * index as f64 / DIRECTIONS as f64).sin_cos();
        self.count([cosine, sine].map(single));
        let (before, all) = (&self.before, self.samples.len());
        // From where to where, and how much less is left.
        let mut best = (0, 0, 0.0_f32);
        for (to, (n, sum)) in before.iter().enumerate() {
            let gained = sum * sum * self.worth[*n];
            if gained > best.2 {
                best = (0, to, gained);
            }
        }
        for (from, (n, sum)) in before.iter().enumerate().skip(1) {
            for (to, (n_there, sum_there)) in before.iter().enumerate().skip(from + 1).take(WIDEST_LINE) {
                let (n, sum) = (n_there - n, sum_there - sum);
                // A line has less than what is beside it.
                let gained = sum * sum * self.worth[n];
                if gained > best.2 && 2 * n <= all {
                    best = (from, to, gained);
                }
            }
        }
        let (from, to, gained) = best;
        if to == 0 {
            return None;
        }
        let (n, sum) = (before[to].0 - before[from].0, f64::from(before[to].1 - before[from].1));
        let (inside, outside) = (self.mean + sum / n as f64, self.mean - sum / (all - n) as f64);
        let distance = |place: usize| f64::from(place as f32 / PLACES_PER_PX - self.reach);
        let normal = Vector2::new(cosine, sine);
        let (border, level) = if from > 0 {
            let width = distance(to) - distance(from);
            (Border { normal, distance: distance(from), width, height: inside - outside }, outside)
        } else if 2 * n <= all {
            // The other ground is the one of which there is less.
            (Border { normal: -normal, distance: -distance(to), width: ENDLESS_PX, height: inside - outside }, outside)
        } else {
            (Border { normal, distance: distance(to), width: ENDLESS_PX, height: outside - inside }, inside)
        };
        Some(Split { border, level, left: self.squares - f64::from(gained) })
    }
}

/// Rounded down; 0 for what is below.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "that is what it is for")]
const fn whole(number: f32) -> usize {
    number.max(0.0) as usize
}
