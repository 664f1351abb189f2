//! Hues: a sector of the colour circle.

use nalgebra::Vector2;

use crate::frame::color::ycbcr_of_rgb;

/// A sector of hues, in degrees of the HSV colour circle: 0 red, 120 green, 240 blue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HueRange {
    /// Middle of the sector, `[0, 360)`.
    pub centre_deg: f64,
    /// Half its width, `(0, 60]`.
    pub half_width_deg: f64,
}

/// The hues that have a name, each with the middle of its sector.
pub const NAMED_HUES: [(&str, f64); 7] = [
    ("red", 0.0),
    ("orange", 28.0),
    ("yellow", 57.0),
    ("green", 120.0),
    ("cyan", 185.0),
    ("blue", 230.0),
    ("magenta", 310.0),
];

impl HueRange {
    /// What a camera makes of red paint, without orange on the one side and pink on the other.
    pub const RED: Self = Self { centre_deg: 0.0, half_width_deg: Self::NAMED_HALF_WIDTH_DEG };

    /// Half the width of a named hue's sector: wide enough for a camera without white balance.
    pub const NAMED_HALF_WIDTH_DEG: f64 = 32.0;

    /// The sector of a named hue.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let (_, centre_deg) = NAMED_HUES.iter().find(|(known, _)| *known == name)?;
        Some(Self { centre_deg: *centre_deg, half_width_deg: Self::NAMED_HALF_WIDTH_DEG })
    }

    /// Where the sector begins and ends, degrees.
    #[must_use]
    pub fn ends_deg(&self) -> [f64; 2] {
        [-1.0, 1.0].map(|side| (self.centre_deg + side * self.half_width_deg).rem_euclid(360.0))
    }

    /// The direction of the sector's middle in the plane of (Cb, Cr), a unit vector.
    pub(in crate::detect) fn direction(&self) -> Vector2<f64> {
        chroma_direction(self.centre_deg)
    }

    /// Two vectors in the plane of (Cb, Cr) such that the smaller of the two products with a pixel's chroma is the chroma's
    /// length where its hue is the sector's middle, falls to zero at the sector's edges, and is negative outside.
    pub(in crate::detect) fn edges(&self) -> [Vector2<f64>; 2] {
        let middle = chroma_direction(self.centre_deg);
        [self.half_width_deg, -self.half_width_deg].map(|offset| {
            let edge = chroma_direction(self.centre_deg + offset);
            let normal = Vector2::new(-edge.y, edge.x);
            normal / normal.dot(&middle)
        })
    }
}

/// Unit vector of a fully saturated hue in the plane of (Cb, Cr).
pub(super) fn chroma_direction(hue_deg: f64) -> Vector2<f64> {
    let sextant = hue_deg.rem_euclid(360.0) / 60.0;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    let level = |distance: f64| (255.0 * (2.0 - distance).clamp(0.0, 1.0)).round() as u8;
    let circular = |centre: f64| {
        let d = (sextant - centre).abs();
        d.min(6.0 - d)
    };
    let [_, cb, cr] = ycbcr_of_rgb([level(circular(0.0)), level(circular(2.0)), level(circular(4.0))]);
    Vector2::new(f64::from(cb) - 128.0, f64::from(cr) - 128.0).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reach(range: HueRange, rgb: [u8; 3]) -> f64 {
        let [_, cb, cr] = ycbcr_of_rgb(rgb);
        let chroma = Vector2::new(f64::from(cb) - 128.0, f64::from(cr) - 128.0);
        range.edges().iter().map(|edge| edge.dot(&chroma)).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn a_saturated_colour_reaches_only_into_its_own_sector() {
        let colors = [
            ("red", [220, 10, 15]),
            ("orange", [230, 120, 10]),
            ("yellow", [230, 220, 20]),
            ("green", [20, 200, 30]),
            ("cyan", [20, 210, 220]),
            ("blue", [20, 60, 220]),
            ("magenta", [220, 30, 190]),
        ];
        for (name, _) in NAMED_HUES {
            let range = HueRange::named(name).expect("a named hue");
            for (color, rgb) in colors {
                let found = reach(range, rgb);
                assert_eq!(found > 60.0, name == color, "{color} in {name}: {found}");
            }
        }
    }

    #[test]
    fn gray_reaches_nowhere_and_the_reach_grows_with_the_light() {
        assert!(reach(HueRange::RED, [130, 130, 130]).abs() < 2.0);
        let (dim, bright) = (reach(HueRange::RED, [60, 8, 8]), reach(HueRange::RED, [240, 32, 32]));
        assert!((bright / dim - 4.0).abs() < 0.2, "{dim} {bright}");
    }
}
