//! The default detector for coloured markers.
//!
//! Each pixel gets a score: how far its chroma reaches into the sector of the marker's hue. The score grows with the light,
//! not with whiteness, and is zero for everything gray. Its blobs are the candidates; each is then located in luma and chroma
//! together.

mod hue;
mod sample;
mod score;

use super::Detection;
use super::blob::{self, BlobOptions};
use super::locate::Locator;
use crate::frame::{Frame, Region};

pub use hue::{HueRange, NAMED_HUES};
pub use sample::{NoHue, learned};

/// What counts as a marker. The defaults suit matt discs in daylight, from a few pixels to a quarter of the frame's height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorOptions {
    /// The marker's hue.
    pub hue: HueRange,
    /// What counts as a blob; its score is chroma.
    pub blobs: BlobOptions,
}

impl Default for ColorOptions {
    fn default() -> Self {
        let blobs = BlobOptions {
            // Below about 10 the noise of a JPEG begins.
            min_contrast: 12.0,
            // Colour in JPEG is sampled at half the rate, so less than this is one or two colour samples. Where it is not, half of it will do.
            min_area_px: 4.0,
            max_area_ratio: 0.04,
            max_elongation: 6.0,
            min_fill: 0.87,
            max_centroids: 64,
        };
        Self { hue: HueRange::RED, blobs }
    }
}

/// Finds markers, frame after frame, in the same memory.
#[derive(Default)]
pub struct Finder {
    scores: Vec<u8>,
    blobs: blob::Finder,
}

impl Finder {
    /// The markers in `region`, the best first.
    #[must_use]
    pub fn detect(&mut self, frame: &Frame, region: Region, options: &ColorOptions) -> Detection {
        if !score::score(frame, region, &options.hue, &mut self.scores) {
            return Detection::default();
        }
        let hue = Some(options.hue.direction());
        self.blobs.detect(frame, region, &self.scores, frame.coding(), hue, &options.blobs)
    }

    /// What markers are located in.
    pub(super) const fn locator(&mut self) -> &mut Locator {
        self.blobs.locator()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector2, Vector3};

    use super::*;
    use crate::camera::{Camera, Distortion, Pixel};
    use crate::detect::Refusal;
    use crate::frame::{Coding, Decoding, Pixels};
    use crate::geometry::{CameraFromTarget, Point};
    use crate::random::{self, normal2};
    use crate::scene::encode::{jpeg, png};
    use crate::scene::render::{Model, Optics, Sky, render};
    use crate::scene::truth::truth;
    use crate::target::{Marker, Target};

    const GRAY: [f64; 3] = [120.0, 124.0, 128.0];
    const RED: [f64; 3] = [200.0, 40.0, 35.0];

    /// A picture of 160 x 120 px without noise; `colour` tells what is at a place. Edges are the mean of
    /// 8 x 8 places in a pixel.
    fn picture(colour: impl Fn(f64, f64) -> [f64; 3]) -> Frame {
        let pixel = |x: u32, y: u32| {
            let mut sum = [0.0; 3];
            for index in 0..64 {
                let place = |step: u32| (f64::from(step) + 0.5) / 8.0 - 0.5;
                let light = colour(f64::from(x) + place(index % 8), f64::from(y) + place(index / 8));
                // Light, not codes, is what mixes.
                sum.iter_mut().zip(light).for_each(|(sum, light)| *sum += light * light / 64.0);
            }
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a colour")]
            sum.map(|value| value.sqrt().round() as u8)
        };
        let samples = (0..120).flat_map(|y| (0..160).flat_map(move |x| pixel(x, y))).collect();
        Frame::checked(160, 120, Pixels::Rgb(samples), Coding::LOSSLESS).expect("a frame")
    }

    /// Squared distance in units of the disc's radius.
    fn off(x: f64, y: f64, [u, v]: [f64; 2], radius: f64) -> f64 {
        ((x - u).powi(2) + (y - v).powi(2)) / (radius * radius)
    }

    fn disc(centre: [f64; 2], radius: f64) -> Frame {
        picture(|x, y| if off(x, y, centre, radius) <= 1.0 { RED } else { GRAY })
    }

    fn detect(frame: &Frame, region: Region, options: &ColorOptions) -> Detection {
        Finder::default().detect(frame, region, options)
    }

    fn found(frame: &Frame) -> Detection {
        detect(frame, frame.full(), &ColorOptions::default())
    }

    fn assert_refused(frame: &Frame, reason: Refusal) {
        let detection = found(frame);
        assert_eq!(detection.centroids, [], "{reason:?}");
        assert!(detection.refused.iter().any(|refused| refused.reason == reason), "{reason:?}: {detection:?}");
    }

    #[test]
    fn a_disc_is_found_where_it_is_within_its_deviation() {
        for (centre, radius) in [([80.0, 60.0], 5.0), ([61.37, 44.81], 2.5), ([99.5, 70.25], 12.0), ([40.9, 30.1], 2.0)]
        {
            let detection = found(&disc(centre, radius));
            let [centroid] = detection.centroids[..] else { panic!("{radius}: {detection:?}") };
            let error = (centroid.pixel.x - centre[0]).hypot(centroid.pixel.y - centre[1]);
            // Without noise all that is left is rounding to 8 bits and sampling: well inside three deviations.
            assert!(error < 3.0 * centroid.sigma_px, "{radius}: {error} px, sigma {}", centroid.sigma_px);
            let area = std::f64::consts::PI * radius * radius;
            // Whole pixels above half height: off by some part of the outline's length.
            assert!((centroid.area_px - area).abs() < 1.0 + radius, "{radius}: {} of {area}", centroid.area_px);
            assert!(centroid.score > 0.7, "{radius}: {}", centroid.score);
        }
    }

    #[test]
    fn dim_and_bright_discs_are_found_alike() {
        let dim = GRAY.map(|value| 0.3 * value);
        let frame = picture(|x, y| match x {
            _ if off(x, y, [40.3, 60.2], 6.0) <= 1.0 => RED,
            _ if off(x, y, [120.6, 60.7], 6.0) <= 1.0 => RED.map(|value| 0.3 * value),
            x if x > 80.0 => dim,
            _ => GRAY,
        });
        let mut at: Vec<f64> = found(&frame).centroids.iter().map(|centroid| centroid.pixel.x).collect();
        at.sort_by(f64::total_cmp);
        assert_eq!(at.len(), 2, "{at:?}");
        assert!((at[0] - 40.3).abs() < 0.1 && (at[1] - 120.6).abs() < 0.1, "{at:?}");
    }

    #[test]
    fn a_marker_on_a_reddish_ground_is_found_as_on_a_gray_one() {
        let brick = [140.0, 95.0, 85.0];
        let frame = picture(|x, y| match () {
            () if off(x, y, [80.4, 60.3], 6.0) <= 1.0 => RED,
            () if (20.0..140.0).contains(&x) && (20.0..100.0).contains(&y) => brick,
            () => GRAY,
        });
        let detection = found(&frame);
        let [centroid] = detection.centroids[..] else { panic!("{detection:?}") };
        assert!((centroid.pixel.x - 80.4).hypot(centroid.pixel.y - 60.3) < 0.1, "{centroid:?}");
    }

    #[test]
    fn what_is_no_disc_is_refused_with_its_reason() {
        let centre = [80.0, 60.0];
        let ring = |x: f64, y: f64| if (0.4..=1.0).contains(&off(x, y, centre, 12.0)) { RED } else { GRAY };
        assert_refused(&picture(ring), Refusal::Ragged);
        let bar = |x: f64, y: f64| if (x - 80.0).abs() <= 40.0 && (y - 60.0).abs() <= 2.0 { RED } else { GRAY };
        assert_refused(&picture(bar), Refusal::Elongated);
        assert_refused(&disc([0.0, 60.0], 6.0), Refusal::AtBorder);
        assert_refused(&disc(centre, 30.0), Refusal::TooLarge);
        let speck = |x: f64, y: f64| if (x - 80.0).abs() <= 1.0 && (y - 60.0).abs() <= 0.5 { RED } else { GRAY };
        assert_refused(&picture(speck), Refusal::TooSmall);
    }

    #[test]
    fn other_colours_are_no_markers_unless_asked_for() {
        for (name, rgb) in
            [("green", [35.0, 200.0, 40.0]), ("blue", [35.0, 60.0, 210.0]), ("yellow", [220.0, 210.0, 40.0])]
        {
            let frame = picture(|x, y| if off(x, y, [80.0, 60.0], 6.0) <= 1.0 { rgb } else { GRAY });
            assert_eq!(found(&frame).centroids, [], "{name}");
            let options = ColorOptions { hue: HueRange::named(name).expect("is named"), ..ColorOptions::default() };
            assert_eq!(detect(&frame, frame.full(), &options).centroids.len(), 1, "{name}");
        }
        let gray = Frame::checked(160, 120, Pixels::Luma(vec![200; 160 * 120]), Coding::LOSSLESS).expect("a frame");
        assert_eq!(found(&gray), Detection::default());
    }

    #[test]
    fn in_a_region_places_are_those_of_the_whole_frame() {
        let frame = disc([100.25, 70.75], 5.0);
        let region = Region { x: 80, y: 50, width: 50, height: 40 };
        let (whole, part) = (found(&frame), detect(&frame, region, &ColorOptions::default()));
        let ([part], [whole]) = (&part.centroids[..], &whole.centroids[..]) else { panic!("{part:?} {whole:?}") };
        // To the last digits, which are those of sums from another origin.
        assert!((part.pixel - whole.pixel).norm() < 1e-9 && part.bounds == whole.bounds, "{part:?} {whole:?}");
        let beside = Region { x: 0, y: 0, width: 60, height: 60 };
        assert_eq!(detect(&frame, beside, &ColorOptions::default()).centroids, []);
    }

    /// Discs on gray as a JPEG has them, whose colours are sampled at half the rate.
    fn coded(discs: &[[f64; 2]], radius: f64) -> Frame {
        let is_disc = |x: f64, y: f64| discs.iter().any(|centre| off(x, y, *centre, radius) <= 1.0);
        let frame = picture(|x, y| if is_disc(x, y) { RED } else { GRAY });
        Frame::decode(&jpeg(&frame, 90).expect("encodes"), &Decoding::default()).expect("decodes")
    }

    #[test]
    fn discs_whose_colours_run_into_each_other_are_found_each() {
        for turn in 0..12 {
            let (sine, cosine) = (f64::from(turn) * 0.52).sin_cos();
            for (radius, apart) in [(2.7, 8.2), (3.0, 9.0), (4.8, 12.0), (6.0, 15.0), (6.0, 19.6)] {
                let discs = [-0.5, 0.5, 1.5].map(|step| [70.3 + step * apart * cosine, 60.4 + step * apart * sine]);
                let detection = found(&coded(&discs, radius));
                assert_eq!(detection.centroids.len(), 3, "{radius} {apart} {turn}: {detection:?}");
                for [u, v] in discs {
                    let off = |pixel: &Pixel| (pixel.x - u).hypot(pixel.y - v);
                    let nearest = detection.centroids.iter().map(|centroid| off(&centroid.pixel)).fold(9.0, f64::min);
                    // Where no disc is fitted, a neighbour's colour still pulls by a part of a pixel.
                    assert!(nearest < 1.0, "{radius} {apart} {turn}: {nearest} px");
                }
            }
        }
    }

    #[test]
    fn beyond_the_most_that_is_asked_for_the_rest_is_told_as_crowded() {
        let is_disc = |x: f64, y: f64| (0..4).any(|i| off(x, y, [20.0 + 40.0 * f64::from(i), 60.0], 6.0) <= 1.0);
        let frame = picture(|x, y| if is_disc(x, y) { RED } else { GRAY });
        let mut few = ColorOptions::default();
        few.blobs.max_centroids = 3;
        let detection = detect(&frame, frame.full(), &few);
        assert_eq!(detection.centroids.len(), 3);
        assert_eq!(detection.refused.iter().filter(|refused| refused.reason == Refusal::Crowded).count(), 1);
    }

    /// Rendered discs of a radius, in front of gray, taken by a sensor that measures all colours at each pixel, as a file of a format; and where
    /// they are.
    fn rendered(radius_px: f64, rgb: [u8; 3], quality: Option<u8>, name: &str) -> (Frame, Vec<Pixel>) {
        let camera = Camera::checked([640, 400], [1000.0; 2], [319.5, 199.5], Distortion::None).expect("a good camera");
        let depth_m = 10.0;
        let mut rng = random::named(name);
        let per_px = depth_m / camera.focal_lengths()[0];
        let markers = (0..60_u32).map(|index| {
            let place = Vector2::new(f64::from(index % 10) - 4.5, f64::from(index / 10) - 2.5) * 58.0;
            let place = (place + normal2(&mut rng)) * per_px;
            Marker {
                id: format!("m{index}"),
                position: Point::new(place.x, place.y, 0.0),
                radius_m: Some(radius_px * per_px),
                normal: Some(-Vector3::z()),
            }
        });
        let target = Target::checked("discs", markers.collect()).expect("a good target");
        let body = vec![[-4.0, -3.0], [4.0, -3.0], [4.0, 3.0], [-4.0, 3.0]];
        let model = Model { body, body_rgb: [150, 154, 160], marker_rgb: rgb, ..Model::bare(target) };
        let pose = CameraFromTarget::new(Rotation3::identity(), Vector3::new(0.0, 0.0, depth_m));
        // Of small ones there are few edges, which are to be right.
        let supersampling = if radius_px < 4.0 { 16 } else { 8 };
        let optics = Optics { bayer: None, supersampling, ..Optics::default() };
        let frame = render(&camera, &pose, &model, &Sky::default(), &optics, &mut rng);
        let bytes = quality.map_or_else(|| png(&frame), |quality| jpeg(&frame, quality)).expect("encodes");
        let places = truth(&camera, &pose, &model).into_iter().filter_map(|marker| marker.centroid).collect();
        (Frame::decode(&bytes, &Decoding::default()).expect("decodes"), places)
    }

    #[test]
    fn deviations_hold_in_every_format_and_of_all_sizes() {
        let cyan = [20, 190, 205];
        // 96 to 120 coordinates move the mean of the squares by 0.14. Whether a file's colours were filled in from a mosaic it does not
        // tell: for the sake of those deviations may be the larger where they were not, by twice, of the smallest discs by three times.
        for (radius, rgb, hue, quality, rms_px) in [
            (1.0, cyan, "cyan", None, 0.12),
            (1.0, [204, 26, 22], "red", None, 0.06),
            (2.0, [204, 26, 22], "red", None, 0.03),
            (5.0, [204, 26, 22], "red", None, 0.012),
            (12.0, [204, 26, 22], "red", None, 0.01),
            (2.0, cyan, "cyan", Some(75), 0.5),
            (3.0, cyan, "cyan", Some(75), 0.25),
            (5.0, [204, 26, 22], "red", Some(50), 0.15),
            (5.0, [204, 26, 22], "red", Some(90), 0.03),
        ] {
            let name = format!("{hue} of {radius} px, {quality:?}");
            let (frame, places) = rendered(radius, rgb, quality, &name);
            let options = ColorOptions { hue: HueRange::named(hue).expect("is named"), ..ColorOptions::default() };
            let found = detect(&frame, frame.full(), &options).centroids;
            let near = places.iter().filter_map(|at| {
                let centroid = found.iter().find(|centroid| (centroid.pixel - at).norm() < 2.0)?;
                Some(((centroid.pixel - at).norm_squared(), centroid.sigma_px.powi(2)))
            });
            let near: Vec<(f64, f64)> = near.collect();
            let count = near.len() as f64;
            // Of the pale waves around discs that coding leaves some are of their hue.
            let others = if quality.is_some() { 6 } else { 0 };
            assert!(
                near.len() >= 48 && found.len() <= near.len() + others,
                "{name}: {} of {}",
                near.len(),
                found.len()
            );
            let rms = (near.iter().map(|(square, _)| square).sum::<f64>() / (2.0 * count)).sqrt();
            let mean = near.iter().map(|(square, variance)| square / variance).sum::<f64>() / (2.0 * count);
            assert!(rms < rms_px, "{name}: {rms} px");
            let least = if radius < 2.0 { 0.1 } else { 0.2 };
            assert!((least..1.9).contains(&mean), "{name}: {mean} of sigma^2, {rms} px");
        }
    }
}
