//! The rim cut into sectors: which of them belong to an ellipse.
//!
//! A panel line that touches a marker, or a neighbour that hides a part of it, spoils a stretch of its rim. No pixel of
//! that stretch looks wrong by itself, but all of them together say that the rim lies elsewhere.

use nalgebra::{SMatrix, SVector};

use super::ellipse::FORM;

/// Sectors of the rim.
pub(super) const SECTORS: usize = 24;

pub(super) type Form = SVector<f64, FORM>;
pub(super) type FormMatrix = SMatrix<f64, FORM, FORM>;

/// What the pixels of each sector say: how far outwards their rim lies, each entry weighted by its information.
#[derive(Clone, Debug, Default)]
pub(super) struct Rim {
    pub information: [f64; SECTORS],
    pub pull: [f64; SECTORS],
    pub form: [Form; SECTORS],
}

/// The same as offsets.
pub(super) struct Offsets {
    /// How far outwards the rim lies, px.
    offset: [f64; SECTORS],
    /// Variance of that, px^2; infinite where nothing is known.
    variance: [f64; SECTORS],
    /// What of the form moves it.
    form: [Form; SECTORS],
}

/// The sectors' weights, 0 to 1, and how far they scatter against what their pixels' noise allows.
#[derive(Clone, Debug)]
pub(super) struct Trust {
    pub of: [f64; SECTORS],
    pub scatter: f64,
}

impl Trust {
    pub(super) const FULL: Self = Self { of: [1.0; SECTORS], scatter: 1.0 };
    pub(super) const NONE: Self = Self { of: [0.0; SECTORS], scatter: 1.0 };
}

/// How finely a sector of chroma's rim is drawn at best, px.
pub(super) const CHROMA_FLOOR_PX: f64 = 0.06;

impl Rim {
    pub(super) fn offsets(&self, floor_px: f64) -> Offsets {
        let known = |k: usize| self.information[k] > 1e-9;
        Offsets {
            offset: std::array::from_fn(|k| if known(k) { self.pull[k] / self.information[k] } else { 0.0 }),
            variance: std::array::from_fn(|k| {
                if known(k) { self.information[k].recip() + floor_px * floor_px } else { f64::INFINITY }
            }),
            form: std::array::from_fn(|k| if known(k) { self.form[k] / self.information[k] } else { Form::zeros() }),
        }
    }
}

impl Offsets {
    /// Adds the normal equations of the form.
    pub(super) fn add_to(&self, trust: &Trust, normal: &mut FormMatrix, right: &mut Form) {
        for k in 0..SECTORS {
            let weight = trust.of[k] / self.variance[k];
            normal.ger(weight, &self.form[k], &self.form[k], 1.0);
            right.axpy(weight * self.offset[k], &self.form[k], 1.0);
        }
    }

    fn solved(&self, trust: &Trust, prior: &FormMatrix) -> Option<Form> {
        let (mut normal, mut right) = (*prior, Form::zeros());
        self.add_to(trust, &mut normal, &mut right);
        solved(normal, &right)
    }

    /// What of the rim deviates from an ellipse that `form` has moved.
    fn apart(&self, form: &Form) -> [f64; SECTORS] {
        std::array::from_fn(|k| self.offset[k] - self.form[k].dot(form))
    }

    /// Which sectors of luma to trust. Chroma, where there is any, sees no panel lines: what is far from its ellipse is no rim.
    pub(super) fn trust(&self, chroma: Option<&Self>, prior: &FormMatrix) -> Trust {
        let mut trust = Trust::FULL;
        let by_chroma = chroma.and_then(|chroma| chroma.solved(&Trust::FULL, prior));
        if let Some(form) = &by_chroma {
            let apart = self.apart(form);
            // Light of another colour moves all of a rim alike.
            let middle = median(apart);
            let scale = (1.4826 * median(apart.map(|a| (a - middle).abs()))).max(2.0 * CHROMA_FLOOR_PX);
            trust.of = apart.map(|a| tukey((a - middle) / scale, 3.0));
        }
        for round in 0..ROUNDS {
            let Some(form) = self.solved(&trust, prior) else { return Trust::NONE };
            let apart = self.apart(&form);
            let sizes: [f64; SECTORS] = std::array::from_fn(|k| apart[k].abs() / self.variance[k].sqrt());
            let mut sorted = sizes;
            sorted.sort_unstable_by(f64::total_cmp);
            // Five of the sectors are used up: the median of what is left.
            trust.scatter = (1.4826 * sorted[usize::midpoint(SECTORS, FORM)]).max(1.0);
            // Without chroma nearly least absolute values come first, which a fifth of bad sectors cannot bend.
            let absolute = by_chroma.is_none() && round < ROUNDS / 2;
            trust.of = sizes.map(|size| {
                let size = size / trust.scatter;
                if absolute { size.max(0.3).recip() } else { tukey(size, 4.0) }
            });
        }
        trust
    }

    /// All sectors, as those of a small rim cannot be told from each other; but together they tell how well an ellipse fits.
    pub(super) fn untrimmed(&self, prior: &FormMatrix) -> Trust {
        let Some(form) = self.solved(&Trust::FULL, prior) else { return Trust::NONE };
        let squares =
            self.apart(&form).into_iter().zip(self.variance).map(|(apart, variance)| apart * apart / variance);
        let scatter = (squares.sum::<f64>() / (SECTORS - FORM) as f64).sqrt().max(1.0);
        Trust { scatter, ..Trust::FULL }
    }

    /// The share of what is known that is trusted.
    pub(super) fn kept(&self, trust: &Trust) -> f64 {
        let all: f64 = self.variance.iter().map(|v| v.recip()).sum();
        let kept: f64 = self.variance.iter().zip(trust.of).map(|(v, trust)| trust / v).sum();
        if all > 0.0 { kept / all } else { 1.0 }
    }
}

const ROUNDS: usize = 4;

/// The solution of normal equations that may lack a direction.
pub(super) fn solved(mut normal: FormMatrix, right: &Form) -> Option<Form> {
    for k in 0..FORM {
        normal[(k, k)] += 1e-9 * normal[(k, k)] + 1e-12;
    }
    Some(normal.cholesky()?.solve(right))
}

fn median(mut values: [f64; SECTORS]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    f64::midpoint(values[SECTORS / 2 - 1], values[SECTORS / 2])
}

/// Weight of Beaton and Tukey.
fn tukey(size: f64, limit: f64) -> f64 {
    let excess = (size / limit).powi(2);
    if excess >= 1.0 { 0.0 } else { (1.0 - excess).powi(2) }
}
