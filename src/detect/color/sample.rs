//! A marker's hue, learned from a place on it.

use std::collections::HashSet;

use nalgebra::Vector2;

use super::HueRange;
use super::hue::chroma_direction;
use crate::frame::color::{rgb_of_ycbcr, ycbcr_of_rgb};
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
    /// The sensor was full there, and no pixel around says what colour it was.
    #[error(
        "the sample is overexposed: {blown} of its {pixels} px are near full scale, and around them is no colour to learn from"
    )]
    Overexposed {
        /// How many of its pixels tell no hue for that.
        blown: usize,
        /// How many it has.
        pixels: usize,
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

/// A code from here on may stand for any light that is brighter.
const FULL: u8 = 250;

/// The same where all three are: coding leaves ripples on a white core.
const NEARLY_FULL: u8 = 225;

/// Beside one colour that is full, the others may have so much: more, and the hue is off by more than 20 degrees where the full one is
/// twice as bright as it seems.
const MAX_BESIDE_FULL: u8 = 80;

/// How far around what is overexposed its own colour is looked for, px: the slope of a lens' blur, and a sample of chroma.
const RING_PX: u32 = 2;

/// Chroma that what is overexposed must have for its hue to count beside that of the ring: then only one of its colours, or two, are full.
const MIN_BLOWN_CHROMA: f64 = 30.0;

/// The ring's hue is at most so far from that of what it surrounds, if that has one.
const MAX_TURN_DEG: f64 = 60.0;

/// The hues of the marker of which `sample` shows a part. Its rim may be in it, and some of what surrounds it if that is gray:
/// every pixel counts by its chroma.
///
/// Where the sensor was full a marker looks white, or of the hue between it and white: an LED's core. Such pixels do not count; those next
/// to them, also outside the sample, do.
///
/// # Errors
/// Why there is none. The sample must lie on the frame.
pub fn learned(frame: &Frame, sample: Region) -> Result<HueRange, NoHue> {
    if sample.area() > MAX_PIXELS {
        return Err(NoHue::TooLarge { pixels: sample.area(), most: MAX_PIXELS });
    }
    let places =
        (sample.y..sample.y + sample.height).flat_map(|y| (sample.x..sample.x + sample.width).map(move |x| [x, y]));
    let (mut blown, mut chroma, mut blown_chroma) = (Vec::new(), Vec::new(), Vec::new());
    for place in places {
        let colour = colour_at(frame, place).ok_or(NoHue::NoColor)?;
        if is_blown(colour) {
            blown.push(place);
            blown_chroma.push(chroma_of(colour));
        } else {
            chroma.push(chroma_of(colour));
        }
    }
    if blown.is_empty() {
        return mean_chroma(&chroma).map(|mean| hue_of(&mean));
    }
    let overexposed = NoHue::Overexposed { blown: blown.len(), pixels: sample.area() };
    chroma.extend(ring(frame, sample, blown));
    let core: Vector2<f64> = blown_chroma.iter().sum::<Vector2<f64>>() / blown_chroma.len() as f64;
    let has_hue = core.norm() >= MIN_BLOWN_CHROMA;
    match mean_chroma(&chroma) {
        Ok(mean) if has_hue && mean.angle(&core).to_degrees() > MAX_TURN_DEG => Err(overexposed),
        Ok(mean) => Ok(hue_of(&mean)),
        // Pure colours of drawings are full and have no slope around them.
        Err(NoHue::Gray { .. }) if has_hue => Ok(hue_of(&core)),
        Err(NoHue::Gray { .. }) => Err(overexposed),
        Err(other) => Err(other),
    }
}

/// Red, green, blue of a pixel; `None` in a frame without colour.
fn colour_at(frame: &Frame, [x, y]: [u32; 2]) -> Option<[u8; 3]> {
    let index = 3 * (y as usize * frame.width() as usize + x as usize);
    match frame.pixels() {
        Pixels::Luma(_) => None,
        Pixels::YCbCr(s) => Some(rgb_of_ycbcr([s[index], s[index + 1], s[index + 2]])),
        Pixels::Rgb(s) => Some([s[index], s[index + 1], s[index + 2]]),
    }
}

fn chroma_of(colour: [u8; 3]) -> Vector2<f64> {
    let [_, cb, cr] = ycbcr_of_rgb(colour);
    Vector2::new(f64::from(cb) - 128.0, f64::from(cr) - 128.0)
}

/// Whether the sensor was so full that the hue is not to be trusted.
fn is_blown(colour: [u8; 3]) -> bool {
    let mut sorted = colour;
    sorted.sort_unstable();
    let [least, beside, most] = sorted;
    least >= NEARLY_FULL || most >= FULL && beside > MAX_BESIDE_FULL
}

/// Chroma of what is not overexposed but next to what is: to `blown`, and to what is overexposed together with it, outside the sample.
fn ring(frame: &Frame, sample: Region, blown: Vec<[u32; 2]>) -> Vec<Vector2<f64>> {
    let mut chroma = Vec::new();
    let is_in_sample = |[x, y]: [u32; 2]| {
        (sample.x..sample.x + sample.width).contains(&x) && (sample.y..sample.y + sample.height).contains(&y)
    };
    let mut known: HashSet<[u32; 2]> = blown.iter().copied().collect();
    let mut open = blown;
    while let Some([x, y]) = open.pop() {
        for row in y.saturating_sub(RING_PX)..(y + RING_PX + 1).min(frame.height()) {
            for column in x.saturating_sub(RING_PX)..(x + RING_PX + 1).min(frame.width()) {
                let place = [column, row];
                if known.len() > MAX_PIXELS || !known.insert(place) {
                    continue;
                }
                match colour_at(frame, place) {
                    Some(colour) if is_blown(colour) => open.push(place),
                    Some(colour) if !is_in_sample(place) => chroma.push(chroma_of(colour)),
                    _ => (),
                }
            }
        }
    }
    chroma
}

/// The direction of the one colour of these.
fn mean_chroma(chroma: &[Vector2<f64>]) -> Result<Vector2<f64>, NoHue> {
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
    Ok(mean)
}

/// The sector around a direction of chroma.
fn hue_of(chroma: &Vector2<f64>) -> HueRange {
    // Angles in the plane of chroma and hues are not the same, but grow with each other.
    let nearness = |hue_deg: f64| chroma_direction(hue_deg).dot(chroma);
    let centre_deg = (0..720).map(|half| 0.5 * f64::from(half)).max_by(|a, b| nearness(*a).total_cmp(&nearness(*b)));
    HueRange { centre_deg: centre_deg.unwrap_or(0.0), half_width_deg: HueRange::NAMED_HALF_WIDTH_DEG }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::*;
    use crate::detect::{ColorOptions, Detector, detect};
    use crate::frame::{Coding, Decoding};
    use crate::geometry::CameraFromTarget;
    use crate::random;
    use crate::scene::encode::jpeg;
    use crate::scene::models::{demo_camera, wing_six};
    use crate::scene::render::{Model, Optics, Sky, render};
    use crate::scene::truth::truth;

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

    /// LEDs of the wing in the dark, so much brighter than the sensor holds, and where they are.
    fn lit(rgb: [u8; 3], gain: f64, is_coded: bool) -> (Frame, Vec<[u32; 2]>) {
        let camera = demo_camera();
        let pose = CameraFromTarget::new(Rotation3::identity(), Vector3::new(0.0, 0.0, 3.0));
        let model = Model { marker_rgb: rgb, marker_gain: gain, ..Model::bare(wing_six()) };
        let optics = Optics { glare_ratio: 0.01, ..Optics::default() };
        let night = Sky::plain([14, 15, 18]);
        let frame = render(&camera, &pose, &model, &night, &optics, &mut random::named("overexposed"));
        let places = truth(&camera, &pose, &model).into_iter().filter_map(|marker| marker.centroid);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in view")]
        let places = places.map(|place| [place.x.round() as u32, place.y.round() as u32]).collect();
        if !is_coded {
            return (frame, places);
        }
        let bytes = jpeg(&frame, 90).expect("encodes");
        (Frame::decode(&bytes, &Decoding::default()).expect("decodes"), places)
    }

    #[test]
    fn of_an_overexposed_light_the_hue_is_that_of_its_slopes() {
        let colours = [([230, 40, 40], 0.0), ([60, 220, 70], 124.0), ([70, 90, 240], 233.0), ([230, 140, 40], 32.0)];
        for (rgb, truth_deg) in colours {
            for is_coded in [false, true] {
                for gain in [1.0, 4.0, 40.0] {
                    let (frame, places) = lit(rgb, gain, is_coded);
                    for [x, y] in places {
                        for side in [1, 3, 9] {
                            let hue = learned(&frame, square(x - side / 2, y - side / 2, side));
                            let found_deg = hue.map(|hue| hue.centre_deg);
                            let off_deg = found_deg.map(|deg| ((deg - truth_deg + 540.0) % 360.0 - 180.0).abs());
                            // A named sector reaches 32 degrees to both sides.
                            assert!(
                                off_deg.is_ok_and(|off| off < 20.0),
                                "{rgb:?} {gain} {side} {is_coded}: {found_deg:?}"
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn what_is_overexposed_with_gray_or_another_colour_around_it_is_refused_as_that() {
        let of = |inner: [u8; 3], outer: [u8; 3]| {
            let samples = (0..400_i32)
                .flat_map(|i| if (i % 20 - 10).pow(2) + (i / 20 - 10).pow(2) <= 25 { inner } else { outer });
            Frame::checked(20, 20, Pixels::Rgb(samples.collect()), Coding::LOSSLESS).expect("a frame")
        };
        let click = square(9, 9, 3);
        let overexposed = Err(NoHue::Overexposed { blown: 9, pixels: 9 });
        assert_eq!(learned(&of([255, 255, 255], [90, 90, 90]), click), overexposed);
        // Yellow paint in too much light, before the sky.
        assert_eq!(learned(&of([255, 255, 90], [80, 130, 200]), click), overexposed);
        // Of drawings, colours are pure.
        for (rgb, hue_deg) in [([255, 0, 0], 0.0), ([255, 255, 0], 60.0), ([0, 255, 255], 180.0)] {
            let hue = learned(&of(rgb, [128, 128, 128]), click).expect("a colour");
            assert!((hue.centre_deg - hue_deg + 180.0).rem_euclid(360.0) - 180.0 < 1.0, "{rgb:?}: {hue:?}");
        }
    }
}
