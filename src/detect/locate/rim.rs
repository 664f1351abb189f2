//! The rim cut into sectors: which of them belong to an ellipse.
//!
//! A panel line that touches a marker, or a neighbour that hides a part of it, spoils a stretch of its rim. No pixel of
//! that stretch looks wrong by itself, but all of them together say that the rim lies elsewhere.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x8, f64x4};
use nalgebra::{SMatrix, SVector};

use super::ellipse::FORM;
use super::lanes::LANES;
use crate::detect::{MACHINE, single};

/// Sectors of the rim.
pub(super) const SECTORS: usize = 24;

/// Groups of as many sectors as there are lanes.
pub(super) const GROUPS: usize = SECTORS / LANES;

/// Sectors of each quadrant. Each group has those that lie as far from its axes, which are as wide as each other.
const QUADRANT: usize = SECTORS / 4;

/// The group and the lane of a sector.
pub(super) const fn seat(sector: usize) -> (usize, usize) {
    let (quadrant, place) = (sector / QUADRANT, sector % QUADRANT);
    if place < GROUPS { (place, 2 * quadrant) } else { (QUADRANT - 1 - place, 2 * quadrant + 1) }
}

/// The sectors of a group, lane by lane.
pub(super) fn sectors(group: usize) -> [usize; LANES] {
    std::array::from_fn(|lane| QUADRANT * (lane / 2) + if lane % 2 == 0 { group } else { QUADRANT - 1 - group })
}

pub(super) type Form = SVector<f64, FORM>;
pub(super) type FormMatrix = SMatrix<f64, FORM, FORM>;

/// Normal equations of the form: its matrix, and what that times the form is to be.
pub(super) type Equations = (FormMatrix, Form);

/// What the pixels of each sector say: how far outwards their rim lies, each entry weighted by its information.
#[derive(Clone, Debug, Default)]
pub(super) struct Rim {
    pub information: [f64; SECTORS],
    pub pull: [f64; SECTORS],
    pub form: [[f64; SECTORS]; FORM],
}

/// The same as offsets.
pub(super) struct Offsets {
    /// How far outwards the rim lies, px.
    offset: [f64; SECTORS],
    /// Inverse of its deviation, 1/px; zero where nothing is known.
    certainty: [f64; SECTORS],
    /// What of the form moves it.
    form: [[f64; SECTORS]; FORM],
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
pub(super) const CHROMA_FLOOR_PX: f64 = 0.045;

impl Rim {
    pub(super) fn offsets(&self, floor_px: f64) -> Offsets {
        let per_information = self.information.map(|known| if known > 1e-9 { known.recip() } else { 0.0 });
        let certain = |of: f64| if of > 0.0 { (of + floor_px * floor_px).sqrt().recip() } else { 0.0 };
        let (mut offset, mut form) = (self.pull, self.form);
        for of in form.iter_mut().chain([&mut offset]) {
            for (of, per_information) in of.iter_mut().zip(&per_information) {
                *of *= per_information;
            }
        }
        Offsets { offset, certainty: per_information.map(certain), form }
    }
}

impl Offsets {
    /// Adds the normal equations of the form.
    pub(super) fn add_to(&self, trust: &Trust, normal: &mut FormMatrix, right: &mut Form) {
        let (sums, moments) = dispatch!(*MACHINE, simd => self.products(simd, &self.weights(trust)));
        for row in 0..FORM {
            for column in 0..row {
                normal[(row, column)] += sums[row][column];
                normal[(column, row)] += sums[row][column];
            }
            normal[(row, row)] += sums[row][row];
            right[row] += moments[row];
        }
    }

    /// Weighted sums of products of the form's rows, up to the diagonal, and of those with the offsets.
    #[inline(always)]
    fn products<S: Simd>(&self, simd: S, weights: &[f64; SECTORS]) -> ([[f64; FORM]; FORM], [f64; FORM]) {
        const WIDE: usize = 4;
        let zero = f64x4::splat(simd, 0.0);
        let mut sums = [[zero; FORM]; FORM];
        let mut moments = [zero; FORM];
        let at = |of: &[f64; SECTORS], start: usize| f64x4::from_slice(simd, &of[start..start + WIDE]);
        for start in (0..SECTORS).step_by(WIDE) {
            let (weight, offset) = (at(weights, start), at(&self.offset, start));
            let form = self.form.each_ref().map(|form| at(form, start));
            for row in 0..FORM {
                let weighted = weight * form[row];
                for (sum, other) in sums[row].iter_mut().zip(&form).take(row + 1) {
                    *sum += weighted * *other;
                }
                moments[row] += weighted * offset;
            }
        }
        let total = |lanes: f64x4<S>| {
            let [a, b, c, d] = *lanes;
            (a + b) + (c + d)
        };
        (sums.map(|row| row.map(total)), moments.map(total))
    }

    /// What each sector counts.
    fn weights(&self, trust: &Trust) -> [f64; SECTORS] {
        std::array::from_fn(|k| trust.of[k] * self.certainty[k] * self.certainty[k])
    }

    fn equations_of(&self, k: usize) -> Equations {
        let form = Form::from(self.form.each_ref().map(|form| form[k]));
        let weight = self.certainty[k] * self.certainty[k];
        (form * form.transpose() * weight, form * (weight * self.offset[k]))
    }

    fn solved(&self, trust: &Trust, base: &Equations) -> Option<Form> {
        let (mut normal, mut right) = *base;
        self.add_to(trust, &mut normal, &mut right);
        solved(normal, &right)
    }

    /// What of the rim deviates from an ellipse that `form` has moved.
    fn apart(&self, form: &Form) -> [f64; SECTORS] {
        let mut apart = self.offset;
        for (of, by) in self.form.iter().zip(form) {
            for (apart, of) in apart.iter_mut().zip(of) {
                *apart -= of * by;
            }
        }
        apart
    }

    /// What each sector pulls outwards beside an ellipse that `form` has moved, and the variance of that which its own lets expect.
    fn pulls(&self, trust: &Trust, form: &Form) -> [(f64, f64); SECTORS] {
        let (apart, weights) = (self.apart(form), self.weights(trust));
        std::array::from_fn(|k| (weights[k] * apart[k], weights[k]))
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
            let sizes = self.sizes(&form);
            // Five of the sectors are used up: the median of what is left.
            let scatter = 1.4826 * ranked(&sizes, usize::midpoint(SECTORS, FORM));
            trust.scatter = scatter.max(LEAST_SCATTER);
            trust.of = sizes.map(|size| tukey(size / scatter.max(LEAST_SCALE), MAX_DEVIATIONS));
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
        let sectors: [Equations; SECTORS] = std::array::from_fn(|k| self.equations_of(k));
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
        std::array::from_fn(|k| apart[k].abs() * self.certainty[k])
    }

    /// The largest of those but a stretch of the largest.
    fn size_of_most(&self, form: &Form) -> f64 {
        ranked(&self.sizes(form), SECTORS - STRETCH)
    }

    /// All sectors, as those of a small rim cannot be told from each other; but together they tell how well an ellipse fits.
    pub(super) fn untrimmed(&self, base: &Equations) -> Trust {
        let Some(form) = self.solved(&Trust::FULL, base) else { return Trust::NONE };
        let squares = self.sizes(&form).into_iter().map(|size| size * size);
        let scatter = (squares.sum::<f64>() / (SECTORS - FORM) as f64).sqrt().max(LEAST_SCATTER);
        Trust { scatter, ..Trust::FULL }
    }

    /// The share of what is known that is trusted.
    pub(super) fn kept(&self, trust: &Trust) -> f64 {
        let [all, kept] = [&Trust::FULL, trust].map(|trust| self.weights(trust).iter().sum::<f64>());
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

/// The value of that rank, from zero, by counting for each how many are less: of so few that is faster than moving them.
fn ranked(values: &[f64; SECTORS], rank: usize) -> f64 {
    let values = values.map(single);
    f64::from(dispatch!(*MACHINE, simd => ranked_by(simd, &values, rank as f32)))
}

#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn ranked_by<S: Simd>(simd: S, values: &[f32; SECTORS], rank: f32) -> f32 {
    let lanes: [f32x8<S>; GROUPS] = std::array::from_fn(|k| f32x8::from_slice(simd, &values[LANES * k..][..LANES]));
    let [zero, one] = [0.0, 1.0].map(|value| f32x8::splat(simd, value));
    let mut less = [zero; GROUPS];
    for other in values {
        for (less, values) in less.iter_mut().zip(&lanes) {
            *less += values.simd_gt(*other).select(one, zero);
        }
    }
    // The largest that no more than `rank` are less than.
    let within = less.iter().zip(&lanes).map(|(less, values)| less.simd_le(rank).select(*values, zero));
    within.fold(zero, SimdBase::max).reduce_max()
}

/// The solution of normal equations that may lack a direction. By Cholesky's factors without roots, and in place: thirty of these are
/// solved for each look at a rim, and of five unknowns that takes half of what it takes of any number.
pub(super) fn solved(mut normal: FormMatrix, right: &Form) -> Option<Form> {
    let mut solution = *right;
    for column in 0..FORM {
        normal[(column, column)] += 1e-9 * normal[(column, column)] + 1e-12;
    }
    for column in 0..FORM {
        let pivot = normal[(column, column)];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        let per_pivot = pivot.recip();
        normal[(column, column)] = per_pivot;
        for row in column + 1..FORM {
            let factor = normal[(row, column)] * per_pivot;
            for to in column + 1..=row {
                normal[(row, to)] -= factor * normal[(to, column)];
            }
            solution[row] -= factor * solution[column];
        }
    }
    // On the diagonal are the pivots' reciprocals by now.
    for row in (0..FORM).rev() {
        for below in row + 1..FORM {
            solution[row] -= normal[(below, row)] * solution[below];
        }
        solution[row] *= normal[(row, row)];
    }
    Some(solution)
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
            certainty: [1e2; SECTORS],
            form: [0, 1, 2, 3, 4].map(|row| {
                std::array::from_fn(|k| match row {
                    0 => angle(k).cos(),
                    1 => angle(k).sin(),
                    _ => 0.0,
                })
            }),
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

    #[test]
    fn products_are_the_same_in_all_registers() {
        let of = |k: usize, row: usize| ((k * 37 + row * 11) % 29) as f64 * 0.37 - 4.0;
        let offsets = Offsets {
            offset: std::array::from_fn(|k| of(k, 9)),
            certainty: std::array::from_fn(|k| 1.0 + of(k, 7).abs()),
            form: [0, 1, 2, 3, 4].map(|row| std::array::from_fn(|k| of(k, row))),
        };
        let weights = offsets.weights(&Trust::FULL);
        let slow = |a: &[f64; SECTORS], b: &[f64; SECTORS]| {
            let lane = |lane: usize| (lane..SECTORS).step_by(4).map(|k| weights[k] * a[k] * b[k]).sum::<f64>();
            (lane(0) + lane(1)) + (lane(2) + lane(3))
        };
        for level in [*MACHINE, fearless_simd::Level::baseline()] {
            let (sums, moments) = dispatch!(level, simd => offsets.products(simd, &weights));
            for row in 0..FORM {
                for (sum, other) in sums[row].iter().zip(&offsets.form).take(row + 1) {
                    assert_eq!(sum.to_bits(), slow(&offsets.form[row], other).to_bits(), "{row}");
                }
                let expected = slow(&offsets.form[row], &offsets.offset);
                assert_eq!(moments[row].to_bits(), expected.to_bits(), "{row}");
            }
        }
    }
}
