//! The two simpler projections of the seed: orthographic, and scaled orthographic (weak perspective), on which POSIT rests.

use crate::geometry::{Point, space};

use super::Normalized;

/// Parallel projection along the optical axis: `(x, y)` in metres.
#[must_use]
pub fn orthographic(point: &Point<space::Camera>) -> nalgebra::Vector2<f64> {
    point.coords.xy()
}

/// Scaled orthographic projection: every point is imaged as if it stood at the depth of `reference`. `None` if
/// `reference` does not lie in front of the camera.
///
/// Agrees with perspective for points at the reference's depth; the relative error elsewhere is `dz / z`.
#[must_use]
pub fn scaled_orthographic(point: &Point<space::Camera>, reference: &Point<space::Camera>) -> Option<Normalized> {
    let depth = reference.coords.z;
    (depth > 0.0).then(|| point.coords.xy() / depth)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn scaled_orthographic_nears_perspective_as_the_object_gets_shallow(
            x in -1.0..1.0, y in -1.0..1.0, z in 2.0..50.0, dz in -0.5..0.5_f64
        ) {
            let reference = Point::new(0.0, 0.0, z);
            let point = Point::new(x, y, z + dz);
            let perspective = point.coords.xy() / point.coords.z;
            let scaled = scaled_orthographic(&point, &reference).expect("in front");
            prop_assert!((scaled - perspective).norm() <= perspective.norm() * dz.abs() / z + 1e-12);
            prop_assert!((orthographic(&point) / z - scaled).norm() < 1e-15);
        }
    }

    #[test]
    fn a_reference_behind_the_camera_scales_nothing() {
        assert_eq!(scaled_orthographic(&Point::new(0.0, 0.0, 1.0), &Point::new(0.0, 0.0, -1.0)), None);
    }
}
