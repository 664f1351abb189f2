//! Sobel's gradient, thresholded to a bit a pixel.

use fearless_simd::dispatch;
use fearless_simd::prelude::*;

use super::gray::Plane;
use super::{MACHINE, bits};

/// Which pixels of a picture are edges, a bit each.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bits {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// 64 pixels a word, the first in the lowest bit; each row begins a word, and bits beyond its end are zero.
    pub words: Vec<u64>,
}

impl Bits {
    /// Words of a row.
    #[must_use]
    pub const fn stride(&self) -> usize {
        self.width.div_ceil(64)
    }

    /// Becomes those of a picture of this size; which of them are set is left open.
    pub(super) fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.words.resize(self.stride() * height, 0);
    }
}

/// Where the magnitude of the gradient is above `threshold_ratio` of full scale, 0 to 1.
///
/// The kernels are those that the seed prints (weights 1, 2, 1, not divided by their sum) and full scale is that of the picture,
/// 255: a magnitude beyond it counts as 255, as Matlab stores it, so that nothing is above a ratio of 1. Beyond the border is
/// the nearest pixel, as Matlab's `edge` has it. No root is taken: squares are whole numbers, and comparing them is exact.
#[must_use]
pub fn sobel(plane: &Plane, threshold_ratio: f64) -> Bits {
    let mut bits = Bits::default();
    Rows::default().edges(plane, threshold_ratio, &mut bits);
    bits
}

/// Row by row, picture after picture in the same memory.
#[derive(Default)]
pub(super) struct Rows {
    sums: Sums,
    mask: Vec<u8>,
    /// What the squared magnitude must exceed; `None` where nothing can.
    threshold: Option<u16>,
}

impl Rows {
    /// Makes room for a picture of `width` columns.
    pub(super) fn begin(&mut self, width: usize, threshold_ratio: f64) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to what a u16 holds")]
        let threshold = (255.0 * threshold_ratio).powi(2).floor().clamp(0.0, 65_535.0) as u16;
        self.threshold = (threshold_ratio < 1.0).then_some(threshold);
        for sums in [&mut self.sums.across, &mut self.sums.down] {
            sums.resize(width + 2, 0);
        }
        // Beyond the row are no edges.
        self.mask.clear();
        self.mask.resize(width.next_multiple_of(64), 0);
    }

    /// The edges of the middle of three rows.
    pub(super) fn write(&mut self, [above, here, below]: [&[u8]; 3], words: &mut [u64]) {
        let Some(threshold) = self.threshold else {
            words.fill(0);
            return;
        };
        self.sums.fill(above, here, below);
        compare(&self.sums.across, &self.sums.down, threshold, &mut self.mask[..here.len()]);
        pack(&self.mask, words);
    }

    /// As [`sobel`].
    pub(super) fn edges(&mut self, plane: &Plane, threshold_ratio: f64, bits: &mut Bits) {
        let (width, height) = (plane.width, plane.height);
        bits.resize(width, height);
        if bits.words.is_empty() {
            return;
        }
        self.begin(width, threshold_ratio);
        let row = |y: usize| &plane.samples[y * width..(y + 1) * width];
        let stride = bits.stride();
        for (y, words) in bits.words.chunks_exact_mut(stride).enumerate() {
            self.write([row(y.saturating_sub(1)), row(y), row((y + 1).min(height - 1))], words);
        }
    }
}

/// What three rows have in each column, with a column more on each side: the sum smoothed down the column, whose differences are
/// the gradient across, and the difference down the column, whose smoothed sums are the gradient down.
#[derive(Default)]
struct Sums {
    across: Vec<i16>,
    down: Vec<i16>,
}

impl Sums {
    fn fill(&mut self, above: &[u8], here: &[u8], below: &[u8]) {
        let width = here.len();
        smooth(above, here, below, &mut self.across[1..=width], &mut self.down[1..=width]);
        for sums in [&mut self.across, &mut self.down] {
            sums[0] = sums[1];
            sums[width + 1] = sums[width];
        }
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1+ssse3"))]
fn smooth(above: &[u8], here: &[u8], below: &[u8], across: &mut [i16], down: &mut [i16]) {
    let rows = above.iter().zip(here).zip(below);
    for (((a, h), b), (across, down)) in rows.zip(across.iter_mut().zip(down)) {
        let [a, h, b] = [*a, *h, *b].map(i16::from);
        *across = a + 2 * h + b;
        *down = b - a;
    }
}

/// 1 where the squared magnitude is above the threshold. Each part is cut at 255 first: what is cut is above any threshold.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1+ssse3"))]
fn compare(across: &[i16], down: &[i16], threshold: u16, mask: &mut [u8]) {
    let width = mask.len();
    let (left, right) = (&across[..width], &across[2..][..width]);
    let (before, here, after) = (&down[..width], &down[1..][..width], &down[2..][..width]);
    for x in 0..width {
        let gx = (right[x] - left[x]).unsigned_abs().min(255);
        let gy = (before[x] + 2 * here[x] + after[x]).unsigned_abs().min(255);
        mask[x] = u8::from((gx * gx).saturating_add(gy * gy) > threshold);
    }
}

/// 64 pixels of 0 or 1 in each word.
fn pack(mask: &[u8], words: &mut [u64]) {
    dispatch!(*MACHINE, simd => pack_by(simd, mask, words));
}

#[expect(clippy::inline_always, reason = "only inside its caller can it be compiled for its instructions")]
#[inline(always)]
fn pack_by<S: Simd>(simd: S, mask: &[u8], words: &mut [u64]) {
    for (number, word) in words.iter_mut().enumerate() {
        *word = bits::at_least(simd, mask, number, 1);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// By the definition, in floating point.
    fn slow_sobel(plane: &Plane, threshold_ratio: f64) -> Vec<bool> {
        let at = |x: usize, y: usize, dx: usize, dy: usize| {
            let near = |place: usize, side: usize| place.saturating_sub(1).min(side - 1);
            f64::from(plane.samples[near(y + dy, plane.height) * plane.width + near(x + dx, plane.width)])
        };
        let kernel = [[-1.0, 0.0, 1.0], [-2.0, 0.0, 2.0], [-1.0, 0.0, 1.0]];
        (0..plane.samples.len())
            .map(|index| {
                let (x, y) = (index % plane.width, index / plane.width);
                let (mut gx, mut gy) = (0.0, 0.0);
                for (dy, weights) in kernel.iter().enumerate() {
                    for (dx, weight) in weights.iter().enumerate() {
                        gx += weight * at(x, y, dx, dy);
                        gy += weight * at(x, y, dy, dx);
                    }
                }
                f64::hypot(gx, gy).min(255.0) > 255.0 * threshold_ratio
            })
            .collect()
    }

    proptest! {
        #[test]
        fn edges_are_those_of_the_definition(
            width in 1_usize..140, height in 1_usize..9, most in prop_oneof![Just(20_u8), Just(255)],
            hundredths in prop_oneof![Just(0_u32), Just(20), Just(99), Just(100), 0_u32..101], seed in any::<u64>()
        ) {
            let mut state = seed | 1;
            let samples = (0..width * height).map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                state.to_be_bytes()[0] % most
            });
            let plane = Plane { width, height, samples: samples.collect() };
            let ratio = f64::from(hundredths) / 100.0;
            let bits = sobel(&plane, ratio);
            let found: Vec<bool> = (0..height)
                .flat_map(|y| (0..width).map(move |x| (x, y)))
                .map(|(x, y)| bits.words[y * bits.stride() + x / 64] >> (x % 64) & 1 == 1)
                .collect();
            prop_assert_eq!(found, slow_sobel(&plane, ratio));
            if width % 64 != 0 {
                let beyond = bits.words.chunks_exact(bits.stride()).all(|row| row[width / 64] >> (width % 64) == 0);
                prop_assert!(beyond);
            }
        }
    }
}
