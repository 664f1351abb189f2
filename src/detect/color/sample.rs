//! A marker's hue, learned from a place on it.

use nalgebra::Vector2;

use super::HueRange;
use super::hue::chroma_direction;
use crate::frame::color::ycbcr_of_rgb;
use crate::frame::{Frame, Pixels, Region};

/// Why a place tells no hue.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoHue {
    /// The frame is gray altogether.
    #[error("the frame has no colours to learn from")]
    NoColor,
    /// What is there is gray.
    #[error("what the sample shows is gray: its chroma is {chroma:.1} of 255, at least {needed} is needed")]
    Gray {
        /// Mean chroma of the sample.
        chroma: f64,
        /// The least.
        needed: f64,
    },
    /// It is no place on a marker but a part of the picture.
    #[error("the sample has {pixels} px, more than {most}: some pixels on the marker are enough")]
    TooLarge {
        /// How many it has.
        pixels: usize,
        /// The most.
        most: usize,
    },
    /// It shows several colours.
    #[error(
        "the sample shows several colours: their hues spread by {spread_deg:.0} degrees, at most {most_deg} is one colour"
    )]
    Mixed {
        /// Root mean square angle from the mean.
        spread_deg: f64,
        /// The most.
        most_deg: f64,
    },
}

/// Less chroma than this is noise of the sensor or of coding.
const MIN_CHROMA: f64 = 8.0;

/// Hues of one paint, in one light, lie nearer together.
const MAX_SPREAD_DEG: f64 = 25.0;

/// Most pixels of a sample; a click needs a few.
const MAX_PIXELS: usize = 16_384;

/// The hues of the marker of which `sample` shows a part. Its rim may be in it, and some of what surrounds it if that is gray:
/// every pixel counts by its chroma.
///
/// # Errors
/// Why there is none. The sample must lie on the frame.
pub fn learned(frame: &Frame, sample: Region) -> Result<HueRange, NoHue> {
    if sample.area() > MAX_PIXELS {
        return Err(NoHue::TooLarge { pixels: sample.area(), most: MAX_PIXELS });
    }
    let mut chroma: Vec<Vector2<f64>> = Vec::with_capacity(sample.area());
    for y in sample.y..sample.y + sample.height {
        for x in sample.x..sample.x + sample.width {
            let index = 3 * (y as usize * frame.width() as usize + x as usize);
            let [_, cb, cr] = match frame.pixels() {
                Pixels::Luma(_) => return Err(NoHue::NoColor),
                Pixels::YCbCr(s) => [s[index], s[index + 1], s[index + 2]],
                Pixels::Rgb(s) => ycbcr_of_rgb([s[index], s[index + 1], s[index + 2]]),
            };
            chroma.push(Vector2::new(f64::from(cb) - 128.0, f64::from(cr) - 128.0));
        }
    }
    let lengths: f64 = chroma.iter().map(Vector2::norm).sum();
    // The upper half: pixels beside the marker, if they are gray, tell nothing of it.
    let mut sorted: Vec<f64> = chroma.iter().map(Vector2::norm).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let upper = &sorted[sorted.len() / 2..];
    let typical = upper.iter().sum::<f64>() / upper.len().max(1) as f64;
    if typical < MIN_CHROMA {
        return Err(NoHue::Gray { chroma: typical, needed: MIN_CHROMA });
    }
    let mean: Vector2<f64> = chroma.iter().sum::<Vector2<f64>>().normalize();
    let square = |c: &Vector2<f64>| c.norm() * mean.angle(c).powi(2);
    let spread_deg = (chroma.iter().map(square).sum::<f64>() / lengths).sqrt().to_degrees();
    // Colours that cancel each other have no mean at all.
    if !(spread_deg <= MAX_SPREAD_DEG) {
        return Err(NoHue::Mixed { spread_deg, most_deg: MAX_SPREAD_DEG });
    }
    // Angles in the plane of chroma and hues are not the same, but grow with each other.
    let nearness = |hue_deg: f64| chroma_direction(hue_deg).dot(&mean);
    let centre_deg = (0..720).map(|half| 0.5 * f64::from(half)).max_by(|a, b| nearness(*a).total_cmp(&nearness(*b)));
    Ok(HueRange { centre_deg: centre_deg.unwrap_or(0.0), half_width_deg: HueRange::NAMED_HALF_WIDTH_DEG })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::{ColorOptions, Detector, detect};
    use crate::frame::Coding;

    /// Two discs of the colours given on gray, at (30, 30) and (90, 30).
    fn frame(colours: [[u8; 3]; 2]) -> Frame {
        let samples = (0..60_i32)
            .flat_map(|y| {
                (0..120_i32).flat_map(move |x| {
                    let on = |u: i32| (x - u).pow(2) + (y - 30).pow(2) <= 64;
                    if on(30) {
                        colours[0]
                    } else if on(90) {
                        colours[1]
                    } else {
                        [120, 120, 120]
                    }
                })
            })
            .collect();
        Frame::checked(120, 60, Pixels::Rgb(samples), Coding::LOSSLESS).expect("a frame")
    }

    fn square(x: u32, y: u32, side: u32) -> Region {
        Region { x, y, width: side, height: side }
    }

    #[test]
    fn of_two_colours_the_one_pointed_at_is_found() {
        // Hues that have no name.
        let colours = [[120, 30, 200], [150, 210, 30]];
        let frame = frame(colours);
        for (place, u) in [(square(27, 27, 6), 30.0), (square(86, 26, 8), 90.0), (square(90, 30, 1), 90.0)] {
            let hue = learned(&frame, place).expect("a colour");
            let detector = Detector::Color(ColorOptions { hue, ..ColorOptions::default() });
            let found = detect(&frame, frame.full(), &detector);
            assert_eq!(found.centroids.len(), 1, "{place:?}: {hue:?}");
            assert!((found.centroids[0].pixel.x - u).abs() < 0.2, "{place:?}: {found:?}");
        }
    }

    #[test]
    fn a_sample_that_holds_gray_beside_the_marker_tells_its_hue_all_the_same() {
        let frame = frame([[200, 30, 30], [30, 30, 200]]);
        let inside = learned(&frame, square(28, 28, 4)).expect("red");
        let wide = learned(&frame, square(24, 24, 16)).expect("red");
        assert!((inside.centre_deg - wide.centre_deg).abs() < 2.0, "{inside:?} {wide:?}");
    }

    #[test]
    fn gray_and_several_colours_are_refused_with_the_reason() {
        let frame = frame([[200, 30, 30], [30, 30, 200]]);
        assert!(matches!(learned(&frame, square(0, 0, 5)), Err(NoHue::Gray { .. })));
        assert!(matches!(learned(&frame, Region { x: 20, y: 20, width: 80, height: 20 }), Err(NoHue::Mixed { .. })));
        let gray = Frame::checked(4, 4, Pixels::Luma(vec![9; 16]), Coding::LOSSLESS).expect("a frame");
        assert_eq!(learned(&gray, square(0, 0, 2)), Err(NoHue::NoColor));
    }
}
