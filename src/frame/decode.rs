//! Encoded pictures: recognised by their first bytes, measured by their header, only then decoded.

use std::io::Cursor;

use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use thiserror::Error;

use super::{Coding, Frame, Orientation, Pixels, Region, jpeg};

/// What a frame may cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Most pixels a frame may have, checked before it is decoded. The default is a frame of 8192 x 4320.
    pub max_pixels: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { max_pixels: 8192 * 4320 }
    }
}

impl Limits {
    /// Whether a frame of this size is within the limits.
    ///
    /// # Errors
    /// [`FrameError::ZeroSize`], [`FrameError::TooManyPixels`].
    pub const fn check_size(&self, width: u32, height: u32) -> Result<(), FrameError> {
        if width == 0 || height == 0 {
            return Err(FrameError::ZeroSize { width, height });
        }
        if width as u64 * height as u64 > self.max_pixels {
            return Err(FrameError::TooManyPixels { width, height, max_pixels: self.max_pixels });
        }
        Ok(())
    }
}

/// Which colour space the caller can work in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// Whatever the file holds: `YCbCr` from a colour JPEG.
    Native,
    /// RGB (or luma, where there is no colour).
    Rgb,
    /// Luma is enough. A JPEG is decoded without its colours, which saves a third of the time; other files as they are.
    Luma,
}

/// How encoded bytes become a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decoding {
    /// Colour space of the result.
    pub wanted: Wanted,
    /// Turn the frame as its EXIF orientation says. Off by default: intrinsics belong to the sensor's pixel grid.
    pub apply_orientation: bool,
    /// What it may cost.
    pub limits: Limits,
}

impl Default for Decoding {
    fn default() -> Self {
        Self { wanted: Wanted::Native, apply_orientation: false, limits: Limits::default() }
    }
}

/// Why bytes are not a frame, or not one that fits.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FrameError {
    /// Nothing there.
    #[error("the frame is empty: 0 bytes")]
    Empty,
    /// None of the formats we read.
    #[error("not a picture: the first bytes are {start:02x?}; JPEG, PNG, WebP, BMP, TIFF and PNM are read")]
    UnknownFormat {
        /// Up to eight of them.
        start: Vec<u8>,
    },
    /// A picture without its end.
    #[error("the {format} is cut off: its end is missing")]
    Truncated {
        /// Name of the format.
        format: &'static str,
    },
    /// A picture that its decoder gives up on.
    #[error("the {format} cannot be decoded: {detail}")]
    Corrupt {
        /// Name of the format.
        format: &'static str,
        /// The decoder's words.
        detail: String,
    },
    /// A side of no pixels.
    #[error("a frame of {width} x {height} px has no pixels")]
    ZeroSize {
        /// Width, px.
        width: u32,
        /// Height, px.
        height: u32,
    },
    /// Over the limit.
    #[error("a frame of {width} x {height} px is larger than the limit of {max_pixels} px")]
    TooManyPixels {
        /// Width, px.
        width: u32,
        /// Height, px.
        height: u32,
        /// The limit.
        max_pixels: u64,
    },
    /// A buffer that does not hold the samples of its size.
    #[error("a frame of {width} x {height} px has {expected} samples, not {actual}")]
    SampleCount {
        /// Width, px.
        width: u32,
        /// Height, px.
        height: u32,
        /// Samples needed.
        expected: u64,
        /// Samples there.
        actual: u64,
    },
    /// Raw bytes of the wrong number.
    #[error("{format} of {width} x {height} px is {expected} bytes, not {actual}")]
    RawLength {
        /// Name of the format.
        format: &'static str,
        /// Width, px.
        width: u32,
        /// Height, px.
        height: u32,
        /// Bytes needed.
        expected: u64,
        /// Bytes there.
        actual: u64,
    },
    /// An odd side where pixels share their colour in pairs.
    #[error("{format} of {width} x {height} px: the format needs even sides")]
    OddSize {
        /// Name of the format.
        format: &'static str,
        /// Width, px.
        width: u32,
        /// Height, px.
        height: u32,
    },
    /// A frame of another size than its camera's.
    #[error(
        "the frame is {} x {} px but its camera is calibrated for {} x {} px",
        frame[0], frame[1], camera[0], camera[1]
    )]
    NotOfCamera {
        /// Size of the frame, px.
        frame: [u32; 2],
        /// Size of the camera, px.
        camera: [u32; 2],
    },
    /// A region without pixels.
    #[error("the region {region} has no pixels")]
    EmptyRegion {
        /// The region.
        region: Region,
    },
    /// A region that leaves the frame.
    #[error("the region {region} does not lie on the frame of {} x {} px", frame[0], frame[1])]
    RegionOutside {
        /// The region.
        region: Region,
        /// Size of the frame, px.
        frame: [u32; 2],
    },
}

impl Frame {
    /// A frame from the bytes of a JPEG, PNG, `WebP`, BMP, TIFF or PNM file. What the file is, its first bytes decide, not a
    /// name or a content type. An alpha channel is dropped; 16 bits are reduced to 8.
    ///
    /// # Errors
    /// See [`FrameError`]; size limits are checked against the header before anything is decoded.
    pub fn decode(bytes: &[u8], decoding: &Decoding) -> Result<Self, FrameError> {
        if bytes.is_empty() {
            return Err(FrameError::Empty);
        }
        let frame = if bytes.starts_with(&[0xFF, 0xD8, 0xFF]) {
            jpeg::decode(bytes, decoding.wanted, decoding.limits)?
        } else {
            let (format, name) = recognise(bytes)?;
            decode_with_image(bytes, format, name, decoding.limits)?
        };
        Ok(if decoding.apply_orientation { frame.upright() } else { frame })
    }
}

fn recognise(bytes: &[u8]) -> Result<(ImageFormat, &'static str), FrameError> {
    let unknown = || FrameError::UnknownFormat { start: bytes[..bytes.len().min(8)].to_vec() };
    let format = image::guess_format(bytes).map_err(|_| unknown())?;
    let name = match format {
        ImageFormat::Png => "PNG",
        ImageFormat::WebP => "WebP",
        ImageFormat::Bmp => "BMP",
        ImageFormat::Tiff => "TIFF",
        ImageFormat::Pnm => "PNM",
        _ => return Err(unknown()),
    };
    Ok((format, name))
}

fn decode_with_image(
    bytes: &[u8],
    format: ImageFormat,
    name: &'static str,
    limits: Limits,
) -> Result<Frame, FrameError> {
    let failed = |e: image::ImageError| match e {
        image::ImageError::IoError(io) if io.kind() == std::io::ErrorKind::UnexpectedEof => {
            FrameError::Truncated { format: name }
        }
        other => FrameError::Corrupt { format: name, detail: other.to_string() },
    };
    if let Some((width, height)) = claimed_size(bytes, format) {
        limits.check_size(width, height)?;
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut allowed = image::Limits::default();
    // The worst of the formats we read: four channels of 32 bits, decoded and converted.
    allowed.max_alloc = Some(limits.max_pixels.saturating_mul(32));
    reader.limits(allowed);
    let mut decoder = reader.into_decoder().map_err(failed)?;
    let (width, height) = decoder.dimensions();
    limits.check_size(width, height)?;
    let orientation = decoder.orientation().map_or(Orientation::Upright, |o| Orientation::from_exif(o.to_exif()));
    let gray = matches!(decoder.color_type(), ColorType::L8 | ColorType::La8 | ColorType::L16 | ColorType::La16);
    let picture = DynamicImage::from_decoder(decoder).map_err(failed)?;
    let pixels =
        if gray { Pixels::Luma(picture.into_luma8().into_raw()) } else { Pixels::Rgb(picture.into_rgb8().into_raw()) };
    Ok(Frame::checked(width, height, pixels, Coding::LOSSLESS)?.stating(orientation))
}

/// The size that a PNG claims in its first chunk; its decoder reads on until the pixels begin before it tells.
fn claimed_size(bytes: &[u8], format: ImageFormat) -> Option<(u32, u32)> {
    let header = (format == ImageFormat::Png).then(|| bytes.get(12..24)).flatten()?.strip_prefix(b"IHDR")?;
    let side = |at: usize| Some(u32::from_be_bytes(*header.get(at..)?.first_chunk()?));
    Some((side(0)?, side(4)?))
}

#[cfg(test)]
mod tests {
    use image::{ExtendedColorType, ImageEncoder, RgbImage};
    use jpeg_encoder::{ColorType as JpegColor, Encoder, SamplingFactor};

    use super::*;
    use crate::frame::{ChromaSampling, Siting};

    /// A smooth picture with colour, so that JPEG keeps it.
    fn picture() -> RgbImage {
        RgbImage::from_fn(48, 32, |x, y| {
            image::Rgb([40 + 3 * x, 200 - 4 * y, 90 + x + y].map(|v| u8::try_from(v).expect("a sample")))
        })
    }

    fn encoded(format: ImageFormat) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        picture().write_to(&mut out, format).expect("encodes");
        out.into_inner()
    }

    fn jpeg(sampling: SamplingFactor, exif_orientation: Option<u8>) -> Vec<u8> {
        let mut out = Vec::new();
        let mut encoder = Encoder::new(&mut out, 95);
        encoder.set_sampling_factor(sampling);
        if let Some(value) = exif_orientation {
            // A little-endian TIFF header and one directory entry: tag 0x0112, type SHORT, count 1.
            let mut exif = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".to_vec();
            exif.extend([value, 0, 0, 0, 0, 0, 0, 0]);
            encoder.add_exif_metadata(&exif).expect("fits");
        }
        encoder.encode(picture().as_raw(), 48, 32, JpegColor::Rgb).expect("encodes");
        out
    }

    fn decode(bytes: &[u8]) -> Result<Frame, FrameError> {
        Frame::decode(bytes, &Decoding::default())
    }

    #[test]
    fn lossless_formats_give_their_pixels_back() {
        for format in [ImageFormat::Png, ImageFormat::WebP, ImageFormat::Bmp, ImageFormat::Tiff, ImageFormat::Pnm] {
            let frame = decode(&encoded(format)).expect("decodes");
            assert_eq!((frame.width(), frame.height()), (48, 32), "{format:?}");
            assert_eq!(frame.pixels(), &Pixels::Rgb(picture().into_raw()), "{format:?}");
        }
    }

    #[test]
    fn sixteen_bits_alpha_and_gray_are_reduced() {
        let mut wide = Vec::new();
        let samples: Vec<u8> = [0x1234_u16, 0x8080, 0xFFFF, 0x4242].iter().flat_map(|s| s.to_ne_bytes()).collect();
        image::codecs::png::PngEncoder::new(&mut wide)
            .write_image(&samples, 1, 1, ExtendedColorType::Rgba16)
            .expect("encodes");
        assert_eq!(decode(&wide).expect("decodes").pixels(), &Pixels::Rgb(vec![0x12, 0x80, 0xFF]));
        assert_eq!(decode(b"P5 2 1 255\n\x07\x09").expect("decodes").pixels(), &Pixels::Luma(vec![7, 9]));
    }

    #[test]
    fn a_jpeg_stays_ycbcr_unless_rgb_is_wanted_and_states_its_sampling() {
        let between = |between_columns, between_rows| ChromaSampling::Reduced(Siting { between_columns, between_rows });
        for (sampling, chroma) in [
            (SamplingFactor::F_1_1, ChromaSampling::Full),
            (SamplingFactor::F_2_1, between(true, false)),
            (SamplingFactor::F_1_2, between(false, true)),
            (SamplingFactor::F_2_2, between(true, true)),
        ] {
            let bytes = jpeg(sampling, None);
            let native = decode(&bytes).expect("decodes");
            assert!(matches!(native.pixels(), Pixels::YCbCr(_)));
            assert_eq!(native.coding().chroma, chroma);
            let rgb = Frame::decode(&bytes, &Decoding { wanted: Wanted::Rgb, ..Decoding::default() }).expect("decodes");
            for (name, samples) in [("native", native.rgb()), ("rgb", rgb.rgb())] {
                let worst = samples.iter().zip(picture().as_raw()).map(|(a, b)| a.abs_diff(*b)).max();
                assert!(worst <= Some(12), "{name}: {worst:?}");
            }
        }
    }

    #[test]
    fn orientation_is_stated_and_ignored_or_applied() {
        let bytes = jpeg(SamplingFactor::F_1_1, Some(6));
        let stated = decode(&bytes).expect("decodes");
        assert_eq!((stated.width(), stated.orientation()), (48, Orientation::Turned(6)));
        let applied =
            Frame::decode(&bytes, &Decoding { apply_orientation: true, ..Decoding::default() }).expect("decodes");
        assert_eq!((applied.width(), applied.orientation()), (32, Orientation::Upright));
    }

    #[test]
    fn every_cut_of_every_format_is_refused() {
        let files = [
            ("JPEG", jpeg(SamplingFactor::F_2_2, None)),
            ("PNG", encoded(ImageFormat::Png)),
            ("WebP", encoded(ImageFormat::WebP)),
            ("BMP", encoded(ImageFormat::Bmp)),
            ("TIFF", encoded(ImageFormat::Tiff)),
            ("PNM", encoded(ImageFormat::Pnm)),
        ];
        for (name, bytes) in files {
            // WebP is padded to even length and PNG ends in a chunk without data, so the very last bytes may go unmissed.
            for length in (0..bytes.len() - 16).step_by(7) {
                assert!(decode(&bytes[..length]).is_err(), "{name} cut to {length} of {} bytes passed", bytes.len());
            }
        }
        let whole = jpeg(SamplingFactor::F_2_2, None);
        assert_eq!(decode(&whole[..whole.len() - 2]), Err(FrameError::Truncated { format: "JPEG" }));
    }

    #[test]
    fn a_huge_claim_is_refused_from_the_header() {
        let mut png = encoded(ImageFormat::Png);
        png[16..20].copy_from_slice(&60_000_u32.to_be_bytes());
        png[20..24].copy_from_slice(&60_000_u32.to_be_bytes());
        assert!(matches!(decode(&png), Err(FrameError::TooManyPixels { width: 60_000, height: 60_000, .. })));
        assert!(matches!(decode(b"P6 60000 60000 255\n"), Err(FrameError::TooManyPixels { .. })));
    }

    #[test]
    fn what_is_no_picture_is_named_by_its_first_bytes() {
        assert_eq!(decode(b""), Err(FrameError::Empty));
        let refused = decode(b"hello, I am a text").expect_err("text");
        assert!(refused.to_string().starts_with("not a picture: the first bytes are [68, 65, 6c, 6c, 6f"));
        assert!(matches!(decode(b"GIF89a\x01\0\x01\0\0\0\0"), Err(FrameError::UnknownFormat { .. })));
    }

    #[test]
    fn luma_alone_is_the_luma_of_all() {
        let samples = (0..64_u32 * 40 * 3).map(|i| (i * 7 % 251).to_le_bytes()[0]).collect();
        let frame = Frame::checked(64, 40, Pixels::Rgb(samples), Coding::LOSSLESS).expect("a frame");
        let bytes = crate::scene::encode::jpeg(&frame, 90).expect("fits");
        let all = Frame::decode(&bytes, &Decoding::default()).expect("decodes");
        let luma = Frame::decode(&bytes, &Decoding { wanted: Wanted::Luma, ..Decoding::default() }).expect("decodes");
        let (Pixels::YCbCr(all), Pixels::Luma(luma)) = (all.pixels(), luma.pixels()) else { panic!("other pixels") };
        assert!(all.chunks_exact(3).map(|pixel| pixel[0]).eq(luma.iter().copied()));
    }

    #[test]
    fn flipped_bits_never_panic() {
        let whole = jpeg(SamplingFactor::F_2_2, None);
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 0x55;
            let _ = decode(&damaged);
        }
    }
}
