//! The search for blobs, level by level.
//!
//! At a low level a marker on a reddish ground is one piece with the ground; at a high level a dim marker is gone. So the
//! levels are tried from low to high, each one and a half times the last. A component that makes a good blob at its own
//! half height is taken, one that does not is looked at again at the next level, inside its bounds only.
//!
//! What a frame costs is bounded whatever it shows: tiles that are all texture at a level wait for a higher one
//! ([`Tiles`]), and of the components of a level only the largest are examined.

use std::cmp::Reverse;

use nalgebra::Matrix2;

use super::tiles::Tiles;
use super::{BlobOptions, Picture, Verdict, examine};
use crate::detect::components::{Components, Connectivity, Labeling, Run, area, bounds};
use crate::detect::{Centroid, Refusal, Refused};
use crate::frame::Region;

/// From one level to the next.
const LEVEL_RATIO: f64 = 1.5;

/// Components examined at one level, the largest: a bound on the cost of a frame of noise.
const MAX_EXAMINED: usize = 128;

/// Windows that are searched one by one at a level; more become one, which costs less than to sort them out.
const MAX_WINDOWS: usize = 256;

/// A blob that is one.
pub(super) struct Marker {
    /// How many were found before it.
    pub number: usize,
    /// In the picture.
    pub centroid: Centroid,
    /// Second moments of its area, px^2.
    pub moments: Matrix2<f64>,
}

/// Searches, picture after picture, in the same memory.
#[derive(Default)]
pub(super) struct Search {
    markers: Vec<Marker>,
    /// What is searched at a level, and at the next.
    windows: Vec<Region>,
    again: Vec<Region>,
    tiles: Tiles,
    labeling: Labeling,
    largest: Largest,
    /// What of a component is above half its height.
    parts: Labeling,
}

impl Search {
    /// The markers, in the order in which they were found; `refuse` hears of what is none.
    pub(super) fn markers(
        &mut self,
        picture: &Picture<'_>,
        options: &BlobOptions,
        mut refuse: impl FnMut(Refused),
    ) -> &mut [Marker] {
        let Self { markers, windows, again, tiles, labeling, largest, parts } = self;
        markers.clear();
        windows.clear();
        windows.push(picture.window());
        let mut level = (0.5 * options.min_contrast).max(1.0);
        while !windows.is_empty() && level < 255.0 {
            #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "1 to 255")]
            let threshold = level.ceil() as u8;
            again.clear();
            let mut examined = 0;
            for window in &*windows {
                tiles.look(picture, *window, threshold);
                again.extend(tiles.busy());
                let width = picture.width as usize;
                let components = labeling.within(picture.score, width, tiles.open(), threshold, Connectivity::Eight);
                for number in largest.of(components, MAX_EXAMINED.saturating_sub(examined)) {
                    let runs = components.runs(number);
                    let whole = bounds(runs);
                    // Taken at a lower level, or as part of an overlapping window.
                    if markers.iter().any(|marker| overlaps(marker.centroid.bounds, whole)) {
                        continue;
                    }
                    if tiles.cut(whole) {
                        again.push(whole);
                        continue;
                    }
                    examined += 1;
                    match examine(picture, runs, options, parts) {
                        Verdict::Marker(centroid, moments) => {
                            markers.push(Marker { number: markers.len(), centroid, moments });
                        }
                        Verdict::LookHigher(_) if level * LEVEL_RATIO < f64::from(peak(picture, runs)) => {
                            again.push(whole);
                        }
                        Verdict::LookHigher(reason) | Verdict::Refused(reason) => refuse(refused(runs, whole, reason)),
                    }
                }
            }
            merge(again, windows);
            level *= LEVEL_RATIO;
        }
        markers
    }
}

fn refused(runs: &[Run], whole: Region, reason: Refusal) -> Refused {
    Refused { pixel: middle(whole), area_px: area(runs) as f64, bounds: whole, reason }
}

/// Areas of components, and their numbers.
#[derive(Default)]
struct Largest {
    list: Vec<(usize, usize)>,
}

impl Largest {
    /// The numbers of the largest components, in reading order. Less than two pixels no marker has even at half height, and a noisy frame
    /// has them without number.
    fn of(&mut self, components: &Components, most: usize) -> impl Iterator<Item = usize> {
        let areas = components.iter().map(area).zip(0..);
        self.list.clear();
        self.list.extend(areas.filter(|(area, _)| *area >= 2));
        if self.list.len() > most {
            if most > 0 {
                self.list.select_nth_unstable_by_key(most - 1, |(area, number)| (Reverse(*area), *number));
            }
            self.list.truncate(most);
            self.list.sort_unstable_by_key(|(_, number)| *number);
        }
        self.list.iter().map(|(_, number)| *number)
    }
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

/// Overlapping windows of `from` become one of `into`, so that no pixel is searched twice at one level.
fn merge(from: &mut Vec<Region>, into: &mut Vec<Region>) {
    into.clear();
    if from.len() > MAX_WINDOWS {
        into.extend(from.drain(..).reduce(union));
    }
    while let Some(mut window) = from.pop() {
        while let Some(index) = into.iter().position(|other| overlaps(window, *other)) {
            let other = into.swap_remove(index);
            window = union(window, other);
        }
        into.push(window);
    }
}
