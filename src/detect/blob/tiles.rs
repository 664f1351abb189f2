//! Which parts of a picture are worth a search at a level: those that hold something, and are not all texture.

use fearless_simd::dispatch;
use fearless_simd::prelude::*;

use super::Picture;
use crate::detect::{MACHINE, bits};
use crate::frame::Region;

/// Side of a tile, px.
const SIDE: usize = bits::SAMPLES;

/// Beginnings of runs, of 4096 pixels, above which a tile is texture at this level. Six markers of ten rows each have 60.
const MAX_STARTS: u32 = 128;

/// Pixels for each beginning of a run that a search takes at a level: beyond that, the tiles that hold the most wait.
const PIXELS_A_START: usize = 512;
/// And what is always taken.
const FREE_STARTS: u32 = 768;

/// What a tile holds at a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tile {
    Empty,
    Open,
    Busy,
}

/// A window cut into tiles, one after the other in the same memory.
#[derive(Default)]
pub(super) struct Tiles {
    window: Region,
    columns: usize,
    kinds: Vec<Tile>,
    /// Beginnings of runs of each tile.
    starts: Vec<u32>,
    open: Vec<Region>,
}

impl Tiles {
    /// Looks at the tiles of `window` at a level.
    pub(super) fn look(&mut self, picture: &Picture<'_>, window: Region, threshold: u8) {
        let width = window.width as usize;
        self.window = window;
        self.columns = width.div_ceil(SIDE);
        let row = |y: u32| {
            let start = y as usize * picture.width as usize + window.x as usize;
            &picture.score[start..start + width]
        };
        self.starts.clear();
        self.starts.resize(self.columns * (window.height as usize).div_ceil(SIDE), 0);
        let tops = (window.y..window.y + window.height).step_by(SIDE);
        for (top, starts) in tops.zip(self.starts.chunks_exact_mut(self.columns.max(1))) {
            for y in (top..window.y + window.height).take(SIDE) {
                count_starts(row(y), threshold, starts);
            }
        }
        let most = most_starts(&self.starts, window.area());
        let kind = |starts: &u32| match *starts {
            0 => Tile::Empty,
            starts if starts > most => Tile::Busy,
            _ => Tile::Open,
        };
        self.kinds.clear();
        self.kinds.extend(self.starts.iter().map(kind));
        self.open_what_runs_enter();
        let mut open = std::mem::take(&mut self.open);
        open.clear();
        open.extend(self.strips(Tile::Open));
        self.open = open;
    }

    /// A run may begin in one tile and end in the next, which has no beginning of its own: what stands right of an open tile is
    /// searched too.
    fn open_what_runs_enter(&mut self) {
        for row in self.kinds.chunks_exact_mut(self.columns.max(1)) {
            for at in 1..row.len() {
                if row[at] == Tile::Empty && row[at - 1] != Tile::Empty {
                    row[at] = Tile::Open;
                }
            }
        }
    }

    /// The tiles to be searched, joined along the rows.
    pub(super) fn open(&self) -> &[Region] {
        &self.open
    }

    /// The tiles that wait for a higher level, joined along the rows and with a margin, so that those that touch overlap.
    pub(super) fn busy(&self) -> impl Iterator<Item = Region> {
        self.strips(Tile::Busy).map(|strip| {
            let (x, y) = (strip.x.saturating_sub(1).max(self.window.x), strip.y.saturating_sub(1).max(self.window.y));
            let right = (strip.x + strip.width + 1).min(self.window.x + self.window.width);
            let bottom = (strip.y + strip.height + 1).min(self.window.y + self.window.height);
            Region { x, y, width: right - x, height: bottom - y }
        })
    }

    fn strips(&self, kind: Tile) -> impl Iterator<Item = Region> {
        let window = self.window;
        let rows = self.kinds.chunks_exact(self.columns.max(1)).zip((window.y..).step_by(SIDE));
        rows.flat_map(move |(row, top)| {
            let mut next = 0;
            row.chunk_by(|a, b| a == b).filter_map(move |same| {
                let at = next;
                next += same.len();
                let x = window.x + as_u32(at * SIDE);
                let right = (window.x + as_u32(next * SIDE)).min(window.x + window.width);
                let height = as_u32(SIDE).min(window.y + window.height - top);
                (same[0] == kind).then_some(Region { x, y: top, width: right - x, height })
            })
        })
    }

    /// Whether something with these bounds may go on in a tile that was left out.
    pub(super) fn cut(&self, bounds: Region) -> bool {
        let place = |at: u32, start: u32| at.saturating_sub(start) as usize / SIDE;
        let columns = place(bounds.x.saturating_sub(1), self.window.x)..=place(bounds.x + bounds.width, self.window.x);
        let mut rows =
            place(bounds.y.saturating_sub(1), self.window.y)..=place(bounds.y + bounds.height, self.window.y);
        rows.any(|row| {
            let tiles = self.kinds.get(row * self.columns..(row + 1) * self.columns).unwrap_or_default();
            columns.clone().any(|column| tiles.get(column) == Some(&Tile::Busy))
        })
    }
}

/// The most that a tile may hold, so that all that hold no more do not hold too much together.
fn most_starts(starts: &[u32], area: usize) -> u32 {
    let budget = FREE_STARTS + as_u32(area / PIXELS_A_START);
    let mut tiles_with = [0; MAX_STARTS as usize + 1];
    for starts in starts.iter().filter(|starts| **starts <= MAX_STARTS) {
        tiles_with[*starts as usize] += 1;
    }
    let mut sum = 0;
    let within = (0..).zip(tiles_with).take_while(|(starts, tiles)| {
        sum += starts * tiles;
        sum <= budget
    });
    within.last().map_or(0, |(starts, _)| starts)
}

#[expect(clippy::cast_possible_truncation, reason = "a frame counts its columns in u32")]
const fn as_u32(side: usize) -> u32 {
    side as u32
}

/// Adds to each tile the beginnings of runs in its part of a row.
fn count_starts(row: &[u8], threshold: u8, starts: &mut [u32]) {
    dispatch!(*MACHINE, simd => count_starts_by(simd, row, threshold, starts));
}

#[expect(clippy::inline_always, reason = "only inside its caller can it be compiled for its instructions")]
#[inline(always)]
fn count_starts_by<S: Simd>(simd: S, row: &[u8], threshold: u8, starts: &mut [u32]) {
    let mut last = 0;
    for (number, starts) in starts.iter_mut().enumerate() {
        let word = bits::at_least(simd, row, number, threshold);
        *starts += (word & !(word << 1 | last)).count_ones();
        last = word >> 63;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::components::{Components, Connectivity, Labeling};
    use crate::frame::Coding;

    fn tiles_of(score: &[u8], window: Region) -> Tiles {
        let coding = Coding::LOSSLESS;
        let mut tiles = Tiles::default();
        // Another window before leaves nothing behind.
        for window in [Region { x: 0, y: 0, width: 150, height: 140 }, window] {
            tiles.look(&Picture { score, width: 200, height: 150, coding, frame_area: 30_000.0 }, window, 10);
        }
        tiles
    }

    #[test]
    fn what_is_not_texture_is_found_as_in_the_whole() {
        let mut score = vec![0; 200 * 150];
        // A bar through three tiles, a dot on their border, and texture at the lower right.
        for x in 20..170 {
            score[30 * 200 + x] = 50;
        }
        score[64 * 200 + 64] = 99;
        for (y, x) in (80..140).flat_map(|y| (140..199).map(move |x| (y, x))) {
            score[y * 200 + x] = if (x + y) % 2 == 0 { 40 } else { 0 };
        }
        let window = Region { x: 3, y: 2, width: 197, height: 148 };
        let tiles = tiles_of(&score, window);
        assert!(tiles.busy().next().is_some());
        let mut labeling = Labeling::default();
        let found = labeling.within(&score, 200, tiles.open(), 10, Connectivity::Eight);
        let whole = Components::of(&score, 200, Region { height: 76, ..window }, 10, Connectivity::Eight);
        assert_eq!(found.iter().next(), whole.iter().next());
        assert_eq!(found.iter().nth(1), whole.iter().nth(1));
        assert!(tiles.cut(Region { x: 190, y: 100, width: 2, height: 2 }));
        assert!(tiles.cut(Region { x: 100, y: 100, width: 31, height: 2 }), "it touches");
        assert!(!tiles.cut(Region { x: 20, y: 30, width: 100, height: 1 }));
    }
}
