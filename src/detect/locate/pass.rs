//! One look at all pixels with a model: what they say about rim, light, blur and noise.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instructions of the function that calls it"
)]

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x8, u32x8};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use super::Likeness;
use super::border::Border;
use super::cover::Place;
use super::ellipse::{Ellipse, FORM};
use super::lanes::{Lanes, sum};
use super::mixture::Mixtures;
use super::patch::{Channel, Patch};
use super::rim::{GROUPS, Rim, Trust, sectors};
use crate::detect::{MACHINE, single};

/// What is linear in luma, and its normal equations.
pub(super) const LIGHTS: usize = 5;
pub(super) type Lit = SVector<f64, LIGHTS>;
pub(super) type LitMatrix = SMatrix<f64, LIGHTS, LIGHTS>;

/// How an ellipse is lit: what the pixels' light is within it and around it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    /// Codes of luma: height of the ellipse over the ground, the ground at the origin, its slopes right and down, and how much higher the
    /// ground beyond a border is.
    pub luma: Lit,
    /// Chroma along the marker's hue: height, ground.
    pub chroma: Vector2<f64>,
}

/// Standard deviations of one pixel where there is no edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Noise {
    pub luma: f64,
    pub chroma: f64,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Model {
    pub ellipse: Ellipse,
    pub light: Light,
    pub noise: Noise,
    /// How codes go from ground to ellipse.
    pub mixture: Mixtures,
    /// Where another ground begins, and how codes go from that.
    pub border: Option<(Border, Mixtures)>,
}

/// What luma says: normal equations and what else a pass gathers.
pub(super) struct Sums {
    pub rim: Rim,
    pub light: (LitMatrix, Lit),
    /// How the ground's slopes and border (columns) look like moves (rows).
    pub cross: SMatrix<f64, 2, 3>,
    /// Information and pull of the blur's logarithm.
    pub blur: (f64, f64),
    /// Deviation of what no edge explains.
    pub noise: f64,
    /// The largest residual of the ground.
    pub farthest: f64,
}

/// What became of eight pixels.
#[derive(Clone, Copy)]
pub(super) struct Looked {
    pub residual: Lanes,
    pub variance: Lanes,
    pub share: Lanes,
}

/// The part of an edge's height by which optics, sampling and coding bend it away from the model, as a standard deviation.
const EDGE_ERROR: f64 = 0.03;

/// The same for a lens so sharp that its blur is lost between the pixels, and the variance at which that begins, px^2.
const SHARP_ERROR: f64 = 0.12;
pub(super) const SHARP_BLUR: f64 = 0.1;

/// The part of a border's height by which it is not as straight, as sharp and as wide as it is drawn.
const BORDER_ERROR: f32 = 0.15;

/// The error of edges with this blur.
fn bent(edge_error: f64, ln_blur: f64, more: f64) -> f32 {
    single(edge_error + SHARP_ERROR * (-(ln_blur.exp() + more) / SHARP_BLUR).exp())
}

/// Residuals beyond this many standard deviations belong to something else; beyond fewer where there is something else.
const MAX_DEVIATIONS: f32 = 8.0;
const MAX_DEVIATIONS_AMID_OTHERS: f32 = 6.0;

/// Shares below this are ground.
pub(super) const GROUND: f32 = 0.05;

/// A share times what is left of one, below which a pixel is not at the edge.
const FLAT: f32 = 0.075;

/// How much of the height of chroma counts as height of luma there: demosaicing lets it show.
const CHROMA_IN_LUMA: f32 = 1.4;

/// How luma's codes are mixed.
struct Mixed<S: Simd> {
    /// What of the ground is beyond the border.
    far: f32x8<S>,
    /// What the code is over the straight line from the ground before the border to the ellipse, and the slope of that.
    over_line: f32x8<S>,
    slope: f32x8<S>,
}

impl<S: Simd> Mixed<S> {
    #[inline(always)]
    fn of(model: &Model, share: f32x8<S>, x: f32x8<S>, y: f32x8<S>) -> Self {
        let (over_line, slope) = model.mixture.luma.over_line(share);
        let Some((border, mixture)) = &model.border else {
            return Self { far: f32x8::splat(share.simd, 0.0), over_line, slope };
        };
        let far = border.share(x, y);
        let higher = single(model.light.luma[LIGHTS - 1]);
        let (over_there, slope_there) = mixture.luma.over_line(share);
        Self {
            far,
            over_line: over_line + far * (over_there - over_line - share * higher + higher),
            slope: slope + far * (slope_there - slope - higher),
        }
    }
}

/// What one channel of eight pixels says.
struct Said<S: Simd> {
    residual: f32x8<S>,
    weight: f32x8<S>,
    /// Change of the code for each pixel that the rim moves outwards.
    by_rim: f32x8<S>,
}

#[inline(always)]
fn said<S: Simd>(
    residual: f32x8<S>,
    variance: f32x8<S>,
    max_deviations: f32,
    by_rim: f32x8<S>,
    there: f32x8<S>,
) -> Said<S> {
    let per_variance = f32x8::splat(variance.simd, 1.0) / variance;
    let excess = residual * residual * per_variance * (max_deviations * max_deviations).recip();
    let inside = -(excess.min(1.0) - 1.0);
    Said { residual, weight: there * inside * inside * per_variance, by_rim }
}

#[derive(Clone, Copy)]
struct RimLanes<S: Simd> {
    information: f32x8<S>,
    pull: f32x8<S>,
    form: [f32x8<S>; FORM],
}

impl<S: Simd> RimLanes<S> {
    #[inline(always)]
    fn none(simd: S) -> Self {
        let zero = f32x8::splat(simd, 0.0);
        Self { information: zero, pull: zero, form: [zero; FORM] }
    }

    #[inline(always)]
    fn add(&mut self, said: &Said<S>, place: &Place<S>) {
        let pull = said.weight * said.by_rim;
        let information = pull * said.by_rim;
        self.information += information;
        self.pull += pull * said.residual;
        for (sum, form) in self.form.iter_mut().zip(place.form) {
            *sum += information * form;
        }
    }

    #[inline(always)]
    fn into(self, rim: &mut Rim, group: usize) {
        for (lane, sector) in sectors(group).into_iter().enumerate() {
            rim.information[sector] = f64::from(self.information[lane]);
            rim.pull[sector] = f64::from(self.pull[lane]);
            for (row, form) in self.form.iter().enumerate() {
                rim.form[row][sector] = f64::from(form[lane]);
            }
        }
    }
}

/// What a border adds to the normal equations of the light.
struct BorderLanes<S: Simd> {
    /// With the share, one, x, y, and itself.
    normal: [f32x8<S>; LIGHTS],
    moment: f32x8<S>,
    cross: [f32x8<S>; 2],
}

impl<S: Simd> BorderLanes<S> {
    #[inline(always)]
    fn none(simd: S) -> Self {
        let zero = f32x8::splat(simd, 0.0);
        Self { normal: [zero; LIGHTS], moment: zero, cross: [zero; 2] }
    }

    /// `seen` is what of a pixel is seen of the other ground; `by` are the weighted share, one, x, y.
    #[inline(always)]
    fn add(&mut self, weighted: f32x8<S>, by: &[f32x8<S>; 4], said: &Said<S>, place: &Place<S>, seen: f32x8<S>) {
        for (sum, by) in self.normal.iter_mut().zip(by) {
            *sum += *by * seen;
        }
        let own = weighted * seen;
        self.normal[LIGHTS - 1] += own * seen;
        self.moment += own * said.residual;
        for (sum, normal) in self.cross.iter_mut().zip(&place.form) {
            *sum += own * said.by_rim * *normal;
        }
    }
}

/// Looks at every sample of `patch`.
pub(super) fn gather(
    patch: &Patch<'_>,
    model: &Model,
    likeness: &Likeness,
    amid_others: bool,
    trust: &Trust,
    looked: &mut Vec<Looked>,
) -> Sums {
    looked.clear();
    dispatch!(*MACHINE, simd => gather_by(simd, patch, model, likeness, amid_others, trust, looked))
}

#[inline(always)]
fn gather_by<S: Simd>(
    simd: S,
    patch: &Patch<'_>,
    model: &Model,
    likeness: &Likeness,
    amid_others: bool,
    trust: &Trust,
    looked: &mut Vec<Looked>,
) -> Sums {
    let Model { ellipse, light, noise, border, .. } = model;
    let noise_squared = single(noise.luma * noise.luma);
    // An edge of what is small is drawn by few pixels.
    let small = (1.0 + likeness.sectored_area_px / ellipse.area_px()).sqrt();
    let bent = bent(likeness.edge_error * small, ellipse.ln_blur, 0.0);
    let [height, ground, right, down, beyond] = light.luma.map(single).into();
    let zero = f32x8::splat(simd, 0.0);
    let mut rim = Rim::default();
    let mut normal = [zero; 10];
    let mut moment = [zero; 4];
    let mut cross = [zero; 4];
    let mut by_border = BorderLanes::none(simd);
    let (mut blur, mut blur_pull) = (zero, zero);
    let max_deviations = if amid_others { MAX_DEVIATIONS_AMID_OTHERS } else { MAX_DEVIATIONS };
    let (mut flat, mut flat_squares) = (zero, zero);
    let mut farthest = zero;
    let chroma_bend = (CHROMA_IN_LUMA * single(light.chroma.x)).powi(2);
    for group in 0..GROUPS {
        let mut here = RimLanes::none(simd);
        let trusted = Lanes(sectors(group).map(|sector| single(trust.of[sector]))).load(simd);
        for octet in patch.luma.group(group) {
            let [x, y, value, free] = [&octet.x, &octet.y, &octet.value, &octet.free].map(|lanes| lanes.load(simd));
            let place = Place::of(x, y, ellipse);
            let cover = place.cover(ellipse, 0.0);
            let Mixed { far, over_line, slope } = Mixed::of(model, cover.share, x, y);
            let code = cover.share * height + ground + x * right + y * down + over_line;
            let rise = slope + height;
            let edge = (cover.share - cover.share * cover.share) * 4.0;
            let bend = (edge * (1.0 - likeness.feet) + likeness.feet) * (rise * rise + chroma_bend).sqrt() * bent;
            let seam = (far - far * far) * (4.0 * BORDER_ERROR * beyond);
            let variance = bend * bend + seam * seam + noise_squared;
            let said = said(value - code, variance, max_deviations, rise * cover.by_rim, free);
            here.add(&said, &place);
            let level = free - free * edge;
            flat += level;
            flat_squares += level * (said.residual * said.residual).min(CUT * CUT * noise_squared);
            let stray = cover.share.simd_lt(GROUND).select(said.residual.abs() * octet.there.load(simd), zero);
            farthest = farthest.max(stray);
            looked.push(Looked {
                residual: Lanes(*said.residual),
                variance: Lanes(*variance),
                share: Lanes(*cover.share),
            });
            let weighted = said.weight * trusted;
            let pulled = weighted * said.residual;
            let by = [weighted * cover.share, weighted, weighted * x, weighted * y];
            moment[0] += pulled * cover.share;
            moment[1] += pulled;
            moment[2] += pulled * x;
            moment[3] += pulled * y;
            // The upper triangle row by row: of the share, of one, of x, of y.
            normal[0] += by[0] * cover.share;
            normal[1] += by[0];
            normal[2] += by[0] * x;
            normal[3] += by[0] * y;
            normal[4] += by[1];
            normal[5] += by[2];
            normal[6] += by[3];
            normal[7] += by[2] * x;
            normal[8] += by[2] * y;
            normal[9] += by[3] * y;
            let by_move = weighted * said.by_rim;
            let [by_x, by_y] = [by_move * x, by_move * y];
            for (row, normal) in place.form[..2].iter().enumerate() {
                cross[2 * row] += by_x * *normal;
                cross[2 * row + 1] += by_y * *normal;
            }
            if border.is_some() {
                by_border.add(weighted, &by, &said, &place, far - far * cover.share);
            }
            let by_blur = rise * cover.by_blur;
            blur += weighted * by_blur * by_blur;
            blur_pull += pulled * by_blur;
        }
        here.into(&mut rim, group);
    }
    let n = normal.map(sum);
    let b = by_border.normal.map(sum);
    #[rustfmt::skip]
    let normal = LitMatrix::from_row_slice(&[
        n[0], n[1], n[2], n[3], b[0],
        n[1], n[4], n[5], n[6], b[1],
        n[2], n[5], n[7], n[8], b[2],
        n[3], n[6], n[8], n[9], b[3],
        b[0], b[1], b[2], b[3], b[4],
    ]);
    let [first, second, third, fourth] = moment.map(sum);
    let (slopes, border) = (cross.map(sum), by_border.cross.map(sum));
    Sums {
        rim,
        light: (normal, Lit::from([first, second, third, fourth, sum(by_border.moment)])),
        cross: SMatrix::from_row_slice(&[slopes[0], slopes[1], border[0], slopes[2], slopes[3], border[1]]),
        blur: (sum(blur), sum(blur_pull)),
        noise: if amid_others { level_noise(simd, patch, looked, noise.luma) } else { deviation(flat_squares, flat) },
        farthest: f64::from(farthest.reduce_max()),
    }
}

/// Bins for each deviation in which sizes are counted, and how many.
const FINE: f32 = 24.0;
const BINS: usize = 128;

/// The noise that most pixels beside the edge have, whatever the others are: by the median of sizes, counted in bins of the noise `before`.
/// Where more than half are beyond the last bin it is that bin's, and the next pass goes on from there.
#[inline(always)]
fn level_noise<S: Simd>(simd: S, patch: &Patch<'_>, looked: &[Looked], before: f64) -> f64 {
    // In the last are those that do not count.
    let mut counts = [0_u32; BINS + 2];
    let scale = FINE / single(before);
    for (octet, looked) in patch.luma.octets().zip(looked) {
        let [share, residual] = [&looked.share, &looked.residual].map(|lanes| lanes.load(simd));
        let is_level = (share - share * share).simd_lt(FLAT) & octet.free.load(simd).simd_gt(0.0);
        let bins = (residual.abs() * scale).min(BINS as f32);
        let bins: u32x8<S> = is_level.select(bins, f32x8::splat(simd, BINS as f32 + 1.0)).to_int();
        for bin in *bins {
            counts[(bin as usize).min(BINS + 1)] += 1;
        }
    }
    let counts = &counts[..=BINS];
    let half = 0.5 * f64::from(counts.iter().sum::<u32>());
    let mut below = 0.0;
    for (bin, count) in counts.iter().map(|count| f64::from(*count)).enumerate() {
        if below + count >= half && count > 0.0 {
            let within = if bin == BINS { 0.0 } else { (half - below) / count };
            return 1.4826 * (bin as f64 + within) / f64::from(scale);
        }
        below += count;
    }
    0.0
}

/// What chroma says.
pub(super) struct ChromaSums {
    pub rim: Rim,
    pub light: (Matrix2<f64>, Vector2<f64>),
    pub noise: f64,
}

/// Looks at every sample of the patch's chroma.
pub(super) fn gather_chroma(patch: &Patch<'_>, chroma: &Channel<'_>, model: &Model) -> ChromaSums {
    dispatch!(*MACHINE, simd => gather_chroma_by(simd, patch, chroma, model))
}

#[inline(always)]
fn gather_chroma_by<S: Simd>(simd: S, patch: &Patch<'_>, chroma: &Channel<'_>, model: &Model) -> ChromaSums {
    let Model { ellipse, light, noise, mixture, border } = model;
    // Shares in chroma are blurred further, and what curves them has as much less height as it is wider.
    let sharp = single((ellipse.ln_blur.exp() / (ellipse.ln_blur.exp() + patch.chroma_blur)).sqrt());
    let noise_squared = single(noise.chroma * noise.chroma);
    let bent = bent(EDGE_ERROR, ellipse.ln_blur, patch.chroma_blur);
    let (height, ground) = (single(light.chroma.x), single(light.chroma.y));
    let weight = single(patch.chroma_weight);
    let mut rim = Rim::default();
    let zero = f32x8::splat(simd, 0.0);
    let mut sums = [zero; 5];
    let (mut flat, mut flat_squares) = (zero, zero);
    for group in 0..GROUPS {
        let mut here = RimLanes::none(simd);
        for octet in chroma.group(group) {
            let [x, y, value, there] = [&octet.x, &octet.y, &octet.value, &octet.there].map(|lanes| lanes.load(simd));
            let place = Place::of(x, y, ellipse);
            let cover = place.cover(ellipse, patch.chroma_blur);
            let (mut over_line, mut slope) = mixture.chroma.over_line(cover.share);
            if let Some((border, mixture)) = border {
                let far = border.share(x, y);
                let (from_there, slope_there) = mixture.chroma.over_line(cover.share);
                over_line += far * (from_there - over_line);
                slope += far * (slope_there - slope);
            }
            let rise = slope * sharp + height;
            let residual = value - cover.share * height - ground - over_line * sharp;
            let edge = (cover.share - cover.share * cover.share) * 4.0;
            let bend = edge * (height * bent);
            let variance = bend * bend + noise_squared;
            let mut said = said(residual, variance, MAX_DEVIATIONS_AMID_OTHERS, rise * cover.by_rim, there);
            said.weight *= weight;
            here.add(&said, &place);
            let by_share = said.weight * cover.share;
            sums[0] += by_share * cover.share;
            sums[1] += by_share;
            sums[2] += said.weight;
            sums[3] += by_share * residual;
            sums[4] += said.weight * residual;
            let level = there - there * edge;
            flat += level;
            flat_squares += level * (residual * residual).min(CUT * CUT * noise_squared);
        }
        here.into(&mut rim, group);
    }
    let [aa, ab, bb, a, b] = sums.map(sum);
    ChromaSums { rim, light: (Matrix2::new(aa, ab, ab, bb), Vector2::new(a, b)), noise: deviation(flat_squares, flat) }
}

/// Squares are cut at so many deviations.
const CUT: f32 = 3.0;

/// Where they are cut at three deviations, the mean square of a normal variable is 0.97 of its variance.
fn deviation<S: Simd>(squares: f32x8<S>, count: f32x8<S>) -> f64 {
    (sum(squares) / (0.97 * sum(count).max(1.0))).sqrt()
}
