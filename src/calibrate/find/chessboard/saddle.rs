//! Where exactly four squares meet: a blurred crossing of two edges, fitted to the codes about it.
//!
//! The picture of four squares is the same turned by half a turn about their corner, whatever a gamma, an exposure or ink that runs does to
//! black and white: a model with that symmetry has no bias from them. Each edge has a place, a direction and a blur of its own; the
//! lattice tells how much it bends.

mod edge;
mod sums;

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use self::sums::{COUNT, Lanes, Shape};
use super::pyramid::Plane;

/// Where a fit begins; px of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Start {
    pub place: Vector2<f64>,
    /// The steps to the next column and to the next row, as columns.
    pub axes: Matrix2<f64>,
    /// Second differences along the two ways: how the lines bend.
    pub bends: [Vector2<f64>; 2],
    /// Whether the square between the two ways is black.
    pub is_black: bool,
    /// White less black, codes.
    pub contrast: f64,
    /// Blur that is expected, one standard deviation.
    pub blur_px: f64,
}

/// What was fitted; px of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Saddle {
    pub place: Vector2<f64>,
    /// Standard deviation per axis, from what the fit leaves over.
    pub sigma_px: f64,
    /// Blur across the sharper edge, one standard deviation.
    pub blur_px: f64,
    /// White less black, codes.
    pub contrast: f64,
    /// What the fit leaves over, one standard deviation, codes.
    pub noise: f64,
}

/// Half width of the window in steps, and at most so many px.
const WINDOW: f64 = 0.45;
const MAX_WINDOW_PX: f64 = 13.0;

/// Passes at most, and a move that ends them, px.
const MAX_PASSES: usize = 12;
const SETTLED_PX: f64 = 0.01;

/// Squared residuals that shrink to no less than this have settled, well enough to tell a corner from anything else, and well enough
/// for a deviation.
const SETTLED_SHARES: [f64; 2] = [0.6, 0.9];

/// Edges run along the lattice to about this, sine of the angle in steps; blur is as expected to about this factor (its logarithm).
const SLANT: f64 = 0.08;
const BLUR_SPREAD: f64 = 0.7;

/// The gray between black and white lies off their mean by about this share of half their difference: sRGB has it at 0.4.
const CURVE: f64 = 0.4;

/// Blur below this is the pixel's own, px; above this share of a square no edge is left.
const MIN_BLUR_PX: f64 = 0.25;
const MAX_BLUR: f64 = 0.45;

/// What a lens too sharp for its pixels hides of an edge between them: px on an edge of one px, less on longer ones and for wider blur.
const ALIASING_PX: f64 = 0.085;
const ALIASED_BLUR_PX: f64 = 0.8;

/// The picture's codes are whole numbers.
const ROUNDING: f64 = 0.29;

type Normal = SMatrix<f64, COUNT, COUNT>;
type Parameters = SVector<f64, COUNT>;

/// The crossing near `start`; `None` where there is none or the picture ends.
///
/// The deviation is right only where it is wanted: it costs a few passes more.
pub(super) fn fit(plane: &Plane, start: &Start, wants_sigma: bool) -> Option<Saddle> {
    let window = Window::of(plane, start)?;
    // Square's widths across the edges, px: of the edge along columns, and of the one along rows.
    let area = start.axes.determinant().abs();
    let widths = [area / start.axes.column(0).norm(), area / start.axes.column(1).norm()];
    let sharpness = |width: f64, blur: f64| width / (std::f64::consts::SQRT_2 * blur);
    let expected = widths.map(|width| sharpness(width, start.blur_px.min(0.3 * width)));
    let half = 0.5 * start.contrast * if start.is_black { -1.0 } else { 1.0 };
    let mut at = Parameters::from([0.0, 0.0, expected[0], 0.0, expected[1], 0.0, half, window.mean, 0.0, 0.0, 0.0]);
    let mut variance = (0.1 * start.contrast).powi(2).max(ROUNDING * ROUNDING);
    let settled_share = SETTLED_SHARES[usize::from(wants_sigma)];
    let (mut last, mut squares) = (None, f64::MAX);
    let mut columns = Vec::with_capacity(window.lanes.len());
    for _ in 0..MAX_PASSES {
        let sums = sums::gather(&window.lanes, &shape(&at), &mut columns);
        let free = sums.weight - COUNT as f64;
        if !(free > 4.0) {
            return None;
        }
        variance = if last.is_some() { sums.squares / free } else { variance.max(sums.squares / free) }
            .max(ROUNDING * ROUNDING);
        let (mut normal, mut right) = (sums.normal, sums.right);
        expect(&mut normal, &mut right, &at, expected, variance);
        let factors = normal.cholesky()?;
        let step = factors.solve(&right);
        let before = corner(&at)?;
        at = moved(&at, &step, widths);
        let now = corner(&at)?;
        last = Some((factors, variance));
        if now.amax() > WINDOW {
            return None;
        }
        let is_still = (start.axes * (now - before)).norm() < SETTLED_PX;
        // What is left over tells the deviation, and settles later than the place.
        if is_still && sums.squares > settled_share * squares {
            break;
        }
        squares = sums.squares;
    }
    let (factors, variance) = last?;
    let covariance = factors.inverse() * variance;
    let place = corner(&at)?;
    let spread = start.axes * place_covariance(&at, &place, &covariance)? * start.axes.transpose();
    let sharpest = (at[2] / widths[0]).abs().max((at[4] / widths[1]).abs());
    let blur_px = (std::f64::consts::SQRT_2 * sharpest).recip();
    let contrast = 2.0 * at[6] * if start.is_black { -1.0 } else { 1.0 };
    let aliasing = ALIASING_PX * (-0.5 * (blur_px / ALIASED_BLUR_PX).powi(2)).exp() / window.edge_px.sqrt();
    let saddle = Saddle {
        place: window.middle + start.axes * place,
        sigma_px: (0.5 * spread.trace()).sqrt().hypot(aliasing),
        blur_px,
        contrast,
        noise: variance.sqrt(),
    };
    (saddle.sigma_px.is_finite() && contrast > 0.0).then_some(saddle)
}

/// Adds what is known beforehand: edges run along the lattice and are about as blurred as expected.
fn expect(normal: &mut Normal, right: &mut Parameters, at: &Parameters, expected: [f64; 2], variance: f64) {
    for (slant, sharp, expected) in [(1, 2, expected[0]), (5, 4, expected[1])] {
        let steep = at[sharp].abs();
        let stiff = variance / (SLANT * steep).powi(2);
        normal[(slant, slant)] += stiff;
        right[slant] -= stiff * at[slant];
        let stiff = variance / (BLUR_SPREAD * steep).powi(2);
        normal[(sharp, sharp)] += stiff;
        right[sharp] -= stiff * steep * (steep / expected).ln();
    }
    // Of a curve only so much is believed as cameras have.
    normal[(10, 10)] += variance / (CURVE * at[6]).powi(2);
    right[10] -= variance / (CURVE * at[6]).powi(2) * at[10];
    // Nothing is without a number.
    for k in 0..COUNT {
        normal[(k, k)] += 1e-6 * normal[(k, k)] + 1e-9;
    }
}

/// A step, no longer than it can be trusted.
fn moved(at: &Parameters, step: &Parameters, widths: [f64; 2]) -> Parameters {
    let mut next = at + step;
    for (place, slant, sharp, width) in [(0, 1, 2, widths[0]), (3, 5, 4, widths[1])] {
        let old = at[sharp];
        let least = (std::f64::consts::SQRT_2 * MAX_BLUR).recip();
        let most = (width / (std::f64::consts::SQRT_2 * MIN_BLUR_PX)).max(least);
        next[sharp] = next[sharp].clamp(0.5 * old, 2.0 * old).clamp(least, most);
        next[slant] = next[slant].clamp(at[slant] - 0.3 * old, at[slant] + 0.3 * old);
        next[place] = next[place].clamp(at[place] - 0.3 * old, at[place] + 0.3 * old);
    }
    next[8] = next[8].clamp(-1.5, 1.5);
    next[9] = next[9].clamp(-1.5, 1.5);
    next
}

/// Where both edges are, in steps from the window's middle.
fn corner(at: &Parameters) -> Option<Vector2<f64>> {
    let edges = Matrix2::new(at[1], at[2], at[4], at[5]);
    let place = -(edges.try_inverse()? * Vector2::new(at[0], at[3]));
    place.iter().all(|c| c.is_finite()).then_some(place)
}

fn place_covariance(at: &Parameters, place: &Vector2<f64>, covariance: &Normal) -> Option<Matrix2<f64>> {
    let inverse = Matrix2::new(at[1], at[2], at[4], at[5]).try_inverse()?;
    let mut by = SMatrix::<f64, 2, COUNT>::zeros();
    for (edge, from) in [(0, 0), (1, 3)] {
        by[(edge, from)] = 1.0;
        by[(edge, from + 1)] = place.x;
        by[(edge, from + 2)] = place.y;
    }
    let by = inverse * by;
    Some(by * covariance * by.transpose())
}

#[expect(clippy::cast_possible_truncation, reason = "single precision is enough for a pixel")]
fn shape(at: &Parameters) -> Shape {
    Shape(std::array::from_fn(|k| at[k] as f32))
}

/// The pixels about the start, in steps of the lattice.
struct Window {
    lanes: Vec<Lanes>,
    middle: Vector2<f64>,
    mean: f64,
    /// Length of the shorter edge, px.
    edge_px: f64,
}

impl Window {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the picture")]
    fn of(plane: &Plane, start: &Start) -> Option<Self> {
        let inverse = start.axes.try_inverse()?;
        let halves = [0, 1].map(|k| WINDOW.min(MAX_WINDOW_PX / start.axes.column(k).norm()));
        let edge_px = 2.0 * (halves[0] * start.axes.column(0).norm()).min(halves[1] * start.axes.column(1).norm());
        let span = Vector2::new(
            start.axes[(0, 0)].abs() * halves[0] + start.axes[(0, 1)].abs() * halves[1],
            start.axes[(1, 0)].abs() * halves[0] + start.axes[(1, 1)].abs() * halves[1],
        );
        let least = (start.place - span).map(|c| c.ceil().max(0.0));
        let most = start.place + span;
        let most =
            Vector2::new(most.x.floor().min(plane.width as f64 - 1.0), most.y.floor().min(plane.height as f64 - 1.0));
        // Also false for what is no number.
        if !(least.x <= most.x && least.y <= most.y) {
            return None;
        }
        let [left, top, right, bottom] = [least.x, least.y, most.x, most.y].map(|c| c as usize);
        let bends = start.bends.map(|bend| inverse * bend * 0.5);
        let view = sums::View {
            middle: [start.place.x as f32, start.place.y as f32],
            inverse: [inverse[(0, 0)], inverse[(0, 1)], inverse[(1, 0)], inverse[(1, 1)]].map(|c| c as f32),
            // Along the first way the edge moves across it, along the second likewise.
            bends: [bends[0].y as f32, bends[1].x as f32],
            halves: halves.map(|half| half as f32),
        };
        let lanes = sums::window(plane, [left, top], [right, bottom], &view);
        let (total, weight) =
            lanes.iter().map(Lanes::sum).fold((0.0, 0.0), |sum, next| (sum.0 + next.0, sum.1 + next.1));
        (weight > 0.0).then(|| Self { lanes, middle: start.place, mean: f64::from(total / weight), edge_px })
    }
}
