//! JPEG: the header read by ourselves for limits, sampling and completeness; the picture by `zune-jpeg`.

use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use super::{ChromaSampling, Coding, Frame, FrameError, Limits, Orientation, Pixels, Siting, Wanted};

/// What the markers before the first scan say.
struct Header {
    width: u32,
    height: u32,
    components: u8,
    coding: Coding,
    orientation: Orientation,
    /// Offset of the first scan's data.
    scan: usize,
}

pub(super) fn decode(bytes: &[u8], wanted: Wanted, limits: Limits) -> Result<Frame, FrameError> {
    let header = read_header(bytes).ok_or_else(|| corrupt("its header is incomplete or malformed"))?;
    limits.check_size(header.width, header.height)?;
    // Entropy-coded data cannot hold this marker, so its absence proves that the end is missing. The decoder would fill
    // the missing rows with gray and call it success.
    if !bytes[header.scan..].windows(2).rev().any(|pair| pair == [0xFF, 0xD9]) {
        return Err(FrameError::Truncated { format: "JPEG" });
    }
    // Strict: a picture with damaged data is refused, not repaired with invented pixels.
    let options = DecoderOptions::new_fast()
        .set_strict_mode(true)
        .set_max_width(header.width as usize)
        .set_max_height(header.height as usize);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| corrupt(&e.to_string()))?;
    // Some are stored as red, green and blue; they stay so, whatever is wanted.
    let color = match (header.components, wanted) {
        _ if decoder.input_colorspace() == Some(ColorSpace::RGB) => ColorSpace::RGB,
        (1, _) | (3, Wanted::Luma) => ColorSpace::Luma,
        (3, Wanted::Native) => ColorSpace::YCbCr,
        _ => ColorSpace::RGB,
    };
    decoder.set_options(options.jpeg_set_out_colorspace(color));
    let samples = decoder.decode().map_err(|e| corrupt(&e.to_string()))?;
    let pixels = match decoder.output_colorspace() {
        Some(ColorSpace::Luma) => Pixels::Luma(samples),
        Some(ColorSpace::YCbCr) => Pixels::YCbCr(samples),
        _ => Pixels::Rgb(samples),
    };
    Ok(Frame::checked(header.width, header.height, pixels, header.coding)?.stating(header.orientation))
}

fn corrupt(detail: &str) -> FrameError {
    FrameError::Corrupt { format: "JPEG", detail: detail.into() }
}

fn read_header(bytes: &[u8]) -> Option<Header> {
    let mut at = 2;
    let mut orientation = Orientation::Upright;
    let mut steps = [1.0; 4];
    let mut start = None;
    loop {
        // Fill bytes of 0xFF may stand before a marker.
        let mut marker = *bytes.get(at..at + 2)?.first_chunk::<2>()?;
        while marker == [0xFF, 0xFF] {
            at += 1;
            marker = *bytes.get(at..at + 2)?.first_chunk::<2>()?;
        }
        let [0xFF, code] = marker else { return None };
        at += 2;
        let length = usize::from(u16::from_be_bytes(*bytes.get(at..at + 2)?.first_chunk::<2>()?));
        let segment = bytes.get(at + 2..at + length)?;
        match code {
            0xE1 if segment.starts_with(b"Exif\0\0") => {
                if let Some(found) = image::metadata::Orientation::from_exif_chunk(&segment[6..]) {
                    orientation = Orientation::from_exif(found.to_exif());
                }
            }
            0xDB => read_quantization(segment, &mut steps),
            // Start of frame, all kinds but the tables (C4, CC) and the extension (C8) that share the range.
            0xC0..=0xCF if !matches!(code, 0xC4 | 0xC8 | 0xCC) => start = Some(StartOfFrame::read(segment)?),
            0xDA => {
                let StartOfFrame { width, height, components, chroma, luma_table, chroma_table } = start?;
                let coding = Coding { chroma, luma_step: steps[luma_table], chroma_step: steps[chroma_table] };
                return Some(Header { width, height, components, coding, orientation, scan: at + length });
            }
            _ => {}
        }
        at += length;
    }
}

/// Mean step of the six lowest frequencies, those that carry a blob, of each table in the segment.
fn read_quantization(mut segment: &[u8], steps: &mut [f64; 4]) {
    while let [head, rest @ ..] = segment {
        let wide = usize::from(head >> 4 != 0) + 1;
        let Some(table) = rest.get(..64 * wide) else { return };
        let low =
            table.chunks_exact(wide).take(6).map(|b| f64::from(b.iter().fold(0_u16, |v, b| v << 8 | u16::from(*b))));
        steps[usize::from(head & 3)] = low.sum::<f64>() / 6.0;
        segment = &rest[64 * wide..];
    }
}

struct StartOfFrame {
    width: u32,
    height: u32,
    components: u8,
    chroma: ChromaSampling,
    luma_table: usize,
    chroma_table: usize,
}

impl StartOfFrame {
    fn read(segment: &[u8]) -> Option<Self> {
        let &[_precision, h1, h0, w1, w0, components, ref parts @ ..] = segment else {
            return None;
        };
        let mut factors = parts.chunks_exact(3).map(|part| part[1]);
        let first = factors.next();
        let table = |component: usize| parts.chunks_exact(3).nth(component).map_or(0, |part| usize::from(part[2] & 3));
        // Decoders interpolate what is shared by two, between them, and repeat what is shared by more.
        let is_halved = |factors: [u8; 2]| factors == [2, 1];
        let chroma = match (first, factors.next()) {
            (Some(luma), Some(chroma)) if luma != chroma || factors.any(|other| other != luma) => {
                ChromaSampling::Reduced(Siting {
                    between_columns: is_halved([luma >> 4, chroma >> 4]),
                    between_rows: is_halved([luma & 15, chroma & 15]),
                })
            }
            _ => ChromaSampling::Full,
        };
        Some(Self {
            width: u32::from(u16::from_be_bytes([w1, w0])),
            height: u32::from(u16::from_be_bytes([h1, h0])),
            components,
            chroma,
            luma_table: table(0),
            chroma_table: table(1),
        })
    }
}
