//! One look at all pixels with a model: what they say about rim, light, blur and noise.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

use super::Likeness;
use super::ellipse::{Ellipse, FORM, LOGISTIC};
use super::lanes::{LANES, Lanes};
use super::mixture::Mixtures;
use super::patch::{Channel, Octet, Patch};
use super::rim::{Rim, SECTORS, Trust};

/// How an ellipse is lit: what the pixels' light is within it and around it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    /// Codes of luma: height of the ellipse over the ground, the ground at the origin, its slopes right and down.
    pub luma: Vector4<f64>,
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
}

/// What luma says: normal equations and what else a pass gathers.
pub(super) struct Sums {
    pub rim: Rim,
    pub light: (Matrix4<f64>, Vector4<f64>),
    /// How the ground's slopes (columns) look like moves (rows).
    pub cross: Matrix2<f64>,
    /// Information and pull of the blur's logarithm.
    pub blur: (f64, f64),
    /// Deviation of what no edge explains.
    pub noise: f64,
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

/// The error of edges with this blur.
fn bent(edge_error: f64, ln_blur: f64, more: f64) -> f32 {
    single(edge_error + SHARP_ERROR * (-(ln_blur.exp() + more) / SHARP_BLUR).exp())
}

/// Residuals beyond this many standard deviations belong to something else; beyond fewer where there is something else.
const MAX_DEVIATIONS: f32 = 8.0;
const MAX_DEVIATIONS_AMID_OTHERS: f32 = 6.0;

/// A share times what is left of one, below which a pixel is not at the edge.
const LEVEL: f32 = 0.075;

/// How much of the height of chroma counts as height of luma there: demosaicing lets it show.
const CHROMA_IN_LUMA: f32 = 1.4;

/// The share of a pixel's light that the ellipse gives, and its derivatives.
struct Cover {
    share: Lanes,
    /// For each pixel that the rim moves outwards.
    by_rim: Lanes,
    by_blur: Lanes,
}

/// Position against the ellipse.
struct Place {
    /// Half of the distance from the rim in radii squared.
    n: Lanes,
    gradient_squared: Lanes,
    gradient: Lanes,
    form: [Lanes; FORM],
}

impl Place {
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
    #[inline(always)]
    fn of(octet: &Octet, ellipse: &Ellipse) -> Self {
        let (m11, m12, m22) = (single(ellipse.matrix.m11), single(ellipse.matrix.m12), single(ellipse.matrix.m22));
        let (m11, m12, m22) = (Lanes::all(m11), Lanes::all(m12), Lanes::all(m22));
        let qx = octet.x - Lanes::all(single(ellipse.centre.x));
        let qy = octet.y - Lanes::all(single(ellipse.centre.y));
        let (gx, gy) = (m11 * qx + m12 * qy, m12 * qx + m22 * qy);
        let squared = (qx * gx + qy * gy).max(1e-6);
        let gradient_squared = (gx * gx + gy * gy).max(1e-12);
        let gradient = gradient_squared.sqrt();
        let normal = Lanes::ONE / gradient;
        // Scaled to the rim, where the product is one.
        let half = Lanes::all(0.5) * normal / squared.sqrt();
        let (xx, xy, yy) = (qx * qx, qx * qy, qy * qy);
        // A larger matrix is a smaller ellipse.
        let form = [gx * normal, gy * normal, -(xx * half), -(xy * half) - xy * half, -(yy * half)];
        Self { n: squared - Lanes::ONE, gradient_squared, gradient, form }
    }

    /// Near the outline of a large ellipse the share falls with the distance as through a Gaussian blur; for one that is
    /// small against the blur it falls nearly as a Gaussian of the blur's width. It is symmetric about the centre, which is
    /// what the position lives on.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
    #[inline(always)]
    fn cover(&self, ellipse: &Ellipse, more: f64) -> Cover {
        let own = ellipse.ln_blur.exp();
        let blur = own + more;
        let half_trace = 0.5 * ellipse.matrix.trace();
        let width = (LOGISTIC * blur * half_trace).powi(2);
        let w = Lanes::all(single(blur)) * self.gradient_squared + Lanes::all(single(width));
        let per_root = Lanes::ONE / w.sqrt();
        let half = Lanes::all(single(0.5 * LOGISTIC));
        let z = half * self.n * per_root;
        let share = z.logistic_fall();
        let edge = share * (Lanes::ONE - share);
        let by_rim = edge * (half + half) * self.gradient * per_root;
        // Half of dw / d ln blur, over w.
        let widening = Lanes::all(single(own)) * self.gradient_squared
            + Lanes::all(single(2.0 * own * LOGISTIC * LOGISTIC * blur * half_trace * half_trace));
        let by_blur = edge * z * Lanes::all(0.5) * widening * per_root * per_root;
        Cover { share, by_rim, by_blur }
    }
}

/// What one channel of eight pixels says.
struct Said {
    residual: Lanes,
    weight: Lanes,
    /// Change of the code for each pixel that the rim moves outwards.
    by_rim: Lanes,
}

#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn said(residual: Lanes, variance: Lanes, max_deviations: f32, by_rim: Lanes, there: Lanes) -> Said {
    let excess = residual * residual / (variance * Lanes::all(max_deviations * max_deviations));
    let inside = Lanes::ONE - excess.min(1.0);
    Said { residual, weight: there * inside * inside / variance, by_rim }
}

#[derive(Clone, Copy)]
struct RimLanes {
    information: Lanes,
    pull: Lanes,
    form: [Lanes; FORM],
}

impl RimLanes {
    const ZERO: Self = Self { information: Lanes::ZERO, pull: Lanes::ZERO, form: [Lanes::ZERO; FORM] };

    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
    #[inline(always)]
    fn add(&mut self, said: &Said, place: &Place) {
        let pull = said.weight * said.by_rim;
        let information = pull * said.by_rim;
        self.information += information;
        self.pull += pull * said.residual;
        for (sum, form) in self.form.iter_mut().zip(place.form) {
            *sum += information * form;
        }
    }

    fn into(self, rim: &mut Rim, sector: usize) {
        rim.information[sector] = self.information.sum();
        rim.pull[sector] = self.pull.sum();
        for (row, form) in self.form.iter().enumerate() {
            rim.form[sector][row] = form.sum();
        }
    }
}

/// Looks at every sample of `patch`.
#[multiversion::multiversion(targets("x86_64+avx2+fma", "x86_64+sse4.1+ssse3"))]
pub(super) fn gather(
    patch: &Patch,
    model: &Model,
    likeness: &Likeness,
    amid_others: bool,
    trust: &Trust,
    looked: &mut Vec<Looked>,
) -> Sums {
    let Model { ellipse, light, noise, mixture } = model;
    let noise_squared = single(noise.luma * noise.luma);
    // An edge of what is small is drawn by few pixels.
    let small = (1.0 + likeness.sectored_area_px / ellipse.area_px()).sqrt();
    let bent = Lanes::all(bent(likeness.edge_error * small, ellipse.ln_blur, 0.0));
    let (feet, ridge) = (Lanes::all(likeness.feet), Lanes::all(1.0 - likeness.feet));
    let [height, ground, right, down] = light.luma.map(single).map(Lanes::all).into();
    let mut rim = Rim::default();
    let mut normal = [Lanes::ZERO; 10];
    let mut moment = [Lanes::ZERO; 4];
    let mut cross = [Lanes::ZERO; 4];
    let (mut blur, mut blur_pull) = (Lanes::ZERO, Lanes::ZERO);
    let max_deviations = if amid_others { MAX_DEVIATIONS_AMID_OTHERS } else { MAX_DEVIATIONS };
    looked.clear();
    let (mut flat, mut flat_squares) = (Lanes::ZERO, Lanes::ZERO);
    let chroma_bend = Lanes::all((CHROMA_IN_LUMA * single(light.chroma.x)).powi(2));
    for sector in 0..SECTORS {
        let mut here = RimLanes::ZERO;
        let trusted = Lanes::all(single(trust.of[sector]));
        for octet in patch.luma.sector(sector) {
            let place = Place::of(octet, ellipse);
            let cover = place.cover(ellipse, 0.0);
            let (over_line, slope) = mixture.luma.over_line(cover.share);
            let code = height * cover.share + ground + right * octet.x + down * octet.y + over_line;
            let rise = height + slope;
            let edge = Lanes::all(4.0) * cover.share * (Lanes::ONE - cover.share);
            let bend = (edge * ridge + feet) * (rise * rise + chroma_bend).sqrt() * bent;
            let variance = Lanes::all(noise_squared) + bend * bend;
            let said = said(octet.value - code, variance, max_deviations, rise * cover.by_rim, octet.free);
            here.add(&said, &place);
            let level = octet.free * (Lanes::ONE - edge);
            flat += level;
            flat_squares += level * (said.residual * said.residual).min(CUT * CUT * noise_squared);
            looked.push(Looked { residual: said.residual, variance, share: cover.share });
            let weighted = said.weight * trusted;
            let by = [cover.share, Lanes::ONE, octet.x, octet.y];
            let mut index = 0;
            for row in 0..4 {
                moment[row] += weighted * by[row] * said.residual;
                for column in row..4 {
                    normal[index] += weighted * by[row] * by[column];
                    index += 1;
                }
            }
            let by_move = weighted * said.by_rim;
            for (row, normal) in place.form[..2].iter().enumerate() {
                cross[2 * row] += by_move * *normal * octet.x;
                cross[2 * row + 1] += by_move * *normal * octet.y;
            }
            let by_blur = rise * cover.by_blur;
            blur += weighted * by_blur * by_blur;
            blur_pull += weighted * by_blur * said.residual;
        }
        here.into(&mut rim, sector);
    }
    let n = normal.map(Lanes::sum);
    #[rustfmt::skip]
    let normal = Matrix4::new(
        n[0], n[1], n[2], n[3],
        n[1], n[4], n[5], n[6],
        n[2], n[5], n[7], n[8],
        n[3], n[6], n[8], n[9],
    );
    Sums {
        rim,
        light: (normal, Vector4::from(moment.map(Lanes::sum))),
        cross: Matrix2::from_row_slice(&cross.map(Lanes::sum)),
        blur: (blur.sum(), blur_pull.sum()),
        noise: if amid_others { level_noise(patch, looked, noise.luma) } else { deviation(flat_squares, flat) },
    }
}

/// Bins for each deviation in which sizes are counted, and how many.
const FINE: f32 = 24.0;
const BINS: usize = 128;

/// The noise that most pixels beside the edge have, whatever the others are: by the median of sizes, counted in bins of the noise `before`.
/// Where more than half are beyond the last bin it is that bin's, and the next pass goes on from there.
fn level_noise(patch: &Patch, looked: &[Looked], before: f64) -> f64 {
    let mut counts = [0_u32; BINS + 1];
    let scale = FINE / single(before);
    for (octet, looked) in patch.luma.octets().iter().zip(looked) {
        for lane in 0..LANES {
            let share = looked.share.0[lane];
            let counts_here = octet.free.0[lane] > 0.0 && share * (1.0 - share) < LEVEL;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to BINS")]
            let bin = (looked.residual.0[lane].abs() * scale).min(BINS as f32) as usize;
            counts[bin] += u32::from(counts_here);
        }
    }
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
#[multiversion::multiversion(targets("x86_64+avx2+fma", "x86_64+sse4.1+ssse3"))]
pub(super) fn gather_chroma(patch: &Patch, chroma: &Channel, model: &Model) -> ChromaSums {
    let Model { ellipse, light, noise, mixture } = model;
    // Shares in chroma are blurred further, and what curves them has as much less height as it is wider.
    let sharp = single((ellipse.ln_blur.exp() / (ellipse.ln_blur.exp() + patch.chroma_blur)).sqrt());
    let sharp = Lanes::all(sharp);
    let noise_squared = single(noise.chroma * noise.chroma);
    let bent = bent(EDGE_ERROR, ellipse.ln_blur, patch.chroma_blur);
    let (height, ground) = (Lanes::all(single(light.chroma.x)), Lanes::all(single(light.chroma.y)));
    let weight = Lanes::all(single(patch.chroma_weight));
    let mut rim = Rim::default();
    let mut sums = [Lanes::ZERO; 5];
    let (mut flat, mut flat_squares) = (Lanes::ZERO, Lanes::ZERO);
    for sector in 0..SECTORS {
        let mut here = RimLanes::ZERO;
        for octet in chroma.sector(sector) {
            let place = Place::of(octet, ellipse);
            let cover = place.cover(ellipse, patch.chroma_blur);
            let (over_line, slope) = mixture.chroma.over_line(cover.share);
            let rise = height + sharp * slope;
            let residual = octet.value - height * cover.share - ground - sharp * over_line;
            let edge = Lanes::all(4.0) * cover.share * (Lanes::ONE - cover.share);
            let bend = edge * height * Lanes::all(bent);
            let variance = Lanes::all(noise_squared) + bend * bend;
            let mut said = said(residual, variance, MAX_DEVIATIONS_AMID_OTHERS, rise * cover.by_rim, octet.there);
            said.weight = said.weight * weight;
            here.add(&said, &place);
            sums[0] += said.weight * cover.share * cover.share;
            sums[1] += said.weight * cover.share;
            sums[2] += said.weight;
            sums[3] += said.weight * cover.share * residual;
            sums[4] += said.weight * residual;
            let level = octet.there * (Lanes::ONE - edge);
            flat += level;
            flat_squares += level * (residual * residual).min(CUT * CUT * noise_squared);
        }
        here.into(&mut rim, sector);
    }
    let [aa, ab, bb, a, b] = sums.map(Lanes::sum);
    ChromaSums { rim, light: (Matrix2::new(aa, ab, ab, bb), Vector2::new(a, b)), noise: deviation(flat_squares, flat) }
}

/// Squares are cut at so many deviations.
const CUT: f32 = 3.0;

/// Where they are cut at three deviations, the mean square of a normal variable is 0.97 of its variance.
fn deviation(squares: Lanes, count: Lanes) -> f64 {
    (squares.sum() / (0.97 * count.sum().max(1.0))).sqrt()
}

#[expect(clippy::cast_possible_truncation, reason = "seven digits are enough for what eight bits say")]
const fn single(value: f64) -> f32 {
    value as f32
}
