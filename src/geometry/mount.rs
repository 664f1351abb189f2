//! How a camera sits on its vehicle.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::rotation::EulerAngles;
use super::space::{Body, Camera};
use super::transform::Transform;

/// The space of a camera as seen from the body that carries it.
pub type BodyFromCamera = Transform<Body, Camera>;

/// The turn from the axes of a camera that looks forward, its picture upright, to those of the body (x forward, y right, z down): the
/// camera's z is forward, its x right, its y down.
#[must_use]
pub fn body_from_forward_camera() -> Rotation3<f64> {
    Rotation3::from_matrix_unchecked(Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0))
}

/// The camera's space from the body's, for a camera that is first thought to look forward and then turned by these angles of an aircraft
/// (yaw to the right, pitch up, roll right side down), its centre at `position_m` forward, right and down of the body's origin.
///
/// A pitch of a quarter turn down looks at the ground, with the top of the picture forward.
#[must_use]
pub fn body_from_camera(turned: EulerAngles, position_m: [f64; 3]) -> BodyFromCamera {
    Transform::new(turned.to_rotation() * body_from_forward_camera(), Vector3::from(position_m))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use nalgebra::{Matrix6, Vector6};
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::space::Target;
    use crate::geometry::{CameraFromTarget, Point, PoseCovariance, rotation};

    fn angles(roll_rad: f64, pitch_rad: f64, yaw_rad: f64) -> EulerAngles {
        EulerAngles { roll_rad, pitch_rad, yaw_rad }
    }

    fn seen(mount: BodyFromCamera, point: [f64; 3]) -> Vector3<f64> {
        (mount * Point::<Camera>::from(point)).coords
    }

    #[test]
    fn what_cameras_see_is_where_it_is() {
        // Ten metres ahead of the camera, one to the right and two down in the picture.
        let point = [1.0, 2.0, 10.0];
        for (mount, body) in [
            (angles(0.0, 0.0, 0.0), [10.0, 1.0, 2.0]),
            // Looking down: ahead is below, down in the picture is backward.
            (angles(0.0, -FRAC_PI_2, 0.0), [-2.0, 1.0, 10.0]),
            // Looking to the right: right in the picture is backward.
            (angles(0.0, 0.0, FRAC_PI_2), [-1.0, 10.0, 2.0]),
            // Looking back.
            (angles(0.0, 0.0, PI), [-10.0, -1.0, 2.0]),
            // Lying on its right side: what is down in the picture is to the left.
            (angles(FRAC_PI_2, 0.0, 0.0), [10.0, -2.0, 1.0]),
        ] {
            let found = seen(body_from_camera(mount, [0.0; 3]), point);
            assert!((found - Vector3::from(body)).norm() < 1e-12, "{mount:?}: {found}");
            let moved = seen(body_from_camera(mount, [0.1, 0.2, 0.3]), point);
            assert!((moved - found - Vector3::new(0.1, 0.2, 0.3)).norm() < 1e-12);
        }
    }

    fn mount() -> impl Strategy<Value = BodyFromCamera> {
        ((-PI..PI, -FRAC_PI_2..FRAC_PI_2, -PI..PI), proptest::array::uniform3(-2.0..2.0_f64))
            .prop_map(|((roll, pitch, yaw), position)| body_from_camera(angles(roll, pitch, yaw), position))
    }

    fn pose() -> impl Strategy<Value = CameraFromTarget> {
        proptest::array::uniform6(-1.0..1.0_f64).prop_map(|v| {
            CameraFromTarget::new(
                rotation::exp(&(Vector3::new(v[0], v[1], v[2]) * 1.5)),
                Vector3::new(v[3] * 5.0, v[4] * 5.0, 8.0 + v[5] * 5.0),
            )
        })
    }

    proptest! {
        #[test]
        fn there_and_back_is_the_same(mount in mount(), pose in pose()) {
            let back = mount.inverse() * (mount * pose);
            prop_assert!(back.difference_to(&pose).norm() < 1e-12);
            // Right-handed stays right-handed, and lengths stay.
            prop_assert!((mount.rotation.matrix().determinant() - 1.0).abs() < 1e-12);
        }

        #[test]
        fn a_covariance_turns_as_small_errors_do(
            mount in mount(), pose in pose(), entries in proptest::collection::vec(-1.0..1.0_f64, 36)
        ) {
            let root = Matrix6::from_iterator(entries);
            let covariance = PoseCovariance::checked(root * root.transpose() + Matrix6::identity() * 0.1);
            let covariance = covariance.expect("positive definite");
            // How an error of the pose in the camera's space shows in the body's, by central differences.
            let in_body: Transform<Body, Target> = mount * pose;
            let half = 1e-4;
            let jacobian = Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|i| {
                let step = Vector6::ith(i, half);
                let ahead = in_body.difference_to(&(mount * pose.perturbed(&step)));
                let behind = in_body.difference_to(&(mount * pose.perturbed(&-step)));
                (ahead - behind) / (2.0 * half)
            }));
            let expected = jacobian * covariance.matrix() * jacobian.transpose();
            let found = covariance.turned(&mount.rotation);
            // The differences are of second order: 1e-8, times entries up to some tens.
            prop_assert!((found.matrix() - expected).amax() < 1e-6, "{}", found.matrix() - expected);
            let back = found.turned(&mount.rotation.inverse());
            prop_assert!((back.matrix() - covariance.matrix()).amax() < 1e-12);
        }
    }
}
