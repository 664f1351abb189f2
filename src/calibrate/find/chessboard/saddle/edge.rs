//! The profile of a blurred edge.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instructions of the function that calls it"
)]

/// The error function and its derivative: what a Gaussian blur makes of an edge. Abramowitz and Stegun 1964, 7.1.26, right to 3e-6 in
/// single precision.
#[inline(always)]
pub(super) fn profile(u: f32) -> (f32, f32) {
    let u = if u > 5.0 { 5.0 } else { u };
    let u = if u < -5.0 { -5.0 } else { u };
    let size = u.abs();
    let fall = exp_negative(u * u);
    let t = 1.0 / (1.0 + 0.327_591_1 * size);
    let series = t * (0.254_829_6 + t * (-0.284_496_74 + t * (1.421_413_7 + t * (-1.453_152 + t * 1.061_405_4))));
    ((1.0 - series * fall).copysign(u), std::f32::consts::FRAC_2_SQRT_PI * fall)
}

/// `exp(-x)` for x from 0 to 80, without a branch.
#[inline(always)]
fn exp_negative(x: f32) -> f32 {
    // exp(-x) = 2^n 2^f with f in +-0.5; adding and taking away 1.5 * 2^23 rounds to a whole number.
    const ROUND: f32 = 12_582_912.0;
    let scaled = -x * std::f32::consts::LOG2_E;
    let shifted = scaled + ROUND;
    let f = (scaled - (shifted - ROUND)) * std::f32::consts::LN_2;
    let series = 1.0 + f * (1.0 + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0)))));
    series * f32::from_bits(shifted.to_bits().wrapping_sub(ROUND.to_bits()).wrapping_add(127) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_profile_is_the_integral_of_its_derivative() {
        let mut sum = 0.0;
        let step = 1e-3;
        for k in 0..4500 {
            #[expect(clippy::cast_possible_truncation, reason = "a test value")]
            let (value, slope) = profile((f64::from(k) * step) as f32);
            assert!((f64::from(value) - sum).abs() < 5e-6, "{k}: {value} {sum}");
            let exact = std::f64::consts::FRAC_2_SQRT_PI * (-(f64::from(k) * step).powi(2)).exp();
            assert!((f64::from(slope) - exact).abs() < 5e-6);
            sum += step * std::f64::consts::FRAC_2_SQRT_PI * (-((f64::from(k) + 0.5) * step).powi(2)).exp();
        }
        assert!((profile(-0.7).0 + profile(0.7).0).abs() < 1e-7);
        assert!((profile(f32::MAX).0 - 1.0).abs() < 1e-6);
    }
}
