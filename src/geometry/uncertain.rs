//! A transform and how well it is known.

use std::ops::Mul;

use nalgebra::{Matrix3, Matrix6, Vector3};

use super::rotation::cross_matrix;
use super::space::Space;
use super::transform::Transform;

/// A transform with the covariance of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UncertainTransform<To: Space, From: Space> {
    /// The transform.
    pub transform: Transform<To, From>,
    /// Of the error `(t_true - t, Log(R_true R^T))`, along the axes of `To`; m and rad. Symmetric, and not negative in any direction; zero
    /// where the transform is taken for exact.
    pub covariance: Matrix6<f64>,
}

impl<To: Space, From: Space> UncertainTransform<To, From> {
    /// A transform that is taken for exact.
    #[must_use]
    pub fn exact(transform: Transform<To, From>) -> Self {
        Self { transform, covariance: Matrix6::zeros() }
    }

    /// The transform that leads back, with the covariance carried over to first order.
    #[must_use]
    pub fn inverse(&self) -> UncertainTransform<From, To> {
        let by = inversion_slope(&self.transform);
        UncertainTransform { transform: self.transform.inverse(), covariance: carried(&by, &self.covariance) }
    }
}

/// One after the other, their errors independent of each other; to first order.
impl<To: Space, Middle: Space, From: Space> Mul<UncertainTransform<Middle, From>> for UncertainTransform<To, Middle> {
    type Output = UncertainTransform<To, From>;

    fn mul(self, right: UncertainTransform<Middle, From>) -> Self::Output {
        let turn = self.transform.rotation;
        // An error of the first turn swings what lies behind it about the origin of its space.
        let arm = turn * right.transform.translation;
        let first = blocks(&Matrix3::identity(), &-cross_matrix(&arm), &Matrix3::identity());
        let second = blocks(turn.matrix(), &Matrix3::zeros(), turn.matrix());
        UncertainTransform {
            transform: self.transform * right.transform,
            covariance: carried(&first, &self.covariance) + carried(&second, &right.covariance),
        }
    }
}

/// The derivative of the error of a transform's inverse by the transform's own: minus the adjoint of the inverse, written for these errors.
///
/// A turn `w` moves the way back by `R^T (w x t)` and turns it by `-R^T w`; a step `dt` moves it by `-R^T dt`.
#[must_use]
pub fn inversion_slope<To: Space, From: Space>(transform: &Transform<To, From>) -> Matrix6<f64> {
    let back = transform.rotation.matrix().transpose();
    let swing: Vector3<f64> = transform.translation;
    blocks(&-back, &(-back * cross_matrix(&swing)), &-back)
}

/// `[[a, b], [0, d]]`.
fn blocks(a: &Matrix3<f64>, b: &Matrix3<f64>, d: &Matrix3<f64>) -> Matrix6<f64> {
    let mut all = Matrix6::zeros();
    all.fixed_view_mut::<3, 3>(0, 0).copy_from(a);
    all.fixed_view_mut::<3, 3>(0, 3).copy_from(b);
    all.fixed_view_mut::<3, 3>(3, 3).copy_from(d);
    all
}

fn carried(by: &Matrix6<f64>, covariance: &Matrix6<f64>) -> Matrix6<f64> {
    let carried = by * covariance * by.transpose();
    (carried + carried.transpose()) * 0.5
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::rotation;
    use crate::geometry::space::{Body, Camera, Target};

    fn transform<To: Space, From: Space>() -> impl Strategy<Value = Transform<To, From>> {
        proptest::array::uniform6(-1.0..1.0_f64).prop_map(|v| {
            Transform::new(
                rotation::exp(&(Vector3::new(v[0], v[1], v[2]) * 1.7)),
                Vector3::new(v[3], v[4], v[5]) * 10.0,
            )
        })
    }

    fn covariance() -> impl Strategy<Value = Matrix6<f64>> {
        proptest::collection::vec(-1.0..1.0_f64, 36).prop_map(|entries| {
            let root = Matrix6::from_iterator(entries);
            root * root.transpose() * 0.01
        })
    }

    /// How the error of what is made of a transform depends on the transform's, by central differences.
    fn differences<To: Space, From: Space, ToMade: Space, FromMade: Space>(
        at: &Transform<To, From>,
        make: impl Fn(&Transform<To, From>) -> Transform<ToMade, FromMade>,
    ) -> Matrix6<f64> {
        let (made, half) = (make(at), 1e-5);
        Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|axis| {
            let step = Vector6::ith(axis, half);
            let ahead = made.difference_to(&make(&at.perturbed(&step)));
            let behind = made.difference_to(&make(&at.perturbed(&-step)));
            (ahead - behind) / (2.0 * half)
        }))
    }

    proptest! {
        #[test]
        fn an_inverse_carries_the_covariance_as_central_differences_do(
            transform in transform::<Body, Target>(), covariance in covariance()
        ) {
            let slope = differences(&transform, Transform::inverse);
            prop_assert!((slope - inversion_slope(&transform)).amax() < 1e-7);
            let known = UncertainTransform { transform, covariance };
            let expected = slope * covariance * slope.transpose();
            prop_assert!((known.inverse().covariance - expected).amax() < 1e-6);
            let back = known.inverse().inverse();
            prop_assert!((back.covariance - covariance).amax() < 1e-10);
            prop_assert!(back.transform.difference_to(&transform).amax() < 1e-12);
        }

        #[test]
        fn a_chain_carries_both_covariances_as_central_differences_do(
            first in transform::<Body, Camera>(), second in transform::<Camera, Target>(), of_first in covariance(), of_second in covariance()
        ) {
            let by_first = differences(&first, |first| *first * second);
            let by_second = differences(&second, |second| first * *second);
            let expected = by_first * of_first * by_first.transpose() + by_second * of_second * by_second.transpose();
            let chain = UncertainTransform { transform: first, covariance: of_first }
                * UncertainTransform { transform: second, covariance: of_second };
            prop_assert!((chain.covariance - expected).amax() < 1e-6);
            let exact = UncertainTransform::exact(first) * UncertainTransform::exact(second);
            prop_assert!(exact.covariance.amax() == 0.0 && exact.transform == chain.transform);
        }
    }
}
