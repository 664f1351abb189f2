//! Where exactly four squares meet: a blurred crossing of two edges, fitted to the light about it.
//!
//! The picture of four squares is the same turned by half a turn about their corner, whatever a gamma, an exposure or ink that runs does to
//! black and white: a model with that symmetry has no bias from them where pixels lie about the corner in all ways. Where edges run along rows
//! they do not, so light is fitted and not codes ([`Tone`]). Each edge has a place, a direction and a blur of its own; the
//! lattice tells how much it bends.

mod edge;
mod sums;

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use self::sums::{COUNT, Lanes, Shape};
use super::super::sampling;
use super::super::tone::Tone;
use super::pyramid::Plane;

/// The light about a corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Light {
    /// Half of white less black, of a white of 255; negative where the square between the two ways is black.
    pub half: f64,
    /// Mean of black and white; that of the window if it is not known.
    pub mean: Option<f64>,
    /// How it changes along the two ways, shares a step.
    pub slopes: [f64; 2],
    /// How much lighter than its tone has it the camera's curve makes what is between black and white.
    pub curve: f64,
    /// Blur across the edges along the two ways, one standard deviation.
    pub blurs_px: [f64; 2],
}

impl Light {
    /// Of which nothing is known but the colours.
    pub(super) const fn expected(half: f64, blur_px: f64) -> Self {
        Self { half, mean: None, slopes: [0.0; 2], curve: 0.0, blurs_px: [blur_px; 2] }
    }

    /// The blur of the sharper edge.
    pub(super) const fn sharpest_px(&self) -> f64 {
        self.blurs_px[0].min(self.blurs_px[1])
    }

    /// On a level whose pixels are so many times as large.
    pub(super) fn scaled(self, ratio: f64) -> Self {
        Self { blurs_px: self.blurs_px.map(|blur| blur / ratio), ..self }
    }
}

/// Where a fit begins; px of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Start {
    pub place: Vector2<f64>,
    /// The steps to the next column and to the next row, as columns.
    pub axes: Matrix2<f64>,
    /// Second differences along the two ways: how the lines bend.
    pub bends: [Vector2<f64>; 2],
    /// What the light is thought to be.
    pub light: Light,
    /// How codes tell it.
    pub tone: Tone,
}

/// What was fitted; px of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Saddle {
    pub place: Vector2<f64>,
    /// Standard deviation per axis, from what the fit leaves over and what sampling hides.
    pub sigma_px: f64,
    /// The light.
    pub light: Light,
    /// What the fit leaves over, one standard deviation, as a share of white less black.
    pub noise: f64,
}

/// How well a fit has to have settled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settled {
    /// A move that is none, px.
    pub place_px: f64,
    /// Squared residuals that shrink to no less than this share.
    pub squares: f64,
}

impl Settled {
    /// Well enough to tell a corner from anything else and to say how its lines bend.
    pub(super) const ROUGHLY: Self = Self { place_px: 0.04, squares: 0.6 };
    /// Well enough for a deviation.
    pub(super) const FULLY: Self = Self { place_px: 0.015, squares: 0.85 };
}

/// Half width of the window in steps, and at most so many px.
const WINDOW: f64 = 0.45;
const MAX_WINDOW_PX: f64 = 13.0;

/// Where an edge shows: so many times its blur, and px besides, on either side. Most of what is farther off is left out.
const EDGE_BLURS: f64 = 2.8;
const EDGE_PX: f64 = 1.2;

/// Passes at most.
const MAX_PASSES: usize = 12;

/// Edges run along the lattice to about this, sine of the angle in steps; blur is as expected to about this factor (its logarithm).
const SLANT: f64 = 0.08;
const BLUR_SPREAD: f64 = 0.7;

/// The gray between black and white lies off their mean by about this share of half their difference, in the wrong tone: codes of sRGB have it at 0.4.
const CURVE: f64 = 0.4;

/// Blur below this is the pixel's own, px; above this share of a square no edge is left.
const MIN_BLUR_PX: f64 = 0.25;
const MAX_BLUR: f64 = 0.45;

/// The picture's codes are whole numbers, and so about is the light that they tell.
const ROUNDING: f64 = 0.29;

type Normal = SMatrix<f64, COUNT, COUNT>;
type Parameters = SVector<f64, COUNT>;

/// The crossing near `start`; `None` where there is none or the picture ends.
pub(super) fn fit(plane: &Plane<'_>, start: &Start, settled: &Settled) -> Option<Saddle> {
    let window = Window::of(plane, start)?;
    // Square's widths across the edges, px: of the edge along columns, and of the one along rows.
    let area = start.axes.determinant().abs();
    let widths = [area / start.axes.column(0).norm(), area / start.axes.column(1).norm()];
    let Light { half, mean, slopes, curve, blurs_px } = start.light;
    let sharpness = |k: usize| widths[k] / (std::f64::consts::SQRT_2 * blurs_px[k].min(0.3 * widths[k]));
    let expected = [sharpness(0), sharpness(1)];
    let mean = mean.unwrap_or(window.mean);
    let mut at =
        Parameters::from([0.0, 0.0, expected[0], 0.0, expected[1], 0.0, half, mean, slopes[0], slopes[1], curve]);
    let mut columns = Vec::with_capacity(window.lanes.len());
    let (mut last, mut squares) = (None, f64::MAX);
    for _ in 0..MAX_PASSES {
        let sums = sums::gather(&window.lanes, &shape(&at), &mut columns);
        let free = sums.weight - COUNT as f64;
        if !(free > 4.0) {
            return None;
        }
        let variance = (sums.squares / free).max(ROUNDING * ROUNDING);
        let (mut normal, mut right) = (sums.normal, sums.right);
        expect(&mut normal, &mut right, &at, expected, variance);
        let factors = normal.cholesky()?;
        let before = corner(&at)?;
        at = moved(&at, &factors.solve(&right), widths);
        let now = corner(&at)?;
        last = Some((factors, variance));
        if now.amax() > WINDOW {
            return None;
        }
        let is_still = (start.axes * (now - before)).norm() < settled.place_px;
        // What is left over tells the deviation, and settles later than the place.
        if is_still && sums.squares > settled.squares * squares {
            break;
        }
        squares = sums.squares;
    }
    let (factors, variance) = last?;
    let place = corner(&at)?;
    let by_parameters = start.axes * place_by_parameters(&at, &place)?;
    let spread = by_parameters * factors.solve(&by_parameters.transpose()) * variance;
    let blurs_px = [(widths[0], at[2]), (widths[1], at[4])]
        .map(|(width, sharpness)| width / (std::f64::consts::SQRT_2 * sharpness.abs()));
    let light = Light { half: at[6], mean: Some(at[7]), slopes: [at[8], at[9]], curve: at[10], blurs_px };
    let of_fit = 0.5 * sampling::moving_share(light.sharpest_px()) * spread.trace();
    let saddle = Saddle {
        place: window.middle + start.axes * place,
        sigma_px: (of_fit + sampling::variance_px2(window.drifts_px, light.sharpest_px())).sqrt(),
        light,
        noise: 0.5 * variance.sqrt() / light.half.abs(),
    };
    (saddle.sigma_px.is_finite() && light.half * half > 0.0).then_some(saddle)
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

/// The place's derivative by the parameters.
fn place_by_parameters(at: &Parameters, place: &Vector2<f64>) -> Option<SMatrix<f64, 2, COUNT>> {
    let inverse = Matrix2::new(at[1], at[2], at[4], at[5]).try_inverse()?;
    let mut by = SMatrix::<f64, 2, COUNT>::zeros();
    for (edge, from) in [(0, 0), (1, 3)] {
        by[(edge, from)] = 1.0;
        by[(edge, from + 1)] = place.x;
        by[(edge, from + 2)] = place.y;
    }
    Some(inverse * by)
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
    /// How far either edge drifts across rows or columns of pixels within the window, px.
    drifts_px: [f64; 2],
}

impl Window {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the picture")]
    fn of(plane: &Plane<'_>, start: &Start) -> Option<Self> {
        let inverse = start.axes.try_inverse()?;
        let widths = [0, 1].map(|k| start.axes.determinant().abs() / start.axes.column(k).norm());
        let halves = [0, 1].map(|k| WINDOW.min(MAX_WINDOW_PX / start.axes.column(k).norm()));
        let drifts_px = [0, 1].map(|k| 2.0 * halves[k] * start.axes.column(k).abs().min());
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
            // Of a light that is not known it is not known either where its edges end.
            near: [0, 1].map(|k| match start.light.mean {
                Some(_) => (EDGE_BLURS * start.light.blurs_px[k] + EDGE_PX) as f32 / widths[k] as f32,
                None => f32::INFINITY,
            }),
        };
        let lanes = sums::window(plane, [left, top], [right, bottom], &view, start.tone.lights());
        let (total, weight) =
            lanes.iter().map(Lanes::sum).fold((0.0, 0.0), |sum, next| (sum.0 + next.0, sum.1 + next.1));
        (weight > 0.0).then(|| Self { lanes, middle: start.place, mean: f64::from(total / weight), drifts_px })
    }
}
