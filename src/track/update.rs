//! What a measured pose makes of a motion.

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};

use super::measured::Measured;
use super::motion::{Matrix12, Motion};
use crate::geometry::left_jacobian::{left_jacobian, left_jacobian_inverse};

/// How a measured pose agrees with a predicted one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Innovation {
    /// From the predicted to the measured pose.
    residual: Vector6<f64>,
    /// The residual's derivative by the error of the pose.
    slope: Matrix6<f64>,
    /// Inverse of the residual's covariance.
    weight: Matrix6<f64>,
    /// Squared distance in units of the covariance: chi-square with six degrees of freedom.
    pub squared: f64,
    /// Logarithm of the measurement's density.
    pub ln_density: f64,
    /// Logarithm of the density that a measurement at the predicted pose itself would have.
    pub ln_peak: f64,
}

impl Innovation {
    /// Of `measured` against `predicted`; `None` where numbers end.
    pub(super) fn of(predicted: &Motion, measured: &Measured) -> Option<Self> {
        let residual = predicted.camera_from_target().difference_to(&measured.camera_from_target);
        let slope = slope(&residual);
        let spread = slope * predicted.pose_covariance().matrix() * slope.transpose() + measured.covariance.matrix();
        let factored = ((spread + spread.transpose()) * 0.5).cholesky()?;
        let squared = residual.dot(&factored.solve(&residual));
        let ln_determinant = 2.0 * factored.l_dirty().diagonal().map(f64::ln).sum();
        let ln_peak = -0.5 * (ln_determinant + 6.0 * std::f64::consts::TAU.ln());
        let ln_density = ln_peak - 0.5 * squared;
        ln_density.is_finite().then(|| Self {
            residual,
            slope,
            weight: factored.inverse(),
            squared,
            ln_density,
            ln_peak,
        })
    }

    /// The motion after the measurement: Kalman's update in Joseph's form, which keeps the covariance positive definite, and the
    /// error carried over to the new attitude (Sola, "Quaternion kinematics for the error-state Kalman filter", 2017, 6.3).
    pub(super) fn updated(&self, predicted: &Motion, measured: &Measured) -> Option<Motion> {
        let prior = predicted.covariance();
        let gain: SMatrix<f64, 12, 6> = prior.fixed_columns::<6>(0) * self.slope.transpose() * self.weight;
        let step = gain * self.residual;
        let mut left = Matrix12::identity();
        let seen = gain * self.slope;
        for column in 0..6 {
            for row in 0..12 {
                left[(row, column)] -= seen[(row, column)];
            }
        }
        let mut covariance = left * prior * left.transpose() + gain * measured.covariance.matrix() * gain.transpose();
        let turn = left_jacobian(&Vector3::new(step[3], step[4], step[5]));
        let rows = turn * covariance.fixed_rows::<3>(3);
        covariance.fixed_rows_mut::<3>(3).copy_from(&rows);
        let columns = covariance.fixed_columns::<3>(3) * turn.transpose();
        covariance.fixed_columns_mut::<3>(3).copy_from(&columns);
        predicted.moved(&step, &covariance)
    }
}

/// The derivative of the negated measurement error by the error of the predicted pose. With `R_true = Exp(d) R` and the
/// measurement's own error `e = Log(R_true R_seen^T)`, `e = Log(Exp(d) Exp(-residual))`.
fn slope(residual: &Vector6<f64>) -> Matrix6<f64> {
    let turn: Vector3<f64> = residual.fixed_rows::<3>(3).into_owned();
    let mut slope = Matrix6::identity();
    slope.fixed_view_mut::<3, 3>(3, 3).copy_from(&left_jacobian_inverse(&-turn));
    slope
}

/// How a measured position agrees with a predicted one, whatever the attitudes.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaceInnovation {
    /// Squared distance: chi-square with three degrees of freedom.
    pub squared: f64,
    /// Logarithm of the position's density.
    pub ln_density: f64,
}

impl PlaceInnovation {
    /// Of `measured` against `predicted`; `None` where numbers end.
    pub(super) fn of(predicted: &Motion, measured: &Measured) -> Option<Self> {
        let residual = measured.camera_from_target.translation - predicted.camera_from_target().translation;
        let place = |covariance: &Matrix6<f64>| -> Matrix3<f64> { covariance.fixed_view::<3, 3>(0, 0).into_owned() };
        let spread = place(predicted.pose_covariance().matrix()) + place(measured.covariance.matrix());
        let factored = spread.cholesky()?;
        let squared = residual.dot(&factored.solve(&residual));
        let ln_determinant = 2.0 * factored.l_dirty().diagonal().map(f64::ln).sum();
        let ln_density = -0.5 * (squared + ln_determinant + 3.0 * std::f64::consts::TAU.ln());
        ln_density.is_finite().then_some(Self { squared, ln_density })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::{CameraFromTarget, PoseCovariance, rotation};
    use crate::track::motion::Vector12;

    fn motion(v: [f64; 6]) -> Motion {
        let pose = CameraFromTarget::new(
            rotation::exp(&(Vector3::new(v[0], v[1], v[2]) * 1.5)),
            Vector3::new(v[3], v[4], v[5]) * 10.0,
        );
        let root = Matrix12::from_fn(|r, c| if r == c { 1.0 } else { 0.3 / (1.0 + r as f64 + 2.0 * c as f64) });
        Motion::checked(pose, Vector3::x(), Vector3::y(), &(root * root.transpose() * 0.04)).expect("good numbers")
    }

    fn seen(from: &Motion, step: [f64; 6]) -> Measured {
        Measured {
            camera_from_target: from.camera_from_target().perturbed(&Vector6::from(step)),
            covariance: PoseCovariance::checked(Matrix6::identity() * 0.01).expect("positive definite"),
            probability: 1.0,
        }
    }

    proptest! {
        #[test]
        fn the_slope_agrees_with_central_differences(
            v in proptest::array::uniform6(-1.0..1.0_f64), step in proptest::array::uniform6(-0.8..0.8_f64)
        ) {
            let motion = motion(v);
            let measured = seen(&motion, step);
            let slope = slope(&motion.camera_from_target().difference_to(&measured.camera_from_target));
            let size = 1e-5;
            for axis in 0..6 {
                // The measurement's error if the truth were the prediction moved by this much.
                let error = |size: f64| {
                    let truth = motion.camera_from_target().perturbed(&Vector6::ith(axis, size));
                    measured.camera_from_target.difference_to(&truth)
                };
                let found = (error(size) - error(-size)) / (2.0 * size);
                prop_assert!((found - slope.column(axis)).amax() < 1e-8);
            }
        }

        #[test]
        fn the_carried_error_agrees_with_central_differences(turn in proptest::array::uniform3(-0.8..0.8_f64)) {
            let turn = Vector3::from(turn);
            let carried = left_jacobian(&turn);
            let size = 1e-5;
            for axis in 0..3 {
                let error = |size: f64| {
                    rotation::log(&(rotation::exp(&(turn + Vector3::ith(axis, size))) * rotation::exp(&-turn)))
                };
                let found = (error(size) - error(-size)) / (2.0 * size);
                prop_assert!((found - carried.column(axis)).amax() < 1e-8);
            }
        }

        #[test]
        fn joseph_gives_what_the_information_form_gives(
            v in proptest::array::uniform6(-1.0..1.0_f64), step in proptest::array::uniform6(-0.3..0.3_f64)
        ) {
            let motion = motion(v);
            let measured = seen(&motion, step);
            let innovation = Innovation::of(&motion, &measured).expect("good numbers");
            let updated = innovation.updated(&motion, &measured).expect("good numbers");
            // The slow obvious way: informations add, and the weighted residual is solved for.
            let mut seen_by = SMatrix::<f64, 6, 12>::zeros();
            seen_by.fixed_columns_mut::<6>(0).copy_from(&innovation.slope);
            let weight = Matrix6::identity() * 100.0;
            let information = motion.covariance().try_inverse().expect("regular") + seen_by.transpose() * weight * seen_by;
            let covariance = information.try_inverse().expect("regular");
            let step: Vector12 = covariance * (seen_by.transpose() * (weight * innovation.residual));
            let mut carry = Matrix12::identity();
            carry.fixed_view_mut::<3, 3>(3, 3).copy_from(&left_jacobian(&step.fixed_rows::<3>(3).into_owned()));
            prop_assert!((motion.difference_to(&updated) - step).amax() < 1e-10);
            prop_assert!((updated.covariance() - carry * covariance * carry.transpose()).amax() < 1e-10);
        }
    }
}
