//! The covariance of a pose.

use nalgebra::{Matrix6, Rotation3, Vector6};

use super::space::Space;
use super::transform::Transform;

/// 6 x 6 covariance of a pose in the order x, y, z (m), rotation about camera x, y, z (rad), for the error
/// `(t_true - t, Log(R_true R^T))`: the order of ROS `PoseWithCovariance`. Symmetric and positive definite by
/// construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseCovariance(Matrix6<f64>);

impl PoseCovariance {
    /// A coordinate whose variance grows by more than this because the other five are unknown too is not determined:
    /// rounding alone, 2e-16 of the information, would decide its value.
    const MAX_INFLATION: f64 = 1e12;

    /// The inverse of an information matrix, or `None` if that is not positive definite, not finite, or so nearly
    /// singular that the inverse would be noise.
    #[must_use]
    pub fn from_information(information: &Matrix6<f64>) -> Option<Self> {
        // Metres and radians differ in size, so the matrix is scaled to a unit diagonal before it is inverted.
        let mut scale = Vector6::zeros();
        for i in 0..6 {
            let d = information[(i, i)];
            if !d.is_finite() || d <= 0.0 {
                return None;
            }
            scale[i] = 1.0 / d.sqrt();
        }
        let scaled = Matrix6::from_fn(|r, c| information[(r, c)] * scale[r] * scale[c]);
        let inverse = scaled.cholesky()?.inverse();
        if !(inverse.diagonal().max() < Self::MAX_INFLATION) {
            return None;
        }
        let covariance = Matrix6::from_fn(|r, c| 0.5 * (inverse[(r, c)] + inverse[(c, r)]) * scale[r] * scale[c]);
        Self::checked(covariance)
    }

    /// `matrix` as a covariance, or `None` if it is not symmetric positive definite.
    #[must_use]
    pub fn checked(matrix: Matrix6<f64>) -> Option<Self> {
        let finite = matrix.iter().all(|x| x.is_finite());
        let symmetric = (matrix - matrix.transpose()).amax() <= 1e-9 * matrix.amax();
        (finite && symmetric && matrix.cholesky().is_some()).then_some(Self(matrix))
    }

    /// The matrix.
    #[must_use]
    pub const fn matrix(&self) -> &Matrix6<f64> {
        &self.0
    }

    /// Every entry multiplied by `factor`, which must be positive.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        debug_assert!(factor > 0.0 && factor.is_finite());
        Self(self.0 * factor)
    }

    /// The covariance of the same pose seen from a space whose axes are turned: `rotation` takes the camera's coordinates to those of the
    /// other space, wherever its origin is. Errors of translation and rotation both are vectors of the space in which the pose is told.
    #[must_use]
    pub fn turned(&self, rotation: &Rotation3<f64>) -> Self {
        let mut both = Matrix6::zeros();
        both.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation.matrix());
        both.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation.matrix());
        let turned = both * self.0 * both.transpose();
        Self((turned + turned.transpose()) * 0.5)
    }

    /// Natural logarithm of the determinant.
    #[must_use]
    pub fn ln_determinant(&self) -> f64 {
        self.0.cholesky().map_or(f64::NEG_INFINITY, |c| 2.0 * c.l_dirty().diagonal().map(f64::ln).sum())
    }

    /// Normalised estimation error squared of `estimate` against `truth`: chi-square with 6 degrees of freedom where the
    /// covariance is right.
    #[must_use]
    pub fn normalized_error_squared<To: Space, From: Space>(
        &self,
        estimate: &Transform<To, From>,
        truth: &Transform<To, From>,
    ) -> f64 {
        let error = estimate.difference_to(truth);
        self.0.cholesky().map_or(f64::INFINITY, |c| error.dot(&c.solve(&error)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_badly_scaled_information_matrix_is_inverted_to_rounding() {
        let scales = [1e6, 1e6, 1e1, 1e-2, 1e-2, 1e3];
        let information = Matrix6::from_fn(|r, c| scales[r] * scales[c] * if r == c { 1.0 } else { 0.3 });
        let covariance = PoseCovariance::from_information(&information).expect("positive definite");
        assert!((information * covariance.matrix() - Matrix6::identity()).amax() < 1e-6);
    }

    #[test]
    fn singular_and_non_finite_information_gives_no_covariance() {
        assert!(PoseCovariance::from_information(&Matrix6::zeros()).is_none());
        assert!(PoseCovariance::from_information(&Matrix6::repeat(1.0)).is_none());
        assert!(PoseCovariance::from_information(&Matrix6::repeat(f64::NAN)).is_none());
    }

    #[test]
    fn the_determinant_of_a_diagonal_covariance_is_the_product_of_its_variances() {
        let diagonal = Vector6::new(1.0, 4.0, 9.0, 0.25, 1.0, 1.0);
        let covariance = PoseCovariance::checked(Matrix6::from_diagonal(&diagonal)).expect("positive definite");
        assert!((covariance.ln_determinant() - 9.0_f64.ln()).abs() < 1e-12);
    }
}
