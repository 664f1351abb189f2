//! Where exactly two edges cross: a blurred corner of four fields, fitted to the light about it.
//!
//! Four fields are the same turned by half a turn about their corner, whatever a gamma or an exposure does to black and white. The
//! model has that symmetry, so that none of these moves its corner. Bent edges have it not: how much a lens bends them is told by all
//! corners of the board.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use super::super::sampling;
use super::plane::Plane;
use crate::camera::Pixel;

/// Where a fit begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    pub place: Pixel,
    /// Directions and lengths of the tag's sides at the corner, px: to the right and down, as columns.
    pub axes: Matrix2<f64>,
    /// How the edges along the two axes bend, 1/px; positive to the right of where the axis points, as one sees the picture.
    pub bends_per_px: [f64; 2],
    /// The fields go as far as this, sides.
    pub reach: f64,
    /// Whether the field between the two axes is black.
    pub is_black: bool,
    /// White less black, roughly.
    pub contrast: f64,
}

/// Half width of the window at most, px.
const MAX_HALF_PX: f64 = 9.0;

/// What is left between the window and the next fields, px: their blur.
const MARGIN_PX: f64 = 1.2;

/// Least half width of a window, px.
const MIN_HALF_PX: f64 = 1.6;

/// Most steps, and the one that ends them, px.
const MAX_STEPS: usize = 15;
const SETTLED_PX: f64 = 1e-3;

/// The corner lies no further from where it was first seen, px.
const MAX_MOVE_PX: f64 = 1.5;

/// A corner whose fit leaves over more than this share of its contrast is covered or none.
const MAX_NOISE: f64 = 0.15;

/// The picture's codes are whole numbers: the deviation of their rounding, and about that of the light that they tell.
const ROUNDING: f64 = 0.29;

/// Blur, px: the pixel's own, and more than any corner stands.
const BLURS_PX: [f64; 2] = [0.25, 6.0];

/// Parameters: u, v, two angles, the blur's logarithm, mean, contrast, its square's share, and the light's slope.
const COUNT: usize = 10;

type Row = SVector<f64, COUNT>;
type Square = SMatrix<f64, COUNT, COUNT>;

/// A corner.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub place: Pixel,
    /// How the corner moves with the light of each pixel of the window; and what the fit leaves over there.
    window: Vec<Pull>,
    /// Columns of the window's box, by which neighbours are found.
    columns: usize,
    /// Deviation of what the fit leaves over, of a white of 255.
    noise: f64,
    contrast: f64,
    /// By how much what is between black and white is lighter than their mean, shares of half the contrast.
    pub curve: f64,
    /// Part of what is left over that moves the corner, and variance per axis that sampling adds, px^2.
    moving_share: f64,
    sampled_px2: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Pull {
    /// Whether the pixel is of the window.
    is_in: bool,
    by: Vector2<f64>,
    left: f64,
    /// Its row of a root of the hat matrix: by the product of two, what the fit takes from noise makes their residuals unlike.
    lean: Row,
}

/// The corner near `start`; `None` where there is none or the picture ends.
pub(super) fn fit(raw: &Plane, start: &Start) -> Option<Fit> {
    let window = Window::of(raw, start)?;
    let angle = |axis: usize| start.axes[(1, axis)].atan2(start.axes[(0, axis)]);
    let sign = if start.is_black { -0.5 } else { 0.5 };
    let mut at = Row::zeros();
    (at[2], at[3], at[4]) = (angle(0), angle(1), 0.9_f64.ln());
    (at[5], at[6]) = (window.mean(), sign * start.contrast);
    // The edge along the first axis has its positive side where the second axis points, and the other the first.
    let turn = start.axes.determinant().signum();
    let edges = Edges { turn, bends_per_px: start.bends_per_px };
    let mut damping = 1e-3;
    let mut sums = window.sums(&at, &edges);
    let mut settled = false;
    for _ in 0..MAX_STEPS {
        let mut normal = sums.normal;
        for k in 0..COUNT {
            normal[(k, k)] *= 1.0 + damping;
            normal[(k, k)] += 1e-12;
        }
        let step = normal.cholesky()?.solve(&sums.right);
        let mut next = at + step;
        next[4] = next[4].clamp(BLURS_PX[0].ln(), BLURS_PX[1].ln());
        let tried = window.sums(&next, &edges);
        if tried.squares <= sums.squares {
            (at, sums) = (next, tried);
            damping *= 0.1;
            if step[0].hypot(step[1]) < SETTLED_PX {
                settled = true;
                break;
            }
        } else {
            damping = (damping * 10.0_f64).max(1e-4);
            if damping > 1e6 {
                settled = true;
                break;
            }
        }
        let moved = at[0].hypot(at[1]);
        // Also false for NaN.
        if !(moved <= MAX_MOVE_PX) {
            return None;
        }
    }
    let contrast = 2.0 * at[6] * sign.signum();
    let free = window.count() as f64 - COUNT as f64;
    let noise = (sums.squares / free).sqrt().max(ROUNDING);
    if !(settled && at[0].hypot(at[1]) <= MAX_MOVE_PX && contrast > 0.0 && noise < MAX_NOISE * contrast) {
        return None;
    }
    let inverse = sums.normal.try_inverse()?;
    let root = inverse.cholesky()?.l().transpose();
    let gain = inverse.fixed_view::<2, COUNT>(0, 0).into_owned();
    let pulls = window.pixels.iter().map(|pixel| match pixel {
        Some((offset, value)) => {
            let (model, by) = model(&at, &edges, offset);
            Pull { is_in: true, by: gain * by, left: value - model, lean: root * by }
        }
        None => Pull::default(),
    });
    Some(Fit {
        place: start.place + at.fixed_rows::<2>(0),
        window: pulls.collect(),
        columns: window.columns,
        noise,
        contrast,
        curve: -2.0 * at[7] / contrast,
        moving_share: sampling::moving_share(at[4].exp()),
        sampled_px2: sampling::variance_px2(window.drifts_px, at[4].exp()),
    })
}

impl Fit {
    /// Deviation of what the fit leaves over, as a share of the contrast.
    pub(super) fn noise_ratio(&self) -> f64 {
        self.noise / self.contrast
    }

    /// Standard deviation per axis, px, with noise that is as like from pixel to pixel as it is in this picture.
    pub(super) fn sigma_px(&self, likeness: &Likeness) -> f64 {
        let mut variance = 0.0;
        for ([right, down], share) in likeness.pairs() {
            let sum: f64 = self.pairs(right, down.unsigned_abs()).map(|(a, b)| a.by.dot(&b.by)).sum();
            let both = if [right, down] == [0, 0] { 1.0 } else { 2.0 };
            variance += both * share * sum;
        }
        // Both axes; noise that is like over larger distances than are looked at must not make it nothing.
        let alone: f64 = self.pairs(0, 0).map(|(a, _)| a.by.norm_squared()).sum();
        let of_fit = self.moving_share * self.noise * self.noise * 0.5 * variance.max(0.5 * alone);
        (of_fit + self.sampled_px2).sqrt()
    }

    /// Pixels of the window that lie so far apart.
    fn pairs(&self, right: isize, down: usize) -> impl Iterator<Item = (&Pull, &Pull)> {
        let columns = self.columns;
        self.window.iter().enumerate().filter(|(_, pull)| pull.is_in).filter_map(move |(index, pull)| {
            let column = (index % columns).checked_add_signed(right).filter(|column| *column < columns)?;
            let other = self.window.get((index / columns + down) * columns + column).filter(|other| other.is_in)?;
            Some((pull, other))
        })
    }
}

/// How like the noise of two pixels is, by how far they lie apart: a mosaic's colours are filled in from neighbours.
pub(super) struct Likeness {
    shares: Vec<([isize; 2], f64)>,
}

/// Noise is compared over so many pixels each way.
const LIKE_PX: isize = 2;

impl Likeness {
    pub(super) fn of<'a>(fits: &(impl Iterator<Item = &'a Fit> + Clone)) -> Self {
        let half = |[right, down]: &[isize; 2]| *down > 0 || *right >= 0;
        let all = (0..=LIKE_PX).flat_map(|down| (-LIKE_PX..=LIKE_PX).map(move |right| [right, down]));
        // How alike what is left over is, and how unlike a fit makes noise that is neither, on average.
        let mean = |[right, down]: [isize; 2]| {
            let products = fits.clone().flat_map(|fit| {
                let scale = fit.noise * fit.noise;
                let product = move |(a, b): (&Pull, &Pull)| [a.left * b.left / scale, a.lean.dot(&b.lean)];
                fit.pairs(right, down.unsigned_abs()).map(product)
            });
            let add =
                |(sum, count): ([f64; 2], f64), [like, taken]: [f64; 2]| ([sum[0] + like, sum[1] + taken], count + 1.0);
            let (sum, count) = products.fold(([0.0; 2], 0.0), add);
            sum.map(|sum| if count > 0.0 { sum / count } else { 0.0 })
        };
        let [alone, _] = mean([0, 0]);
        let share = |way: [isize; 2]| match mean(way) {
            _ if way == [0, 0] => 1.0,
            [like, taken] if like < 0.0 => (like + taken).min(0.0) / alone,
            [like, _] => like / alone,
        };
        let shares = all.filter(half).map(|way| (way, if alone > 0.0 { share(way) } else { 0.0 }));
        Self { shares: shares.collect() }
    }

    fn pairs(&self) -> impl Iterator<Item = ([isize; 2], f64)> {
        self.shares.iter().copied()
    }
}

/// What is known of the two edges.
struct Edges {
    /// 1 where the second axis is to the right of the first, as one sees the picture, -1 where it is to the left.
    turn: f64,
    bends_per_px: [f64; 2],
}

/// The light at an offset from the start, and its derivatives.
fn model(at: &Row, edges: &Edges, offset: &Vector2<f64>) -> (f64, Row) {
    let from = offset - at.fixed_rows::<2>(0);
    let blur = at[4].exp();
    let scale = 1.0 / (std::f64::consts::SQRT_2 * blur);
    let edge = |angle: f64, side: f64, bend_per_px: f64| {
        let (sin, cos) = angle.sin_cos();
        let (normal, along) = (Vector2::new(-sin, cos), Vector2::new(cos, sin));
        let (off, way) = (normal.dot(&from), along.dot(&from));
        // From the parabola that the edge is nearby.
        let distance = side * (off - 0.5 * bend_per_px * way * way);
        let across = (normal - along * (bend_per_px * way)) * side;
        // With the angle the normal turns against the direction.
        let by_angle = -side * way * (1.0 + bend_per_px * off);
        let (value, slope) = step(distance * scale);
        (value, slope * scale, distance, across, by_angle)
    };
    let (first, first_slope, first_distance, first_across, first_by_angle) =
        edge(at[2], edges.turn, edges.bends_per_px[0]);
    let (second, second_slope, second_distance, second_across, second_by_angle) =
        edge(at[3], -edges.turn, edges.bends_per_px[1]);
    let product = first * second;
    let gain = at[6] + 2.0 * at[7] * product;
    let (by_first, by_second) = (gain * second * first_slope, gain * first * second_slope);
    let by_place = -(first_across * by_first + second_across * by_second);
    let value = at[5] + at[6] * product + at[7] * product * product + at[8] * offset.x + at[9] * offset.y;
    let by = Row::from([
        by_place.x,
        by_place.y,
        by_first * first_by_angle,
        by_second * second_by_angle,
        -(by_first * first_distance + by_second * second_distance),
        1.0,
        product,
        product * product,
        offset.x,
        offset.y,
    ]);
    (value, by)
}

/// The error function with its slope (Abramowitz and Stegun 7.1.26, within 1.5e-7).
fn step(x: f64) -> (f64, f64) {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let series =
        ((((1.061_405_429 * t - 1.453_152_027) * t + 1.421_413_741) * t - 0.284_496_736) * t + 0.254_829_592) * t;
    let bell = (-x * x).exp();
    ((1.0 - series * bell).copysign(x), std::f64::consts::FRAC_2_SQRT_PI * bell)
}

/// The pixels about a start.
struct Window {
    /// Offsets from the start, and light; `None` for what the box about the window has besides.
    pixels: Vec<Option<(Vector2<f64>, f64)>>,
    columns: usize,
    /// How far either edge drifts across rows or columns of pixels within the window, px.
    drifts_px: [f64; 2],
}

struct Sums {
    normal: Square,
    right: Row,
    squares: f64,
}

impl Window {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the picture")]
    fn of(raw: &Plane, start: &Start) -> Option<Self> {
        let inverse = start.axes.try_inverse()?;
        // Half widths across the edges, px: a side's length across the other axis is the area over that axis.
        let area = start.axes.determinant().abs();
        let across = [1, 0].map(|other: usize| area / start.axes.column(other).norm());
        let half_px = across.map(|width| (start.reach * width - MARGIN_PX).min(MAX_HALF_PX));
        if half_px.iter().any(|half| !(*half >= MIN_HALF_PX)) {
            return None;
        }
        let halves = [half_px[0] / across[0], half_px[1] / across[1]];
        let span = Vector2::new(
            start.axes[(0, 0)].abs() * halves[0] + start.axes[(0, 1)].abs() * halves[1],
            start.axes[(1, 0)].abs() * halves[0] + start.axes[(1, 1)].abs() * halves[1],
        );
        let (least, most) = ((start.place - span).map(f64::ceil), (start.place + span).map(f64::floor));
        let is_inside = least.min() >= 0.0 && most.x < raw.width as f64 && most.y < raw.height as f64;
        // Also false for NaN.
        if !(is_inside && least.x <= most.x && least.y <= most.y) {
            return None;
        }
        let [left, top, right, bottom] = [least.x, least.y, most.x, most.y].map(|c| c as usize);
        let mut pixels = Vec::with_capacity((right - left + 1) * (bottom - top + 1));
        for y in top..=bottom {
            for x in left..=right {
                let offset = Vector2::new(x as f64, y as f64) - start.place;
                let share = inverse * offset;
                let is_in = share.x.abs() <= halves[0] && share.y.abs() <= halves[1];
                pixels.push(is_in.then(|| (offset, f64::from(raw.samples[y * raw.width + x]))));
            }
        }
        let drifts_px = [0, 1].map(|k| 2.0 * halves[k] * start.axes.column(k).abs().min());
        let window = Self { pixels, columns: right - left + 1, drifts_px };
        (window.count() >= COUNT + 4).then_some(window)
    }

    fn seen(&self) -> impl Iterator<Item = &(Vector2<f64>, f64)> {
        self.pixels.iter().flatten()
    }

    fn count(&self) -> usize {
        self.seen().count()
    }

    fn mean(&self) -> f64 {
        self.seen().map(|(_, value)| value).sum::<f64>() / self.count() as f64
    }

    fn sums(&self, at: &Row, edges: &Edges) -> Sums {
        let mut sums = Sums { normal: Square::zeros(), right: Row::zeros(), squares: 0.0 };
        for (offset, value) in self.seen() {
            let (model, by) = model(at, edges, offset);
            let left = value - model;
            sums.normal.ger(1.0, &by, &by, 1.0);
            sums.right.axpy(left, &by, 1.0);
            sums.squares += left * left;
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_models_derivatives_agree_with_central_differences() {
        let at = Row::from([0.2, -0.1, 0.3, 1.7, 0.1, 120.0, 70.0, -5.0, 0.3, -0.2]);
        for (turn, bends_per_px) in [(1.0, [0.0, 0.0]), (-1.0, [0.03, -0.05])] {
            let edges = Edges { turn, bends_per_px };
            for offset in [[1.2, 0.4], [-0.3, 0.7], [2.0, -3.0], [0.2, -0.1]].map(Vector2::from) {
                let (_, by) = model(&at, &edges, &offset);
                for k in 0..COUNT {
                    let moved = |step: f64| {
                        let mut at = at;
                        at[k] += step;
                        model(&at, &edges, &offset).0
                    };
                    let numeric = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                    assert!((by[k] - numeric).abs() < 2e-3 * (1.0 + numeric.abs()), "{k}: {} {numeric}", by[k]);
                }
            }
        }
    }
}
