//! Samples of a row as bits, 64 in a word, the leftmost in its lowest bit.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instructions of the function that calls it"
)]

use fearless_simd::prelude::*;
use fearless_simd::u8x64;

/// How many samples a word holds.
pub(super) const SAMPLES: usize = 64;

/// The word of a row with this number: which of its samples are `threshold` or more. Beyond the row are none.
#[inline(always)]
pub(super) fn at_least<S: Simd>(simd: S, row: &[u8], number: usize, threshold: u8) -> u64 {
    let row = &row[number * SAMPLES..];
    if let Some(samples) = row.first_chunk::<SAMPLES>() {
        return u8x64::from_slice(simd, samples).simd_ge(threshold).to_bitmask();
    }
    let mut samples = [0; SAMPLES];
    samples[..row.len()].copy_from_slice(row);
    u8x64::from_slice(simd, &samples).simd_ge(threshold).to_bitmask() & !(u64::MAX << row.len())
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;
    use crate::detect::MACHINE;

    #[test]
    fn bits_are_those_of_a_look_at_each_sample_whatever_the_machine_can_do() {
        for level in [*MACHINE, Level::baseline()] {
            for (length, threshold) in [(1, 0), (63, 200), (64, 77), (65, 1), (200, 128), (256, 255)] {
                let row: Vec<u8> = (0..length).map(|at: usize| ((at * 7919) >> 4).to_le_bytes()[0]).collect();
                for number in 0..length.div_ceil(SAMPLES) {
                    let word = dispatch!(level, simd => at_least(simd, &row, number, threshold));
                    let slow = |bit: usize| row.get(number * SAMPLES + bit).is_some_and(|sample| *sample >= threshold);
                    assert!((0..SAMPLES).all(|bit| (word >> bit & 1 == 1) == slow(bit)), "{length} {threshold}");
                }
            }
        }
    }
}
