//! The fit: passes over the pixels, each of which moves ellipse and light to where the last one's sums point.

use nalgebra::{Matrix2, Matrix3, Vector2};

use super::ellipse::Ellipse;
use super::foreign;
use super::mixture::{Colour, LUMA, Mixture, Mixtures, chroma_weights};
use super::pass::{ChromaSums, LIGHTS, Light, Lit, Looked, Model, Noise, SHARP_BLUR, Sums, gather, gather_chroma};
use super::patch::{Gatherer, Patch};
use super::rim::{CHROMA_FLOOR_PX, Form, FormMatrix, Trust, solved, unevenness};
use super::shape::Pull;
use super::{Likeness, Located, Seed, Shape};
use crate::frame::Frame;

/// Logarithm of the blur's variance that is expected beforehand, and its deviation: lenses are about as sharp as pixels.
const LN_BLUR: f64 = -0.4;
const LN_BLUR_SPREAD: f64 = 1.5;

/// In the first passes chroma speaks alone, which is not misled by what touches the rim.
const CHROMA_PASSES: usize = 2;
/// And luma in as many at least.
const MIN_LUMA_PASSES: usize = 2;

/// Eight bits have steps; noise below this is not believed.
pub(super) const MIN_NOISE: f64 = 0.5;

/// What a lens too sharp for its pixels hides of a small disc between them: px times the disc's area.
const ALIASING_PX3: f64 = 2.0;

/// What eight bits and a curve of codes that is not known leave of the best, px.
const LEAST_SIGMA_PX: f64 = 0.004;

/// What a border as high as the ellipse leaves when it has been taken into account, px.
const LEFT_BY_BORDER_PX: f64 = 0.02;

/// What grounds leave that are not parted straight, as at the corner of a plate, if they are off by the height of the ellipse, px.
const LEFT_BY_MISFIT_PX: f64 = 1.5;

/// Part of the rim that must be an ellipse's.
const MIN_KEPT: f64 = 0.4;

/// Fits ellipses, one after the other in the same memory.
#[derive(Default)]
pub(super) struct Fitter {
    gatherer: Gatherer,
    looked: Vec<Looked>,
    foreign: foreign::Picture,
}

impl Fitter {
    /// The ellipse at `seed`; of `others`, which are next to it, nothing is looked at.
    pub(super) fn fit(
        &mut self,
        frame: &Frame,
        seed: &Seed,
        shape: Option<&Shape>,
        others: &[Seed],
        hue: Option<Vector2<f64>>,
        likeness: &Likeness,
    ) -> Option<Located> {
        let known = shape.map(Pull::of);
        let matrix = match known {
            Some(known) => known?.matrix,
            None => seed.form()?,
        };
        let Self { gatherer, looked, foreign } = self;
        let mut patch = gatherer.around(frame, seed, others, hue, likeness)?;
        let mut model = start(&patch, seed, matrix, hue);
        let mut trust = Trust::FULL;
        let mut sectors: Option<Trust> = None;
        // Of what was located before, chroma has said enough.
        let chroma_passes = if patch.chroma.is_none() || known.is_some() { 0 } else { CHROMA_PASSES };
        let min_passes = chroma_passes + MIN_LUMA_PASSES;
        let mut last = None;
        let mut uneven = 1.0;
        for pass in 0..likeness.max_passes {
            let chroma = patch.chroma.as_ref().map(|channel| gather_chroma(&patch, channel, &model));
            let colour = chroma.as_ref().map(|chroma| chroma.rim.offsets(CHROMA_FLOOR_PX));
            let (mut normal, mut right) = known
                .flatten()
                .map_or_else(|| (FormMatrix::zeros(), Form::zeros()), |known| known.equations(&model.ellipse.matrix));
            if let Some(colour) = &colour {
                colour.add_to(&Trust::FULL, &mut normal, &mut right);
            }
            let is_small = model.ellipse.area_px() < likeness.sectored_area_px;
            let amid_others = likeness.amid_others && !is_small;
            // In the first passes chroma speaks alone.
            let sums = (pass >= chroma_passes).then(|| gather(&patch, &model, likeness, amid_others, &trust, looked));
            let luma = sums.as_ref().map(|sums| sums.rim.offsets(likeness.floor_px));
            if let (Some(sums), Some(luma)) = (&sums, &luma) {
                let base = (normal, right);
                trust = luma.untrimmed(&base);
                if !is_small && trust.scatter > likeness.trim_scatter {
                    trust = luma.trust(&base, sectors.as_ref());
                    // In luma's first two passes the rim is searched anew: it was not yet where it is.
                    if pass > chroma_passes {
                        sectors = Some(trust.clone());
                    }
                }
                luma.add_to(&trust, &mut normal, &mut right);
                without_slopes(sums, &mut normal, &mut right);
                last = Some((normal, luma.kept(&trust)));
            }
            let step = solved(normal, &right)?;
            if let Some(luma) = &luma {
                let colour = colour.as_ref().map_or((luma, &Trust::NONE), |colour| (colour, &Trust::FULL));
                uneven = unevenness(&[(luma, &trust), colour], &step);
            }
            let next = model.ellipse.moved(&step);
            let moved = (next.centre - model.ellipse.centre).norm();
            model.ellipse = next;
            relit(&mut model, &patch, sums.as_ref(), chroma.as_ref());
            model.mixture = mixtures(&model.light, model.light.luma[1], hue);
            if let Some((_, mixture)) = &mut model.border {
                *mixture = beyond(&model.light, hue);
            }
            if let (Some(sums), true) = (&sums, amid_others) {
                foreign.take_out(&mut patch, looked, sums.farthest, model.noise.luma);
            }
            if pass + 1 >= min_passes && moved < likeness.settled_px {
                break;
            }
        }
        let (normal, kept) = last?;
        let covariance = normal.try_inverse()?;
        let stated = (0.5 * (covariance[(0, 0)] + covariance[(1, 1)])).sqrt();
        let blur = model.ellipse.ln_blur.exp();
        let aliasing = (ALIASING_PX3 * (-blur / SHARP_BLUR).exp() + patch.mosaic_px3) / model.ellipse.area_px();
        let systematic = aliasing.hypot(patch.floor_px).hypot(left_by_border(&model));
        let by_scatter = (trust.scatter * stated).hypot(systematic);
        let misfit = left_by_misfit(&model);
        let sigma_px = if likeness.by_unevenness {
            let uneven = uneven.max(patch.least_unevenness() * trust.scatter.powi(2));
            let random = stated * (uneven * patch.together(&model)).sqrt();
            let lost = patch.lost_px(&model.light, model.ellipse.area_px());
            random.hypot(systematic).hypot(misfit).hypot(lost).hypot(LEAST_SIGMA_PX)
        } else {
            by_scatter
        };
        let pixel = model.ellipse.centre + patch.origin;
        // What coding has taken, and a border that is not straight, are no licence to go elsewhere.
        let may_move = 0.1 + 3.5 * seed.sigma_px.hypot(by_scatter);
        let area_px = model.ellipse.area_px();
        let radius_px = (area_px / std::f64::consts::PI).sqrt();
        // A place that is known no better than the thing is large is not known.
        if sigma_px >= radius_px || kept <= MIN_KEPT {
            return None;
        }
        let moved = (pixel - seed.pixel).norm();
        if moved < may_move {
            return Some(Located { pixel, sigma_px, area_px });
        }
        // Two looks at one thing that do not agree: where it was is as wrong as either may be.
        let is_one = likeness.by_unevenness && moved < radius_px;
        let sigma_px = seed.sigma_px.hypot(moved * std::f64::consts::FRAC_1_SQRT_2);
        is_one.then_some(Located { pixel: seed.pixel, sigma_px, area_px })
    }
}

/// What the border behind an ellipse leaves of its pull, px.
fn left_by_border(model: &Model) -> f64 {
    let (height, beyond) = (model.light.luma[0], model.light.luma[4]);
    if model.border.is_some() { LEFT_BY_BORDER_PX * (beyond.abs() / height.abs().max(1.0)).min(1.0) } else { 0.0 }
}

/// What a border leaves that is not straight, px.
fn left_by_misfit(model: &Model) -> f64 {
    let height = model.light.luma[0].abs().max(model.light.luma[4].abs()).max(1.0);
    model.border.map_or(0.0, |(border, _)| LEFT_BY_MISFIT_PX * border.misfit / height)
}

/// Leaves out of the form's equations what the slopes of the ground and its border explain as well.
fn without_slopes(sums: &Sums, normal: &mut FormMatrix, right: &mut Form) {
    let (light, moment) = &sums.light;
    let mut ground: Matrix3<f64> = light.fixed_view::<3, 3>(2, 2).into_owned();
    if ground.m33 <= 0.0 {
        // Without a border nothing is said of it.
        ground.m33 = 1.0;
    }
    let Some(inverse) = ground.try_inverse() else { return };
    let share = sums.cross * inverse;
    let mut corner = normal.fixed_view_mut::<2, 2>(0, 0);
    corner -= share * sums.cross.transpose();
    let mut top = right.fixed_rows_mut::<2>(0);
    top -= share * moment.fixed_rows::<3>(2);
}

fn start(patch: &Patch<'_>, seed: &Seed, matrix: Matrix2<f64>, hue: Option<Vector2<f64>>) -> Model {
    let chroma = patch.chroma.as_ref();
    let ground = patch.luma.outside;
    let light = Light {
        luma: Lit::from([
            patch.luma.inside - ground,
            ground,
            0.0,
            0.0,
            patch.border.map_or(0.0, |border| border.height),
        ]),
        chroma: chroma.map_or_else(Vector2::zeros, |c| Vector2::new(c.inside - c.outside, c.outside)),
    };
    Model {
        ellipse: Ellipse { centre: seed.pixel - patch.origin, matrix, ln_blur: LN_BLUR },
        mixture: mixtures(&light, light.luma[1], hue),
        border: patch.border.map(|border| (border, beyond(&light, hue))),
        light,
        noise: Noise {
            luma: patch.luma.noise.max(MIN_NOISE).hypot(patch.luma_coding_noise),
            chroma: chroma.map_or(MIN_NOISE, |c| c.noise.hypot(patch.chroma_coding_noise)),
        },
    }
}

/// How codes go from a ground of this luma to the ellipse's. Without a hue all is gray.
fn mixtures(light: &Light, ground: f64, hue: Option<Vector2<f64>>) -> Mixtures {
    let hue = hue.unwrap_or_default();
    let colour = |luma: f64, chroma: f64| Colour { luma, chroma: hue * chroma };
    let (from, to) =
        (colour(ground, light.chroma.y), colour(light.luma[0] + light.luma[1], light.chroma.y + light.chroma.x));
    Mixtures { luma: Mixture::of(&from, &to, LUMA), chroma: Mixture::of(&from, &to, chroma_weights(&hue)) }
}

/// The same from the ground beyond a border.
fn beyond(light: &Light, hue: Option<Vector2<f64>>) -> Mixtures {
    mixtures(light, light.luma[1] + light.luma[4], hue)
}

/// Light, blur and noise as the pass has them.
fn relit(model: &mut Model, patch: &Patch<'_>, sums: Option<&Sums>, chroma: Option<&ChromaSums>) {
    if let Some(chroma) = chroma {
        let (normal, right) = chroma.light;
        if let Some(factors) = (normal + Matrix2::identity() * 1e-9).cholesky() {
            model.light.chroma += factors.solve(&right);
        }
        model.noise.chroma = chroma.noise.hypot(patch.chroma_coding_noise);
    }
    let Some(sums) = sums else { return };
    let (mut normal, right) = sums.light;
    for k in 0..LIGHTS {
        normal[(k, k)] += 1e-6 * normal[(k, k)] + 1e-9;
    }
    if let Some(factors) = normal.cholesky() {
        model.light.luma += factors.solve(&right);
    }
    model.noise.luma = sums.noise.max(MIN_NOISE).hypot(patch.luma_coding_noise);
    let (information, pull) = sums.blur;
    let expected = LN_BLUR_SPREAD.powi(-2);
    let step = (pull - expected * (model.ellipse.ln_blur - LN_BLUR)) / (information + expected);
    model.ellipse.ln_blur = (model.ellipse.ln_blur + step.clamp(-1.5, 1.0)).clamp(-3.0, 4.0);
}
