//! Gray, the median of 3 x 3 and Sobel in one walk down the rows.
//!
//! Each step needs three rows of the one before, so nine rows are all that is kept, and they stay in the fastest cache. Bit for
//! bit what the steps give one after the other.

use super::EdgeOptions;
use crate::detect::gray;
use crate::detect::median::Border;
use crate::detect::median::three::Columns;
use crate::detect::sobel::{Bits, Rows};
use crate::frame::{Frame, Region};

/// Walks down pictures, one after the other in the same memory.
#[derive(Default)]
pub(super) struct Walk {
    /// Row y stands where y modulo three says; grays have a sample more on either side.
    grays: [Vec<u8>; 3],
    medians: [Vec<u8>; 3],
    /// A black row.
    outside: Vec<u8>,
    columns: Columns,
    sobel: Rows,
}

impl Walk {
    fn begin(&mut self, width: usize, threshold_ratio: f64) {
        for row in self.grays.iter_mut().chain([&mut self.outside]) {
            row.clear();
            row.resize(width + 2, 0);
        }
        for row in &mut self.medians {
            row.resize(width, 0);
        }
        self.columns.resize(width);
        self.sobel.begin(width, threshold_ratio);
    }

    /// The edges in `region`, whatever the window of `options`: it is taken as 3 x 3.
    pub(super) fn edges(&mut self, frame: &Frame, region: Region, options: &EdgeOptions, bits: &mut Bits) {
        let (width, height) = (region.width as usize, region.height as usize);
        bits.resize(width, height);
        if bits.words.is_empty() {
            return;
        }
        self.begin(width, options.threshold_ratio);
        let Self { grays, medians, outside, columns, sobel } = self;
        let stride = bits.stride();
        for (step, y) in (0..height + 2).zip(region.y..) {
            if step < height {
                let row = &mut grays[step % 3];
                gray::write_row(frame, region, y, options.gray, &mut row[1..=width]);
                if options.border == Border::Nearest {
                    (row[0], row[width + 1]) = (row[1], row[width]);
                }
            }
            if (1..=height).contains(&step) {
                let middle = step - 1;
                let near = |row: Option<usize>| match (row.filter(|row| *row < height), options.border) {
                    (Some(row), _) => grays[row % 3].as_slice(),
                    (None, Border::Nearest) => grays[middle % 3].as_slice(),
                    (None, Border::Black) => outside.as_slice(),
                };
                let rows = [near(middle.checked_sub(1)), near(Some(middle)), near(Some(middle + 1))];
                columns.median(rows, &mut medians[middle % 3]);
            }
            if let Some(middle) = step.checked_sub(2) {
                let rows =
                    [middle.saturating_sub(1), middle, (middle + 1).min(height - 1)].map(|row| &*medians[row % 3]);
                sobel.write(rows, &mut bits.words[middle * stride..][..stride]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::detect::gray::{Gray, gray};
    use crate::detect::median::{Window, median};
    use crate::detect::sobel::sobel;
    use crate::frame::{Coding, Pixels};

    proptest! {
        #[test]
        fn one_walk_gives_what_the_steps_give(
            sides in (1_u32..150, 1_u32..12), black in any::<bool>(), kind in 0_usize..3, seed in any::<u64>()
        ) {
            let (width, height) = sides;
            let mut state = seed | 1;
            let channels = if kind == 0 { 1 } else { 3 };
            let samples = (0..width * height * channels).map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                state.to_be_bytes()[0]
            }).collect();
            let pixels = [Pixels::Luma, Pixels::Rgb, Pixels::YCbCr][kind](samples);
            let frame = Frame::checked(width, height, pixels, Coding::LOSSLESS).expect("a frame");
            let inner = Region { x: width / 4, y: height / 3, width: width.div_ceil(2), height: height.div_ceil(2) };
            let (mut walk, mut bits) = (Walk::default(), Bits::default());
            for region in [frame.full(), inner] {
                let border = if black { Border::Black } else { Border::Nearest };
                let options = EdgeOptions { border, gray: Gray::Luminosity, ..EdgeOptions::default() };
                let plane = median(&gray(&frame, region, options.gray), Window::SMALL, border);
                walk.edges(&frame, region, &options, &mut bits);
                prop_assert_eq!(&bits, &sobel(&plane, options.threshold_ratio));
            }
        }
    }
}
