//! What there is to be seen of a target.

use crate::target::Target;

/// A coloured shape painted on the airframe, on the side that carries the markers.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Its corners in order, metres, on the plane z = 0 of the target's space.
    pub outline: Vec<[f64; 2]>,
    /// Its colour, sRGB.
    pub rgb: [u8; 3],
}

/// A target with the airframe that carries its markers.
///
/// The markers are flat discs. A marker without a normal lies in the plane of a flat target and is seen from both sides; on
/// a target that is not flat it turns to the camera, as a ball would.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The markers.
    pub target: Target,
    /// The airframe: the corners of a simple polygon, convex or not, in order, metres, on the plane z = 0 of the target's
    /// space. Nothing for fewer than three.
    pub body: Vec<[f64; 2]>,
    /// The airframe's colour, sRGB.
    pub body_rgb: [u8; 3],
    /// Painted on the airframe where z is negative, the later over the earlier.
    pub paint: Vec<Patch>,
    /// The markers' colour, sRGB.
    pub marker_rgb: [u8; 3],
    /// The markers' light in multiples of `marker_rgb`: 1 for paint, far more for an LED that outshines the scene.
    pub marker_gain: f64,
    /// Radius of a marker for which the target states none, m.
    pub default_radius_m: f64,
}

impl Model {
    /// Red paint, as bright as the detector's real markers are in daylight.
    pub const RED: [u8; 3] = [204, 26, 22];

    /// The markers alone, in red, without an airframe.
    #[must_use]
    pub const fn bare(target: Target) -> Self {
        Self {
            target,
            body: Vec::new(),
            body_rgb: [170, 173, 176],
            paint: Vec::new(),
            marker_rgb: Self::RED,
            marker_gain: 1.0,
            default_radius_m: 0.02,
        }
    }
}
