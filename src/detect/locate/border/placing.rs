//! Where a border is exactly, by Gauss and Newton; what lies on either ground beside it counts less the farther off it is.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x8};
use nalgebra::{SMatrix, SVector, Vector2};

use super::{ENDLESS_PX, Edge, STEEP, Split, WIDEST_LINE_PX};
use crate::detect::ground::Sample;
use crate::detect::locate::lanes::{LANES, logistic_fall, sum};
use crate::detect::locate::patch::Octet;
use crate::detect::{MACHINE, single};

/// How wide a line is: what is expected, with a deviation of 1 px, and the least, px.
const LINE_PX: f64 = 1.5;
const LEAST_LINE_PX: f64 = 0.5;

/// Rounds at most, the longest move and turn in each, and the move and turn that end them. Of a corner one edge may be seen so briefly that
/// it begins far off, and both may go by twice as much.
const ROUNDS: usize = 6;
const ROUNDS_OF_CORNER: usize = 12;
const MAX_MOVE_PX: f64 = 0.7;
const MAX_TURN_RAD: f64 = 0.1;
const SETTLED_PX: f64 = 0.01;
const SETTLED_RAD: f64 = 1e-3;

/// What is searched for: the level, the height, the width, distance and turn; of a corner distance and turn of its other edge too.
const STRAIGHT: usize = 5;
const CORNER: usize = STRAIGHT + 2;
const WIDTH: usize = 2;

/// Places borders, one after the other in the same memory.
#[derive(Default)]
pub(super) struct Placer {
    octets: Vec<Octet>,
}

/// Normal equations of a step.
struct Equations<const N: usize> {
    normal: SMatrix<f64, N, N>,
    right: SVector<f64, N>,
    /// Sum of the squares of what is left.
    left: f64,
}

impl Placer {
    /// `noise` is that of the samples. `None` where they do not tell.
    pub(super) fn place(&mut self, split: Split, samples: &[Sample], noise: f64) -> Option<Split> {
        self.octets.clear();
        self.octets.extend(samples.chunks(LANES).map(Octet::of));
        if split.border.corner.is_some() {
            self.placed::<CORNER>(split, noise)
        } else {
            self.placed::<STRAIGHT>(split, noise)
        }
    }

    fn placed<const N: usize>(&self, mut split: Split, noise: f64) -> Option<Split> {
        let mut best: Option<Split> = None;
        let (rounds, stride) = if N == CORNER { (ROUNDS_OF_CORNER, 2.0) } else { (ROUNDS, 1.0) };
        for _ in 0..rounds {
            let is_line = split.border.width < ENDLESS_PX;
            let Equations::<N> { mut normal, mut right, left } =
                dispatch!(*MACHINE, simd => equations(simd, &self.octets, &split, noise));
            normal += SMatrix::identity() * 1e-9;
            if is_line {
                normal[(WIDTH, WIDTH)] += noise * noise;
                right[WIDTH] += noise * noise * (LINE_PX - split.border.width);
            }
            split.left = left;
            if best.is_none_or(|best| left < best.left) {
                best = Some(split);
            }
            let step = normal.cholesky()?.solve(&right);
            split.level += step[0];
            split.border.height += step[1];
            if is_line {
                split.border.width = (split.border.width + step[WIDTH]).clamp(LEAST_LINE_PX, WIDEST_LINE_PX);
            }
            let steps = step.as_slice()[WIDTH + 1..].chunks_exact(2);
            let edges = std::iter::once(&mut split.border.edge).chain(&mut split.border.corner);
            edges.zip(steps.clone()).for_each(|(edge, step)| edge.step(step[0], step[1], stride));
            let is_settled = |step: &[f64]| step[0].abs() < SETTLED_PX && step[1].abs() < SETTLED_RAD;
            if step[WIDTH].abs() < SETTLED_PX && steps.clone().all(is_settled) {
                // The last step is worth no look at what it leaves.
                return Some(split);
            }
        }
        best
    }
}

impl Edge {
    fn step(&mut self, distance: f64, turn: f64, stride: f64) {
        let [distance, turn] =
            [(distance, MAX_MOVE_PX), (turn, MAX_TURN_RAD)].map(|(by, most)| by.clamp(-most * stride, most * stride));
        self.distance += distance;
        self.normal = (self.normal + self.along() * turn).normalize();
    }

    fn along(&self) -> Vector2<f64> {
        Vector2::new(-self.normal.y, self.normal.x)
    }

    /// How it parts pixels, and how far along it they lie.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
    #[inline(always)]
    fn parts<S: Simd>(&self, x: f32x8<S>, y: f32x8<S>) -> [f32x8<S>; 2] {
        let [along_x, along_y] = [self.along().x, self.along().y].map(single);
        [self.before(x, y), x * along_x + y * along_y]
    }
}

#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn equations<S: Simd, const N: usize>(simd: S, octets: &[Octet], split: &Split, noise: f64) -> Equations<N> {
    let border = &split.border;
    let [level, height, steep, width] = [split.level, border.height, STEEP, border.width * STEEP].map(single);
    let per_scale = single((3.0 * noise).hypot(0.1 * border.height).recip());
    let [zero, one] = [0.0, 1.0].map(|value| f32x8::splat(simd, value));
    // The lower triangle, row by row.
    let mut normal = [[zero; N]; N];
    let mut moment = [zero; N];
    let mut left = zero;
    for octet in octets {
        let [x, y, value, there] = [&octet.x, &octet.y, &octet.value, &octet.there].map(|lanes| lanes.load(simd));
        let [before, along] = border.edge.parts(x, y);
        let (from, to) = (logistic_fall(before), logistic_fall(before + width));
        let [second, by_second, along_second] = border.corner.map_or([one, zero, zero], |edge| {
            let [before, along] = edge.parts(x, y);
            let share = logistic_fall(before);
            [share, (share * share - share) * (from - to) * (height * steep), along]
        });
        let begin = (from - from * from) * second * (height * steep);
        let end = (to - to * to) * second * (height * steep);
        let share = (from - to) * second;
        let off = value - level - share * height;
        let all = [one, share, end, end - begin, (begin - end) * along, by_second, -by_second * along_second];
        let by: [f32x8<S>; N] = std::array::from_fn(|index| all[index]);
        let strange = off * per_scale;
        let weight = there / (strange * strange + 1.0);
        for (row, sums) in normal.iter_mut().enumerate() {
            let weighted = by[row] * weight;
            for (sum, by) in sums.iter_mut().zip(&by).take(row + 1) {
                *sum += weighted * *by;
            }
            moment[row] += weighted * off;
        }
        left += there * off * off;
    }
    let normal = SMatrix::from_fn(|row, column| sum(normal[row.max(column)][row.min(column)]));
    Equations { normal, right: SVector::from(moment.map(sum)), left: sum(left) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::locate::border::Border;

    const STRIPE: Split = Split {
        border: Border {
            edge: Edge { normal: Vector2::new(0.6, 0.8), distance: 1.3 },
            width: 2.1,
            corner: None,
            height: -34.0,
            misfit: 0.0,
        },
        level: 140.0,
        left: 0.0,
    };

    const PLATE: Split = Split {
        border: Border {
            width: ENDLESS_PX,
            corner: Some(Edge { normal: Vector2::new(-0.8, 0.6), distance: -0.7 }),
            ..STRIPE.border
        },
        ..STRIPE
    };

    /// The code that two grounds make at a place, when each of the unknowns is changed by so much.
    fn code(split: &Split, at: Vector2<f64>, by: &[f64]) -> f64 {
        let Border { edge, width, corner, height, .. } = split.border;
        let past =
            |edge: &Edge, by: &[f64]| (edge.normal + edge.along() * by[1]).normalize().dot(&at) - edge.distance - by[0];
        let share = |past: f64| 1.0 / (1.0 + (-STEEP * past).exp());
        let first = past(&edge, &by[3..]);
        let second = corner.map_or(1.0, |edge| share(past(&edge, &by[5..])));
        split.level + by[0] + (height + by[1]) * second * (share(first) - share(first - width - by[2]))
    }

    fn assert_equations<const N: usize>(split: &Split) {
        const STEP: f64 = 1e-4;
        for (x, y) in [(0.4, 1.1), (-1.2, 2.6), (3.1, 0.9), (2.0, 3.5)] {
            let at = Vector2::new(x, y);
            // Seven codes too high, which the weight knows.
            let value = code(split, at, &[0.0; N]) + 7.0;
            let octets = [Octet::of(&[Sample { x: single(x), y: single(y), value: single(value) }])];
            let weight = 1.0 / (1.0 + (7.0 / 6.0_f64.hypot(3.4)).powi(2));
            let slopes: [f64; N] = std::array::from_fn(|k| {
                let step = |step: f64| {
                    let by: [f64; N] = std::array::from_fn(|i| if i == k { step } else { 0.0 });
                    code(split, at, &by)
                };
                (step(STEP) - step(-STEP)) / (2.0 * STEP)
            });
            for level in [*MACHINE, fearless_simd::Level::baseline()] {
                let found: Equations<N> = dispatch!(level, simd => equations(simd, &octets, split, 2.0));
                assert!((found.left - 49.0).abs() < 0.01, "{}", found.left);
                for row in 0..N {
                    let expected = weight * slopes[row] * 7.0;
                    assert!((found.right[row] - expected).abs() < 2e-3 * (1.0 + expected.abs()), "{row} at {at:?}");
                    for column in 0..N {
                        let (sum, expected) = (found.normal[(row, column)], weight * slopes[row] * slopes[column]);
                        assert!((sum - expected).abs() < 2e-3 * (1.0 + expected.abs()), "{row}, {column} at {at:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn equations_are_those_of_differences_of_the_code_in_all_registers() {
        assert_equations::<STRAIGHT>(&STRIPE);
        assert_equations::<CORNER>(&PLATE);
    }
}
