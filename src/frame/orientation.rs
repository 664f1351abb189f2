//! The orientation that a camera or phone writes into a picture's EXIF data.

use image::metadata::Orientation as Exif;
use image::{DynamicImage, GrayImage, RgbImage};

use super::{Coding, Frame, Pixels};

/// How the picture must be turned to stand upright. Intrinsics belong to the sensor's own pixel grid, so frames are by
/// default taken as they are stored and their orientation only stated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Orientation {
    /// As stored (EXIF 1, or none given).
    #[default]
    Upright,
    /// Turned or mirrored: the EXIF value, 2 to 8.
    Turned(u8),
}

impl Orientation {
    /// From the EXIF value; what is not 2 to 8 is upright.
    #[must_use]
    pub const fn from_exif(value: u8) -> Self {
        match value {
            2..=8 => Self::Turned(value),
            _ => Self::Upright,
        }
    }

    /// The EXIF value, 1 to 8.
    #[must_use]
    pub const fn exif(self) -> u8 {
        match self {
            Self::Upright => 1,
            Self::Turned(value) => value,
        }
    }
}

impl Frame {
    /// The same frame with an orientation that its source states and that is not applied.
    #[must_use]
    pub const fn stating(mut self, orientation: Orientation) -> Self {
        self.orientation = orientation;
        self
    }

    /// The frame turned upright, as its orientation says.
    #[must_use]
    pub fn upright(self) -> Self {
        let Orientation::Turned(value) = self.orientation else {
            return self;
        };
        let Some(turn) = Exif::from_exif(value) else {
            return self;
        };
        let (width, height) = (self.width, self.height);
        let turned = |mut picture: DynamicImage| {
            picture.apply_orientation(turn);
            (picture.width(), picture.height(), picture.into_bytes())
        };
        // The sizes agree by the frame's invariant, so the buffers always fit.
        let rgb = |samples| RgbImage::from_raw(width, height, samples).unwrap_or_default();
        let (width, height, pixels) = match self.pixels {
            Pixels::Luma(samples) => {
                let picture = GrayImage::from_raw(width, height, samples).unwrap_or_default();
                let (w, h, samples) = turned(DynamicImage::ImageLuma8(picture));
                (w, h, Pixels::Luma(samples))
            }
            Pixels::Rgb(samples) => {
                let (w, h, samples) = turned(DynamicImage::ImageRgb8(rgb(samples)));
                (w, h, Pixels::Rgb(samples))
            }
            // Three channels are moved alike, whatever they mean.
            Pixels::YCbCr(samples) => {
                let (w, h, samples) = turned(DynamicImage::ImageRgb8(rgb(samples)));
                (w, h, Pixels::YCbCr(samples))
            }
        };
        // From the fifth on, rows become columns.
        let chroma = if value >= 5 { self.coding.chroma.transposed() } else { self.coding.chroma };
        Self { width, height, pixels, coding: Coding { chroma, ..self.coding }, orientation: Orientation::Upright }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Coding;

    fn frame(orientation: u8) -> Frame {
        let pixels = Pixels::Luma(vec![1, 2, 3, 4, 5, 6]);
        Frame::checked(3, 2, pixels, Coding::LOSSLESS)
            .expect("six samples")
            .stating(Orientation::from_exif(orientation))
    }

    #[test]
    fn exif_6_is_turned_a_quarter_to_the_right() {
        let turned = frame(6).upright();
        assert_eq!((turned.width(), turned.height()), (2, 3));
        assert_eq!(turned.pixels(), &Pixels::Luma(vec![4, 1, 5, 2, 6, 3]));
        assert_eq!(turned.orientation(), Orientation::Upright);
    }

    #[test]
    fn values_outside_the_standard_are_upright() {
        for value in [0, 1, 9, 255] {
            assert_eq!(frame(value).upright().pixels(), frame(1).pixels());
        }
    }
}
