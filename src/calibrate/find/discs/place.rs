//! Exactly where a disc is.

use super::super::{Luma, NoBoard};
use super::{Disc, Near};
use crate::camera::Pixel;
use crate::detect::locate::{Seed, locate_print};
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

    /// The centroid of the image of a disc among others and its standard deviation per axis, px; `None` where there is no
    /// ellipse.
    pub(in super::super) fn place(&self, disc: usize, discs: &[Disc], near: &Near) -> Option<(Pixel, f64)> {
        let own = discs.get(disc)?;
        let radius = own.half_axes_px()[1];
        let others: Vec<Seed> = near
            .within(own.pixel, OTHERS_RADII * radius + OTHERS_PX)
            .filter(|other| *other != disc)
            .filter_map(|other| Some(discs.get(other)?.seed()))
            .take(MAX_OTHERS)
            .collect();
        let located = locate_print(&self.frame, &own.seed(), &others)?;
        Some((located.pixel, located.sigma_px))
    }
}

/// Discs whose middle is within so many radii, and pixels, touch what is looked at of a disc; so many of them are looked past.
const OTHERS_RADII: f64 = 2.2;
const OTHERS_PX: f64 = 7.0;
const MAX_OTHERS: usize = 8;

impl Disc {
    fn seed(&self) -> Seed {
        let sigma_px = SEED_SIGMA_PX + SEED_SIGMA_RATIO * self.half_axes_px()[1];
        Seed { pixel: self.pixel, moments: self.moments, sigma_px }
    }
}
