//! The sums of one pass over a window, several pixels at a time.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instructions of the function that calls it"
)]
#![allow(clippy::needless_range_loop, reason = "a lane of several arrays")]

use nalgebra::{SMatrix, SVector};

use super::super::pyramid::Plane;
use super::edge::profile;

/// Parameters of the model: place, slant and sharpness of the edge along the first way (`[0, 1, 2]`: constant, by `s`, by `t`) and of that
/// along the second (`[3, 4, 5]`), half of white less black, mean, the light's slopes as shares, and how much
/// lighter the camera's curve makes what is between black and white.
pub(super) const COUNT: usize = 11;

/// The parameters as a pass takes them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape(pub [f32; COUNT]);

/// Pixels side by side.
pub(super) const LANES: usize = 8;

type Values = [f32; LANES];

/// Pixels of a row: where they are in steps of the lattice, straightened, and what they show.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Lanes {
    s: Values,
    t: Values,
    lights: Values,
    weights: Values,
}

impl Lanes {
    const EMPTY: Self = Self { s: [0.0; LANES], t: [0.0; LANES], lights: [0.0; LANES], weights: [0.0; LANES] };

    /// Weighted sum of light, and of weights.
    pub(super) fn sum(&self) -> (f32, f32) {
        let sum = self.lights.iter().zip(&self.weights).map(|(light, weight)| light * weight).sum();
        (sum, self.weights.iter().sum())
    }
}

/// How pixels become steps.
pub(super) struct View {
    pub middle: [f32; 2],
    /// Steps by pixels, row by row.
    pub inverse: [f32; 4],
    /// By how much the first line moves in `t` per `s` squared, and the second in `s` per `t` squared.
    pub bends: [f32; 2],
    /// Half sides of the window, steps.
    pub halves: [f32; 2],
    /// How near to the first line in `t`, and to the second in `s`, a pixel shows its edge.
    pub near: [f32; 2],
}

/// Weights fall from one to zero over so much of the window's half width.
const RIM: f32 = 0.15;

impl View {
    /// Whether none of the pixels from there on shows an edge; a line that bends counts as wider.
    #[inline(always)]
    fn is_flat(&self, dx: f32, dy: f32) -> bool {
        let half = 0.5 * (LANES - 1) as f32;
        let [a, b, c, d] = self.inverse;
        let (across, down) = (a * (dx + half) + b * dy, c * (dx + half) + d * dy);
        let [first, second] =
            [(self.bends[0], c), (self.bends[1], a)].map(|(bend, by_x)| bend.abs() + half * by_x.abs());
        down.abs() > self.near[0] + first && across.abs() > self.near[1] + second
    }

    #[inline(always)]
    fn lanes(&self, dx: f32, dy: f32, codes: &[u8], lights: &[f32; 256]) -> Lanes {
        let [mut s, mut t, mut values, mut weights] = [[0.0; LANES]; 4];
        values.iter_mut().zip(codes).for_each(|(value, code)| *value = lights[usize::from(*code)]);
        for k in 0..LANES {
            let dx = dx + OFFSETS[k];
            let [a, b, c, d] = self.inverse;
            let (across, down) = (a * dx + b * dy, c * dx + d * dy);
            let far = (across / self.halves[0]).abs().max((down / self.halves[1]).abs());
            weights[k] = ((1.0 - far) / RIM).clamp(0.0, 1.0) * if k < codes.len() { 1.0 } else { 0.0 };
            s[k] = across - self.bends[1] * down * down;
            t[k] = down - self.bends[0] * across * across;
        }
        Lanes { s, t, lights: values, weights }
    }
}

/// The place of a pixel among those side by side.
const OFFSETS: Values = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Of the pixels that show no edge, every so many rows are taken: they say how bright black and white are, and nothing else.
const FLAT_STRIDE: usize = 4;

/// The pixels from `[left, top]` to `[right, bottom]` that have a weight, without most of those that show no edge.
#[multiversion::multiversion(targets("x86_64+avx2+fma", "x86_64+sse4.1+ssse3"))]
pub(super) fn window(
    plane: &Plane<'_>,
    [left, top]: [usize; 2],
    [right, bottom]: [usize; 2],
    view: &View,
    lights: &[f32; 256],
) -> Vec<Lanes> {
    let mut window = Vec::with_capacity((bottom - top + 1) * ((right - left) / LANES + 1));
    let mut packed = Lanes::EMPTY;
    let mut count = 0;
    for y in top..=bottom {
        let row = &plane.row(y)[left..=right];
        let dy = y as f32 - view.middle[1];
        let mut dx = left as f32 - view.middle[0];
        let is_flat_taken = y.is_multiple_of(FLAT_STRIDE);
        for codes in row.chunks(LANES) {
            if !is_flat_taken && view.is_flat(dx, dy) {
                dx += LANES as f32;
                continue;
            }
            let lanes = view.lanes(dx, dy, codes, lights);
            let taken: [bool; LANES] = std::array::from_fn(|k| {
                let is_near = (lanes.t[k].abs() < view.near[0]) | (lanes.s[k].abs() < view.near[1]);
                lanes.weights[k] > 0.0 && (is_near | is_flat_taken)
            });
            if taken == [true; LANES] && count == 0 {
                window.push(lanes);
            } else if taken != [false; LANES] {
                for k in 0..LANES {
                    // What is not taken is written over by the next.
                    packed.s[count] = lanes.s[k];
                    packed.t[count] = lanes.t[k];
                    packed.lights[count] = lanes.lights[k];
                    packed.weights[count] = lanes.weights[k];
                    count += usize::from(taken[k]);
                    if count == LANES {
                        window.push(packed);
                        count = 0;
                    }
                }
            }
            dx += LANES as f32;
        }
    }
    if count > 0 {
        packed.weights[count..].fill(0.0);
        window.push(packed);
    }
    window
}

/// Of a pass.
pub(super) struct Sums {
    pub normal: SMatrix<f64, COUNT, COUNT>,
    pub right: SVector<f64, COUNT>,
    /// Of squared residuals.
    pub squares: f64,
    pub weight: f64,
}

/// Entries of the triangle of the normal matrix with the right side as a further column, and the squares.
const ENTRIES: usize = (COUNT + 1) * (COUNT + 2) / 2;

/// `columns` is memory that is used again from pass to pass.
pub(super) fn gather(window: &[Lanes], shape: &Shape, columns: &mut Vec<Columns>) -> Sums {
    columns.clear();
    let mut entries = [[0.0; LANES]; ENTRIES];
    let mut weights = [0.0; LANES];
    differentiate(window, &shape.0, columns, &mut weights);
    multiply(columns, &mut entries);
    let total = |lanes: &Values| lanes.iter().map(|value| f64::from(*value)).sum::<f64>();
    let mut sums = Sums { normal: SMatrix::zeros(), right: SVector::zeros(), squares: 0.0, weight: total(&weights) };
    let mut entry = entries.iter().map(total);
    for row in 0..=COUNT {
        for column in row..=COUNT {
            let value = entry.next().unwrap_or(0.0);
            match (row == COUNT, column == COUNT) {
                (true, _) => sums.squares = value,
                (false, true) => sums.right[row] = value,
                (false, false) => {
                    sums.normal[(row, column)] = value;
                    sums.normal[(column, row)] = value;
                }
            }
        }
    }
    sums
}

#[multiversion::multiversion(targets("x86_64+avx2+fma", "x86_64+sse4.1+ssse3"))]
fn differentiate(window: &[Lanes], shape: &[f32; COUNT], columns: &mut Vec<Columns>, weights: &mut Values) {
    for lanes in window {
        columns.push(derivatives(lanes, shape));
        for k in 0..LANES {
            weights[k] += lanes.weights[k];
        }
    }
}

/// Sums of all products of two columns, the triangle row by row. A row at a time: its sums stay in registers.
#[multiversion::multiversion(targets("x86_64+avx2+fma", "x86_64+sse4.1+ssse3"))]
fn multiply(columns: &[Columns], entries: &mut [Values; ENTRIES]) {
    #[inline(always)]
    fn row<const FROM: usize, const LENGTH: usize>(columns: &[Columns], entries: &mut [Values]) {
        let mut sums = [[0.0; LANES]; LENGTH];
        for columns in columns {
            let first = &columns.0[FROM];
            for (sum, column) in sums.iter_mut().zip(&columns.0[FROM..]) {
                for k in 0..LANES {
                    sum[k] += first[k] * column[k];
                }
            }
        }
        entries.iter_mut().zip(sums).for_each(|(entry, sum)| *entry = sum);
    }
    row::<0, 12>(columns, &mut entries[0..]);
    row::<1, 11>(columns, &mut entries[12..]);
    row::<2, 10>(columns, &mut entries[23..]);
    row::<3, 9>(columns, &mut entries[33..]);
    row::<4, 8>(columns, &mut entries[42..]);
    row::<5, 7>(columns, &mut entries[50..]);
    row::<6, 6>(columns, &mut entries[57..]);
    row::<7, 5>(columns, &mut entries[63..]);
    row::<8, 4>(columns, &mut entries[68..]);
    row::<9, 3>(columns, &mut entries[72..]);
    row::<10, 2>(columns, &mut entries[75..]);
    row::<11, 1>(columns, &mut entries[77..]);
}

/// Derivatives and residual of some pixels.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Columns([Values; COUNT + 1]);

/// The derivatives of the model by its parameters, and the residual, times the root of the weight.
#[inline(always)]
fn derivatives(lanes: &Lanes, shape: &[f32; COUNT]) -> Columns {
    let [p1, s1, t1, p2, s2, t2, half, mean, across, down, curve] = *shape;
    let mut columns = [[0.0; LANES]; COUNT + 1];
    for k in 0..LANES {
        let (s, t) = (lanes.s[k], lanes.t[k]);
        let root = lanes.weights[k].sqrt();
        let (first, first_slope) = profile(p1 + s1 * s + t1 * t);
        let (second, second_slope) = profile(p2 + s2 * s + t2 * t);
        let light = root * (1.0 + across * s + down * t);
        let contrast = first * second;
        let between = 1.0 - contrast * contrast;
        let shade = mean + half * contrast + curve * between;
        let by_contrast = light * (half - 2.0 * curve * contrast);
        let by_first = by_contrast * first_slope * second;
        let by_second = by_contrast * first * second_slope;
        columns[0][k] = by_first;
        columns[1][k] = by_first * s;
        columns[2][k] = by_first * t;
        columns[3][k] = by_second;
        columns[4][k] = by_second * s;
        columns[5][k] = by_second * t;
        columns[6][k] = light * contrast;
        columns[7][k] = light;
        columns[8][k] = root * s * shade;
        columns[9][k] = root * t * shade;
        columns[10][k] = light * between;
        columns[11][k] = root * lanes.lights[k] - light * shade;
    }
    Columns(columns)
}
