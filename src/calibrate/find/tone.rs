//! How the codes of a picture tell its light.
//!
//! Blur mixes light and not codes. Where an edge runs along a row of pixels, a profile that is right in light and taken for one of codes moves it by
//! 0.02 px, in all pixels alike.

use std::sync::LazyLock;

use crate::calibrate::start::median;
use crate::frame::color::light_of_srgb;

/// What a camera does to light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tone {
    /// The curve of sRGB, which nearly all pictures have, or one near it.
    Curved,
    /// Codes are light, as of a sensor that is read as it is.
    Straight,
}

impl Tone {
    /// All, the usual one first.
    pub(super) const ALL: [Self; 2] = [Self::Curved, Self::Straight];

    /// The light of each code; that of white is 255.
    pub(super) fn lights(self) -> &'static [f32; 256] {
        static CURVED: LazyLock<[f32; 256]> = LazyLock::new(|| codes().map(|code| 255.0 * light_of_srgb(code / 255.0)));
        static STRAIGHT: LazyLock<[f32; 256]> = LazyLock::new(codes);
        match self {
            Self::Curved => &CURVED,
            Self::Straight => &STRAIGHT,
        }
    }
}

fn codes() -> [f32; 256] {
    std::array::from_fn(|code| code as f32)
}

/// Of what was fitted in each tone, that in which black and white mix evenly: `curve` tells by how much what is between them is lighter than that.
pub(super) fn evenest<T>(fitted: [Vec<T>; 2], curve: impl Fn(&T) -> f64) -> (Tone, Vec<T>) {
    // Of none it is infinite.
    let off = |fits: &[T]| median(&mut fits.iter().map(&curve).collect::<Vec<_>>()).abs();
    let [curved, straight] = fitted;
    if off(&straight) < off(&curved) { (Tone::Straight, straight) } else { (Tone::Curved, curved) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_is_255_in_either_tone_and_light_rises_with_its_code() {
        for tone in Tone::ALL {
            let lights = tone.lights();
            assert!(lights[0] == 0.0 && (lights[255] - 255.0).abs() < 1e-3 && lights.is_sorted(), "{tone:?}");
        }
        assert!((Tone::Straight.lights()[77] - 77.0).abs() < 1e-6);
    }

    #[test]
    fn the_tone_that_is_nearer_to_even_is_taken() {
        let curve = |curve: &f64| *curve;
        assert_eq!(evenest([vec![0.1, 0.2, 0.1], vec![-0.3, -0.1, -0.2]], curve).0, Tone::Curved);
        assert_eq!(evenest([vec![-0.3], vec![0.2, 0.1]], curve), (Tone::Straight, vec![0.2, 0.1]));
        assert_eq!(evenest([vec![], vec![0.3]], curve).0, Tone::Straight);
        assert_eq!(evenest([vec![], vec![]], curve).0, Tone::Curved);
    }
}
