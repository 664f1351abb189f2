//! Where a border is exactly, by Gauss and Newton; what lies on either ground beside it counts less the farther off it is.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x8};
use nalgebra::{Matrix5, Vector2, Vector5};

use super::{ENDLESS_PX, STEEP, Split, WIDEST_LINE_PX};
use crate::detect::ground::Sample;
use crate::detect::locate::lanes::{LANES, logistic_fall, sum};
use crate::detect::locate::patch::Octet;
use crate::detect::{MACHINE, single};

/// How wide a line is: what is expected, with a deviation of 1 px, and the least, px.
const LINE_PX: f64 = 1.5;
const LEAST_LINE_PX: f64 = 0.5;

/// Rounds at most, the longest move and turn in each, and the move and turn that end them.
const ROUNDS: usize = 6;
const MAX_MOVE_PX: f64 = 0.7;
const MAX_TURN_RAD: f64 = 0.1;
const SETTLED_PX: f64 = 0.01;
const SETTLED_RAD: f64 = 1e-3;

/// What is searched for: the level, the height, the distance, the turn and the width.
const UNKNOWNS: usize = 5;

/// Places borders, one after the other in the same memory.
#[derive(Default)]
pub(super) struct Placer {
    octets: Vec<Octet>,
}

/// Normal equations of a step.
struct Equations {
    normal: Matrix5<f64>,
    right: Vector5<f64>,
    /// Sum of the squares of what is left.
    left: f64,
}

impl Placer {
    /// `noise` is that of the samples. `None` where they do not tell.
    pub(super) fn place(&mut self, mut split: Split, samples: &[Sample], noise: f64) -> Option<Split> {
        self.octets.clear();
        self.octets.extend(samples.chunks(LANES).map(Octet::of));
        for _ in 0..ROUNDS {
            let is_line = split.border.width < ENDLESS_PX;
            let Equations { mut normal, mut right, left } =
                dispatch!(*MACHINE, simd => equations(simd, &self.octets, &split, noise));
            normal += Matrix5::identity() * 1e-9;
            if is_line {
                normal.m55 += noise * noise;
                right[4] += noise * noise * (LINE_PX - split.border.width);
            }
            split.left = left;
            let step = normal.cholesky()?.solve(&right);
            let across = across(&split.border.normal);
            split.level += step[0];
            split.border.height += step[1];
            split.border.distance += step[2].clamp(-MAX_MOVE_PX, MAX_MOVE_PX);
            let turn = step[3].clamp(-MAX_TURN_RAD, MAX_TURN_RAD);
            split.border.normal = (split.border.normal + across * turn).normalize();
            if is_line {
                split.border.width = (split.border.width + step[4]).clamp(LEAST_LINE_PX, WIDEST_LINE_PX);
            }
            if step[2].abs().max(step[4].abs()) < SETTLED_PX && step[3].abs() < SETTLED_RAD {
                break;
            }
        }
        Some(split)
    }
}

/// Along the border.
fn across(normal: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-normal.y, normal.x)
}

#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn equations<S: Simd>(simd: S, octets: &[Octet], split: &Split, noise: f64) -> Equations {
    let border = &split.border;
    let across = across(&border.normal);
    let [level, height, steep, width] = [split.level, border.height, STEEP, border.width].map(single);
    let [right, down, distance] = [border.normal.x, border.normal.y, border.distance].map(single);
    let [along_x, along_y] = [across.x, across.y].map(single);
    let per_scale = single((3.0 * noise).hypot(0.1 * border.height).recip());
    let [zero, one] = [0.0, 1.0].map(|value| f32x8::splat(simd, value));
    // The lower triangle, row by row.
    let mut normal = [[zero; UNKNOWNS]; UNKNOWNS];
    let mut moment = [zero; UNKNOWNS];
    let mut left = zero;
    for octet in octets {
        let [x, y, value, there] = [&octet.x, &octet.y, &octet.value, &octet.there].map(|lanes| lanes.load(simd));
        let past = x * right + y * down - distance;
        let from = logistic_fall(past * -steep);
        let to = logistic_fall((past - width) * -steep);
        let begin = (from - from * from) * (height * steep);
        let end = (to - to * to) * (height * steep);
        let off = value - level - (from - to) * height;
        let by = [one, from - to, end - begin, (begin - end) * (x * along_x + y * along_y), end];
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
    let normal = Matrix5::from_fn(|row, column| sum(normal[row.max(column)][row.min(column)]));
    Equations { normal, right: Vector5::from(moment.map(sum)), left: sum(left) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::locate::border::Border;

    const SPLIT: Split = Split {
        border: Border { normal: Vector2::new(0.6, 0.8), distance: 1.3, width: 2.1, height: -34.0 },
        level: 140.0,
        left: 0.0,
    };

    /// The code that two grounds make at a place, when each of the unknowns is changed by so much.
    fn code(at: Vector2<f64>, by: &[f64; UNKNOWNS]) -> f64 {
        let Border { normal, distance, width, height } = SPLIT.border;
        let normal = (normal + across(&normal) * by[3]).normalize();
        let past = normal.dot(&at) - distance - by[2];
        let share = |past: f64| 1.0 / (1.0 + (-STEEP * past).exp());
        SPLIT.level + by[0] + (height + by[1]) * (share(past) - share(past - width - by[4]))
    }

    #[test]
    fn equations_are_those_of_differences_of_the_code_in_all_registers() {
        const STEP: f64 = 1e-4;
        for (x, y) in [(0.4, 1.1), (-1.2, 2.6), (3.1, 0.9), (2.0, 3.5)] {
            let at = Vector2::new(x, y);
            // Seven codes too high, which the weight knows.
            let value = code(at, &[0.0; UNKNOWNS]) + 7.0;
            let octets = [Octet::of(&[Sample { x: single(x), y: single(y), value: single(value) }])];
            let weight = 1.0 / (1.0 + (7.0 / 6.0_f64.hypot(3.4)).powi(2));
            let slopes: [f64; UNKNOWNS] = std::array::from_fn(|k| {
                let step = |step: f64| code(at, &std::array::from_fn(|i| if i == k { step } else { 0.0 }));
                (step(STEP) - step(-STEP)) / (2.0 * STEP)
            });
            for level in [*MACHINE, fearless_simd::Level::baseline()] {
                let found = dispatch!(level, simd => equations(simd, &octets, &SPLIT, 2.0));
                assert!((found.left - 49.0).abs() < 0.01, "{}", found.left);
                for row in 0..UNKNOWNS {
                    let expected = weight * slopes[row] * 7.0;
                    assert!((found.right[row] - expected).abs() < 2e-3 * (1.0 + expected.abs()), "{row} at {at:?}");
                    for column in 0..UNKNOWNS {
                        let (sum, expected) = (found.normal[(row, column)], weight * slopes[row] * slopes[column]);
                        assert!((sum - expected).abs() < 2e-3 * (1.0 + expected.abs()), "{row}, {column} at {at:?}");
                    }
                }
            }
        }
    }
}
