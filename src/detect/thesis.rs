//! The preset `thesis`: the seed's colour detection step for step (its section 3.2.3 and appendix).
//!
//! Otsu's threshold for each colour band; red is where the red band reaches its threshold and neither green nor blue passes
//! theirs; areas below 10 px are dropped; closing with a disk of radius 2; holes filled; what is left is the mask, its
//! 8-connected components are the markers and their mean positions the centroids. Exact where the seed is; it fails where
//! the seed fails (no marker in the frame still gives thresholds, and so blobs).

use std::cmp::Reverse;

use super::components::{area, bounds, mean_position};
use super::morphology::{Mask, Morphology};
use super::threshold::{histogram, otsu};
use super::{Centroid, Detection, bounds_in_frame, in_frame};
use crate::frame::{Frame, Region};

/// Components of fewer pixels are noise.
const LEAST_AREA: usize = 10;

/// What remains when a blob is large: colour sampled at half the rate, and an outline that is not quite symmetric.
const FLOOR_SIGMA_PX: f64 = 0.15;

/// Finds what is red, frame after frame, in the same memory.
#[derive(Default)]
pub struct Finder {
    /// Of a frame that is stored otherwise.
    rgb: Vec<u8>,
    mask: Mask,
    morphology: Morphology,
    /// Areas of components, and their numbers.
    areas: Vec<(usize, usize)>,
}

impl Finder {
    /// The seed's centroids in `region`, the largest first. Binary centroids carry no intensity, so their score is 1.
    #[must_use]
    pub fn detect(&mut self, frame: &Frame, region: Region) -> Detection {
        let Self { rgb, mask, morphology, areas } = self;
        mark_red(frame.rgb_in(rgb), frame.width() as usize, region, mask, morphology);
        let components = morphology.components(mask);
        areas.clear();
        areas.extend(components.iter().map(area).zip(0..));
        areas.sort_unstable_by_key(|(area, number)| (Reverse(*area), *number));
        let centroid = |(area, number): &(usize, usize)| {
            let runs = components.runs(*number);
            let (x, y) = mean_position(runs);
            let area_px = *area as f64;
            Centroid {
                pixel: in_frame(region, x, y),
                sigma_px: outline_sigma_px(area_px).hypot(FLOOR_SIGMA_PX),
                area_px,
                bounds: bounds_in_frame(region, bounds(runs)),
                score: 1.0,
                class: None,
                track_id: None,
            }
        };
        Detection { centroids: areas.iter().map(centroid).collect(), refused: Vec::new() }
    }
}

/// Standard deviation of a binary disc's mean position: every pixel of the outline falls in or out by chance (variance 1/12
/// of a pixel across the outline), which moves the mean by `1 / (12 pi r)` squared pixels.
pub(super) fn outline_sigma_px(area_px: f64) -> f64 {
    let radius = (area_px / std::f64::consts::PI).sqrt();
    (12.0 * std::f64::consts::PI * radius).recip().sqrt()
}

/// Makes `mask` that of what is red, in the region's own coordinates.
fn mark_red(rgb: &[u8], frame_width: usize, region: Region, mask: &mut Mask, morphology: &mut Morphology) {
    (mask.width, mask.height) = (region.width as usize, region.height as usize);
    let rows = || {
        (0..region.height as usize).flat_map(|row| {
            let start = (row + region.y as usize) * frame_width + region.x as usize;
            rgb[start * 3..(start + region.width as usize) * 3].as_chunks::<3>().0
        })
    };
    let [red, green, blue] = [0, 1, 2].map(|band| otsu(&histogram(rows().map(|pixel| pixel[band]))));
    mask.pixels.clear();
    mask.pixels.reserve(region.area());
    mask.pixels.extend(rows().map(|p| u8::from(p[0] >= red && p[1] <= green && p[2] <= blue)));
    morphology.remove_areas_below(mask, LEAST_AREA);
    morphology.close_disk_2(mask);
    morphology.fill_holes(mask);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Coding, Pixels};

    /// Light gray with red discs.
    fn picture(discs: &[(f64, f64, f64)]) -> Frame {
        let (width, height) = (160_u32, 120_u32);
        let samples = (0..width * height)
            .flat_map(|i| {
                let (x, y) = (f64::from(i % width), f64::from(i / width));
                let inside = discs.iter().any(|(u, v, r)| (x - u).hypot(y - v) <= *r);
                if inside { [210, 20, 25] } else { [150, 152, 149] }
            })
            .collect();
        Frame::checked(width, height, Pixels::Rgb(samples), Coding::LOSSLESS).expect("a good frame")
    }

    fn detect(frame: &Frame, region: Region) -> Detection {
        Finder::default().detect(frame, region)
    }

    fn red_mask(rgb: &[u8], frame_width: usize, region: Region) -> Mask {
        let mut mask = Mask::default();
        mark_red(rgb, frame_width, region, &mut mask, &mut Morphology::default());
        mask
    }

    #[test]
    fn discs_are_found_at_their_centres_and_specks_are_not() {
        let discs = [(40.0, 30.0, 6.0), (100.5, 80.25, 8.0), (20.0, 100.0, 1.0)];
        let frame = picture(&discs);
        let found = detect(&frame, frame.full()).centroids;
        assert_eq!(found.len(), 2);
        for (centroid, (u, v, r)) in found.iter().zip([discs[1], discs[0]]) {
            assert!((centroid.pixel.x - u).hypot(centroid.pixel.y - v) < 4.0 * centroid.sigma_px, "{centroid:?}");
            assert!((centroid.area_px / (std::f64::consts::PI * r * r) - 1.0).abs() < 0.15);
        }
    }

    #[test]
    fn a_region_gives_positions_on_the_whole_frame() {
        let frame = picture(&[(40.0, 30.0, 6.0), (100.0, 80.0, 8.0)]);
        let region = Region { x: 80, y: 60, width: 60, height: 50 };
        let found = detect(&frame, region).centroids;
        assert_eq!(found.len(), 1);
        assert!((found[0].pixel.x - 100.0).abs() < 0.3 && (found[0].pixel.y - 80.0).abs() < 0.3);
        assert!(found[0].bounds.x >= 91 && found[0].bounds.y >= 71, "{:?}", found[0].bounds);
    }

    #[test]
    fn a_ring_is_filled() {
        let frame = picture(&[(80.0, 60.0, 12.0)]);
        let mut rgb = frame.rgb().into_owned();
        for (y, x) in (57..64).flat_map(|y| (77..84).map(move |x| (y, x))) {
            rgb[(y * 160 + x) * 3..][..3].copy_from_slice(&[150, 152, 149]);
        }
        let whole = red_mask(&frame.rgb(), 160, frame.full());
        assert_eq!(red_mask(&rgb, 160, frame.full()), whole);
    }
}
