//! The normal equations of six unknowns.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instructions of the function that calls it"
)]

use nalgebra::{Matrix6, Vector6};

use super::lanes::Lanes;

/// Entries of the upper triangle, row by row.
const ENTRIES: usize = 21;

/// Sums over points, four side by side.
pub(super) struct Sums {
    information: [Lanes; ENTRIES],
    descent: [Lanes; 6],
}

impl Sums {
    pub(super) const ZERO: Self = Self { information: [Lanes::ZERO; ENTRIES], descent: [Lanes::ZERO; 6] };

    /// Adds four points' `distance`s with their derivatives and weights.
    #[inline(always)]
    pub(super) fn add(&mut self, distance: &[Lanes; 2], by_pose: &[[Lanes; 6]; 2], weight: Lanes) {
        let [a, b] = by_pose;
        let mut entry = 0;
        for row in 0..6 {
            let (weighed_a, weighed_b) = (weight * a[row], weight * b[row]);
            self.descent[row] += weighed_a * distance[0] + weighed_b * distance[1];
            for column in row..6 {
                self.information[entry] += weighed_a * a[column] + weighed_b * b[column];
                entry += 1;
            }
        }
    }

    pub(super) fn total(&self) -> Normal {
        let mut entries = self.information.iter().map(|lanes| lanes.sum());
        let mut information = Matrix6::zeros();
        for row in 0..6 {
            for column in row..6 {
                let entry = entries.next().unwrap_or_default();
                information[(row, column)] = entry;
                information[(column, row)] = entry;
            }
        }
        Normal { information, descent: Vector6::from_fn(|row, _| self.descent[row].sum()) }
    }
}

/// `information * step = descent`.
pub(super) struct Normal {
    pub information: Matrix6<f64>,
    /// Half the downhill gradient.
    pub descent: Vector6<f64>,
}

impl Normal {
    /// The step with the diagonal raised by a share of itself; `None` if the matrix is not positive definite.
    #[expect(clippy::needless_range_loop, reason = "rows and columns of the same matrix")]
    pub(super) fn damped_step(&self, damping: f64) -> Option<Vector6<f64>> {
        // Cholesky without roots: information = L D L', L with ones on its diagonal.
        let mut l = [[0.0; 6]; 6];
        let mut inverse = [0.0; 6];
        let mut x = [0.0; 6];
        for column in 0..6 {
            let own = self.information[(column, column)];
            let mut pivot = own + damping * own.max(f64::MIN_POSITIVE);
            for k in 0..column {
                pivot -= l[column][k] * l[k][column];
            }
            // Also for NaN.
            if !(pivot > 0.0) {
                return None;
            }
            inverse[column] = 1.0 / pivot;
            for row in column + 1..6 {
                let mut rest = self.information[(row, column)];
                for k in 0..column {
                    rest -= l[row][k] * l[k][column];
                }
                // Above the diagonal D L', below it L.
                l[column][row] = rest;
                l[row][column] = rest * inverse[column];
            }
        }
        for row in 0..6 {
            let mut rest = self.descent[row];
            for k in 0..row {
                rest -= l[row][k] * x[k];
            }
            x[row] = rest;
        }
        for row in (0..6).rev() {
            let mut rest = x[row] * inverse[row];
            for k in row + 1..6 {
                rest -= l[k][row] * x[k];
            }
            x[row] = rest;
        }
        let step = Vector6::from(x);
        step.iter().all(|x| x.is_finite()).then_some(step)
    }
}
