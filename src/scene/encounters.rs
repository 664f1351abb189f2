//! Random encounters: two aircraft on straight paths, one with a camera, the other with a constellation, and what the camera sees.
//!
//! [`Traffic`] is what is drawn from, an [`Encounter`] is one of it. What its frames show is either rendered
//! ([`render`](super::render::render) of an [`intruder`] before a sky), or simulated blob by blob ([`Sight`]), which is some
//! hundred times faster and errs as the detector was measured to.
//!
//! Vectors are in the level axes of the own aircraft: x along its course, y to the right, z down.

pub mod course;
pub mod intruder;
pub mod sight;
pub mod traffic;

pub use course::{Encounter, Mount};
pub use intruder::Light;
pub use sight::{Disturbance, Sight};
pub use traffic::Traffic;
