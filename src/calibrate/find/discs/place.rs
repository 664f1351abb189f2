//! Exactly where a disc is.

use super::super::{Luma, NoBoard};
use super::Disc;
use crate::camera::Pixel;
use crate::detect::locate::{Seed, locate};
use crate::frame::{Coding, Frame, Pixels};

/// A picture in which discs are placed exactly.
pub(in super::super) struct Places {
    frame: Frame,
}

/// How far the middle of a rough disc may be off: a share of a pixel, and of its radius.
const SEED_SIGMA_PX: f64 = 0.25;
const SEED_SIGMA_RATIO: f64 = 0.02;

impl Places {
    /// Of this picture.
    pub(in super::super) fn of(picture: &Luma) -> Result<Self, NoBoard> {
        #[expect(clippy::cast_possible_truncation, reason = "the sides come from a frame's, which are u32")]
        let [width, height] = [picture.width, picture.height].map(|side| side as u32);
        let frame = Frame::checked(width, height, Pixels::Luma(picture.samples.clone()), Coding::LOSSLESS)?;
        Ok(Self { frame })
    }

    /// The centroid of the disc's image and its standard deviation per axis, px; `None` where there is no ellipse.
    pub(in super::super) fn place(&self, disc: &Disc) -> Option<(Pixel, f64)> {
        let radius = disc.half_axes_px()[1];
        let sigma_px = SEED_SIGMA_PX + SEED_SIGMA_RATIO * radius;
        let located = locate(&self.frame, &Seed { pixel: disc.pixel, moments: disc.moments, sigma_px }, None)?;
        Some((located.pixel, located.sigma_px))
    }
}
