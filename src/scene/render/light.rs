//! Linear light and its coding in 8 bits.

use crate::frame::color::{light_of_srgb, srgb_of_light};

/// Red, green and blue in linear light; 1 fills the sensor.
pub type Light = [f32; 3];

/// The light of an 8-bit sRGB colour.
#[must_use]
pub fn of_srgb(rgb: [u8; 3]) -> Light {
    rgb.map(|code| light_of_srgb(f32::from(code) / 255.0))
}

/// `a` and `b` mixed, `share` of it `b`.
#[must_use]
pub fn mixed(a: Light, b: Light, share: f32) -> Light {
    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * share)
}

/// `light` made brighter by `factor`.
#[must_use]
pub fn scaled(light: Light, factor: f32) -> Light {
    light.map(|value| value * factor)
}

/// Codes linear light in 8 bits by table.
pub struct Gamma(Vec<u8>);

impl Gamma {
    /// Entries a unit of light: the curve's steepest part climbs 0.2 codes an entry.
    const STEPS: u16 = 1 << 14;

    /// The table.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the curve stays within 0 to 1")]
    pub fn new() -> Self {
        let code = |step: u16| (255.0 * srgb_of_light(f32::from(step) / f32::from(Self::STEPS)) + 0.5) as u8;
        Self((0..=Self::STEPS).map(code).collect())
    }

    /// The code of `light`; 255 for all that is brighter than 1.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the table")]
    pub fn code(&self, light: f32) -> u8 {
        self.0[(light.clamp(0.0, 1.0) * f32::from(Self::STEPS) + 0.5) as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_comes_back() {
        let gamma = Gamma::new();
        for code in 0..=255 {
            assert_eq!(of_srgb([code; 3]).map(|light| gamma.code(light)), [code; 3]);
        }
    }

    #[test]
    fn light_beyond_the_scale_is_black_or_white() {
        let gamma = Gamma::new();
        assert_eq!([-1.0, 2.0, f32::INFINITY, f32::NAN].map(|light| gamma.code(light)), [0, 255, 255, 0]);
    }
}
