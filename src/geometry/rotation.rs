//! Rotations: exponential and logarithm, quaternions, and the seed's Euler order.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

/// The skew-symmetric matrix with `cross_matrix(a) * b == a.cross(&b)`.
#[must_use]
pub fn cross_matrix(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// The rotation by `|vector_rad|` about the axis `vector_rad` (Rodrigues), exact to rounding also for tiny angles.
#[must_use]
pub fn exp(vector_rad: &Vector3<f64>) -> Rotation3<f64> {
    let angle_squared = vector_rad.norm_squared();
    let (sine_ratio, versine_ratio) = if angle_squared < 1e-8 {
        // Series of sin(a)/a and (1 - cos(a))/a^2: the terms left out are below 1e-17.
        (1.0 - angle_squared / 6.0, 0.5 - angle_squared / 24.0)
    } else {
        let angle = angle_squared.sqrt();
        let half_sine = (0.5 * angle).sin();
        (angle.sin() / angle, 2.0 * half_sine * half_sine / angle_squared)
    };
    let cross = cross_matrix(vector_rad);
    Rotation3::from_matrix_unchecked(Matrix3::identity() + cross * sine_ratio + cross * cross * versine_ratio)
}

/// The rotation vector of `rotation`, of length at most pi. Inverse of [`exp`]; stable at both ends of the range.
#[must_use]
pub fn log(rotation: &Rotation3<f64>) -> Vector3<f64> {
    let quaternion = to_quaternion(rotation);
    let vector = quaternion.vector();
    let sine = vector.norm();
    if sine < 1e-12 {
        // atan2(s, w) / s = 1 / w to rounding.
        return vector * 2.0;
    }
    vector * (2.0 * sine.atan2(quaternion.w) / sine)
}

/// The unit quaternion of `rotation` with `w >= 0`.
///
/// Takes the largest of the four components as pivot (Shepperd 1978), so no component loses precision.
#[must_use]
pub fn to_quaternion(rotation: &Rotation3<f64>) -> UnitQuaternion<f64> {
    let m = rotation.matrix();
    let trace = m.trace();
    let (w, x, y, z) = if trace >= m[(0, 0)] && trace >= m[(1, 1)] && trace >= m[(2, 2)] {
        let w = 1.0 + trace;
        (w, m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)])
    } else if m[(0, 0)] >= m[(1, 1)] && m[(0, 0)] >= m[(2, 2)] {
        let x = 1.0 + m[(0, 0)] - m[(1, 1)] - m[(2, 2)];
        (m[(2, 1)] - m[(1, 2)], x, m[(0, 1)] + m[(1, 0)], m[(0, 2)] + m[(2, 0)])
    } else if m[(1, 1)] >= m[(2, 2)] {
        let y = 1.0 - m[(0, 0)] + m[(1, 1)] - m[(2, 2)];
        (m[(0, 2)] - m[(2, 0)], m[(0, 1)] + m[(1, 0)], y, m[(1, 2)] + m[(2, 1)])
    } else {
        let z = 1.0 - m[(0, 0)] - m[(1, 1)] + m[(2, 2)];
        (m[(1, 0)] - m[(0, 1)], m[(0, 2)] + m[(2, 0)], m[(1, 2)] + m[(2, 1)], z)
    };
    let sign = if w < 0.0 { -1.0 } else { 1.0 };
    UnitQuaternion::from_quaternion(Quaternion::new(w * sign, x * sign, y * sign, z * sign))
}

/// The rotation of a unit quaternion.
#[must_use]
pub fn from_quaternion(quaternion: &UnitQuaternion<f64>) -> Rotation3<f64> {
    quaternion.to_rotation_matrix()
}

/// The rotation nearest to `matrix` in the Frobenius norm, or `None` where there is no single nearest one.
#[must_use]
pub fn nearest(matrix: &Matrix3<f64>) -> Option<Rotation3<f64>> {
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let svd = matrix.try_svd(true, true, f64::EPSILON, 200)?;
    let (u, v_t) = (svd.u?, svd.v_t?);
    let largest = svd.singular_values.max();
    let sorted = {
        let mut s = svd.singular_values;
        s.as_mut_slice().sort_by(f64::total_cmp);
        s
    };
    if largest <= 0.0 || sorted[1] <= 1e-12 * largest {
        return None;
    }
    let mut signs = Matrix3::identity();
    if (u * v_t).determinant() < 0.0 {
        let weakest = svd.singular_values.imin();
        signs[(weakest, weakest)] = -1.0;
    }
    Some(Rotation3::from_matrix_unchecked(u * signs * v_t))
}

/// Angle in radians, in `[0, pi]`, of the rotation that leads from `a` to `b`.
#[must_use]
pub fn angle_between_rad(a: &Rotation3<f64>, b: &Rotation3<f64>) -> f64 {
    log(&(b * a.inverse())).norm()
}

/// Roll, pitch and yaw with `R = Rz(yaw) Ry(pitch) Rx(roll)`, the order of the seed.
///
/// Pitch lies in `[-pi/2, pi/2]`. At gimbal lock (pitch = ±pi/2) only yaw ∓ roll is defined; roll is 0 there. The stable
/// two-argument arc tangents follow Slabaugh 1999, "Computing Euler angles from a rotation matrix".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EulerAngles {
    /// Rotation about x, radians, in `(-pi, pi]`.
    pub roll_rad: f64,
    /// Rotation about y, radians, in `[-pi/2, pi/2]`.
    pub pitch_rad: f64,
    /// Rotation about z, radians, in `(-pi, pi]`.
    pub yaw_rad: f64,
}

impl EulerAngles {
    /// `cos(pitch)` at or below which roll and yaw can no longer be told apart in double precision.
    const GIMBAL_LOCK_COSINE: f64 = 1e-8;

    /// The angles of `rotation`.
    #[must_use]
    pub fn from_rotation(rotation: &Rotation3<f64>) -> Self {
        let m = rotation.matrix();
        let pitch_cosine = m[(0, 0)].hypot(m[(1, 0)]);
        let pitch_rad = (-m[(2, 0)]).atan2(pitch_cosine);
        if pitch_cosine <= Self::GIMBAL_LOCK_COSINE {
            return Self { roll_rad: 0.0, pitch_rad, yaw_rad: (-m[(0, 1)]).atan2(m[(1, 1)]) };
        }
        Self { roll_rad: m[(2, 1)].atan2(m[(2, 2)]), pitch_rad, yaw_rad: m[(1, 0)].atan2(m[(0, 0)]) }
    }

    /// The rotation of these angles.
    #[must_use]
    pub fn to_rotation(self) -> Rotation3<f64> {
        let about = |axis: Vector3<f64>, angle: f64| exp(&(axis * angle));
        about(Vector3::z(), self.yaw_rad) * about(Vector3::y(), self.pitch_rad) * about(Vector3::x(), self.roll_rad)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use proptest::prelude::*;

    use super::*;

    fn vector(limit: f64) -> impl Strategy<Value = Vector3<f64>> {
        (-1.0..1.0, -1.0..1.0, -1.0..1.0, 0.0..limit).prop_filter_map("zero axis", |(x, y, z, angle)| {
            Vector3::new(x, y, z).try_normalize(1e-3).map(|axis| axis * angle)
        })
    }

    proptest! {
        #[test]
        fn log_undoes_exp(v in vector(PI - 1e-6)) {
            prop_assert!((log(&exp(&v)) - v).norm() < 1e-9);
        }

        #[test]
        fn log_undoes_exp_of_tiny_angles(v in vector(1e-5)) {
            // Relative accuracy: what an arc cosine of the trace would lose.
            prop_assert!((log(&exp(&v)) - v).norm() <= 1e-10 * v.norm() + 1e-17);
        }

        #[test]
        fn exp_undoes_log_up_to_half_a_turn(v in vector(PI)) {
            let rotation = exp(&v);
            prop_assert!((exp(&log(&rotation)).matrix() - rotation.matrix()).norm() < 1e-12);
        }

        #[test]
        fn euler_angles_give_the_rotation_back(v in vector(PI)) {
            let rotation = exp(&v);
            let euler = EulerAngles::from_rotation(&rotation);
            prop_assert!(euler.pitch_rad.abs() <= FRAC_PI_2);
            prop_assert!((euler.to_rotation().matrix() - rotation.matrix()).norm() < 1e-12);
        }

        #[test]
        fn gimbal_lock_gives_the_rotation_back_with_zero_roll(yaw in -PI..PI, roll in -PI..PI, up in any::<bool>()) {
            let pitch_rad = if up { FRAC_PI_2 } else { -FRAC_PI_2 };
            let rotation = EulerAngles { roll_rad: roll, pitch_rad, yaw_rad: yaw }.to_rotation();
            let euler = EulerAngles::from_rotation(&rotation);
            prop_assert!(euler.roll_rad.abs() == 0.0);
            prop_assert!((euler.to_rotation().matrix() - rotation.matrix()).norm() < 1e-7);
        }

        #[test]
        fn quaternions_have_a_positive_scalar_and_give_the_rotation_back(v in vector(PI)) {
            let rotation = exp(&v);
            let quaternion = to_quaternion(&rotation);
            prop_assert!(quaternion.w >= 0.0);
            prop_assert!((from_quaternion(&quaternion).matrix() - rotation.matrix()).norm() < 1e-12);
        }

        #[test]
        fn the_nearest_rotation_of_a_scaled_rotation_is_that_rotation(v in vector(PI), scale in 0.01..100.0) {
            let rotation = exp(&v);
            let found = nearest(&(rotation.matrix() * scale)).expect("full rank");
            prop_assert!((found.matrix() - rotation.matrix()).norm() < 1e-12);
        }
    }

    #[test]
    fn the_corrected_entries_of_the_seeds_rotation_hold() {
        // Eq. 2.16 with its misprint undone: the middle factor is Ry(pitch).
        let (roll, pitch, yaw) = (0.3_f64, -0.7_f64, 1.9_f64);
        let r = EulerAngles { roll_rad: roll, pitch_rad: pitch, yaw_rad: yaw }.to_rotation();
        let r13 = yaw.sin() * roll.sin() + yaw.cos() * pitch.sin() * roll.cos();
        let r22 = yaw.cos() * roll.cos() + yaw.sin() * pitch.sin() * roll.sin();
        assert!((r.matrix()[(0, 2)] - r13).abs() < 1e-15);
        assert!((r.matrix()[(1, 1)] - r22).abs() < 1e-15);
    }

    #[test]
    fn no_rotation_is_nearest_to_a_rank_one_matrix() {
        let flat = Vector3::new(1.0, 2.0, 3.0) * Vector3::new(0.5, 0.1, -1.0).transpose();
        assert!(nearest(&flat).is_none());
        assert!(nearest(&Matrix3::repeat(f64::NAN)).is_none());
    }
}
