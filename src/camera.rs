//! The calibrated camera: intrinsics, lens distortion, projection and its inverse with Jacobians.
//!
//! Pixels: u to the right, v down, the centre of the top-left pixel at (0, 0). The camera's space: x right, y down,
//! z forward. Only points in front of the camera (`z > 0`) have a projection.

mod derived;
pub mod disc;
pub mod distortion;
pub mod intrinsics;
pub mod orthographic;
pub mod parameters;
pub mod projection;

pub use disc::DiscImage;
pub use distortion::Distortion;
pub use intrinsics::{Camera, CameraError};
pub use orthographic::{orthographic, scaled_orthographic};
pub use parameters::ParameterCovariance;

use nalgebra::Vector2;

/// Image coordinates `(u, v)` in pixels.
pub type Pixel = Vector2<f64>;

/// Coordinates `(x / z, y / z)` of a ray on the plane `z = 1` of the camera's space, free of distortion.
pub type Normalized = Vector2<f64>;
