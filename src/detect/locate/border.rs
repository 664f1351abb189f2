//! The border between two grounds: the edge of a wing, of a panel, of paint, that passes behind a marker or close by; the corner of a plate or
//! of a wing's tip; or a line.
//!
//! A disc that lies across it is higher over the one ground than over the other, and of all that spoils a rim this looks most like a disc that
//! lies elsewhere. Beyond the rim it is plain to see, and straight on it goes behind the disc.

mod placing;
mod search;

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use nalgebra::{Matrix3, Vector2, Vector3};

use super::ellipse::LOGISTIC;
use super::fit::MIN_NOISE;
use super::lanes::logistic_fall;
use crate::detect::ground::{Sample, shortest_third};
use crate::detect::single;
use placing::Placer;
use search::Searcher;

/// Where one ground ends.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Edge {
    /// Towards the other ground, of length one.
    normal: Vector2<f64>,
    /// How far along it from the patch's origin the edge lies, px.
    distance: f64,
}

/// A straight border, or two that meet. Beyond all of its edges lies another ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Border {
    edge: Edge,
    /// How wide the other ground is, px: a wide stretch, or a line.
    width: f64,
    /// The other edge of a corner.
    corner: Option<Edge>,
    /// How much higher the other ground's code is.
    pub height: f64,
    /// By how much the grounds are not what it makes of them, codes: there is another one.
    pub misfit: f64,
}

/// Samples are another ground's from so many deviations on; a line or a border is looked for where there are as many of them.
const OFF: f64 = 5.0;
const MIN_SAMPLES: usize = 6;

/// What it leaves of the squares about a level ground, at most, and of those about a slope. At first, where it is placed roughly and is as
/// sharp as none is, it may leave more.
const MAX_LEFT: f64 = 0.5;
const MAX_LEFT_AT_FIRST: f64 = 0.7;
const MAX_LEFT_OF_SLOPE: f64 = 0.75;

/// A border that leaves more than so many times the noise's squares may be a corner, which must leave so much less of them.
const STRAIGHT: f64 = 2.0;
const MAX_LEFT_OF_STRAIGHT: f64 = 0.6;

/// Deviation of the blur of a border, px, as lenses about as sharp as pixels have, and how steeply that rises, 1/px.
const BLUR_PX: f64 = 0.84;
const STEEP: f64 = LOGISTIC / BLUR_PX;

/// The most that is the width of a line, and what has no end, px.
const WIDEST_LINE_PX: f64 = 4.0;
const ENDLESS_PX: f64 = 1e4;

/// Two grounds on either side of a line.
#[derive(Clone, Copy)]
struct Split {
    border: Border,
    /// Code of the ground before it.
    level: f64,
    /// Sum of the squares about both.
    left: f64,
}

/// Finds borders, one after the other in the same memory.
#[derive(Default)]
pub(super) struct Finder {
    values: Vec<f32>,
    searcher: Searcher,
    placer: Placer,
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
        if self.values.iter().filter(is_off).count() < MIN_SAMPLES {
            return None;
        }
        let (level, slope) = squares(beyond)?;
        let split = self.searcher.best(beyond)?;
        let is_plain = |placed: &Split| placed.left < MAX_LEFT * level && placed.left < MAX_LEFT_OF_SLOPE * slope;
        let straight = (split.left < MAX_LEFT_AT_FIRST * level).then(|| self.placer.place(split, beyond, noise));
        let straight = straight.flatten().filter(is_plain);
        let by_noise = beyond.len() as f64 * noise * noise;
        let left = straight.map_or(level, |placed| placed.left);
        let corner = if left > STRAIGHT * by_noise { self.searcher.corner(&split) } else { None };
        let corner = corner.and_then(|split| self.placer.place(split, beyond, noise)).filter(is_plain);
        let Split { border, level, left } =
            corner.filter(|placed| placed.left < MAX_LEFT_OF_STRAIGHT * left).or(straight)?;
        let border = Border { misfit: ((left - by_noise).max(0.0) / beyond.len() as f64).sqrt(), ..border };
        (border.height.abs() > OFF * noise).then_some((border, level))
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
        let before = self.edge.before(x, y);
        let share = logistic_fall(before) - logistic_fall(before + single(self.width * STEEP));
        self.corner.map_or(share, |edge| share * logistic_fall(edge.before(x, y)))
    }
}

impl Edge {
    /// How far pixels lie before it, in units of its blur.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
    #[inline(always)]
    fn before<S: Simd>(&self, x: f32x8<S>, y: f32x8<S>) -> f32x8<S> {
        let [right, down, distance] = [self.normal.x, self.normal.y, self.distance].map(|of| single(of * STEEP));
        -(x * right + y * down) + distance
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
    fn past(at: &Vector2<f64>, normal: &Vector2<f64>, distance: f64) -> f64 {
        // Of the square of a pixel and a lens, by rays.
        let rays = (-8..=8).map(|step| f64::from(step) / 4.0);
        let lens = |off: f64| (-off * off / (2.0 * BLUR_PX * BLUR_PX)).exp();
        let way = normal.dot(at) - distance;
        let (sum, all) = rays
            .fold((0.0, 0.0), |(sum, all), off| (sum + if way + off > 0.0 { lens(off) } else { 0.0 }, all + lens(off)));
        sum / all
    }

    #[test]
    fn a_border_is_found_where_it_is_on_either_side_of_the_middle() {
        for (turn, distance) in [(0.3, 2.0), (1.9, 1.1), (4.4, 4.1), (5.9, -1.4)] {
            let normal = Vector2::new(f64::cos(turn), f64::sin(turn));
            let samples = ring(|at| 150.0 - 32.0 * past(&at, &normal, distance));
            let (found, ground) = Finder::default().find(&samples, 0.0).unwrap_or_else(|| panic!("{turn}: no border"));
            // The other ground is the one of which there is less.
            let is_turned = found.height > 0.0;
            let sign = if is_turned { -1.0 } else { 1.0 };
            assert!(is_turned == (distance < 0.0), "{found:?}");
            assert!((found.edge.normal * sign - normal).norm() < 0.03, "{turn}: {found:?}");
            assert!((found.edge.distance * sign - distance).abs() < 0.15, "{turn}: {found:?}");
            assert!((found.height.abs() - 32.0).abs() < 0.7, "{turn}: {found:?}");
            assert!((ground - if is_turned { 118.0 } else { 150.0 }).abs() < 0.5, "{turn}: {ground}");
        }
    }

    #[test]
    fn a_corner_is_found_wherever_it_points_or_it_is_told_that_there_is_something() {
        let mut missed = 0;
        for turn in 0..24 {
            let turn = 0.27 * f64::from(turn);
            // Where its tip lies behind the disc it is told by the ends of its edges alone.
            for (opening, distances, most) in [(1.6, [4.0, 5.0], 3.0), (1.1, [2.0, 6.5], 3.0), (1.5, [-1.0, 2.0], 9.0)]
            {
                let normals =
                    [turn, turn + std::f64::consts::PI - opening].map(|a| Vector2::new(f64::cos(a), f64::sin(a)));
                let edges = [0, 1].map(|k| Edge { normal: normals[k], distance: -distances[k] });
                let plate =
                    |at: &Vector2<f64>| edges.iter().map(|edge| past(at, &edge.normal, edge.distance)).product::<f64>();
                let samples = ring(|at| 150.0 - 32.0 * plate(&at));
                let (found, level) =
                    Finder::default().find(&samples, 0.0).unwrap_or_else(|| panic!("{turn} {opening}: none"));
                if found.corner.is_none() {
                    missed += 1;
                    assert!(found.misfit > 0.5, "{turn} {opening}: {found:?}");
                    continue;
                }
                assert!(found.misfit < 1.5, "{turn} {opening}: {found:?}");
                // Behind the disc, where no sample is.
                let behind = (-7..=7).flat_map(|y| (-7..=7).map(move |x| Vector2::new(f64::from(x), f64::from(y))));
                let behind: Vec<Vector2<f64>> = behind.filter(|at| at.norm() < 6.5).collect();
                let off = |at: &Vector2<f64>| {
                    let [x, y] = [at.x, at.y].map(|of| Lanes([single(of); LANES]));
                    let share = dispatch!(*MACHINE, simd => found.share(x.load(simd), y.load(simd))[0]);
                    (level + found.height * f64::from(share) - 150.0 + 32.0 * plate(at)).powi(2)
                };
                let rms = (behind.iter().map(off).sum::<f64>() / behind.len() as f64).sqrt();
                assert!(rms < most, "{turn} {opening}: {rms} codes, {found:?} of {edges:?}");
            }
        }
        assert!(missed < 6, "{missed} of 72");
    }

    #[test]
    fn that_there_is_another_thing_than_a_border_is_told() {
        let misfit = |height: f64| {
            let thing = |at: Vector2<f64>| (-(at - Vector2::new(-4.0, 7.5)).norm_squared() / 4.0).exp();
            let code = |at: Vector2<f64>| 150.0 + 32.0 * past(&at, &Vector2::new(1.0, 0.0), 3.0) + height * thing(at);
            Finder::default().find(&ring(code), 0.0).expect("a border").0.misfit
        };
        let (nothing, thing) = (misfit(0.0), misfit(20.0));
        assert!(nothing < 0.5 && (1.0..10.0).contains(&thing), "{nothing} {thing}");
    }

    #[test]
    fn a_line_is_found_behind_a_disc_and_along_its_rim() {
        for (turn, distance) in [(0.3, 0.5), (1.9, 4.0), (2.8, 6.5)] {
            let normal = Vector2::new(f64::cos(turn), f64::sin(turn));
            let line = |at: &Vector2<f64>| past(at, &normal, distance) - past(at, &normal, distance + 1.4);
            let (found, ground) = Finder::default().find(&ring(|at| 150.0 - 40.0 * line(&at)), 0.0).expect("a line");
            // The same line from either side.
            let sign = found.edge.normal.dot(&normal).signum();
            assert!((found.edge.normal * sign - normal).norm() < 0.05, "{turn}: {found:?}");
            let middle = sign * (found.edge.distance + 0.5 * found.width);
            assert!((middle - distance - 0.7).abs() < 0.2, "{turn}: {found:?}");
            // How wide a thin line is and how dark can hardly be told apart; their product can.
            assert!((found.height * found.width + 40.0 * 1.4).abs() < 9.0, "{turn}: {found:?}");
            assert!((ground - 150.0).abs() < 0.7, "{turn}: {ground}");
        }
    }

    #[test]
    fn what_is_no_border_is_none() {
        let find = |value: &dyn Fn(Vector2<f64>) -> f64| Finder::default().find(&ring(value), 0.0);
        assert_eq!(find(&|_| 120.0), None, "level");
        assert_eq!(find(&|at| 120.0 + 3.0 * at.x), None, "a slope");
        assert_eq!(find(&|at| 120.0 + 30.0 * (0.9 * at.x).sin() * (0.9 * at.y).cos()), None, "leaves");
        assert_eq!(Finder::default().find(&[], 0.0), None);
        let few = &ring(|at| if at.x > 0.0 { 80.0 } else { 120.0 })[..12];
        assert_eq!(Finder::default().find(few, 0.0), None, "{few:?}");
    }

    #[test]
    fn shares_are_those_that_it_was_placed_with() {
        let edge = Edge { normal: Vector2::new(0.6, 0.8), distance: 1.5 };
        let border = Border { edge, width: 3.0, corner: None, height: 20.0, misfit: 0.0 };
        let xs: [f32; LANES] = std::array::from_fn(|lane| lane as f32 - 3.0);
        let found: [f32; LANES] =
            dispatch!(*MACHINE, simd => *border.share(Lanes(xs).load(simd), Lanes([2.0; LANES]).load(simd)));
        for (x, found) in xs.into_iter().zip(found) {
            let at = Vector2::new(f64::from(x), 2.0);
            let expected = past(&at, &edge.normal, 1.5) - past(&at, &edge.normal, 4.5);
            assert!((f64::from(found) - expected).abs() < 0.06, "{x}: {found} {expected}");
        }
    }
}
