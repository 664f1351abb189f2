//! What white acceleration adds to the covariance between two frames.

use nalgebra::{Matrix3, Vector3};

use super::motion::Matrix12;
use super::options::TrackOptions;
use crate::geometry::rotation::cross_matrix;

/// Below this squared turn the series is used; the terms left out are below 1e-9 of the whole.
const SMALL_SQUARED: f64 = 1e-4;

/// The exact covariance of the constant-velocity model after `dt_s` of white acceleration and angular acceleration, about a
/// motion that turns by `turn_rad` meanwhile.
///
/// For the translation it is the one of Bar-Shalom, Li and Kirubarajan, "Estimation with applications to tracking and
/// navigation", 2001, section 6.2.2. A kick to the angular velocity, `s` before the end, turns the end by
/// `A(s) = integral of Exp(u turn / dt) over u from 0 to s`; what is needed are the integrals of `A A^T` and `A` over `s`, which
/// have closed forms along the axis and in the plane across it.
pub(super) fn process_noise(turn_rad: &Vector3<f64>, dt_s: f64, options: &TrackOptions) -> Matrix12 {
    let along = options.acceleration_mps2_per_rthz.powi(2);
    let about = options.angular_acceleration_radps2_per_rthz.powi(2);
    let (attitude, cross) = turned(turn_rad, dt_s);
    let mut noise = Matrix12::zeros();
    let mut put = |row: usize, column: usize, block: &Matrix3<f64>| {
        noise.fixed_view_mut::<3, 3>(row, column).copy_from(block);
        noise.fixed_view_mut::<3, 3>(column, row).copy_from(&block.transpose());
    };
    let scaled = Matrix3::from_diagonal_element;
    put(0, 0, &scaled(along * dt_s.powi(3) / 3.0));
    put(0, 6, &scaled(along * dt_s.powi(2) / 2.0));
    put(6, 6, &scaled(along * dt_s));
    put(3, 3, &(attitude * about));
    put(3, 9, &(cross * about));
    put(9, 9, &scaled(about * dt_s));
    noise
}

/// The integrals of `A A^T` and of `A`.
fn turned(turn_rad: &Vector3<f64>, dt_s: f64) -> (Matrix3<f64>, Matrix3<f64>) {
    let squared = turn_rad.norm_squared();
    // By how much A A^T and the symmetric part of A are smaller across the axis than along it, and the skew part of A: as shares
    // of dt^3 and dt^2, over the squared turn, over the squared turn, over the turn.
    let (less_both, less_even, odd) = if squared < SMALL_SQUARED {
        (1.0 / 60.0, 1.0 / 24.0, 1.0 / 6.0 - squared / 120.0)
    } else {
        let angle = squared.sqrt();
        let rest = (angle - angle.sin()) / (squared * angle);
        let half_sine = (0.5 * angle).sin();
        let versine = 2.0 * half_sine * half_sine / squared;
        ((1.0 / 3.0 - 2.0 * rest) / squared, (0.5 - versine) / squared, rest)
    };
    let cross = cross_matrix(turn_rad);
    // The projection across the axis times the squared turn, with its sign turned: no axis is needed where there is none.
    let across = cross * cross;
    let attitude = (Matrix3::identity() / 3.0 + across * less_both) * dt_s.powi(3);
    let with_rate = (Matrix3::identity() * 0.5 + across * less_even + cross * odd) * dt_s.powi(2);
    (attitude, with_rate)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::left_jacobian::left_jacobian;

    proptest! {
        #[test]
        fn it_is_the_integral_over_all_kicks(v in proptest::array::uniform3(-3.0..3.0_f64), tiny in 0..4, dt_s in 0.01..1.0_f64) {
            let turn = Vector3::from(v) * 0.1_f64.powi(tiny);
            let steps = 2000;
            let (mut both, mut once) = (Matrix3::zeros(), Matrix3::zeros());
            for step in 0..steps {
                let share = (f64::from(step) + 0.5) / f64::from(steps);
                let reached = left_jacobian(&(turn * share)) * (share * dt_s);
                both += reached * reached.transpose() * (dt_s / f64::from(steps));
                once += reached * (dt_s / f64::from(steps));
            }
            let (attitude, cross) = turned(&turn, dt_s);
            // The midpoint rule is within 1 / (24 steps^2) of the second derivative.
            prop_assert!((attitude - both).amax() < 2e-6 * dt_s.powi(3), "{attitude} {both}");
            prop_assert!((cross - once).amax() < 2e-6 * dt_s.powi(2), "{cross} {once}");
        }

        #[test]
        fn it_is_positive_definite(v in proptest::array::uniform3(-3.0..3.0_f64), dt_s in 0.001..2.0_f64) {
            prop_assert!(process_noise(&Vector3::from(v), dt_s, &TrackOptions::default()).cholesky().is_some());
        }
    }
}
