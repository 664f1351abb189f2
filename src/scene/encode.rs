//! Frames as files in memory.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use jpeg_encoder::{ChromaSubsamplingMethod, ColorType, Encoder, SamplingFactor};
use thiserror::Error;

use crate::frame::{Frame, Pixels};

/// Why a frame has no file.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum EncodeError {
    /// A side that the format cannot state.
    #[error("{format} holds at most {max} px a side, the frame is {width} x {height} px")]
    TooLarge {
        /// Name of the format.
        format: &'static str,
        /// Width, px.
        width: u32,
        /// Height, px.
        height: u32,
        /// Largest side, px.
        max: u32,
    },
    /// The encoder gave up.
    #[error("the {format} encoder failed: {detail}")]
    Failed {
        /// Name of the format.
        format: &'static str,
        /// The encoder's words.
        detail: String,
    },
}

/// The frame as a JPEG of `quality` 1 to 100, one colour sample for 2 x 2 pixels (4:2:0) as cameras have it.
///
/// # Errors
/// [`EncodeError::TooLarge`] for a side of more than 65 535 px.
pub fn jpeg(frame: &Frame, quality: u8) -> Result<Vec<u8>, EncodeError> {
    let (samples, colour) = match frame.pixels() {
        Pixels::Luma(samples) => (samples, ColorType::Luma),
        Pixels::Rgb(samples) => (samples, ColorType::Rgb),
        Pixels::YCbCr(samples) => (samples, ColorType::Ycbcr),
    };
    let (width, height) = (frame.width(), frame.height());
    let (Ok(short_width), Ok(short_height)) = (u16::try_from(width), u16::try_from(height)) else {
        return Err(EncodeError::TooLarge { format: "JPEG", width, height, max: u32::from(u16::MAX) });
    };
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, quality.clamp(1, 100));
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    // The encoder's default takes the first of four pixels, which moves every colour by half a pixel.
    encoder.set_chroma_subsampling_method(ChromaSubsamplingMethod::Average);
    encoder
        .encode(samples, short_width, short_height, colour)
        .map_err(|e| EncodeError::Failed { format: "JPEG", detail: e.to_string() })?;
    Ok(bytes)
}

/// The frame as a PNG. What was `YCbCr` becomes RGB, everything else is kept to the bit.
///
/// # Errors
/// [`EncodeError::Failed`] if the encoder gives up.
pub fn png(frame: &Frame) -> Result<Vec<u8>, EncodeError> {
    let colour = match frame.pixels() {
        Pixels::Luma(_) => ExtendedColorType::L8,
        Pixels::Rgb(_) | Pixels::YCbCr(_) => ExtendedColorType::Rgb8,
    };
    let rgb;
    let samples: &[u8] = match frame.pixels() {
        Pixels::Luma(samples) => samples,
        Pixels::Rgb(_) | Pixels::YCbCr(_) => {
            rgb = frame.rgb();
            &rgb
        }
    };
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Sub)
        .write_image(samples, frame.width(), frame.height(), colour)
        .map_err(|e| EncodeError::Failed { format: "PNG", detail: e.to_string() })?;
    Ok(bytes)
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the pictures are small")]
mod tests {
    use super::*;
    use crate::frame::{Coding, Decoding, Wanted};

    /// A smooth picture, so that JPEG keeps it.
    fn picture(width: u32, height: u32) -> Frame {
        let rgb = (0..height).flat_map(|y| (0..width).flat_map(move |x| [40 + 2 * x, 200 - 3 * y, 90 + x + y]));
        let samples = rgb.map(|v| u8::try_from(v).expect("small")).collect();
        Frame::checked(width, height, Pixels::Rgb(samples), Coding::LOSSLESS).expect("a frame")
    }

    fn decoded(bytes: &[u8]) -> Frame {
        Frame::decode(bytes, &Decoding { wanted: Wanted::Rgb, ..Decoding::default() }).expect("decodes")
    }

    #[test]
    fn a_png_gives_the_frame_back() {
        let gray =
            Frame::checked(3, 2, Pixels::Luma(vec![0, 9, 80, 200, 254, 255]), Coding::LOSSLESS).expect("a frame");
        for frame in [picture(37, 21), gray] {
            assert_eq!(decoded(&png(&frame).expect("encodes")).pixels(), frame.pixels());
        }
    }

    #[test]
    fn a_jpeg_decodes_to_the_same_size_and_nearly_the_same_colours() {
        // Odd sides: the last chroma sample covers less than four pixels.
        let frame = picture(37, 21);
        let ycbcr: Vec<u8> =
            frame.rgb().chunks_exact(3).flat_map(|p| crate::frame::color::ycbcr_of_rgb([p[0], p[1], p[2]])).collect();
        let native = Frame::checked(37, 21, Pixels::YCbCr(ycbcr), Coding::LOSSLESS).expect("a frame");
        for frame in [frame.clone(), native] {
            let back = decoded(&jpeg(&frame, 95).expect("encodes"));
            assert_eq!((back.width(), back.height()), (37, 21));
            assert!(back.coding().chroma.is_reduced());
            let worst = back.rgb().iter().zip(frame.rgb().iter()).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(worst <= Some(12), "{worst:?}");
        }
    }

    #[test]
    fn a_jpeg_leaves_a_coloured_blob_where_it_is() {
        // Red on gray of the same luma, so that only chroma tells where it is.
        let centre = [20.3, 15.6];
        let samples = (0..32_u32).flat_map(|y| (0..40_u32).map(move |x| (x, y))).flat_map(|(x, y)| {
            let squared = (f64::from(x) - centre[0]).powi(2) + (f64::from(y) - centre[1]).powi(2);
            let share = (-squared / 18.0).exp();
            [(90.0, 70.0), (90.0, -35.7), (90.0, 0.0)]
                .map(|(base, gain): (f64, f64)| (base + share * gain).round() as u8)
        });
        let frame = Frame::checked(40, 32, Pixels::Rgb(samples.collect()), Coding::LOSSLESS).expect("a frame");
        // At full quality; below it, quantization moves single blobs by 0.1 px at random.
        let back = decoded(&jpeg(&frame, 100).expect("encodes"));
        let (mut sum, mut moment) = (0.0, [0.0; 2]);
        for (i, pixel) in back.rgb().chunks_exact(3).enumerate() {
            let weight = (f64::from(pixel[0]) - f64::from(pixel[1]) - 6.0).max(0.0);
            sum += weight;
            moment[0] += weight * (i % 40) as f64;
            moment[1] += weight * (i / 40) as f64;
        }
        let found = moment.map(|m| m / sum);
        assert!((found[0] - centre[0]).abs() < 0.05 && (found[1] - centre[1]).abs() < 0.05, "{found:?}");
    }

    #[test]
    fn a_side_that_does_not_fit_is_named() {
        let wide = Frame::checked(70_000, 1, Pixels::Luma(vec![0; 70_000]), Coding::LOSSLESS).expect("a frame");
        assert_eq!(
            jpeg(&wide, 90),
            Err(EncodeError::TooLarge { format: "JPEG", width: 70_000, height: 1, max: 65_535 })
        );
        assert_eq!(decoded(&png(&wide).expect("encodes")).width(), 70_000);
    }

    #[test]
    fn any_quality_makes_a_file_and_more_quality_a_larger_one() {
        let sizes = [0, 1, 50, 100, 255].map(|quality| jpeg(&picture(64, 32), quality).expect("encodes").len());
        assert!(sizes.is_sorted(), "{sizes:?}");
    }
}
