//! The search for blobs, level by level.
//!
//! At a low level a marker on a reddish ground is one piece with the ground; at a high level a dim marker is gone. So the
//! levels are tried from low to high, each one and a half times the last. A component that makes a good blob at its own
//! half height is taken, one that does not is looked at again at the next level, inside its bounds only.
//!
//! What a frame costs is bounded whatever it shows: tiles that are all texture at a level wait for a higher one
//! ([`Tiles`]), and of the components of a level only the largest are examined.

use nalgebra::Matrix2;

use super::tiles::Tiles;
use super::{BlobOptions, Picture, Verdict, examine};
use crate::detect::components::{Components, Connectivity, Run, area, bounds};
use crate::detect::{Centroid, Refusal, Refused};
use crate::frame::Region;

/// From one level to the next.
const LEVEL_RATIO: f64 = 1.5;

/// Components examined at one level, the largest: a bound on the cost of a frame of noise.
const MAX_EXAMINED: usize = 128;

/// Windows that are searched one by one at a level; more become one, which costs less than to sort them out.
const MAX_WINDOWS: usize = 256;

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
    while !windows.is_empty() && level < 255.0 {
        #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "1 to 255")]
        let threshold = level.ceil() as u8;
        let mut again: Vec<Region> = Vec::new();
        let mut examined = 0;
        for window in &windows {
            let tiles = Tiles::of(picture, *window, threshold);
            again.extend(tiles.busy());
            let width = picture.width as usize;
            let components = Components::within(picture.score, width, &tiles.open(), threshold, Connectivity::Eight);
            for runs in largest(&components, MAX_EXAMINED.saturating_sub(examined)) {
                let whole = bounds(runs);
                // Taken at a lower level, or as part of an overlapping window.
                if found.markers.iter().any(|(c, _)| overlaps(c.bounds, whole)) {
                    continue;
                }
                if tiles.cut(whole) {
                    again.push(whole);
                    continue;
                }
                examined += 1;
                match examine(picture, runs, options) {
                    Verdict::Marker(centroid, moments) => found.markers.push((centroid, moments)),
                    Verdict::LookHigher(_) if level * LEVEL_RATIO < f64::from(peak(picture, runs)) => again.push(whole),
                    Verdict::LookHigher(reason) | Verdict::Refused(reason) => {
                        found.refused.push(refused(runs, whole, reason));
                    }
                }
            }
        }
        windows = merged(again);
        level *= LEVEL_RATIO;
    }
    found
}

fn refused(runs: &[Run], whole: Region, reason: Refusal) -> Refused {
    Refused { pixel: middle(whole), area_px: area(runs) as f64, bounds: whole, reason }
}

/// The largest components, in reading order. Less than two pixels no marker has even at half height, and a noisy frame has them
/// without number.
fn largest(components: &Components, most: usize) -> Vec<&[Run]> {
    let mut list: Vec<(usize, &[Run])> =
        components.iter().map(|runs| (area(runs), runs)).filter(|(area, _)| *area >= 2).collect();
    if list.len() > most {
        let key = |(area, runs): &(usize, &[Run])| (std::cmp::Reverse(*area), runs[0].y, runs[0].start);
        if most > 0 {
            list.select_nth_unstable_by_key(most - 1, key);
        }
        list.truncate(most);
        list.sort_unstable_by_key(|(_, runs)| (runs[0].y, runs[0].start));
    }
    list.into_iter().map(|(_, runs)| runs).collect()
}

fn peak(picture: &Picture<'_>, runs: &[Run]) -> u8 {
    runs.iter().flat_map(|run| picture.run(run)).copied().max().unwrap_or(0)
}

fn middle(region: Region) -> nalgebra::Vector2<f64> {
    let half = |start: u32, length: u32| f64::from(start) + 0.5 * f64::from(length - 1);
    nalgebra::Vector2::new(half(region.x, region.width), half(region.y, region.height))
}

const fn overlaps(a: Region, b: Region) -> bool {
    a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height
}

fn union(a: Region, b: Region) -> Region {
    let (x, y) = (a.x.min(b.x), a.y.min(b.y));
    let (right, bottom) = ((a.x + a.width).max(b.x + b.width), (a.y + a.height).max(b.y + b.height));
    Region { x, y, width: right - x, height: bottom - y }
}

/// Overlapping windows become one, so that no pixel is searched twice at one level.
fn merged(mut windows: Vec<Region>) -> Vec<Region> {
    if windows.len() > MAX_WINDOWS {
        return windows.into_iter().reduce(union).into_iter().collect();
    }
    let mut separate: Vec<Region> = Vec::new();
    while let Some(mut window) = windows.pop() {
        while let Some(index) = separate.iter().position(|other| overlaps(window, *other)) {
            let other = separate.swap_remove(index);
            window = union(window, other);
        }
        separate.push(window);
    }
    separate
}
