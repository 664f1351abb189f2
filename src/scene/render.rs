//! A target in front of a sky as a camera takes it: rays, light, lens and sensor, in this order.
//!
//! [`Radiance`] is what falls on the sensor, in linear light; a [`Frame`] is what the sensor makes of it. The steps are
//! rooms of their own.

mod blur;
mod clouds;
mod light;
mod model;
mod optics;
mod outline;
mod radiance;
mod sensor;
mod sheet;
mod sky;
mod surface;

use rand::Rng;

use crate::camera::Camera;
use crate::frame::Frame;
use crate::geometry::CameraFromTarget;

pub use model::{Model, Patch};
pub use optics::Optics;
pub use radiance::Radiance;
pub use sheet::{Rays, Sheet, render_sheet};
pub use sky::{Clouds, Distractor, Ground, Shape, Sky};

pub(super) use surface::{Seen, Surfaces, facing_normal};

/// The frame that `camera` takes of `model` in front of `sky`. The same random numbers give the same bytes.
#[must_use]
pub fn render(
    camera: &Camera,
    camera_from_target: &CameraFromTarget,
    model: &Model,
    sky: &Sky,
    optics: &Optics,
    rng: &mut impl Rng,
) -> Frame {
    let scene = Radiance::of(camera, camera_from_target, model, sky, optics.supersampling);
    sensor::frame_of(&blur::through_lens(scene, optics), optics, rng)
}

#[cfg(test)]
mod tests;
