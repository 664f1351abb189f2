//! One picture: decoding within limits, raw pixel formats, region of interest, orientation.
//!
//! A frame holds its samples in the colour space in which they came, because converting costs as much as detecting:
//! JPEG stays `YCbCr` (full range, BT.601) where the caller can use that, everything else is RGB or luma.

pub mod bayer;
pub mod color;
pub mod decode;
pub mod jpeg;
pub mod orientation;
pub mod planar;
pub mod raw;
pub mod region;

use std::borrow::Cow;

pub use decode::{Decoding, FrameError, Limits, Wanted};
pub use orientation::Orientation;
pub use planar::Planar;
pub use raw::RawFormat;
pub use region::Region;

use crate::camera::Camera;

/// Samples, 8 bits each, rows from the top, no padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Pixels {
    /// One sample a pixel.
    Luma(Vec<u8>),
    /// Red, green, blue.
    Rgb(Vec<u8>),
    /// Luma, blue difference, red difference; full range, BT.601, as in JFIF.
    YCbCr(Vec<u8>),
}

/// How finely colour was sampled before the frame reached us. It bounds how well a coloured blob can be located.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChromaSampling {
    /// Every pixel has its own colour (or there is no colour at all).
    Full,
    /// One colour sample for several pixels: 4:2:0 and 4:2:2 JPEG and video, YUYV, NV12, Bayer.
    Reduced(Siting),
}

/// Where the colour that pixels share was sampled. What decoders give the pixels themselves is interpolated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Siting {
    /// Between two columns, as in JPEG; otherwise on one of them, as in video.
    pub between_columns: bool,
    /// Between two rows, as in 4:2:0; otherwise on one of them.
    pub between_rows: bool,
}

impl Siting {
    /// On a pixel.
    pub const ON_PIXEL: Self = Self { between_columns: false, between_rows: false };
}

impl ChromaSampling {
    /// Whether pixels share their colour.
    #[must_use]
    pub const fn is_reduced(self) -> bool {
        matches!(self, Self::Reduced(_))
    }

    /// The same of a frame whose rows are columns.
    const fn transposed(self) -> Self {
        match self {
            Self::Full => Self::Full,
            Self::Reduced(Siting { between_columns, between_rows }) => {
                Self::Reduced(Siting { between_columns: between_rows, between_rows: between_columns })
            }
        }
    }
}

/// What coding has done to a frame before it reached us.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coding {
    /// How finely colour was sampled.
    pub chroma: ChromaSampling,
    /// Mean quantization step of the low frequencies of the luma: 1 for raw and lossless frames, 1 to 30 for JPEG.
    pub luma_step: f64,
    /// The same of the chroma: 1 for raw and lossless frames, 5 to 60 for JPEG.
    pub chroma_step: f64,
}

impl Coding {
    /// Nothing lost.
    pub const LOSSLESS: Self = Self { chroma: ChromaSampling::Full, luma_step: 1.0, chroma_step: 1.0 };

    /// Colour shared by neighbours, otherwise nothing lost.
    #[must_use]
    pub const fn shared_chroma(siting: Siting) -> Self {
        Self { chroma: ChromaSampling::Reduced(siting), luma_step: 1.0, chroma_step: 1.0 }
    }
}

/// A picture in memory. Its size is never zero and always agrees with its samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    width: u32,
    height: u32,
    pixels: Pixels,
    coding: Coding,
    orientation: Orientation,
}

impl Frame {
    /// A frame of `width` x `height` px.
    ///
    /// # Errors
    /// [`FrameError::ZeroSize`] and [`FrameError::SampleCount`].
    pub fn checked(width: u32, height: u32, pixels: Pixels, coding: Coding) -> Result<Self, FrameError> {
        if width == 0 || height == 0 {
            return Err(FrameError::ZeroSize { width, height });
        }
        let (samples, channels) = match &pixels {
            Pixels::Luma(samples) => (samples, 1),
            Pixels::Rgb(samples) | Pixels::YCbCr(samples) => (samples, 3),
        };
        let expected = u64::from(width) * u64::from(height) * channels;
        if samples.len() as u64 != expected {
            return Err(FrameError::SampleCount { width, height, expected, actual: samples.len() as u64 });
        }
        Ok(Self { width, height, pixels, coding, orientation: Orientation::Upright })
    }

    /// A picture of the image library as a frame.
    ///
    /// # Errors
    /// [`FrameError::ZeroSize`].
    pub fn from_rgb_image(picture: image::RgbImage) -> Result<Self, FrameError> {
        let (width, height) = picture.dimensions();
        Self::checked(width, height, Pixels::Rgb(picture.into_raw()), Coding::LOSSLESS)
    }

    /// Width, px.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Height, px.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// The samples.
    #[must_use]
    pub const fn pixels(&self) -> &Pixels {
        &self.pixels
    }

    /// What coding has done to its colours.
    #[must_use]
    pub const fn coding(&self) -> Coding {
        self.coding
    }

    /// The orientation that the file states and that was *not* applied; upright where it was.
    #[must_use]
    pub const fn orientation(&self) -> Orientation {
        self.orientation
    }

    /// The samples as RGB, converted if need be.
    #[must_use]
    pub fn rgb(&self) -> Cow<'_, [u8]> {
        if let Pixels::Rgb(samples) = &self.pixels {
            return Cow::Borrowed(samples);
        }
        let mut samples = Vec::new();
        self.rgb_in(&mut samples);
        Cow::Owned(samples)
    }

    /// As [`rgb`](Self::rgb); what is converted is in `samples`.
    pub fn rgb_in<'a>(&'a self, samples: &'a mut Vec<u8>) -> &'a [u8] {
        match &self.pixels {
            Pixels::Rgb(rgb) => return rgb,
            Pixels::Luma(luma) => {
                samples.clear();
                samples.reserve(3 * luma.len());
                samples.extend(luma.iter().flat_map(|&y| [y, y, y]));
            }
            Pixels::YCbCr(ycbcr) => {
                samples.resize(ycbcr.len(), 0);
                color::write_rgb(ycbcr, samples);
            }
        }
        samples
    }

    /// The whole frame as a region.
    #[must_use]
    pub const fn full(&self) -> Region {
        Region { x: 0, y: 0, width: self.width, height: self.height }
    }

    /// Whether the frame can have come from `camera`.
    ///
    /// # Errors
    /// [`FrameError::NotOfCamera`] with both sizes where they differ.
    pub const fn check_camera(&self, camera: &Camera) -> Result<(), FrameError> {
        if self.width == camera.width() && self.height == camera.height() {
            return Ok(());
        }
        Err(FrameError::NotOfCamera { frame: [self.width, self.height], camera: [camera.width(), camera.height()] })
    }
}
