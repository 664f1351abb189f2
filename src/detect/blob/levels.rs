//! The search for blobs, level by level.
//!
//! At a low level a marker on a reddish ground is one piece with the ground; at a high level a dim marker is gone. So the
//! levels are tried from low to high, each one and a half times the last or higher by the least contrast, whichever is less. A
//! component that makes a good blob at its own half height is taken; one that does not, or in which more than the blob may be,
//! is looked at again at the next level, inside its bounds only. There what holds a taken core or lies on it is the same blob;
//! all else is looked at, however near it lies.
//!
//! What a frame costs is bounded whatever it shows: tiles that are all texture at a level wait for a higher one
//! ([`Tiles`]), and of the components of a level only the largest are examined.

use std::cmp::Reverse;
use std::ops::Range;

use nalgebra::Matrix2;

use super::tiles::Tiles;
use super::{Bench, BlobOptions, Picture, Verdict, examine, peak};
use crate::detect::components::{Components, Connectivity, Labeling, Run, area, bounds, holds};
use crate::detect::{Centroid, Refusal, Refused};
use crate::frame::Region;

/// From one level to the next.
const LEVEL_RATIO: f64 = 1.5;

/// And by so much at least where steps are those of the contrast, so that there are not too many.
const LEAST_STEP: f64 = 8.0;

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
    /// Which of the cores is its own.
    core: Range<usize>,
}

impl Marker {
    /// Whether a component is this marker, with or without what surrounds it.
    fn is_one_with(&self, runs: &[Run], whole: Region, cores: &[Run]) -> bool {
        let core = &cores[self.core.clone()];
        overlaps(self.centroid.bounds, whole) && (holds(runs, core) || holds(core, runs))
    }

    /// Whether a component with these bounds that holds the marker reaches further than its fringe, so that other things may be joined to it.
    const fn leaves_something_of(&self, whole: Region) -> bool {
        let own = self.centroid.bounds;
        whole.x + FRINGE_PX < own.x
            || whole.y + FRINGE_PX < own.y
            || whole.x + whole.width > own.x + own.width + FRINGE_PX
            || whole.y + whole.height > own.y + own.height + FRINGE_PX
    }
}

/// How far a marker without neighbours reaches beyond half its height, px: blur, and colour that is sampled at half the rate.
const FRINGE_PX: u32 = 4;

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
    /// What is above half their heights of the markers, one after the other.
    cores: Vec<Run>,
    bench: Bench,
}

impl Search {
    /// The markers, in the order in which they were found; `refuse` hears of what is none.
    pub(super) fn markers(
        &mut self,
        picture: &Picture<'_>,
        options: &BlobOptions,
        mut refuse: impl FnMut(Refused),
    ) -> &mut [Marker] {
        let Self { markers, windows, again, tiles, labeling, largest, cores, bench } = self;
        markers.clear();
        cores.clear();
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
                    let is_taken = |marker: &Marker| marker.is_one_with(runs, whole, cores);
                    if let Some(marker) = markers.iter().find(|marker| is_taken(marker)) {
                        if marker.leaves_something_of(whole) {
                            again.push(whole);
                        }
                        continue;
                    }
                    if tiles.cut(whole) {
                        again.push(whole);
                        continue;
                    }
                    examined += 1;
                    match examine(picture, runs, threshold, options, bench) {
                        Verdict::Marker(centroid, moments) => {
                            let core = cores.len()..cores.len() + bench.core.len();
                            cores.extend_from_slice(&bench.core);
                            let marker = Marker { number: markers.len(), centroid, moments, core };
                            if marker.leaves_something_of(whole) {
                                again.push(whole);
                            }
                            markers.push(marker);
                        }
                        Verdict::LookHigher(_) if next_level(level, options) < f64::from(peak(picture, runs)) => {
                            again.push(whole);
                        }
                        Verdict::LookHigher(reason) | Verdict::Refused(reason) => refuse(refused(runs, whole, reason)),
                    }
                }
            }
            merge(again, windows);
            level = next_level(level, options);
        }
        markers
    }
}

/// So that no blob that stands out enough lies between two levels.
fn next_level(level: f64, options: &BlobOptions) -> f64 {
    level + (level * (LEVEL_RATIO - 1.0)).min(options.min_contrast.max(LEAST_STEP))
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
