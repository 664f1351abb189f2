//! A frame's luma: as it is stored where it is, else as JPEG has it.

use crate::frame::{Frame, Pixels, Region};

/// Fills `samples` with the luma of the region, row by row.
pub fn take(frame: &Frame, region: Region, samples: &mut Vec<u8>) {
    let (width, x) = (frame.width() as usize, region.x as usize);
    samples.clear();
    samples.reserve(region.area());
    for y in region.y as usize..(region.y + region.height) as usize {
        let run = y * width + x..y * width + x + region.width as usize;
        match frame.pixels() {
            Pixels::Luma(luma) => samples.extend_from_slice(&luma[run]),
            Pixels::YCbCr(all) => samples.extend(all.as_chunks::<3>().0[run].iter().map(|[y, _, _]| *y)),
            Pixels::Rgb(all) => samples.extend(all.as_chunks::<3>().0[run].iter().map(|rgb| luma(*rgb))),
        }
    }
}

fn luma(rgb: [u8; 3]) -> u8 {
    let [r, g, b] = rgb.map(u32::from);
    #[expect(clippy::cast_possible_truncation, reason = "the weights sum to 256")]
    let luma = ((77 * r + 150 * g + 29 * b + 128) >> 8) as u8;
    luma
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Coding;

    #[test]
    fn luma_is_the_same_however_it_is_stored() {
        let region = Region { x: 1, y: 1, width: 2, height: 1 };
        let gray = [0_u8, 10, 20, 30, 40, 50];
        let rgb: Vec<u8> = gray.iter().flat_map(|value| [*value; 3]).collect();
        let ycbcr: Vec<u8> = gray.iter().flat_map(|value| [*value, 7, 9]).collect();
        for pixels in [Pixels::Luma(gray.to_vec()), Pixels::Rgb(rgb), Pixels::YCbCr(ycbcr)] {
            let frame = Frame::checked(3, 2, pixels, Coding::LOSSLESS).expect("a frame");
            let mut samples = vec![99];
            take(&frame, region, &mut samples);
            assert_eq!(samples, [40, 50]);
        }
    }
}
