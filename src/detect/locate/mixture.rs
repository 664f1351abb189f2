//! How the code of a pixel goes from ground to marker as the marker takes a larger share of it.
//!
//! Light mixes, codes do not: a sensor's code is close to the square root of light, in each of its three colours. Where a red disc covers
//! half of a gray pixel, red, green and blue each are halfway in light, and luma, made of their codes, is not halfway: a disc seems smaller
//! than it is, and one no darker than its ground has a bright seam.

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use nalgebra::Vector2;

use crate::detect::single;

/// Of ITU-R BT.601.
pub(super) const LUMA: [f64; 3] = [0.299, 0.587, 0.114];

/// Sensors' codes, 0 to 1, are about the root of light with the exponent 1/2.3: as `(3 r + q) / 4` of its square root and its fourth
/// root, which eight pixels have at once.
fn light_of(code: f64) -> f64 {
    let fourth = ((1.0 + 48.0 * code).sqrt() - 1.0) / 6.0;
    fourth.powi(4)
}

/// What a channel's code adds to the straight line from ground to marker.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mixture {
    /// What each colour counts in the channel, times 255 / 4.
    weights: [f32; 3],
    /// Light of the ground, 0 to 1, and what the marker has more of it.
    ground: [f32; 3],
    rise: [f32; 3],
    /// The line's own ends.
    from: f32,
    by: f32,
}

/// That of both channels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mixtures {
    pub luma: Mixture,
    pub chroma: Mixture,
}

/// Codes of luma and chroma.
#[derive(Clone, Copy, Debug)]
pub(super) struct Colour {
    pub luma: f64,
    /// (Cb, Cr) from gray.
    pub chroma: Vector2<f64>,
}

impl Colour {
    /// Red, green, blue.
    fn codes(&self) -> [f64; 3] {
        let (cb, cr) = (self.chroma.x, self.chroma.y);
        let [r, b] = [self.luma + 1.402 * cr, self.luma + 1.772 * cb];
        let g = (self.luma - LUMA[0] * r - LUMA[2] * b) / LUMA[1];
        [r, g, b].map(|code| code.clamp(1.0, 255.0))
    }
}

/// Least light: its root is divided by.
const LEAST: f32 = 1e-6;

impl Mixture {
    /// `weights` are what each colour counts in the channel.
    pub(super) fn of(ground: &Colour, marker: &Colour, weights: [f64; 3]) -> Self {
        let (from, to) = (ground.codes(), marker.codes());
        let code = |codes: &[f64; 3]| weights.iter().zip(codes).map(|(weight, code)| weight * code).sum::<f64>();
        let [dark, lit] = [from, to].map(|codes| codes.map(|code| light_of(code / 255.0)));
        Self {
            weights: weights.map(|weight| single(weight * 255.0 / 4.0)),
            ground: dark.map(single),
            rise: std::array::from_fn(|i| single(lit[i] - dark[i])),
            from: single(code(&from)),
            by: single(code(&to) - code(&from)),
        }
    }

    /// What the code at a share is over the straight line, and the slope of that.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
    #[inline(always)]
    pub(super) fn over_line<S: Simd>(&self, share: f32x8<S>) -> (f32x8<S>, f32x8<S>) {
        let one = f32x8::splat(share.simd, 1.0);
        let mut code = share * -self.by - self.from;
        let mut slope = one * -self.by;
        for i in 0..3 {
            let (weight, rise) = (self.weights[i], self.rise[i]);
            let root = (share * rise + self.ground[i]).max(LEAST).sqrt();
            let fourth = root.sqrt();
            code += (root * 3.0 + fourth) * weight;
            // d root / d light is half of 1 / root, and d fourth / d root half of 1 / fourth, which is fourth / root.
            let per_root = one / root;
            slope += per_root * (fourth * per_root * 0.25 + 1.5) * (weight * rise);
        }
        (code, slope)
    }
}

/// What each colour counts in chroma along a hue.
pub(super) fn chroma_weights(hue: &Vector2<f64>) -> [f64; 3] {
    let (cb, cr) = (hue.x / 1.772, hue.y / 1.402);
    std::array::from_fn(|i| cb * (f64::from(u8::from(i == 2)) - LUMA[i]) + cr * (f64::from(u8::from(i == 0)) - LUMA[i]))
}

#[cfg(test)]
mod tests {
    use fearless_simd::dispatch;

    use super::super::lanes::{LANES, Lanes};
    use super::*;
    use crate::detect::MACHINE;

    const GROUND: Colour = Colour { luma: 140.0, chroma: Vector2::new(8.0, -6.0) };
    const MARKER: Colour = Colour { luma: 90.0, chroma: Vector2::new(-25.0, 80.0) };
    const SHARES: [f32; LANES] = [0.0, 0.07, 0.2, 0.35, 0.5, 0.7, 0.9, 1.0];

    fn over_line(mixture: &Mixture, shares: [f32; LANES]) -> ([f32; LANES], [f32; LANES]) {
        dispatch!(*MACHINE, simd => {
            let (code, slope) = mixture.over_line(Lanes(shares).load(simd));
            (*code, *slope)
        })
    }

    /// Weights of the channels as the fit has them, and their codes of ground and marker: luma, and chroma along the marker's hue.
    fn channels() -> [([f64; 3], [f64; 2]); 2] {
        let hue = MARKER.chroma.normalize();
        let codes = |of: fn(&Colour, &Vector2<f64>) -> f64| [GROUND, MARKER].map(|colour| of(&colour, &hue));
        [(LUMA, codes(|colour, _| colour.luma)), (chroma_weights(&hue), codes(|colour, hue| hue.dot(&colour.chroma)))]
    }

    #[test]
    fn codes_of_mixed_light_are_those_of_a_sensor() {
        for (weights, [ground, marker]) in channels() {
            let (over, _) = over_line(&Mixture::of(&GROUND, &MARKER, weights), SHARES);
            let (from, to) = (GROUND.codes(), MARKER.codes());
            for lane in 0..LANES {
                let share = f64::from(SHARES[lane]);
                // Each colour's light by itself, with the exponent of a sensor, not with what is near it.
                let mixed = |i: usize| {
                    let [a, b] = [from[i], to[i]].map(|code| (code / 255.0_f64).powf(2.3));
                    255.0 * (a + share * (b - a)).powf(1.0 / 2.3)
                };
                let code: f64 = (0..3).map(|i| weights[i] * mixed(i)).sum();
                let line = ground + share * (marker - ground);
                let off = f64::from(over[lane]) - (code - line);
                // What it is for is 18 codes high in luma.
                assert!(off.abs() < 1.0, "{share}: {off} of {}", code - line);
            }
        }
    }

    #[test]
    fn the_slope_is_that_of_the_codes() {
        const STEP: f32 = 1e-2;
        for (weights, _) in channels() {
            let mixture = Mixture::of(&GROUND, &MARKER, weights);
            let inner = SHARES.map(|share| share.clamp(STEP, 1.0 - STEP));
            let (ahead, _) = over_line(&mixture, inner.map(|share| share + STEP));
            let (behind, _) = over_line(&mixture, inner.map(|share| share - STEP));
            let (_, slope) = over_line(&mixture, inner);
            for lane in 0..LANES {
                let difference = (ahead[lane] - behind[lane]) / (2.0 * STEP);
                assert!((slope[lane] - difference).abs() < 0.02 * difference.abs().max(10.0), "{lane}: {difference}");
            }
        }
    }

    #[test]
    fn gray_between_equal_codes_stays_on_the_line() {
        let gray = Colour { luma: 120.0, chroma: Vector2::zeros() };
        let (over, slope) = over_line(&Mixture::of(&gray, &gray, LUMA), SHARES);
        assert!(over.iter().chain(&slope).all(|x| x.abs() < 1e-3), "{over:?} {slope:?}");
    }
}
