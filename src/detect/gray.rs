//! Colour to gray, the three ways of the seed's section 3.1.1, rounded to the nearest of 256 levels (halves up).

use super::bands::{PIXELS, SAMPLES, bands, each_block};
use crate::frame::color::write_rgb;
use crate::frame::{Frame, Pixels, Region};

/// A picture of one sample a pixel, rows from the top without padding.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plane {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The samples.
    pub samples: Vec<u8>,
}

impl Plane {
    /// Becomes one of this size; what its samples are is left open.
    pub(super) fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.samples.resize(width * height, 0);
    }

    /// Its rows.
    #[must_use]
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[u8]> {
        self.samples.chunks_exact(self.width.max(1))
    }
}

/// How three colours become one gray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Gray {
    /// `0.21 R + 0.71 G + 0.07 B`, the weights as the seed prints them. They sum to 0.99, so white becomes 252.
    #[default]
    Luminosity,
    /// `(R + G + B) / 3`.
    Average,
    /// `(max + min) / 2`. The seed prints it without parentheses.
    Lightness,
}

impl Gray {
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
    #[inline(always)]
    fn of(self, [red, green, blue]: [u8; 3]) -> u8 {
        let [r, g, b] = [red, green, blue].map(u16::from);
        let gray = match self {
            Self::Luminosity => (21 * r + 71 * g + 7 * b + 50) / 100,
            Self::Average => (r + g + b + 1) / 3,
            Self::Lightness => (r.max(g).max(b) + r.min(g).min(b)).div_ceil(2),
        };
        #[expect(clippy::cast_possible_truncation, reason = "a mean of bytes")]
        let gray = gray as u8;
        gray
    }
}

/// The gray of the region's pixels.
#[must_use]
pub fn gray(frame: &Frame, region: Region, how: Gray) -> Plane {
    let mut plane = Plane::default();
    take(frame, region, how, &mut plane);
    plane
}

/// The same into a plane that is there already.
pub(super) fn take(frame: &Frame, region: Region, how: Gray, plane: &mut Plane) {
    plane.resize(region.width as usize, region.height as usize);
    for (y, out) in (region.y..).zip(plane.samples.chunks_exact_mut(region.width as usize)) {
        write_row(frame, region, y, how, out);
    }
}

/// The gray of the region's pixels in row `y` of the frame.
pub(super) fn write_row(frame: &Frame, region: Region, y: u32, how: Gray, out: &mut [u8]) {
    let start = y as usize * frame.width() as usize + region.x as usize;
    let end = start + region.width as usize;
    match frame.pixels() {
        Pixels::Luma(samples) => gray_of_luma(&samples[start..end], how, out),
        Pixels::Rgb(samples) => gray_row(&samples[3 * start..3 * end], how, out),
        Pixels::YCbCr(samples) => {
            let mut rgb = [0; SAMPLES];
            for (block, out) in samples[3 * start..3 * end].chunks(SAMPLES).zip(out.chunks_mut(PIXELS)) {
                let rgb = &mut rgb[..block.len()];
                write_rgb(block, rgb);
                gray_row(rgb, how, out);
            }
        }
    }
}

/// A row of colour: each way has its own loop, so that each is without a branch inside.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512vl+avx512vbmi",
    "x86_64+avx2",
    "x86_64+sse4.1+ssse3"
))]
fn gray_row(row: &[u8], how: Gray, out: &mut [u8]) {
    match how {
        Gray::Luminosity => each(row, out, |pixel| Gray::Luminosity.of(pixel)),
        Gray::Average => each(row, out, |pixel| Gray::Average.of(pixel)),
        Gray::Lightness => each(row, out, |pixel| Gray::Lightness.of(pixel)),
    }
}

#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn each(row: &[u8], out: &mut [u8], of: impl Fn([u8; 3]) -> u8) {
    each_block(row, out, |block, out| {
        let [red, green, blue] = bands(block);
        for i in 0..PIXELS {
            out[i] = of([red[i], green[i], blue[i]]);
        }
    });
}

/// As if the sample stood in all three bands; only the weights that do not sum to one tell.
fn gray_of_luma(row: &[u8], how: Gray, out: &mut [u8]) {
    if how == Gray::Luminosity {
        row.iter().zip(out).for_each(|(sample, out)| *out = Gray::Luminosity.of([*sample; 3]));
    } else {
        out.copy_from_slice(row);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::Coding;

    fn slow(how: Gray, rgb: [u8; 3]) -> f64 {
        let [r, g, b] = rgb.map(f64::from);
        match how {
            // In hundredths, as 0.21 and its like are no binary fractions.
            Gray::Luminosity => ((21.0 * r + 71.0 * g + 7.0 * b) / 100.0).round(),
            Gray::Average => ((r + g + b) / 3.0).round(),
            Gray::Lightness => f64::midpoint(r.max(g).max(b), r.min(g).min(b)).round(),
        }
    }

    proptest! {
        #[test]
        fn gray_is_the_rounded_formula(pixels in proptest::collection::vec(any::<[u8; 3]>(), 1..600)) {
            let width = u32::try_from(pixels.len()).expect("a row");
            let rgb = Frame::checked(width, 1, Pixels::Rgb(pixels.concat()), Coding::LOSSLESS).expect("a frame");
            let luma = Frame::checked(width, 1, Pixels::Luma(pixels.iter().map(|p| p[0]).collect()), Coding::LOSSLESS)
                .expect("a frame");
            for how in [Gray::Luminosity, Gray::Average, Gray::Lightness] {
                let found = gray(&rgb, rgb.full(), how).samples.into_iter().map(f64::from).collect::<Vec<_>>();
                prop_assert_eq!(found, pixels.iter().map(|p| slow(how, *p)).collect::<Vec<_>>());
                let found = gray(&luma, luma.full(), how).samples.into_iter().map(f64::from).collect::<Vec<_>>();
                prop_assert_eq!(found, pixels.iter().map(|p| slow(how, [p[0]; 3])).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn a_region_is_cut_out() {
        let samples = (0..12).collect();
        let frame = Frame::checked(4, 3, Pixels::Luma(samples), Coding::LOSSLESS).expect("a frame");
        let region = Region { x: 1, y: 1, width: 2, height: 2 };
        let plane = gray(&frame, region, Gray::Average);
        assert_eq!(plane, Plane { width: 2, height: 2, samples: vec![5, 6, 9, 10] });
        assert_eq!(plane.rows().collect::<Vec<_>>(), [[5, 6], [9, 10]]);
    }
}
