//! What a sensor makes of the light: noise, colour filters, 8 bits.

use rand::Rng;

use super::light::Gamma;
use super::optics::Optics;
use super::radiance::Radiance;
use crate::frame::bayer::{Mosaic, demosaic};
use crate::frame::{Coding, Frame, Pixels, Region, Siting};
use crate::random::normal;

/// The frame of this light.
///
/// The samples of a mosaic are coded in 8 bits of sRGB before colours are filled in, as in a camera that gives out 8 bits
/// raw: linear light in 8 bits would show steps in the shade.
pub fn frame_of(picture: &Radiance, optics: &Optics, rng: &mut impl Rng) -> Frame {
    let (width, height) = (picture.width, picture.height);
    #[expect(clippy::cast_possible_truncation, reason = "the sides come from a camera's, which are u32")]
    let whole = Region { x: 0, y: 0, width: width as u32, height: height as u32 };
    let gamma = Gamma::new();
    let mut expose = |light: f32| gamma.code(measured(light, optics, rng));
    let (samples, coding) = match optics.bayer {
        None => (picture.light.iter().flatten().map(|&light| expose(light)).collect(), Coding::LOSSLESS),
        Some(mosaic) => {
            let pixels = picture.light.iter().enumerate();
            let raw: Vec<u8> = pixels.map(|(i, light)| expose(light[channel(mosaic, i % width, i / width)])).collect();
            (demosaic(mosaic, width, height, &raw, whole), Coding::shared_chroma(Siting::ON_PIXEL))
        }
    };
    #[expect(clippy::expect_used, reason = "three samples for each pixel of a camera, which has at least one")]
    Frame::checked(whole.width, whole.height, Pixels::Rgb(samples), coding)
        .expect("as many samples as the size asks for")
}

/// `light` as the sensor measures it, linear, full at 1: electrons come singly, and reading them errs.
fn measured(light: f32, optics: &Optics, rng: &mut impl Rng) -> f32 {
    let exposed = f64::from(light) * optics.exposure_ratio;
    let (shot, read) = (optics.shot_noise_ratio, optics.read_noise_ratio);
    let variance = shot * shot * exposed.clamp(0.0, 1.0) + read * read;
    // Also false for NaN.
    let noise = if variance > 0.0 { variance.sqrt() * normal(rng) } else { 0.0 };
    #[expect(clippy::cast_possible_truncation, reason = "light has three digits")]
    let value = (exposed + noise) as f32;
    value
}

/// Which colour the pixel's filter lets through: 0 red, 1 green, 2 blue.
const fn channel(mosaic: Mosaic, x: usize, y: usize) -> usize {
    let tile = match mosaic {
        Mosaic::Rggb => [0, 1, 1, 2],
        Mosaic::Bggr => [2, 1, 1, 0],
        Mosaic::Gbrg => [1, 2, 0, 1],
        Mosaic::Grbg => [1, 0, 2, 1],
    };
    tile[y % 2 * 2 + x % 2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::named;
    use crate::scene::render::light::of_srgb;

    fn even(rgb: [u8; 3]) -> Radiance {
        Radiance { width: 10, height: 8, light: vec![of_srgb(rgb); 80] }
    }

    #[test]
    fn noise_has_the_stated_variance() {
        let optics = Optics { shot_noise_ratio: 0.02, read_noise_ratio: 0.004, ..Optics::ideal() };
        let mut rng = named("noise has the stated variance");
        for light in [0.0, 0.1, 0.5, 0.9] {
            let count = 20_000;
            let values: Vec<f64> = (0..count).map(|_| f64::from(measured(light, &optics, &mut rng))).collect();
            let mean = values.iter().sum::<f64>() / f64::from(count);
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(count - 1);
            let stated = 0.02_f64.powi(2) * f64::from(light) + 0.004_f64.powi(2);
            // Of 20 000 draws, the mean is known to sigma / 141 and the variance to 1 %: four deviations.
            assert!((mean - f64::from(light)).abs() < 4.0 * stated.sqrt() / 141.0, "{light}: mean {mean}");
            assert!((variance / stated - 1.0).abs() < 0.04, "{light}: {variance} for {stated}");
        }
    }

    #[test]
    fn an_even_colour_passes_every_mosaic() {
        let colour = [200, 90, 40];
        for bayer in [None, Some(Mosaic::Rggb), Some(Mosaic::Bggr), Some(Mosaic::Gbrg), Some(Mosaic::Grbg)] {
            let optics = Optics { bayer, ..Optics::ideal() };
            let frame = frame_of(&even(colour), &optics, &mut named("even"));
            assert!(frame.rgb().chunks_exact(3).all(|pixel| pixel == colour), "{bayer:?}");
        }
    }

    #[test]
    fn exposure_doubles_the_light_and_fills_the_sensor() {
        let twice = Optics { exposure_ratio: 2.0, ..Optics::ideal() };
        let frame = frame_of(&even([100, 200, 255]), &twice, &mut named("even"));
        assert_eq!(frame.rgb()[..3], [138, 255, 255]);
    }
}
