//! Rigid transforms between spaces.

use std::marker::PhantomData;
use std::ops::Mul;

use nalgebra::{Rotation3, Vector3, Vector6};

use super::point::Point;
use super::rotation;
use super::space::{self, Space};

/// The pose of a target in the space of the camera that sees it: `p_camera = R p_target + t`.
pub type CameraFromTarget = Transform<space::Camera, space::Target>;

/// The pose of a calibration board in the space of the camera that sees it.
pub type CameraFromBoard = Transform<space::Camera, space::Board>;

/// The rigid motion that takes coordinates in `From` to coordinates in `To`.
///
/// Named with both ends, target first, so that neighbours cancel:
/// `world_from_target = world_from_camera * camera_from_target`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform<To: Space, From: Space> {
    /// Rotation part.
    pub rotation: Rotation3<f64>,
    /// Translation part, metres: the origin of `From` as seen in `To`.
    pub translation: Vector3<f64>,
    spaces: PhantomData<(To, From)>,
}

impl<To: Space, From: Space> Transform<To, From> {
    /// The transform `p -> rotation * p + translation`.
    #[must_use]
    pub const fn new(rotation: Rotation3<f64>, translation: Vector3<f64>) -> Self {
        Self { rotation, translation, spaces: PhantomData }
    }

    /// The transform that leads back.
    #[must_use]
    pub fn inverse(&self) -> Transform<From, To> {
        let rotation = self.rotation.inverse();
        Transform::new(rotation, -(rotation * self.translation))
    }

    /// The transform moved by a small step in the space `To`: `(dt, w)` adds `dt` to the translation and turns by
    /// `exp(w)` on the left. These are the six coordinates of [`PoseCovariance`](super::PoseCovariance).
    #[must_use]
    pub fn perturbed(&self, step: &Vector6<f64>) -> Self {
        let turn = rotation::exp(&Vector3::new(step[3], step[4], step[5]));
        Self::new(turn * self.rotation, self.translation + Vector3::new(step[0], step[1], step[2]))
    }

    /// The step that leads from `self` to `other`: `(t_other - t_self, Log(R_other R_self^T))`.
    #[must_use]
    pub fn difference_to(&self, other: &Self) -> Vector6<f64> {
        let dt = other.translation - self.translation;
        let w = rotation::log(&(other.rotation * self.rotation.inverse()));
        Vector6::new(dt.x, dt.y, dt.z, w.x, w.y, w.z)
    }

    /// Whether every number in it is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.translation.iter().all(|x| x.is_finite()) && self.rotation.matrix().iter().all(|x| x.is_finite())
    }
}

impl<To: Space, Middle: Space, From: Space> Mul<Transform<Middle, From>> for Transform<To, Middle> {
    type Output = Transform<To, From>;

    fn mul(self, right: Transform<Middle, From>) -> Self::Output {
        Transform::new(self.rotation * right.rotation, self.rotation * right.translation + self.translation)
    }
}

impl<To: Space, From: Space> Mul<Point<From>> for Transform<To, From> {
    type Output = Point<To>;

    fn mul(self, point: Point<From>) -> Self::Output {
        Point::from(self.rotation * point.coords + self.translation)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::space::{Camera, Target, World};

    fn transform<To: Space, From: Space>() -> impl Strategy<Value = Transform<To, From>> {
        proptest::array::uniform6(-1.0..1.0_f64).prop_map(|v| {
            Transform::new(
                rotation::exp(&(Vector3::new(v[0], v[1], v[2]) * 1.7)),
                Vector3::new(v[3], v[4], v[5]) * 10.0,
            )
        })
    }

    proptest! {
        #[test]
        fn a_transform_and_its_inverse_cancel(t in transform::<Camera, Target>(), p in proptest::array::uniform3(-5.0..5.0)) {
            let p = Point::<Target>::from(p);
            prop_assert!(((t.inverse() * (t * p)).coords - p.coords).norm() < 1e-12);
        }

        #[test]
        fn composing_is_applying_one_after_the_other(
            a in transform::<World, Camera>(), b in transform::<Camera, Target>(), p in proptest::array::uniform3(-5.0..5.0)
        ) {
            let p = Point::<Target>::from(p);
            prop_assert!((((a * b) * p).coords - (a * (b * p)).coords).norm() < 1e-12);
        }

        #[test]
        fn a_difference_is_the_step_that_was_taken(
            t in transform::<Camera, Target>(), step in proptest::array::uniform6(-0.5..0.5)
        ) {
            let step = Vector6::from(step);
            prop_assert!((t.difference_to(&t.perturbed(&step)) - step).norm() < 1e-12);
        }
    }
}
