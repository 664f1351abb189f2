//! Comparisons and fusion against truth: drawn errors, and flights of two vehicles that see each other.

#![allow(clippy::print_stdout, reason = "a test shows its figures")]

mod drawn;
mod flights;
mod moments;

use crate::geometry::space::{Body, Peer};
use crate::geometry::{Transform, rotation};

/// Squared errors of place and attitude, m^2 and rad^2.
fn squared_errors(found: &Transform<Body, Peer>, truth: &Transform<Body, Peer>) -> [f64; 2] {
    [
        (found.translation - truth.translation).norm_squared(),
        rotation::angle_between_rad(&found.rotation, &truth.rotation).powi(2),
    ]
}
