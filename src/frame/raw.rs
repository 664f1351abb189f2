//! Raw pixel formats, named as in ROS and OpenCV.

use std::ops::Range;

use super::bayer::{self, Mosaic};
use super::planar::{Planar, interleaved};
use super::{Coding, Frame, FrameError, Limits, Pixels, Region, Siting};

/// A raw format of 8 bits a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RawFormat {
    /// Red, green, blue.
    Rgb8,
    /// Blue, green, red.
    Bgr8,
    /// One luma sample.
    Mono8,
    /// A colour filter array.
    Bayer(Mosaic),
    /// Y0 Cb Y1 Cr for two pixels, sampled on the left one; limited range BT.601, as webcams give it. Even width.
    Yuyv,
    /// A plane of Y, then a plane of Cb, Cr at half the size, sampled on the left pixels between the rows as in video; limited range BT.601.
    /// Even width and height.
    Nv12,
}

impl RawFormat {
    /// All formats with their names in the contract.
    pub const NAMED: [(&'static str, Self); 9] = [
        ("rgb8", Self::Rgb8),
        ("bgr8", Self::Bgr8),
        ("mono8", Self::Mono8),
        ("bayer_rggb8", Self::Bayer(Mosaic::Rggb)),
        ("bayer_bggr8", Self::Bayer(Mosaic::Bggr)),
        ("bayer_gbrg8", Self::Bayer(Mosaic::Gbrg)),
        ("bayer_grbg8", Self::Bayer(Mosaic::Grbg)),
        ("yuyv", Self::Yuyv),
        ("nv12", Self::Nv12),
    ];

    /// The name in the contract.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMED.iter().find(|(_, format)| *format == self).map_or("", |(name, _)| name)
    }

    /// Bytes of a frame of this size.
    #[must_use]
    pub const fn byte_count(self, width: u32, height: u32) -> u64 {
        let area = width as u64 * height as u64;
        match self {
            Self::Rgb8 | Self::Bgr8 => 3 * area,
            Self::Mono8 | Self::Bayer(_) => area,
            Self::Yuyv => 2 * area,
            Self::Nv12 => area + area / 2,
        }
    }

    const fn needs_even(self) -> (bool, bool) {
        match self {
            Self::Yuyv => (true, false),
            Self::Nv12 | Self::Bayer(_) => (true, true),
            Self::Rgb8 | Self::Bgr8 | Self::Mono8 => (false, false),
        }
    }
}

impl Frame {
    /// A frame from raw bytes.
    ///
    /// # Errors
    /// A size of zero, odd where the format needs it even, or over the limit; bytes that are not exactly as many as the
    /// size asks for.
    pub fn from_raw(
        format: RawFormat,
        width: u32,
        height: u32,
        bytes: &[u8],
        limits: Limits,
    ) -> Result<Self, FrameError> {
        Self::from_raw_within(format, width, height, bytes, Region { x: 0, y: 0, width, height }, limits)
    }

    /// The same where only a part of the frame will be looked at: all of its pixels are right, what lies elsewhere is not said.
    ///
    /// # Errors
    /// As [`from_raw`](Self::from_raw), and those of a part that is not on the frame.
    pub fn from_raw_within(
        format: RawFormat,
        width: u32,
        height: u32,
        bytes: &[u8],
        part: Region,
        limits: Limits,
    ) -> Result<Self, FrameError> {
        limits.check_size(width, height)?;
        let (even_width, even_height) = format.needs_even();
        if (even_width && width % 2 == 1) || (even_height && height % 2 == 1) {
            return Err(FrameError::OddSize { format: format.name(), width, height });
        }
        let expected = format.byte_count(width, height);
        let actual = bytes.len() as u64;
        if actual != expected {
            return Err(FrameError::RawLength { format: format.name(), width, height, expected, actual });
        }
        let part = part.checked(width, height)?;
        let width_px = width as usize;
        let (pixels, coding) = match format {
            RawFormat::Rgb8 => (Pixels::Rgb(copied(width_px, 3, bytes, part)), Coding::LOSSLESS),
            RawFormat::Bgr8 => {
                let mut rgb = copied(width_px, 3, bytes, part);
                rgb.chunks_exact_mut(3).for_each(|p| p.swap(0, 2));
                (Pixels::Rgb(rgb), Coding::LOSSLESS)
            }
            RawFormat::Mono8 => (Pixels::Luma(copied(width_px, 1, bytes, part)), Coding::LOSSLESS),
            RawFormat::Bayer(mosaic) => {
                let rgb = bayer::demosaic(mosaic, width_px, height as usize, bytes, part);
                (Pixels::Rgb(rgb), Coding::shared_chroma(Siting::ON_PIXEL))
            }
            RawFormat::Yuyv => {
                (Pixels::YCbCr(yuyv_to_ycbcr(width_px, bytes, part)), Coding::shared_chroma(YUYV.siting()))
            }
            RawFormat::Nv12 => {
                (Pixels::YCbCr(nv12_to_ycbcr(width_px, bytes, part)), Coding::shared_chroma(NV12.siting()))
            }
        };
        Self::checked(width, height, pixels, coding)
    }
}

/// The samples within a part of a frame; zero elsewhere, in memory that nobody touches.
fn copied(width: usize, channels: usize, bytes: &[u8], part: Region) -> Vec<u8> {
    if part.area() * channels == bytes.len() {
        return bytes.to_vec();
    }
    let mut out = vec![0; bytes.len()];
    for y in part.y as usize..(part.y + part.height) as usize {
        let run = (y * width + part.x as usize) * channels..(y * width + (part.x + part.width) as usize) * channels;
        out[run.clone()].copy_from_slice(&bytes[run]);
    }
    out
}

fn yuyv_to_ycbcr(width: usize, bytes: &[u8], part: Region) -> Vec<u8> {
    let height = bytes.len() / (2 * width);
    full_range(YUYV, [width, height], part, |planes, rows, columns| {
        for y in rows {
            for pair in bytes[2 * y * width..][2 * columns.start..2 * columns.end].chunks_exact(4) {
                planes.luma.extend([full_range_luma(pair[0]), full_range_luma(pair[2])]);
                planes.cb.push(full_range_chroma(pair[1]));
                planes.cr.push(full_range_chroma(pair[3]));
            }
        }
    })
}

fn nv12_to_ycbcr(width: usize, bytes: &[u8], part: Region) -> Vec<u8> {
    let (luma, chroma) = bytes.split_at(bytes.len() / 3 * 2);
    let height = luma.len() / width;
    full_range(NV12, [width, height], part, |planes, rows, columns| {
        for y in rows {
            planes.luma.extend(luma[y * width..][columns.clone()].iter().map(|y| full_range_luma(*y)));
            if y % 2 == 0 {
                for pair in chroma[y / 2 * width..][columns.clone()].chunks_exact(2) {
                    planes.cb.push(full_range_chroma(pair[0]));
                    planes.cr.push(full_range_chroma(pair[1]));
                }
            }
        }
    })
}

/// Two pixels of a row share their colour, which lies on the left one, as cameras on USB have it.
const YUYV: Planar = Planar::Pairs;

/// Four pixels share their colour, which lies on the left ones between the rows, as video has it unless it says otherwise.
const NV12: Planar = Planar::Squares { on_left: true };

#[derive(Default)]
struct Planes {
    luma: Vec<u8>,
    cb: Vec<u8>,
    cr: Vec<u8>,
}

/// The pixels within a part, zero elsewhere; `read` reads rows and columns, which begin and end with whole pairs, as planes of full range.
fn full_range(
    planar: Planar,
    [width, height]: [usize; 2],
    part: Region,
    read: impl FnOnce(&mut Planes, Range<usize>, Range<usize>),
) -> Vec<u8> {
    // Colour is interpolated from the pairs next to the part, too.
    let grown = |from: u32, length: u32, most: usize| {
        let (from, to) = (from as usize, (from + length) as usize);
        (from & !1).saturating_sub(2)..(to.next_multiple_of(2) + 2).min(most)
    };
    let (rows, columns) = (grown(part.y, part.height, height), grown(part.x, part.width, width));
    let mut planes = Planes::default();
    read(&mut planes, rows.clone(), columns.clone());
    let wide = columns.len();
    let pixels = interleaved(planar, wide, &planes.luma, [&planes.cb, &planes.cr]);
    if wide == width && rows.len() == height {
        return pixels;
    }
    let mut out = vec![0; 3 * width * height];
    for y in part.y as usize..(part.y + part.height) as usize {
        let (x, length) = (part.x as usize, 3 * part.width as usize);
        let from = 3 * ((y - rows.start) * wide + x - columns.start);
        out[3 * (y * width + x)..][..length].copy_from_slice(&pixels[from..from + length]);
    }
    out
}

/// 16..235 to 0..255.
#[expect(clippy::cast_possible_truncation, reason = "at most 255")]
const fn full_range_luma(y: u8) -> u8 {
    let wide = (y.saturating_sub(16) as u32 * 255 + 109) / 219;
    if wide > 255 { 255 } else { wide as u8 }
}

/// 16..240 about 128 to 0..255 about 128.
#[expect(clippy::cast_sign_loss, reason = "clamped to 0..=255")]
fn full_range_chroma(c: u8) -> u8 {
    let offset = i32::from(c) - 128;
    (128 + (offset * 255 + 112 * offset.signum()) / 224).clamp(0, 255) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rgb(format: RawFormat, width: u32, height: u32, bytes: &[u8]) -> Vec<u8> {
        Frame::from_raw(format, width, height, bytes, Limits::default()).expect("a good frame").rgb().into_owned()
    }

    #[test]
    fn bgr_is_rgb_turned_round() {
        assert_eq!(rgb(RawFormat::Bgr8, 2, 1, &[1, 2, 3, 4, 5, 6]), [3, 2, 1, 6, 5, 4]);
        assert_eq!(rgb(RawFormat::Rgb8, 2, 1, &[1, 2, 3, 4, 5, 6]), [1, 2, 3, 4, 5, 6]);
        assert_eq!(rgb(RawFormat::Mono8, 2, 1, &[7, 9]), [7, 7, 7, 9, 9, 9]);
    }

    #[test]
    fn video_formats_give_the_colours_that_opencv_gives() {
        // cv2.cvtColor(..., COLOR_YUV2RGB_YUY2 / COLOR_YUV2RGB_NV12): limited range BT.601; red is (81, 90, 240).
        let near = |found: &[u8], wanted: [u8; 3]| {
            for pixel in found.chunks_exact(3) {
                assert!(pixel.iter().zip(wanted).all(|(a, b)| a.abs_diff(b) <= 2), "{pixel:?} is not {wanted:?}");
            }
        };
        near(&rgb(RawFormat::Yuyv, 2, 1, &[81, 90, 81, 240]), [255, 0, 0]);
        near(&rgb(RawFormat::Nv12, 2, 2, &[81, 81, 81, 81, 90, 240]), [255, 0, 0]);
        near(&rgb(RawFormat::Yuyv, 2, 1, &[235, 128, 235, 128]), [255, 255, 255]);
        near(&rgb(RawFormat::Yuyv, 2, 1, &[16, 128, 16, 128]), [0, 0, 0]);
        near(&rgb(RawFormat::Nv12, 2, 2, &[145, 145, 145, 145, 54, 34]), [0, 255, 0]);
    }

    #[test]
    fn within_a_part_pixels_are_those_of_the_whole_frame() {
        let (width, height) = (16, 12);
        for (name, format) in RawFormat::NAMED {
            let count = usize::try_from(format.byte_count(width, height)).expect("small");
            let bytes: Vec<u8> = (0..count).map(|i| u8::try_from((i * i * 31 + i * 7) % 251).expect("small")).collect();
            let whole = Frame::from_raw(format, width, height, &bytes, Limits::default()).expect("a good frame");
            for [x, y, w, h] in
                [[0, 0, 16, 12], [0, 0, 1, 1], [3, 1, 5, 4], [15, 11, 1, 1], [1, 5, 14, 2], [13, 0, 3, 12]]
            {
                let part = Region { x, y, width: w, height: h };
                let frame = Frame::from_raw_within(format, width, height, &bytes, part, Limits::default());
                let frame = frame.expect("a good frame");
                assert_eq!(frame.cropped(part), whole.cropped(part), "{name} {part}");
            }
            let outside = Region { x: 10, y: 0, width: 7, height: 3 };
            let refused = Frame::from_raw_within(format, width, height, &bytes, outside, Limits::default());
            assert!(matches!(refused, Err(FrameError::RegionOutside { .. })), "{name}");
        }
    }

    /// Colour that rises to the right is sampled on the left pixel of each pair, and rises from pixel to pixel.
    #[test]
    fn shared_colour_lies_where_cameras_and_video_have_it() {
        let (width, height) = (16_u8, 6_u8);
        let colour = |pair: u8| 100 + 4 * pair;
        let pairs: Vec<u8> = (0..width / 2).flat_map(|pair| [128, colour(pair)]).collect();
        let row: Vec<u8> = (0..width / 2).flat_map(|pair| [90, 128, 90, colour(pair)]).collect();
        let yuyv = row.repeat(height.into());
        let nv12 = [vec![90; usize::from(width) * usize::from(height)], pairs.repeat(usize::from(height) / 2)].concat();
        for (format, bytes) in [(RawFormat::Yuyv, yuyv), (RawFormat::Nv12, nv12)] {
            let frame = Frame::from_raw(format, width.into(), height.into(), &bytes, Limits::default()).expect("good");
            let Pixels::YCbCr(samples) = frame.pixels() else { panic!("YCbCr") };
            for (x, pixel) in samples.chunks_exact(3).take(usize::from(width) - 1).enumerate() {
                let wanted = 128.0 + (100.0 + 2.0 * x as f64 - 128.0) * 255.0 / 224.0;
                assert!((f64::from(pixel[2]) - wanted).abs() < 1.1, "{format:?} {x}: {pixel:?}, {wanted}");
            }
        }
    }

    #[test]
    fn a_wrong_number_of_bytes_is_refused_with_both_numbers() {
        let refused = Frame::from_raw(RawFormat::Nv12, 4, 2, &[0; 11], Limits::default()).expect_err("11 bytes");
        assert_eq!(refused.to_string(), "nv12 of 4 x 2 px is 12 bytes, not 11");
    }

    #[test]
    fn odd_sizes_are_refused_where_colour_is_shared_between_neighbours() {
        let refused = |format, w, h| Frame::from_raw(format, w, h, &[0; 15], Limits::default());
        assert!(matches!(refused(RawFormat::Yuyv, 3, 2), Err(FrameError::OddSize { .. })));
        assert!(matches!(refused(RawFormat::Nv12, 4, 3), Err(FrameError::OddSize { .. })));
        assert!(matches!(refused(RawFormat::Bayer(Mosaic::Rggb), 5, 3), Err(FrameError::OddSize { .. })));
        assert!(matches!(refused(RawFormat::Mono8, 0, 3), Err(FrameError::ZeroSize { .. })));
    }

    #[test]
    fn every_format_has_its_own_name() {
        for (name, format) in RawFormat::NAMED {
            assert_eq!(format.name(), name);
        }
    }
}
