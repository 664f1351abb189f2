//! The default detector for coloured markers.
//!
//! Each pixel gets a score: how far its chroma reaches into the sector of the marker's hue. The score grows with the light,
//! not with whiteness, and is zero for everything gray. Blobs are then sought level by level, so that a marker is found on a
//! reddish ground as well as on a gray one, each is cut at half its own height, and shape and size decide.
//!
//! What holds for every blob: its threshold is its own (half way between its surroundings and its top), so dim and bright
//! markers of one frame are found alike.

mod blob;
mod hue;
mod levels;
mod score;

use super::{Detection, Refusal, Refused, bounds_in_frame, in_frame};
use crate::frame::{Frame, Region};

pub use hue::{HueRange, NAMED_HUES};

/// What counts as a marker. The defaults suit matt discs in daylight, from a few pixels to a quarter of the frame's height.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorOptions {
    /// The marker's hue.
    pub hue: HueRange,
    /// Chroma, of 255, by which a marker must stand out from what surrounds it. Below about 10 the noise of a JPEG begins.
    pub min_contrast: f64,
    /// Smallest area, px. Colour in JPEG is sampled at half the rate, so less than this is one or two colour samples.
    pub min_area_px: f64,
    /// Largest area as a share of the frame.
    pub max_area_ratio: f64,
    /// Largest ratio of length to width. A disc tilted by 75 degrees has 3.9.
    pub max_elongation: f64,
    /// Smallest ratio of the area to that of the ellipse of the same moments. 1 for a disc however tilted, 0.95 for a
    /// rectangle, 0.83 for a triangle, less for a ring.
    pub min_fill: f64,
    /// Most centroids returned.
    pub max_centroids: usize,
}

impl Default for ColorOptions {
    fn default() -> Self {
        Self {
            hue: HueRange::RED,
            min_contrast: 12.0,
            min_area_px: 4.0,
            max_area_ratio: 0.04,
            max_elongation: 6.0,
            min_fill: 0.87,
            max_centroids: 64,
        }
    }
}

/// The markers in `region`, the best first.
#[must_use]
pub fn detect(frame: &Frame, region: Region, options: &ColorOptions) -> Detection {
    let Some(score) = score::score(frame, region, &options.hue) else {
        return Detection::default();
    };
    let picture = blob::Picture {
        score: &score,
        width: region.width,
        height: region.height,
        coding: frame.coding(),
        frame_area: f64::from(frame.width()) * f64::from(frame.height()),
    };
    let mut detection = levels::search(&picture, options);
    detection.centroids.sort_by(|a, b| b.score.total_cmp(&a.score));
    for extra in detection.centroids.drain(options.max_centroids.min(detection.centroids.len())..) {
        detection.refused.push(Refused {
            pixel: extra.pixel,
            area_px: extra.area_px,
            bounds: extra.bounds,
            reason: Refusal::Crowded,
        });
    }
    for centroid in &mut detection.centroids {
        centroid.pixel = in_frame(region, centroid.pixel.x, centroid.pixel.y);
        centroid.bounds = bounds_in_frame(region, centroid.bounds);
    }
    for refused in &mut detection.refused {
        refused.pixel = in_frame(region, refused.pixel.x, refused.pixel.y);
        refused.bounds = bounds_in_frame(region, refused.bounds);
    }
    detection
}
