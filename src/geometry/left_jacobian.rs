//! The left Jacobian of SO(3): how a turn changes when its rotation vector does.

use nalgebra::{Matrix3, Vector3};

use super::rotation::cross_matrix;

/// Below this squared angle the series is used; the terms left out are below rounding.
const SMALL_SQUARED: f64 = 1e-4;

/// `Exp(v + d) = Exp(J(v) d) Exp(v)` to first order in `d`.
/// Sola, Deray and Atchuthan, "A micro Lie theory for state estimation in robotics", 2018, equation 145.
#[must_use]
pub fn left_jacobian(vector_rad: &Vector3<f64>) -> Matrix3<f64> {
    let squared = vector_rad.norm_squared();
    let (versine_ratio, rest_ratio) = if squared < SMALL_SQUARED {
        (0.5 - squared / 24.0 * (1.0 - squared / 30.0), 1.0 / 6.0 - squared / 120.0 * (1.0 - squared / 42.0))
    } else {
        let angle = squared.sqrt();
        let half_sine = (0.5 * angle).sin();
        (2.0 * half_sine * half_sine / squared, (angle - angle.sin()) / (squared * angle))
    };
    let cross = cross_matrix(vector_rad);
    Matrix3::identity() + cross * versine_ratio + cross * cross * rest_ratio
}

/// The inverse of [`left_jacobian`], for angles up to half a turn: `Log(Exp(d) Exp(v)) = v + J(v)^-1 d` to first order.
/// Equation 146 there, with the half angle's cotangent so that half a turn is no special case.
#[must_use]
pub fn left_jacobian_inverse(vector_rad: &Vector3<f64>) -> Matrix3<f64> {
    let squared = vector_rad.norm_squared();
    let ratio = if squared < SMALL_SQUARED {
        1.0 / 12.0 + squared / 720.0 * (1.0 + squared / 42.0)
    } else {
        let half = 0.5 * squared.sqrt();
        (1.0 - half * half.cos() / half.sin()) / squared
    };
    let cross = cross_matrix(vector_rad);
    Matrix3::identity() - cross * 0.5 + cross * cross * ratio
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use proptest::prelude::*;

    use super::*;
    use crate::geometry::rotation;

    fn turn(limit_rad: f64) -> impl Strategy<Value = Vector3<f64>> {
        (proptest::array::uniform3(-1.0..1.0_f64), 0.0..limit_rad)
            .prop_filter_map("no axis", |(v, angle)| Vector3::from(v).try_normalize(1e-3).map(|axis| axis * angle))
    }

    /// Columns of central differences of `function` at zero.
    fn differences(function: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Matrix3<f64> {
        let step = 1e-5;
        let columns = [0, 1, 2].map(|axis| {
            let along = Vector3::ith(axis, step);
            (function(&along) - function(&-along)) / (2.0 * step)
        });
        Matrix3::from_columns(&columns)
    }

    proptest! {
        #[test]
        fn both_agree_with_central_differences(v in turn(PI - 0.01)) {
            let turned = rotation::exp(&v);
            let of_exp = differences(|d| rotation::log(&(rotation::exp(&(v + d)) * turned.inverse())));
            prop_assert!((of_exp - left_jacobian(&v)).amax() < 1e-8);
            let of_log = differences(|d| rotation::log(&(rotation::exp(d) * turned)));
            // Near half a turn the second derivative is as large as the inverse distance to it.
            prop_assert!((of_log - left_jacobian_inverse(&v)).amax() < 1e-5);
        }

        #[test]
        fn one_undoes_the_other_and_small_turns_are_no_exception(v in turn(PI), exponent in 0..8_i32) {
            let v = v * 10.0_f64.powi(-exponent);
            prop_assert!((left_jacobian(&v) * left_jacobian_inverse(&v) - Matrix3::identity()).amax() < 1e-11);
        }
    }
}
