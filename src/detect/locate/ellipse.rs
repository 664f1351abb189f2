//! A blurred ellipse.

use nalgebra::{Matrix2, SVector, Vector2};

/// What moves a rim: two of position, three of shape.
pub(super) const FORM: usize = 5;

/// The set of `x` with `(x - centre)^T matrix (x - centre) <= 1`, seen through a round blur.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ellipse {
    /// Where it is, px.
    pub centre: Vector2<f64>,
    /// Its shape, px^-2.
    pub matrix: Matrix2<f64>,
    /// Logarithm of the blur's variance, px^2.
    pub ln_blur: f64,
}

/// A logistic step of this slope is the error function's within 0.01.
pub(super) const LOGISTIC: f64 = 1.702;

/// Longest step of the centre at once, px: beyond it the rim's pixels say nothing.
const MAX_STEP_PX: f64 = 0.8;

impl Ellipse {
    pub(super) fn area_px(&self) -> f64 {
        std::f64::consts::PI / self.matrix.determinant().max(1e-12).sqrt()
    }

    /// Moved by a step of centre and matrix, cut short where it would lead too far.
    pub(super) fn moved(&self, step: &SVector<f64, FORM>) -> Self {
        let share = (MAX_STEP_PX / step.xy().norm().max(1e-12)).min(1.0);
        let mut change = Matrix2::new(step[2], step[3], step[3], step[4]) * share;
        // Not smaller or larger than by a half at once, so always an ellipse.
        let scale = self.matrix.m11.min(self.matrix.m22).min(self.matrix.determinant() / self.matrix.trace());
        let largest = change.abs().max() * 2.0;
        if largest > 0.5 * scale {
            change *= 0.5 * scale / largest;
        }
        Self { centre: self.centre + step.xy() * share, matrix: self.matrix + change, ..*self }
    }
}
