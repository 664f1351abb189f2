//! LEDs on a dark ground.
//!
//! An LED that outshines the scene is white in its middle, whatever its colour, and colour is left only in its halo. So luma
//! finds and locates it, and colour, where one is asked for, only decides whether it is one of ours.

use nalgebra::Vector2;

use super::blob::{self, BlobOptions};
use super::{Centroid, Detection, HueRange, Refusal, Refused, luma};
use crate::frame::color::ycbcr_of_rgb;
use crate::frame::{ChromaSampling, Coding, Frame, Pixels, Region};

/// What counts as an LED.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeaconOptions {
    /// The hue of its halo; `None` for light of any colour.
    pub hue: Option<HueRange>,
    /// What counts as a blob; its score is luma.
    pub blobs: BlobOptions,
}

impl Default for BeaconOptions {
    fn default() -> Self {
        let blobs = BlobOptions {
            min_contrast: 30.0,
            // Even the image of a point has more, as the lens blurs it.
            min_area_px: 2.0,
            max_area_ratio: 0.01,
            // Motion draws out what is small.
            max_elongation: 8.0,
            min_fill: 0.8,
            max_centroids: 64,
        };
        Self { hue: None, blobs }
    }
}

/// Chroma, of 255, that a halo must have before its hue counts for anything.
const MIN_CHROMA: f64 = 4.0;

/// Finds LEDs, frame after frame, in the same memory.
#[derive(Default)]
pub struct Finder {
    luma: Vec<u8>,
    blobs: blob::Finder,
}

impl Finder {
    /// The LEDs in `region`, the best first.
    #[must_use]
    pub fn detect(&mut self, frame: &Frame, region: Region, options: &BeaconOptions) -> Detection {
        luma::take(frame, region, &mut self.luma);
        // Those of another colour are still among them.
        let most = options.blobs.max_centroids;
        let max_centroids = if options.hue.is_some() { usize::MAX } else { most };
        let blobs = BlobOptions { max_centroids, ..options.blobs };
        // Luma is sampled at every pixel, whatever happened to the colours.
        let coding = Coding { chroma: ChromaSampling::Full, ..frame.coding() };
        let mut found = self.blobs.detect(frame, region, &self.luma, coding, None, &blobs);
        if let Some(hue) = &options.hue {
            let mut ours = std::mem::take(&mut found.centroids);
            ours.retain(|centroid| {
                let is_ours = is_of(frame, centroid, hue);
                if !is_ours {
                    found.refuse(Refused::of(centroid, Refusal::OtherColor));
                }
                is_ours
            });
            for extra in ours.drain(most.min(ours.len())..) {
                found.refuse(Refused::of(&extra, Refusal::Crowded));
            }
            found.centroids = ours;
        }
        found
    }
}

/// Whether the light in and around the centroid's bounds has the hue. A frame without colour has none.
fn is_of(frame: &Frame, centroid: &Centroid, hue: &HueRange) -> bool {
    let bounds = centroid.bounds;
    let (right, bottom) = (bounds.x + bounds.width, bounds.y + bounds.height);
    let mut sum = Vector2::zeros();
    let mut count = 0.0;
    for y in bounds.y.saturating_sub(2)..(bottom + 2).min(frame.height()) {
        for x in bounds.x.saturating_sub(2)..(right + 2).min(frame.width()) {
            let index = 3 * (y as usize * frame.width() as usize + x as usize);
            let [_, cb, cr] = match frame.pixels() {
                Pixels::Luma(_) => return false,
                Pixels::YCbCr(s) => [s[index], s[index + 1], s[index + 2]],
                Pixels::Rgb(s) => ycbcr_of_rgb([s[index], s[index + 1], s[index + 2]]),
            };
            sum += Vector2::new(f64::from(cb) - 128.0, f64::from(cr) - 128.0);
            count += 1.0;
        }
    }
    hue.edges().iter().all(|edge| edge.dot(&sum) > MIN_CHROMA * count)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lights in a dark picture of 120 x 90 px, each a Gaussian spot that may outshine the sensor.
    fn night(lights: &[([f64; 2], f64, [f64; 3])]) -> Frame {
        let pixel = |x: u32, y: u32| {
            let mut sum = [9.0, 9.0, 12.0];
            for ([u, v], peak, colour) in lights {
                let off = ((f64::from(x) - u).powi(2) + (f64::from(y) - v).powi(2)) / (2.0 * 1.1 * 1.1);
                sum.iter_mut().zip(colour).for_each(|(sum, colour)| *sum += peak * colour * (-off).exp());
            }
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a colour")]
            sum.map(|value| value.min(255.0).round() as u8)
        };
        let samples = (0..90).flat_map(|y| (0..120).flat_map(move |x| pixel(x, y))).collect();
        Frame::checked(120, 90, Pixels::Rgb(samples), Coding::LOSSLESS).expect("a frame")
    }

    fn detect(frame: &Frame, region: Region, options: &BeaconOptions) -> Detection {
        Finder::default().detect(frame, region, options)
    }

    const RED: [f64; 3] = [1.0, 0.25, 0.2];
    const WHITE: [f64; 3] = [1.0, 0.95, 0.9];

    #[test]
    fn dim_and_outshining_lights_are_found_where_they_are() {
        for peak in [90.0, 250.0, 900.0, 2500.0] {
            for at in [[40.0, 50.0], [61.37, 30.81], [70.5, 44.25]] {
                let found = detect(
                    &frame_of(at, peak),
                    Region { x: 0, y: 0, width: 120, height: 90 },
                    &BeaconOptions::default(),
                );
                let [centroid] = found.centroids[..] else { panic!("{peak} {at:?}: {found:?}") };
                let error = (centroid.pixel.x - at[0]).hypot(centroid.pixel.y - at[1]);
                assert!(error < 3.0 * centroid.sigma_px && error < 0.06, "{peak} {at:?}: {error} {centroid:?}");
            }
        }
    }

    fn frame_of(at: [f64; 2], peak: f64) -> Frame {
        night(&[(at, peak, RED)])
    }

    #[test]
    fn a_hue_leaves_out_lights_of_other_colours_even_where_both_are_white_in_the_middle() {
        let frame = night(&[([30.2, 40.6], 1500.0, RED), ([80.7, 45.1], 1500.0, WHITE)]);
        assert_eq!(detect(&frame, frame.full(), &BeaconOptions::default()).centroids.len(), 2);
        let red = BeaconOptions { hue: Some(HueRange::RED), ..BeaconOptions::default() };
        let found = detect(&frame, frame.full(), &red);
        assert_eq!(found.centroids.len(), 1, "{found:?}");
        assert!((found.centroids[0].pixel.x - 30.2).abs() < 0.1, "{found:?}");
        assert_eq!(found.refused.iter().map(|r| r.reason).collect::<Vec<_>>(), [Refusal::OtherColor]);
    }

    /// Lights of which each outshines the sensor and glows far around, in a dark picture of 160 x 160 px. From row 64 on it is texture.
    fn glowing(lights: &[[f64; 2]]) -> Frame {
        let pixel = |x: u32, y: u32| {
            let dark = if y >= 64 && (x + y).is_multiple_of(2) { 16.0 } else { 10.0 };
            let light = |[u, v]: &[f64; 2]| {
                let off = (f64::from(x) - u).hypot(f64::from(y) - v);
                2000.0 * (-off * off / (2.0 * 1.3 * 1.3)).exp() + 220.0 * (-off / 4.0).exp()
            };
            let code = dark + lights.iter().map(light).sum::<f64>();
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a code")]
            let code = code.min(255.0).round() as u8;
            code
        };
        let places = (0..160).flat_map(|y| (0..160).map(move |x| [x, y]));
        let samples = places.map(|[x, y]| pixel(x, y)).collect();
        Frame::checked(160, 160, Pixels::Luma(samples), Coding::LOSSLESS).expect("a frame")
    }

    fn assert_found(lights: &[[f64; 2]]) {
        let frame = glowing(lights);
        let found = detect(&frame, frame.full(), &BeaconOptions::default());
        assert_eq!(found.centroids.len(), lights.len(), "{lights:?}: {found:?}");
        for [u, v] in lights {
            let off = |centroid: &Centroid| (centroid.pixel.x - u).hypot(centroid.pixel.y - v);
            let nearest = found.centroids.iter().map(off).fold(f64::MAX, f64::min);
            assert!(nearest < 0.4, "{lights:?}: {nearest} px, {found:?}");
        }
    }

    #[test]
    fn lights_whose_glows_flow_together_are_told_apart() {
        for apart in [11.0, 12.0, 16.0, 24.0] {
            for turn in [0.0, 0.4, 0.8_f64] {
                let (sine, cosine) = turn.sin_cos();
                let light = |along: f64| [80.2 + along * cosine, 31.7 + along * sine];
                assert_found(&[light(-0.5 * apart), light(0.5 * apart)]);
            }
        }
    }

    #[test]
    fn lights_across_the_border_of_texture_are_found_whole() {
        for y in [54.0, 58.0, 61.0, 64.0, 67.0] {
            assert_found(&[[60.3, y - 22.0], [85.8, y + 0.4], [110.1, y - 5.0]]);
        }
    }

    #[test]
    fn a_dark_frame_and_a_lit_wall_hold_no_lights() {
        let empty = night(&[]);
        assert_eq!(detect(&empty, empty.full(), &BeaconOptions::default()).centroids, []);
        let wall = (0..90 * 120).map(|i| if i % 120 < 60 { 20 } else { 200 }).collect();
        let wall = Frame::checked(120, 90, Pixels::Luma(wall), Coding::LOSSLESS).expect("a frame");
        assert_eq!(detect(&wall, wall.full(), &BeaconOptions::default()).centroids, []);
    }
}
