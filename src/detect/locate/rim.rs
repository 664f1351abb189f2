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

/// Normal equations of the form: its matrix, and what that times the form is to be.
pub(super) type Equations = (FormMatrix, Form);

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
            self.add_sector(k, trust.of[k], normal, right);
        }
    }

    fn add_sector(&self, k: usize, trust: f64, normal: &mut FormMatrix, right: &mut Form) {
        let weight = trust / self.variance[k];
        normal.ger(weight, &self.form[k], &self.form[k], 1.0);
        right.axpy(weight * self.offset[k], &self.form[k], 1.0);
    }

    fn solved(&self, trust: &Trust, base: &Equations) -> Option<Form> {
        let (mut normal, mut right) = *base;
        self.add_to(trust, &mut normal, &mut right);
        solved(normal, &right)
    }

    /// What of the rim deviates from an ellipse that `form` has moved.
    fn apart(&self, form: &Form) -> [f64; SECTORS] {
        std::array::from_fn(|k| self.offset[k] - self.form[k].dot(form))
    }

    /// What each sector pulls outwards beside an ellipse that `form` has moved, and the variance of that which its own lets expect.
    fn pulls(&self, trust: &Trust, form: &Form) -> [(f64, f64); SECTORS] {
        let apart = self.apart(form);
        std::array::from_fn(|k| {
            let weight = trust.of[k] / self.variance[k];
            (weight * apart[k], weight)
        })
    }

    /// Which sectors of luma to trust. `base` is what else is known of the form: equations of chroma and of a known shape; `before`
    /// is what the pass before trusted.
    pub(super) fn trust(&self, base: &Equations, before: Option<&Trust>) -> Trust {
        let start = match before {
            Some(before) => self.solved(before, base),
            None => self.agreed(base),
        };
        let Some(mut form) = start else { return Trust::NONE };
        let mut trust = Trust::FULL;
        for _ in 0..ROUNDS {
            let mut sizes = self.sizes(&form);
            let all = sizes;
            // Five of the sectors are used up: the median of what is left.
            let middle = usize::midpoint(SECTORS, FORM);
            let scatter = 1.4826 * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
            trust.scatter = scatter.max(LEAST_SCATTER);
            trust.of = all.map(|size| tukey(size / scatter.max(LEAST_SCALE), MAX_DEVIATIONS));
            let Some(next) = self.solved(&trust, base) else { return Trust::NONE };
            form = next;
        }
        trust
    }

    /// The form that most of the sectors agree with.
    ///
    /// What spoils a rim (a line along it, a neighbour, what hides a part) spoils one stretch of it and bends an ellipse towards itself, so
    /// that nothing looks wrong any more. So each stretch in turn is left out.
    fn agreed(&self, base: &Equations) -> Option<Form> {
        let of_sector = |k: usize| {
            let (mut normal, mut right) = (FormMatrix::zeros(), Form::zeros());
            self.add_sector(k, 1.0, &mut normal, &mut right);
            (normal, right)
        };
        let sectors: [Equations; SECTORS] = std::array::from_fn(of_sector);
        let (mut normal, mut right) = *base;
        for sector in &sectors {
            normal += sector.0;
            right += sector.1;
        }
        let mut best = solved(normal, &right).map(|form| (self.size_of_most(&form), form));
        for sector in &sectors[..STRETCH] {
            normal -= sector.0;
            right -= sector.1;
        }
        for start in 0..SECTORS {
            if let Some(form) = solved(normal, &right) {
                let size = self.size_of_most(&form);
                if best.as_ref().is_none_or(|(least, _)| size < *least) {
                    best = Some((size, form));
                }
            }
            let (back, gone) = (&sectors[start], &sectors[(start + STRETCH) % SECTORS]);
            normal += back.0 - gone.0;
            right += back.1 - gone.1;
        }
        best.map(|(_, form)| form)
    }

    /// How far the sectors lie beside an ellipse that `form` has moved, in deviations.
    fn sizes(&self, form: &Form) -> [f64; SECTORS] {
        let apart = self.apart(form);
        std::array::from_fn(|k| apart[k].abs() / self.variance[k].sqrt())
    }

    /// The largest of those but a stretch of the largest.
    fn size_of_most(&self, form: &Form) -> f64 {
        *self.sizes(form).select_nth_unstable_by(SECTORS - STRETCH, f64::total_cmp).1
    }

    /// All sectors, as those of a small rim cannot be told from each other; but together they tell how well an ellipse fits.
    pub(super) fn untrimmed(&self, base: &Equations) -> Trust {
        let Some(form) = self.solved(&Trust::FULL, base) else { return Trust::NONE };
        let squares =
            self.apart(&form).into_iter().zip(self.variance).map(|(apart, variance)| apart * apart / variance);
        let scatter = (squares.sum::<f64>() / (SECTORS - FORM) as f64).sqrt().max(LEAST_SCATTER);
        Trust { scatter, ..Trust::FULL }
    }

    /// The share of what is known that is trusted.
    pub(super) fn kept(&self, trust: &Trust) -> f64 {
        let all: f64 = self.variance.iter().map(|v| v.recip()).sum();
        let kept: f64 = self.variance.iter().zip(trust.of).map(|(v, trust)| trust / v).sum();
        if all > 0.0 { kept / all } else { 1.0 }
    }
}

/// By how much, as a factor of variance, the place is worse known than the sectors' own variances say; beside an ellipse that `form` has
/// moved, of all channels together.
///
/// What optics and sampling do to all of a rim alike moves no centre, however badly it fits an ellipse. Only what one side has and the
/// opposite one has not does.
pub(super) fn unevenness(channels: &[(&Offsets, &Trust)], form: &Form) -> f64 {
    let mut pulls = [(0.0, 0.0); SECTORS];
    for (offsets, trust) in channels {
        for (sum, (pull, expected)) in pulls.iter_mut().zip(offsets.pulls(trust, form)) {
            *sum = (sum.0 + pull, sum.1 + expected);
        }
    }
    let (one, opposite) = pulls.split_at(SECTORS / 2);
    let (mut squares, mut pairs) = (0.0, 0.0);
    for ((pull, expected), (back, as_expected)) in one.iter().zip(opposite) {
        if expected.min(*as_expected) > 0.0 {
            squares += (pull - back).powi(2) / (expected + as_expected);
            pairs += 1.0;
        }
    }
    // The place itself has used up two.
    (squares + BEFOREHAND * EXPECTED_UNEVENNESS) / (pairs - 2.0 + BEFOREHAND).max(1.0)
}

/// What is expected before a rim is looked at, and the pairs of sectors for which that counts.
const EXPECTED_UNEVENNESS: f64 = 0.64;
const BEFOREHAND: f64 = 4.0;

/// Sectors that are left out together.
const STRETCH: usize = 7;

/// Rounds of weighing sectors by how far they lie beside the ellipse that the others make.
const ROUNDS: usize = 4;

/// Sectors that agree better than their pixels' noise allows are believed so far: noise is stated smaller by as much at most.
const LEAST_SCATTER: f64 = 0.8;

/// What is beyond so many of the sectors' own deviations, or of this part of those that their noise allows, is none of them.
const MAX_DEVIATIONS: f64 = 4.0;
const LEAST_SCALE: f64 = 0.5;

/// The solution of normal equations that may lack a direction.
pub(super) fn solved(mut normal: FormMatrix, right: &Form) -> Option<Form> {
    for k in 0..FORM {
        normal[(k, k)] += 1e-9 * normal[(k, k)] + 1e-12;
    }
    Some(normal.cholesky()?.solve(right))
}

/// Weight of Beaton and Tukey.
fn tukey(size: f64, limit: f64) -> f64 {
    let excess = (size / limit).powi(2);
    if excess >= 1.0 { 0.0 } else { (1.0 - excess).powi(2) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offsets(offset: impl Fn(f64) -> f64) -> Offsets {
        let angle = |k: usize| std::f64::consts::TAU * k as f64 / SECTORS as f64;
        Offsets {
            offset: std::array::from_fn(|k| offset(angle(k))),
            variance: [1e-4; SECTORS],
            form: std::array::from_fn(|k| Form::new(angle(k).cos(), angle(k).sin(), 0.0, 0.0, 0.0)),
        }
    }

    #[test]
    fn only_what_one_side_has_and_the_opposite_one_has_not_is_uneven() {
        let full = Trust::FULL;
        let of = |offsets: &Offsets, form: Form| unevenness(&[(offsets, &full)], &form);
        let least = BEFOREHAND * EXPECTED_UNEVENNESS / (10.0 + BEFOREHAND);
        let square = offsets(|angle| 0.05 * (4.0 * angle).cos());
        assert!((of(&square, Form::zeros()) - least).abs() < 1e-9, "alike on both sides");
        let moved = offsets(|angle| 0.05 * angle.cos());
        let to = Form::new(0.05, 0.0, 0.0, 0.0, 0.0);
        assert!((of(&moved, to) - least).abs() < 1e-9, "the form has gone there");
        // Twelve pairs of twice 0.05 cos(3 angle), each against a variance of two sectors': 12 * 25.
        let bent = offsets(|angle| 0.05 * (3.0 * angle).cos());
        let expected = least + 12.0 * 25.0 / (10.0 + BEFOREHAND);
        assert!((of(&bent, Form::zeros()) / expected - 1.0).abs() < 1e-6, "{}", of(&bent, Form::zeros()));
    }
}
