//! A picture made small, for the page.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::detect::luma;
use crate::frame::{Coding, Frame, Pixels};
use crate::scene::encode::jpeg;

/// Its larger side, px.
const SIDE_PX: u32 = 360;

/// The picture as a small gray JPEG in base 64; `None` where it has none.
pub(super) fn of(frame: &Frame) -> Option<String> {
    let step = frame.width().max(frame.height()).div_ceil(SIDE_PX).max(1);
    let (width, height) = (frame.width() / step, frame.height() / step);
    let mut samples = Vec::new();
    luma::take(frame, frame.full(), &mut samples);
    let (step_px, row_px) = (step as usize, frame.width() as usize);
    let mean = |column: usize, row: usize| {
        let first = row * step_px * row_px + column * step_px;
        let rows = samples.get(first..)?.chunks(row_px).take(step_px);
        let sum: u32 = rows.flat_map(|row| row.iter().take(step_px)).map(|sample| u32::from(*sample)).sum();
        u8::try_from(sum / (step * step)).ok()
    };
    let small = (0..height as usize).flat_map(|row| (0..width as usize).map(move |column| (column, row)));
    let small: Option<Vec<u8>> = small.map(|(column, row)| mean(column, row)).collect();
    let small = Frame::checked(width, height, Pixels::Luma(small?), Coding::LOSSLESS).ok()?;
    Some(STANDARD.encode(jpeg(&small, 70).ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Decoding;

    #[test]
    fn a_large_picture_becomes_a_small_one_of_the_same_shape() {
        let samples: Vec<u8> = (0..900 * 400).map(|i| if i % 900 < 450 { 40 } else { 200 }).collect();
        let frame = Frame::checked(900, 400, Pixels::Luma(samples), Coding::LOSSLESS).expect("a frame");
        let bytes = STANDARD.decode(of(&frame).expect("a thumbnail")).expect("base 64");
        let small = Frame::decode(&bytes, &Decoding::default()).expect("a JPEG");
        assert_eq!([small.width(), small.height()], [300, 133]);
        let rgb = small.rgb();
        assert!((i32::from(rgb[0]) - 40).abs() < 8 && (i32::from(rgb[3 * 299]) - 200).abs() < 8);
    }
}
