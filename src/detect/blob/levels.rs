//! The search for blobs, level by level.
//!
//! At a low level a marker on a reddish ground is one piece with the ground; at a high level a dim marker is gone. So the
//! levels are tried from low to high, each one and a half times the last. A component that makes a good blob at its own
//! half height is taken, one that does not is looked at again at the next level, inside its bounds only.

use nalgebra::Matrix2;

use super::{BlobOptions, Picture, Verdict, examine};
use crate::detect::components::{Components, Connectivity, area, bounds};
use crate::detect::{Centroid, Refused};
use crate::frame::Region;

/// From one level to the next.
const LEVEL_RATIO: f64 = 1.5;

/// Components examined in one frame: a bound on the cost of a frame of noise.
const MAX_EXAMINED: usize = 4096;

/// What a search ends with.
#[derive(Default)]
pub(super) struct Found {
    /// Markers, each with the second moments of its area, px^2.
    pub markers: Vec<(Centroid, Matrix2<f64>)>,
    pub refused: Vec<Refused>,
}

pub(super) fn search(picture: &Picture<'_>, options: &BlobOptions) -> Found {
    let mut found = Found::default();
    let mut windows = vec![picture.window()];
    let mut level = (0.5 * options.min_contrast).max(1.0);
    let mut examined = 0;
    while !windows.is_empty() && level < 255.0 {
        #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "1 to 255")]
        let threshold = level.ceil() as u8;
        let mut again: Vec<Region> = Vec::new();
        for window in &windows {
            for runs in
                Components::of(picture.score, picture.width as usize, *window, threshold, Connectivity::Eight).iter()
            {
                let whole = bounds(runs);
                // Taken at a lower level, or as part of an overlapping window.
                let known = found.markers.iter().any(|(c, _)| overlaps(c.bounds, whole));
                // Less than a marker can have even at half height, and so without number in a noisy frame.
                if known || area(runs) < 2 || examined >= MAX_EXAMINED {
                    continue;
                }
                examined += 1;
                match examine(picture, runs, options) {
                    Verdict::Marker(centroid, moments) => found.markers.push((centroid, moments)),
                    Verdict::LookHigher(_) if level * LEVEL_RATIO < f64::from(peak(picture, runs)) => again.push(whole),
                    Verdict::LookHigher(reason) | Verdict::Refused(reason) => found.refused.push(Refused {
                        pixel: middle(whole),
                        area_px: area(runs) as f64,
                        bounds: whole,
                        reason,
                    }),
                }
            }
        }
        windows = merged(again);
        level *= LEVEL_RATIO;
    }
    found
}

fn peak(picture: &Picture<'_>, runs: &[crate::detect::components::Run]) -> u8 {
    runs.iter().flat_map(|run| picture.run(run)).copied().max().unwrap_or(0)
}

fn middle(region: Region) -> nalgebra::Vector2<f64> {
    let half = |start: u32, length: u32| f64::from(start) + 0.5 * f64::from(length - 1);
    nalgebra::Vector2::new(half(region.x, region.width), half(region.y, region.height))
}

const fn overlaps(a: Region, b: Region) -> bool {
    a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height
}

/// Overlapping windows become one, so that no pixel is searched twice at one level.
fn merged(mut windows: Vec<Region>) -> Vec<Region> {
    let mut separate: Vec<Region> = Vec::new();
    while let Some(mut window) = windows.pop() {
        while let Some(index) = separate.iter().position(|other| overlaps(window, *other)) {
            let other = separate.swap_remove(index);
            let (x, y) = (window.x.min(other.x), window.y.min(other.y));
            let right = (window.x + window.width).max(other.x + other.width);
            let bottom = (window.y + window.height).max(other.y + other.height);
            window = Region { x, y, width: right - x, height: bottom - y };
        }
        separate.push(window);
    }
    separate
}
