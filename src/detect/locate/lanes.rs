//! Eight pixels at a time, in the widest registers that the machine has.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instructions of the function that calls it"
)]

use fearless_simd::f32x8;
use fearless_simd::prelude::*;

/// How many pixels go side by side.
pub(super) const LANES: usize = 8;

/// One number of each pixel, as it is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(32))]
pub(super) struct Lanes(pub [f32; LANES]);

impl Lanes {
    pub(super) const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, simd: S) -> f32x8<S> {
        self.0.simd_into(simd)
    }
}

#[inline(always)]
pub(super) fn sum<S: Simd>(lanes: f32x8<S>) -> f64 {
    let [a, b, c, d, e, f, g, h] = *lanes;
    f64::from((a + b) + (c + d)) + f64::from((e + f) + (g + h))
}

/// `1 / (1 + exp(x))`, to a few units of the last place of its part in one. The argument is clamped to +-30.
#[inline(always)]
pub(super) fn logistic_fall<S: Simd>(x: f32x8<S>) -> f32x8<S> {
    // exp(x) = 2^n 2^f with f in +-0.5; adding and taking away 1.5 * 2^23 rounds to a whole number.
    const ROUND: f32 = 12_582_912.0;
    let scaled = x.min(30.0).max(-30.0) * std::f32::consts::LOG2_E;
    let shifted = scaled + ROUND;
    let f = (scaled - (shifted - ROUND)) * std::f32::consts::LN_2;
    let series = f * (1.0 / 120.0) + 1.0 / 24.0;
    let series = f * (f * (f * (f * series + 1.0 / 6.0) + 0.5) + 1.0) + 1.0;
    let power = f32x8::from_bits((shifted.to_bits() - ROUND.to_bits() + 127) << 23);
    f32x8::splat(x.simd, 1.0) / (series * power + 1.0)
}

#[cfg(test)]
mod tests {
    use fearless_simd::dispatch;

    use super::*;
    use crate::detect::MACHINE;

    #[test]
    fn the_logistic_is_that_of_the_library() {
        for k in -4000..4000 {
            let x = f64::from(k) * 0.01;
            #[expect(clippy::cast_possible_truncation, reason = "a test value")]
            let lanes = Lanes([x as f32; LANES]);
            let found = dispatch!(*MACHINE, simd => f64::from(logistic_fall(lanes.load(simd))[3]));
            let exact = 1.0 / (1.0 + x.clamp(-30.0, 30.0).exp());
            assert!((found - exact).abs() < 3e-6 * exact + 1e-7 * (1.0 - exact), "{x}: {found} {exact}");
        }
    }
}
