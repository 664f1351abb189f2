//! Four numbers at a time, one of each of four points: what the compiler turns into one instruction where the machine has it.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instructions of the function that calls it"
)]

use std::ops::{Add, AddAssign, Mul, Sub};

/// How many points go side by side.
pub(super) const LANES: usize = 4;

/// One number of each point. Sums over lanes keep their order, so the same request has the same answer on every machine.
#[derive(Clone, Copy)]
pub(super) struct Lanes(pub [f64; LANES]);

impl Lanes {
    pub(super) const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub(super) const fn all(value: f64) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    pub(super) fn recip(self) -> Self {
        let [a, b, c, d] = self.0;
        Self([1.0 / a, 1.0 / b, 1.0 / c, 1.0 / d])
    }

    #[inline(always)]
    pub(super) fn sum(self) -> f64 {
        let [a, b, c, d] = self.0;
        (a + b) + (c + d)
    }
}

impl Add for Lanes {
    type Output = Self;

    #[inline(always)]
    fn add(self, right: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, right.0);
        Self([a + e, b + f, c + g, d + h])
    }
}

impl Sub for Lanes {
    type Output = Self;

    #[inline(always)]
    fn sub(self, right: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, right.0);
        Self([a - e, b - f, c - g, d - h])
    }
}

impl Mul for Lanes {
    type Output = Self;

    #[inline(always)]
    fn mul(self, right: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, right.0);
        Self([a * e, b * f, c * g, d * h])
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, right: Self) {
        *self = *self + right;
    }
}
