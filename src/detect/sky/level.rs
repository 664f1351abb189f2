//! One level of the pyramid: a picture of half the size each time, and what stands out in it at that size.
//!
//! Heights are gray levels in steps of 1/128, in `u16`: all sums of a pass stay within 16 bits, so that a register holds as many as
//! it can.

use multiversion::multiversion;

/// Steps of a gray level in [`Level::smooth`] and [`Level::contrast`].
pub const STEPS: f32 = 128.0;

/// A level. `1 << index` pixels of the frame are one of its own.
#[derive(Clone, Debug, Default)]
pub struct Level {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Input, gray levels in steps of 1/8.
    raw: Vec<u16>,
    /// Input under a binomial of 3 by 3: standard deviation 0.7 px.
    pub smooth: Vec<u16>,
    /// `smooth` less its surround of standard deviation 2.4 px: positive for bright.
    pub contrast: Vec<i16>,
    row: Vec<u16>,
}

/// How far the surround reaches.
const REACH: usize = 4;

impl Level {
    /// Takes the frame itself.
    pub fn take_frame(&mut self, samples: &[u8], width: usize, height: usize) {
        self.resize(width, height);
        self.raw.iter_mut().zip(samples).for_each(|(raw, sample)| *raw = u16::from(*sample) << 3);
        self.fill();
    }

    /// Takes the level below at half its size.
    pub fn take_half(&mut self, below: &Self) {
        let (width, height) = (below.width / 2, below.height / 2);
        self.resize(width, height);
        for (y, out) in self.raw.chunks_exact_mut(width.max(1)).enumerate() {
            let upper = &below.smooth[2 * y * below.width..][..2 * width];
            let lower = &below.smooth[(2 * y + 1) * below.width..][..2 * width];
            halve(upper, lower, out);
        }
        self.fill();
    }

    fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.raw.resize(width * height, 0);
        self.smooth.resize(width * height, 0);
        self.contrast.resize(width * height, 0);
        self.row.resize(width + 2 * REACH, 0);
    }

    fn fill(&mut self) {
        let (width, height) = (self.width, self.height);
        if width == 0 || height == 0 {
            return;
        }
        let last = height - 1;
        for y in 0..height {
            let row = |y: usize| &self.raw[y * width..][..width];
            weigh_down([row(y.saturating_sub(1)), row(y), row((y + 1).min(last))], &mut self.row[REACH..REACH + width]);
            extend(&mut self.row, width);
            weigh_across(&self.row[REACH - 1..], &mut self.smooth[y * width..][..width]);
        }
        for y in 0..height {
            let at = |offset: usize| {
                let y = (y + offset).clamp(REACH, last + REACH) - REACH;
                &self.smooth[y * width..][..width]
            };
            surround_down([at(0), at(2), at(4), at(6), at(8)], &mut self.row[REACH..REACH + width]);
            extend(&mut self.row, width);
            let smooth = &self.smooth[y * width..][..width];
            contrast_across(&self.row, smooth, &mut self.contrast[y * width..][..width]);
        }
    }
}

/// Beyond the border is what is at the border.
fn extend(row: &mut [u16], width: usize) {
    let (first, last) = (row[REACH], row[REACH + width - 1]);
    row[..REACH].fill(first);
    row[REACH + width..].fill(last);
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn weigh_down([a, b, c]: [&[u16]; 3], out: &mut [u16]) {
    for (((out, a), b), c) in out.iter_mut().zip(a).zip(b).zip(c) {
        *out = a + 2 * b + c;
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn weigh_across(row: &[u16], out: &mut [u16]) {
    for (((out, a), b), c) in out.iter_mut().zip(row).zip(&row[1..]).zip(&row[2..]) {
        *out = a + 2 * b + c;
    }
}

/// Weights 1, 2, 2, 2, 1 of 8.
#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
const fn surround([a, b, c, d, e]: [u16; 5]) -> u16 {
    let ends = (a + e) >> 1;
    let middle = (ends + c) >> 1;
    (middle + ((b + d) >> 1)) >> 1
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn surround_down([a, b, c, d, e]: [&[u16]; 5], out: &mut [u16]) {
    for (((((out, a), b), c), d), e) in out.iter_mut().zip(a).zip(b).zip(c).zip(d).zip(e) {
        *out = surround([*a, *b, *c, *d, *e]);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn contrast_across(row: &[u16], smooth: &[u16], out: &mut [i16]) {
    let inputs = row.iter().zip(&row[2..]).zip(&row[4..]).zip(&row[6..]).zip(&row[8..]);
    for ((out, smooth), ((((a, b), c), d), e)) in out.iter_mut().zip(smooth).zip(inputs) {
        // Both are below 2^15.
        *out = smooth.wrapping_sub(surround([*a, *b, *c, *d, *e])).cast_signed();
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn halve(upper: &[u16], lower: &[u16], out: &mut [u16]) {
    let pairs = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
    for (out, ([a, b], [c, d])) in out.iter_mut().zip(pairs) {
        // Sums of two stay within 16 bits; 16 is what the binomial multiplied by.
        *out = (((a + b) >> 1) + ((c + d) >> 1)) >> 5;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A level by its definition, pixel by pixel.
    fn slow(raw: &[u16], width: usize, height: usize) -> (Vec<u16>, Vec<i16>) {
        // A place some steps from a pixel, or what is nearest on the level.
        let stepped = |along: usize, step: isize, side: usize| along.saturating_add_signed(step).min(side - 1);
        let at = |plane: &[u32], x: usize, y: usize| plane[y * width + x];
        let each = |of: &dyn Fn(usize, usize) -> u32| -> Vec<u32> {
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| of(x, y)).collect()
        };
        let raw: Vec<u32> = raw.iter().map(|value| u32::from(*value)).collect();
        let down =
            each(&|x, y| at(&raw, x, stepped(y, -1, height)) + 2 * at(&raw, x, y) + at(&raw, x, stepped(y, 1, height)));
        let smooth = each(&|x, y| {
            at(&down, stepped(x, -1, width), y) + 2 * at(&down, x, y) + at(&down, stepped(x, 1, width), y)
        });
        let weigh = |[a, b, c, d, e]: [u32; 5]| a.midpoint(e).midpoint(c).midpoint(b.midpoint(d));
        let down = each(&|x, y| weigh([-4, -2, 0, 2, 4].map(|step| at(&smooth, x, stepped(y, step, height)))));
        let around = each(&|x, y| weigh([-4, -2, 0, 2, 4].map(|step| at(&down, stepped(x, step, width), y))));
        let contrast =
            smooth.iter().zip(&around).map(|(a, b)| i16::try_from(i64::from(*a) - i64::from(*b)).expect("16 bits"));
        (smooth.iter().map(|value| u16::try_from(*value).expect("16 bits")).collect(), contrast.collect())
    }

    proptest! {
        #[test]
        fn a_level_is_that_of_its_definition(width in 1_usize..70, height in 1_usize..20, seed in any::<u64>()) {
            let mut state = seed | 1;
            let samples: Vec<u8> = (0..width * height)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    // Full black and white too: the sums are as large as they get.
                    if state >> 62 == 0 { 255 } else { (state >> 56) as u8 }
                })
                .collect();
            let mut level = Level::default();
            level.take_frame(&samples, width, height);
            let raw: Vec<u16> = samples.iter().map(|sample| u16::from(*sample) * 8).collect();
            let (smooth, contrast) = slow(&raw, width, height);
            prop_assert_eq!(&level.smooth, &smooth);
            prop_assert_eq!(&level.contrast, &contrast);
            let mut half = Level::default();
            half.take_half(&level);
            prop_assert_eq!([half.width, half.height], [width / 2, height / 2]);
            for (index, value) in half.raw.iter().enumerate() {
                let (x, y) = (index % (width / 2), index / (width / 2));
                let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| f64::from(smooth[(2 * y + j) * width + 2 * x + i]));
                // Rounded down three times.
                prop_assert!((f64::from(*value) - four.iter().sum::<f64>() / 64.0).abs() <= 1.5);
            }
        }
    }
}
