//! Where exactly a marker is: a blurred ellipse fitted to luma and chroma together.
//!
//! Chroma tells a marker from everything else, but JPEG and Bayer sensors sample it at half the rate. Luma is sharp, but a red
//! disc may be as bright as what is behind it, and whatever crosses its rim (a panel line, the edge of a wing) is there too.
//! So one ellipse is fitted to both, each channel with a ground and a height of its own, weighted by its own noise, and
//! pixels that fit neither are left out.

mod ellipse;
mod fit;
mod lanes;
mod pass;
mod patch;
mod rim;

use nalgebra::{Matrix2, Vector2};

use crate::camera::Pixel;
use crate::frame::Frame;

/// A blob that was found, roughly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed {
    /// Its middle in the frame, px.
    pub pixel: Pixel,
    /// Second moments of its area, px^2.
    pub moments: Matrix2<f64>,
    /// How far its middle may be off, one standard deviation, px.
    pub sigma_px: f64,
}

/// The same blob, exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Located {
    /// Middle of its ellipse, px.
    pub pixel: Pixel,
    /// Standard deviation per axis, px.
    pub sigma_px: f64,
    /// Area of its ellipse, px.
    pub area_px: f64,
}

/// The ellipse at `seed`; `chroma` is the direction of the marker's hue in the plane of (Cb, Cr). `None` where no ellipse fits.
#[must_use]
pub fn locate(frame: &Frame, seed: &Seed, chroma: Option<Vector2<f64>>) -> Option<Located> {
    fit::fit(frame, seed, chroma)
}
