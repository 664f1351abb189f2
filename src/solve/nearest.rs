//! The rotation nearest to a matrix, without singular vectors where that is safe.

use nalgebra::{Matrix3, Rotation3};

use crate::geometry::rotation;

/// Newton steps for the largest root; from above it takes seven as a rule.
const STEPS: usize = 60;

/// Below this product of sums of singular values, in units of their norm, digits would be lost.
const MIN_DENOMINATOR: f64 = 1e-2;

/// As [`rotation::nearest`], and by that where the nearest one is not clearly so.
///
/// Markley 1993, "Attitude determination using vector observations: a fast optimal matrix algorithm".
#[must_use]
pub(super) fn nearest(matrix: &Matrix3<f64>) -> Option<Rotation3<f64>> {
    let norm = matrix.norm();
    if !(norm > 0.0 && norm.is_finite()) {
        return None;
    }
    let b = matrix / norm;
    let [x, y, z] = [b.column(0), b.column(1), b.column(2)];
    let cofactors = Matrix3::from_columns(&[y.cross(&z), z.cross(&x), x.cross(&y)]);
    let determinant = x.dot(&cofactors.column(0));
    let square = cofactors.norm_squared();
    // The largest sum of singular values, the last with the determinant's sign: the largest root of
    // (s^2 - 1)^2 - 8 s det - 4 |cofactors|^2, from its upper bound.
    let mut sum = 3.0_f64.sqrt();
    for _ in 0..STEPS {
        let excess = sum * sum - 1.0;
        let step =
            (excess * excess - 8.0 * sum * determinant - 4.0 * square) / (4.0 * sum * excess - 8.0 * determinant);
        sum -= step;
        // Also for NaN.
        if !(step > 1e-15) {
            break;
        }
    }
    let kappa = 0.5 * (sum * sum - 1.0);
    let denominator = kappa * sum - determinant;
    if !(denominator > MIN_DENOMINATOR) {
        return rotation::nearest(matrix);
    }
    let r = (b * (kappa + 1.0) + cofactors * sum - b * b.tr_mul(&b)) / denominator;
    // A step towards orthonormal columns brings them there to rounding.
    let r = r * (Matrix3::identity() * 1.5 - r.tr_mul(&r) * 0.5);
    Some(Rotation3::from_matrix_unchecked(r))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn it_is_the_one_of_the_singular_vectors(entries in proptest::array::uniform9(-1.0..1.0)) {
            let matrix = Matrix3::from_row_slice(&entries);
            let (Some(fast), Some(exact)) = (nearest(&matrix), rotation::nearest(&matrix)) else { return Ok(()) };
            // The exact one loses digits where two singular values nearly cancel.
            let gap = {
                let mut values = matrix.singular_values();
                values.as_mut_slice().sort_by(f64::total_cmp);
                (values[1] + values[0] * matrix.determinant().signum()) / values[2]
            };
            prop_assert!((fast.matrix() - exact.matrix()).amax() < 1e-13 / gap.max(1e-13));
            prop_assert!((fast.matrix().tr_mul(fast.matrix()) - Matrix3::identity()).amax() < 1e-14);
            prop_assert!(fast.matrix().determinant() > 0.0);
        }
    }

    #[test]
    fn a_reflection_a_flat_and_a_lost_matrix() {
        let mirrored = Matrix3::from_diagonal(&Vector3::new(3.0, 2.0, -1.0));
        assert!((nearest(&mirrored).expect("a rotation").matrix() - Matrix3::identity()).amax() < 1e-14);
        let flat = Matrix3::from_diagonal(&Vector3::new(3.0, 2.0, 0.0));
        assert!((nearest(&flat).expect("a rotation").matrix() - Matrix3::identity()).amax() < 1e-14);
        for lost in [Matrix3::zeros(), Matrix3::repeat(1.0), Matrix3::repeat(f64::NAN)] {
            assert_eq!(nearest(&lost), None);
        }
    }
}
