//! The border between two grounds: the edge of a wing, of a panel, of paint, that passes behind a marker or close by.
//!
//! A disc that lies across it is higher over the one ground than over the other, and of all that spoils a rim this looks most like a disc that
//! lies elsewhere. Beyond the rim it is plain to see, and straight on it goes behind the disc.

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use nalgebra::{Matrix3, Matrix4, Vector2, Vector3, Vector4};

use super::ellipse::LOGISTIC;
use super::fit::MIN_NOISE;
use super::lanes::logistic_fall;
use crate::detect::ground::{Sample, shortest_third};
use crate::detect::single;

/// A straight border.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Border {
    /// Towards the other ground, of length one.
    normal: Vector2<f64>,
    /// How far along it from the patch's origin the border lies, px.
    distance: f64,
    /// How much higher the other ground's code is.
    pub height: f64,
}

/// A border is looked for where this part of the samples, and as many at least, are so many deviations off the ground.
const MIN_PART: f64 = 0.12;
const MIN_SAMPLES: usize = 8;
const OFF: f64 = 5.0;

/// Directions that are tried, over half a turn, and samples that are looked at, at most.
const DIRECTIONS: usize = 24;
const MAX_SAMPLES: usize = 240;

/// What two level grounds leave of the squares about one level, at most, and of those about a slope.
const MAX_LEFT: f64 = 0.5;
const MAX_LEFT_OF_SLOPE: f64 = 0.75;

/// How steeply it rises, 1/px: through a blur of this deviation, px, as lenses about as sharp as pixels have.
const BLUR_PX: f64 = 0.84;
const STEEP: f64 = LOGISTIC / BLUR_PX;

/// Rounds by which it is placed, and the longest move in each, px.
const ROUNDS: usize = 5;
const MAX_MOVE_PX: f64 = 0.7;

/// Finds borders, one after the other in the same memory.
#[derive(Default)]
pub(super) struct Finder {
    values: Vec<f32>,
    samples: Vec<Sample>,
    /// Of each sample, how far along a direction it lies, and its value.
    along: Vec<(f32, f32)>,
}

/// Two grounds on either side of a line.
#[derive(Clone, Copy)]
struct Split {
    normal: Vector2<f64>,
    distance: f64,
    /// Means before and beyond it, and whether most of the samples are beyond.
    means: [f64; 2],
    is_turned: bool,
    /// Sum of the squares about them.
    left: f64,
}

impl Finder {
    /// The border that parts the samples beyond a rim, and the code of the ground of which there is more. `coding_noise` is theirs at least.
    /// `None` where there is no border, or none that is plain.
    pub(super) fn find(&mut self, beyond: &[Sample], coding_noise: f64) -> Option<(Border, f64)> {
        self.values.clear();
        self.values.extend(beyond.iter().map(|sample| sample.value));
        let (ground, noise) = shortest_third(&mut self.values)?;
        let (ground, noise) = (f64::from(ground), f64::from(noise).max(MIN_NOISE).hypot(coding_noise));
        let is_off = |value: &&f32| (f64::from(**value) - ground).abs() > OFF * noise;
        let off = self.values.iter().filter(is_off).count();
        if off < MIN_SAMPLES || (off as f64) < MIN_PART * beyond.len() as f64 {
            return None;
        }
        self.samples.clear();
        self.samples.extend(beyond.iter().step_by(beyond.len().div_ceil(MAX_SAMPLES)));
        let splits = (0..DIRECTIONS).filter_map(|index| self.split(index));
        let split = splits.min_by(|a, b| a.left.total_cmp(&b.left))?;
        let (level, slope) = squares(&self.samples)?;
        if split.left > MAX_LEFT * level || split.left > MAX_LEFT_OF_SLOPE * slope {
            return None;
        }
        let (border, ground) = split.placed(&self.samples, noise)?;
        (border.height.abs() > OFF * noise).then_some((border, ground))
    }

    /// The best split of the samples across a direction.
    fn split(&mut self, index: usize) -> Option<Split> {
        let (sine, cosine) = (std::f64::consts::PI * index as f64 / DIRECTIONS as f64).sin_cos();
        let [right, down] = [cosine, sine].map(single);
        let Self { samples, along, .. } = self;
        along.clear();
        along.extend(samples.iter().map(|sample| (sample.x * right + sample.y * down, sample.value)));
        along.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let count = along.len() as f64;
        let (sum, squares) = along.iter().fold((0.0, 0.0), |(sum, squares), (_, value)| {
            let value = f64::from(*value);
            (sum + value, squares + value * value)
        });
        let mut before = 0.0;
        let mut best: Option<Split> = None;
        for (k, pair) in along.windows(2).enumerate() {
            before += f64::from(pair[0].1);
            let (n, beyond) = ((k + 1) as f64, sum - before);
            if k + 1 < MIN_SAMPLES || along.len() - k - 1 < MIN_SAMPLES {
                continue;
            }
            let left = squares - before * before / n - beyond * beyond / (count - n);
            if best.is_none_or(|best| left < best.left) {
                best = Some(Split {
                    normal: Vector2::new(cosine, sine),
                    distance: 0.5 * f64::from(pair[0].0 + pair[1].0),
                    means: [before / n, beyond / (count - n)],
                    is_turned: 2 * (k + 1) < along.len(),
                    left,
                });
            }
        }
        best
    }
}

impl Split {
    /// The border where it is exactly, by Gauss and Newton; what lies on either ground beside it counts less the farther off it is.
    fn placed(&self, samples: &[Sample], noise: f64) -> Option<(Border, f64)> {
        let [before, beyond] = self.means;
        let (near, other, sign) = if self.is_turned { (beyond, before, -1.0) } else { (before, beyond, 1.0) };
        let mut level = near;
        let mut border = Border { normal: self.normal * sign, distance: self.distance * sign, height: other - near };
        for _ in 0..ROUNDS {
            let across = Vector2::new(-border.normal.y, border.normal.x);
            let scale = (3.0 * noise).hypot(0.1 * border.height);
            let (mut normal, mut right) = (Matrix4::identity() * 1e-9, Vector4::zeros());
            for sample in samples {
                let at = Vector2::new(f64::from(sample.x), f64::from(sample.y));
                let share = 1.0 / (1.0 + (STEEP * (border.distance - border.normal.dot(&at))).exp());
                let steep = border.height * STEEP * share * (1.0 - share);
                let off = f64::from(sample.value) - level - border.height * share;
                let by = Vector4::new(1.0, share, -steep, steep * across.dot(&at));
                let weight = 1.0 / (1.0 + (off / scale).powi(2));
                normal += by * by.transpose() * weight;
                right += by * (weight * off);
            }
            let step = normal.cholesky()?.solve(&right);
            level += step.x;
            border.height += step.y;
            border.distance += step.z.clamp(-MAX_MOVE_PX, MAX_MOVE_PX);
            border.normal = (border.normal + across * step.w.clamp(-0.1, 0.1)).normalize();
        }
        Some((border, level))
    }
}

/// Sums of the squares of samples about their mean, and about a slope.
fn squares(samples: &[Sample]) -> Option<(f64, f64)> {
    let mean = samples.iter().map(|sample| f64::from(sample.value)).sum::<f64>() / samples.len() as f64;
    let (mut normal, mut right, mut level) = (Matrix3::identity() * 1e-9, Vector3::zeros(), 0.0);
    for sample in samples {
        let at = Vector3::new(f64::from(sample.x), f64::from(sample.y), 1.0);
        let off = f64::from(sample.value) - mean;
        normal += at * at.transpose();
        right += at * off;
        level += off * off;
    }
    Some((level, level - normal.cholesky()?.solve(&right).dot(&right)))
}

impl Border {
    /// The share of pixels that lies on the other ground.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
    #[inline(always)]
    pub(super) fn share<S: Simd>(&self, x: f32x8<S>, y: f32x8<S>) -> f32x8<S> {
        let [right, down, far] = [self.normal.x * STEEP, self.normal.y * STEEP, self.distance * STEEP].map(single);
        logistic_fall(-(x * right + y * down) + far)
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::dispatch;

    use super::super::lanes::{LANES, Lanes};
    use super::*;
    use crate::detect::MACHINE;

    /// What is around a disc of radius 6 px, from 1.5 to 3.5 px beyond its rim, with ripples of half a code.
    fn ring(value: impl Fn(Vector2<f64>) -> f64) -> Vec<Sample> {
        let all = (-10..=10).flat_map(|y| (-10..=10).map(move |x| Vector2::new(f64::from(x), f64::from(y))));
        let beyond = all.filter(|at| (7.5..9.5).contains(&at.norm()));
        let ripple = |at: &Vector2<f64>| if (at.x + 2.0 * at.y).rem_euclid(3.0) < 1.0 { 0.5 } else { -0.25 };
        beyond.map(|at| Sample { x: single(at.x), y: single(at.y), value: single(value(at) + ripple(&at)) }).collect()
    }

    /// What of a pixel is beyond a line, through a blur.
    fn beyond(at: &Vector2<f64>, normal: &Vector2<f64>, distance: f64) -> f64 {
        // Of the square of a pixel and a lens, by rays.
        let rays = (-8..=8).map(|step| f64::from(step) / 4.0);
        let lens = |off: f64| (-off * off / (2.0 * BLUR_PX * BLUR_PX)).exp();
        let past = normal.dot(at) - distance;
        let (sum, all) = rays.fold((0.0, 0.0), |(sum, all), off| {
            (sum + if past + off > 0.0 { lens(off) } else { 0.0 }, all + lens(off))
        });
        sum / all
    }

    #[test]
    fn a_border_is_found_where_it_is_on_either_side_of_the_middle() {
        for (turn, distance) in [(0.3, 2.0), (1.9, 1.1), (4.4, 4.1), (5.9, -1.4)] {
            let normal = Vector2::new(f64::cos(turn), f64::sin(turn));
            let samples = ring(|at| 150.0 - 32.0 * beyond(&at, &normal, distance));
            let (found, ground) = Finder::default().find(&samples, 0.0).unwrap_or_else(|| panic!("{turn}: no border"));
            // The other ground is the one of which there is less.
            let is_turned = found.height > 0.0;
            let sign = if is_turned { -1.0 } else { 1.0 };
            assert!(is_turned == (distance < 0.0), "{found:?}");
            assert!((found.normal * sign - normal).norm() < 0.03, "{turn}: {found:?}");
            assert!((found.distance * sign - distance).abs() < 0.15, "{turn}: {found:?}");
            assert!((found.height.abs() - 32.0).abs() < 0.7, "{turn}: {found:?}");
            assert!((ground - if is_turned { 118.0 } else { 150.0 }).abs() < 0.5, "{turn}: {ground}");
        }
    }

    #[test]
    fn what_is_no_border_is_none() {
        let find = |value: &dyn Fn(Vector2<f64>) -> f64| Finder::default().find(&ring(value), 0.0);
        assert_eq!(find(&|_| 120.0), None, "level");
        assert_eq!(find(&|at| 120.0 + 3.0 * at.x), None, "a slope");
        assert_eq!(find(&|at| if at.y.abs() < 1.0 { 80.0 } else { 120.0 }), None, "a line across");
        assert_eq!(find(&|at| 120.0 + 30.0 * (0.9 * at.x).sin() * (0.9 * at.y).cos()), None, "leaves");
        assert_eq!(Finder::default().find(&[], 0.0), None);
        let few = &ring(|at| if at.x > 0.0 { 80.0 } else { 120.0 })[..12];
        assert_eq!(Finder::default().find(few, 0.0), None, "{few:?}");
    }

    #[test]
    fn shares_are_those_that_it_was_placed_with() {
        let border = Border { normal: Vector2::new(0.6, 0.8), distance: 1.5, height: 20.0 };
        let xs: [f32; LANES] = std::array::from_fn(|lane| lane as f32 - 3.0);
        let found: [f32; LANES] =
            dispatch!(*MACHINE, simd => *border.share(Lanes(xs).load(simd), Lanes([2.0; LANES]).load(simd)));
        for (x, found) in xs.into_iter().zip(found) {
            let expected = beyond(&Vector2::new(f64::from(x), 2.0), &border.normal, border.distance);
            assert!((f64::from(found) - expected).abs() < 0.06, "{x}: {found} {expected}");
        }
    }
}
