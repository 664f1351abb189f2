//! The demo's target and camera.

use nalgebra::Vector3;

use super::render::{Model, Patch};
use crate::camera::{Camera, Distortion};
use crate::target::{Marker, Target};

/// Places of the six markers, metres, on the plane z = 0 of the target's space: x to the nose. In no symmetric order, as the
/// seed's beacon has them, so that no two poses look alike.
const WING_SIX: [(&str, [f64; 2]); 6] = [
    ("nose", [0.31, 0.02]),
    ("left", [-0.12, -0.36]),
    ("right", [-0.20, 0.33]),
    ("tail", [-0.38, -0.06]),
    ("mid", [0.05, 0.11]),
    ("tip", [0.14, -0.27]),
];

/// One half of the airframe's outline, from nose to tail, metres; the other mirrors y.
const HALF_OUTLINE: [[f64; 2]; 8] = [
    [0.46, 0.03],
    [0.40, 0.08],
    [0.04, 0.64],
    [-0.08, 0.69],
    [-0.22, 0.67],
    [-0.30, 0.20],
    [-0.36, 0.13],
    [-0.47, 0.11],
];

/// The target `wing-six`: six red discs of 30 mm radius under a wing, all facing -z.
///
/// # Panics
/// Never: the numbers are good.
#[must_use]
pub fn wing_six() -> Target {
    let markers = WING_SIX
        .into_iter()
        .map(|(id, [x, y])| Marker {
            id: id.into(),
            position: [x, y, 0.0].into(),
            radius_m: Some(0.03),
            normal: Some(-Vector3::z()),
        })
        .collect();
    #[expect(clippy::expect_used, reason = "constants that a test holds up")]
    Target::checked("wing-six", markers).expect("a good target")
}

/// [`wing_six`] under a gray flying wing of 1.4 m span.
#[must_use]
pub fn wing() -> Model {
    let mirrored = |half: &[[f64; 2]]| half.iter().rev().map(|[x, y]| [*x, -y]).collect::<Vec<_>>();
    let both = |half: &[[f64; 2]]| [half.to_vec(), mirrored(half)].concat();
    let pair = |half: &[[f64; 2]], rgb: [u8; 3]| [half.to_vec(), mirrored(half)].map(|outline| Patch { outline, rgb });
    let mut paint = Vec::new();
    // Elevons, wing tips, and the joint between wing and body.
    paint.extend(pair(&[[-0.215, 0.60], [-0.165, 0.60], [-0.235, 0.22], [-0.29, 0.22]], [118, 122, 128]));
    paint.extend(pair(&[[0.04, 0.64], [-0.08, 0.69], [-0.22, 0.67], [-0.213, 0.625], [0.05, 0.625]], [44, 62, 92]));
    paint.extend(pair(&[[0.33, 0.182], [0.325, 0.189], [-0.30, 0.182], [-0.30, 0.175]], [108, 112, 118]));
    paint.push(Patch { outline: both(&[[-0.10, 0.05], [-0.27, 0.05]]), rgb: [104, 108, 114] });
    Model { body: both(&HALF_OUTLINE), body_rgb: [150, 154, 160], paint, ..Model::bare(wing_six()) }
}

/// The demo's camera: 1280 x 720, f about 1000 px (65 degrees wide), with a lens that bends a little.
///
/// # Panics
/// Never: the numbers are good.
#[must_use]
pub fn demo_camera() -> Camera {
    let lens = Distortion::PlumbBob([-0.12, 0.05, 4e-4, -3e-4, 0.0]);
    #[expect(clippy::expect_used, reason = "constants that a test holds up")]
    Camera::checked([1280, 720], [1000.0, 1002.0], [636.5, 357.0], lens).expect("a good camera")
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels in view")]
mod tests {
    use super::*;
    use crate::geometry::{CameraFromTarget, Point};
    use crate::random::named;
    use crate::scene::render::{Optics, Sky, render};

    #[test]
    fn every_marker_lies_on_the_airframe_with_a_margin() {
        // Bare sky is black: around each marker there must be a ring of airframe.
        let pose = CameraFromTarget::new(nalgebra::Rotation3::identity(), Vector3::new(0.0, 0.0, 1.5));
        let camera = demo_camera();
        let model = Model { paint: Vec::new(), marker_rgb: wing().body_rgb, ..wing() };
        let frame = render(&camera, &pose, &model, &Sky::plain([0; 3]), &Optics::ideal(), &mut named("margin"));
        let rgb = frame.rgb();
        for marker in wing_six().markers() {
            for step in 0..36 {
                let angle = f64::from(step) * 10.0_f64.to_radians();
                let ring = marker.position.coords + Vector3::new(angle.cos(), angle.sin(), 0.0) * 0.05;
                let pixel = camera.project(&(pose * Point::from(ring))).expect("in view");
                let index = (pixel.y.round() as usize * 1280 + pixel.x.round() as usize) * 3;
                assert_eq!(rgb[index..index + 3], model.body_rgb, "{} at {step}", marker.id);
            }
        }
    }
}
