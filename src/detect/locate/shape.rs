//! What is known of the shape of a blob before it is looked at.

use nalgebra::{Matrix2, Matrix3, Vector3};

use super::rim::{Form, FormMatrix};

/// Shape of a blob that is known from elsewhere, as that of a marker is whose size and attitude are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Second moments of its area, px^2.
    pub moments: Matrix2<f64>,
    /// Covariance of (xx, xy, yy) of them, px^4.
    pub covariance: Matrix3<f64>,
}

impl Shape {
    /// Area of the ellipse with these moments, px.
    #[must_use]
    pub fn area_px(&self) -> f64 {
        4.0 * std::f64::consts::PI * self.moments.determinant().max(0.0).sqrt()
    }
}

/// The same of an ellipse's matrix, which draws its fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pull {
    pub matrix: Matrix2<f64>,
    information: Matrix3<f64>,
}

impl Pull {
    /// `None` if the moments are no ellipse's, or the covariance none.
    pub(super) fn of(shape: &Shape) -> Option<Self> {
        let matrix = (shape.moments * 4.0).try_inverse().filter(|m| m.m11 > 0.0 && m.determinant() > 0.0)?;
        // M = (4 S)^-1, so dM = -M (4 dS) M.
        let column = |of: Matrix2<f64>| {
            let change = matrix * of * matrix * -4.0;
            Vector3::new(change.m11, change.m12, change.m22)
        };
        let jacobian = Matrix3::from_columns(&[
            column(Matrix2::new(1.0, 0.0, 0.0, 0.0)),
            column(Matrix2::new(0.0, 1.0, 1.0, 0.0)),
            column(Matrix2::new(0.0, 0.0, 0.0, 1.0)),
        ]);
        let information = (jacobian * shape.covariance * jacobian.transpose()).cholesky()?.inverse();
        information.iter().all(|x| x.is_finite()).then_some(Self { matrix, information })
    }

    /// Normal equations of the step that leads from `matrix` to what is known.
    pub(super) fn equations(&self, matrix: &Matrix2<f64>) -> (FormMatrix, Form) {
        let (mut normal, mut right) = (FormMatrix::zeros(), Form::zeros());
        let off = self.matrix - matrix;
        normal.fixed_view_mut::<3, 3>(2, 2).copy_from(&self.information);
        right.fixed_rows_mut::<3>(2).copy_from(&(self.information * Vector3::new(off.m11, off.m12, off.m22)));
        (normal, right)
    }
}
