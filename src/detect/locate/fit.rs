//! The fit: passes over the pixels, each of which moves ellipse and light to where the last one's sums point.

use nalgebra::{Matrix2, Vector2, Vector4};

use super::ellipse::Ellipse;
use super::pass::{ChromaSums, FULL, Light, Model, Noise, SHARP_BLUR, Sums, gather, gather_chroma};
use super::patch::Patch;
use super::rim::{CHROMA_FLOOR_PX, Form, FormMatrix, Trust, solved};
use super::{Likeness, Located, Seed};
use crate::frame::Frame;

/// Logarithm of the blur's variance that is expected beforehand, and its deviation: lenses are about as sharp as pixels.
const LN_BLUR: f64 = -0.4;
const LN_BLUR_SPREAD: f64 = 1.5;

/// In the first passes chroma speaks alone, which is not misled by what touches the rim.
const CHROMA_PASSES: usize = 2;
const MIN_PASSES: usize = 4;

/// Eight bits have steps; noise below this is not believed.
const MIN_NOISE: f64 = 0.5;

/// What a lens too sharp for its pixels hides of a small disc between them: px times the disc's area.
const ALIASING_PX3: f64 = 2.0;

/// Part of the rim that must be an ellipse's.
const MIN_KEPT: f64 = 0.4;

pub(super) fn fit(
    frame: &Frame,
    seed: &Seed,
    others: &[Seed],
    chroma: Option<Vector2<f64>>,
    likeness: &Likeness,
) -> Option<Located> {
    let matrix = seed.form()?;
    let patch = Patch::around(frame, seed, others, chroma, likeness.large)?;
    let mut model = start(&patch, seed, matrix);
    let prior = FormMatrix::zeros();
    let mut trust = Trust::NONE;
    let mut last = None;
    for pass in 0..likeness.max_passes {
        let chroma = patch.chroma.as_ref().map(|channel| gather_chroma(&patch, channel, &model));
        let colour = chroma.as_ref().map(|chroma| chroma.rim.offsets(CHROMA_FLOOR_PX));
        let (mut normal, mut right) = (prior, Form::zeros());
        if let Some(colour) = &colour {
            colour.add_to(&Trust::FULL, &mut normal, &mut right);
        }
        // In the first passes chroma speaks alone.
        let sums = (chroma.is_none() || pass >= CHROMA_PASSES).then(|| gather(&patch, &model, likeness.edge_error));
        if let Some(sums) = &sums {
            let luma = sums.rim.offsets(likeness.floor_px);
            let is_small = model.ellipse.area_px() < likeness.sectored_area_px;
            trust = luma.untrimmed(&prior);
            if !is_small && trust.scatter > likeness.trim_scatter {
                trust = luma.trust(colour.as_ref(), &prior);
            }
            luma.add_to(&trust, &mut normal, &mut right);
            without_slopes(sums, &mut normal, &mut right);
            last = Some((normal, luma.kept(&trust)));
        }
        let next = model.ellipse.moved(&solved(normal, &right)?);
        let moved = (next.centre - model.ellipse.centre).norm();
        model.ellipse = next;
        relit(&mut model, &patch, sums.as_ref(), chroma.as_ref());
        if pass + 1 >= MIN_PASSES && moved < likeness.settled_px {
            break;
        }
    }
    let (normal, kept) = last?;
    let covariance = normal.try_inverse()?;
    let random = trust.scatter * (0.5 * (covariance[(0, 0)] + covariance[(1, 1)])).sqrt();
    let blur = model.ellipse.ln_blur.exp();
    let aliasing = ALIASING_PX3 * (-blur / SHARP_BLUR).exp() / model.ellipse.area_px();
    let sigma_px = random.hypot(patch.floor_px).hypot(aliasing);
    let pixel = model.ellipse.centre + patch.origin;
    let moved = (pixel - seed.pixel).norm();
    let fits = sigma_px.is_finite() && kept > MIN_KEPT && moved < 0.1 + 3.5 * seed.sigma_px.hypot(sigma_px);
    fits.then(|| Located { pixel, sigma_px, area_px: model.ellipse.area_px() })
}

/// Leaves out of the form's equations what the slopes of the ground explain as well.
fn without_slopes(sums: &Sums, normal: &mut FormMatrix, right: &mut Form) {
    let (light, moment) = &sums.light;
    let slopes: Matrix2<f64> = light.fixed_view::<2, 2>(2, 2).into_owned();
    let Some(inverse) = slopes.try_inverse() else { return };
    let share = sums.cross * inverse;
    let mut corner = normal.fixed_view_mut::<2, 2>(0, 0);
    corner -= share * sums.cross.transpose();
    let mut top = right.fixed_rows_mut::<2>(0);
    top -= share * moment.fixed_rows::<2>(2);
}

fn start(patch: &Patch, seed: &Seed, matrix: Matrix2<f64>) -> Model {
    let light = |code: f64| code * code / FULL;
    let ground = light(patch.luma.outside);
    let chroma = patch.chroma.as_ref();
    Model {
        ellipse: Ellipse { centre: seed.pixel - patch.origin, matrix, ln_blur: LN_BLUR },
        light: Light {
            luma: Vector4::new(light(patch.luma.inside) - ground, ground, 0.0, 0.0),
            chroma: chroma.map_or_else(Vector2::zeros, |c| Vector2::new(c.inside - c.outside, c.outside)),
        },
        noise: Noise {
            luma: patch.luma.noise.max(MIN_NOISE),
            chroma: chroma.map_or(MIN_NOISE, |c| c.noise.hypot(patch.min_chroma_noise)),
        },
    }
}

/// Light, blur and noise as the pass has them.
fn relit(model: &mut Model, patch: &Patch, sums: Option<&Sums>, chroma: Option<&ChromaSums>) {
    if let Some(chroma) = chroma {
        let (normal, right) = chroma.light;
        if let Some(factors) = (normal + Matrix2::identity() * 1e-9).cholesky() {
            model.light.chroma += factors.solve(&right);
        }
        model.noise.chroma = chroma.noise.hypot(patch.min_chroma_noise);
    }
    let Some(sums) = sums else { return };
    let (mut normal, right) = sums.light;
    for k in 0..4 {
        normal[(k, k)] += 1e-6 * normal[(k, k)] + 1e-9;
    }
    if let Some(factors) = normal.cholesky() {
        model.light.luma += factors.solve(&right);
    }
    model.noise.luma = sums.noise.max(MIN_NOISE);
    let (information, pull) = sums.blur;
    let expected = LN_BLUR_SPREAD.powi(-2);
    let step = (pull - expected * (model.ellipse.ln_blur - LN_BLUR)) / (information + expected);
    model.ellipse.ln_blur = (model.ellipse.ln_blur + step.clamp(-1.5, 1.0)).clamp(-3.0, 4.0);
}
