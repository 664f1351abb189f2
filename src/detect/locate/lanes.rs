//! Eight pixels at a time: arrays that the compiler keeps in its widest registers.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instructions of the function that calls it"
)]

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// How many pixels go side by side.
pub(super) const LANES: usize = 8;

/// One number of each pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(32))]
pub(super) struct Lanes(pub [f32; LANES]);

impl Lanes {
    pub(super) const ZERO: Self = Self([0.0; LANES]);
    pub(super) const ONE: Self = Self([1.0; LANES]);

    #[inline(always)]
    pub(super) const fn all(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn each(self, f: impl Fn(f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i])))
    }

    #[inline(always)]
    fn both(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        self.each(f32::sqrt)
    }

    #[inline(always)]
    pub(super) fn max(self, other: f32) -> Self {
        self.each(|x| if x > other { x } else { other })
    }

    #[inline(always)]
    pub(super) fn min(self, other: f32) -> Self {
        self.each(|x| if x < other { x } else { other })
    }

    #[inline(always)]
    pub(super) fn sum(self) -> f64 {
        let [a, b, c, d, e, f, g, h] = self.0;
        f64::from((a + b) + (c + d)) + f64::from((e + f) + (g + h))
    }

    /// `1 / (1 + exp(x))`, to a few units of the last place of its part in one. The argument is clamped to +-30.
    #[inline(always)]
    pub(super) fn logistic_fall(self) -> Self {
        // exp(x) = 2^n 2^f with f in +-0.5; adding and taking away 1.5 * 2^23 rounds to a whole number.
        const ROUND: f32 = 12_582_912.0;
        self.each(|x| {
            let x = if x > 30.0 { 30.0 } else { x };
            let x = if x < -30.0 { -30.0 } else { x };
            let scaled = x * std::f32::consts::LOG2_E;
            let shifted = scaled + ROUND;
            let f = (scaled - (shifted - ROUND)) * std::f32::consts::LN_2;
            let series = 1.0 + f * (1.0 + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0)))));
            let power = f32::from_bits(shifted.to_bits().wrapping_sub(ROUND.to_bits()).wrapping_add(127) << 23);
            1.0 / (1.0 + series * power)
        })
    }
}

impl Add for Lanes {
    type Output = Self;

    #[inline(always)]
    fn add(self, right: Self) -> Self {
        self.both(right, |x, y| x + y)
    }
}

impl Sub for Lanes {
    type Output = Self;

    #[inline(always)]
    fn sub(self, right: Self) -> Self {
        self.both(right, |x, y| x - y)
    }
}

impl Mul for Lanes {
    type Output = Self;

    #[inline(always)]
    fn mul(self, right: Self) -> Self {
        self.both(right, |x, y| x * y)
    }
}

impl Div for Lanes {
    type Output = Self;

    #[inline(always)]
    fn div(self, right: Self) -> Self {
        self.both(right, |x, y| x / y)
    }
}

impl Neg for Lanes {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.each(|x| -x)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, right: Self) {
        *self = *self + right;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logistic_is_that_of_the_library() {
        for k in -4000..4000 {
            let x = f64::from(k) * 0.01;
            #[expect(clippy::cast_possible_truncation, reason = "a test value")]
            let found = f64::from(Lanes::all(x as f32).logistic_fall().0[3]);
            let exact = 1.0 / (1.0 + x.clamp(-30.0, 30.0).exp());
            assert!((found - exact).abs() < 3e-6 * exact + 1e-7 * (1.0 - exact), "{x}: {found} {exact}");
        }
    }
}
