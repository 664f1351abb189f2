//! Where in one frame something may be: whole things, and peaks of contrast and of what moves over clutter, at any level.

use super::candidate::{Candidate, Cues};
use super::cells::{Cells, SIDE};
use super::level::{Level, STEPS};
use super::outline::outline;
use super::silhouette::{Piece, SQUARE, Silhouettes};
use super::{single, whole};

/// A peak of a level.
#[derive(Clone, Copy, Debug)]
struct Peak {
    level: usize,
    cell: usize,
    is_moving: bool,
    ratio: f32,
}

/// Contrast that is nothing yet: noise of a third of a gray level.
const FLOOR: f32 = 0.35 * STEPS;
/// A change that is nothing yet.
const MOVING_FLOOR: f32 = 0.25 * STEPS;
/// A peak stands out from its surroundings by this at least.
const LEAST_RATIO: f32 = 2.5;
/// Peaks looked at in a frame, of contrast and of what moves.
const MOST_PEAKS: [usize; 2] = [96, 64];
/// Candidates of a frame.
pub const MOST_CANDIDATES: usize = 72;

/// Finds candidates; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Finder {
    peaks: [Vec<Peak>; 2],
    map: Vec<u16>,
    raw: Vec<(f32, Candidate)>,
    /// Cells of each level's contrast.
    pub cells: Vec<Cells>,
    moving_cells: Cells,
    /// Whole things.
    pub silhouettes: Silhouettes,
}

impl Finder {
    /// Sums up the contrast of each level.
    pub fn take(&mut self, levels: &[Level]) {
        self.cells.resize_with(levels.len(), Cells::default);
        for (cells, level) in self.cells.iter_mut().zip(levels) {
            self.map.clear();
            self.map.extend(level.contrast.iter().map(|contrast| contrast.unsigned_abs()));
            cells.take(&self.map, level.width, level.height);
        }
        self.silhouettes.take(levels, &self.cells, FLOOR);
    }

    /// The candidates, the best first. `moving` is the map of level `moving_level`, if it is known.
    pub fn find(&mut self, levels: &[Level], moving: Option<&[u16]>, moving_level: usize, found: &mut Vec<Candidate>) {
        found.clear();
        let [still, moved] = &mut self.peaks;
        still.clear();
        moved.clear();
        for (index, cells) in self.cells.iter().enumerate() {
            push_peaks(cells, index, FLOOR, false, still);
        }
        if let Some(map) = moving {
            let level = &levels[moving_level];
            self.moving_cells.take(map, level.width, level.height);
            push_peaks(&self.moving_cells, moving_level, MOVING_FLOOR, true, moved);
        }
        for (peaks, most) in self.peaks.iter_mut().zip(MOST_PEAKS) {
            if peaks.len() > most {
                peaks.select_nth_unstable_by(most, |a, b| b.ratio.total_cmp(&a.ratio));
                peaks.truncate(most);
            }
        }
        self.raw.clear();
        found.clear();
        for piece in &self.silhouettes.found {
            if let Some(candidate) = self.whole(piece, levels, moving, moving_level) {
                self.raw.push((candidate.cues.contrast_ln + 0.7 * candidate.cues.moving_ln, candidate));
            }
        }
        self.raw.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        found.extend(self.raw.iter().take(MOST_CANDIDATES / 2).map(|(_, candidate)| *candidate));
        self.raw.clear();
        for peak in self.peaks.iter().flatten() {
            let level = &levels[peak.level];
            let map = moving.filter(|_| peak.is_moving);
            let Some((x, y)) = place_of(peak, level, &self.cells[peak.level], map) else { continue };
            let Some(candidate) = self.candidate(levels, peak.level, x, y, moving, moving_level) else { continue };
            let cues = &candidate.cues;
            let strength = cues.contrast_ln + 0.7 * cues.moving_ln - 1.5 * cues.openness.min(1.2) - cues.goes_on;
            self.raw.push((strength, candidate));
        }
        self.raw.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        for (_, candidate) in &self.raw {
            if found.len() == MOST_CANDIDATES {
                break;
            }
            let is_known = found.iter().any(|known| {
                known.holds(candidate.place)
                    || (known.cues.goes_on > 0.0 || known.area_px < 4.0 * candidate.area_px)
                        && candidate.holds(known.place)
            });
            if !is_known {
                found.push(*candidate);
            }
        }
    }

    fn candidate(
        &self,
        levels: &[Level],
        index: usize,
        x: usize,
        y: usize,
        moving: Option<&[u16]>,
        moving_level: usize,
    ) -> Option<Candidate> {
        let level = &levels[index];
        let outline = outline(level, x, y)?;
        let scale = f64::from(1_u32 << index);
        let place = outline.place.map(|along| (f64::from(along) + 0.5) * scale - 0.5);
        let bounds = outline.bounds.map(|along| along as f64 * scale);
        let contrast = f32::from(level.contrast[y * level.width + x].unsigned_abs());
        let clutter = self.cells[index].clutter_at(x, y);
        let moving_ln = self.moving_in(bounds, levels, moving, moving_level);
        let above_ln = self.above_ln(bounds);
        Some(Candidate {
            place,
            bounds,
            area_px: f64::from(outline.area) * scale * scale,
            is_bright: outline.contrast > 0.0,
            cues: Cues {
                contrast_ln: (contrast / (clutter + FLOOR)).max(0.1).ln(),
                moving_ln,
                size_ln: (outline.area.sqrt() * single(scale)).ln(),
                openness: outline.openness,
                unrest: outline.unrest,
                upright_ln: upright_ln(bounds),
                above_ln,
                goes_on: 1.0,
                foot: self.foot(bounds) / contrast.max(FLOOR),
            },
        })
    }

    /// A piece as a candidate, if it is a thing of its own: within the frame, and no line.
    fn whole(&self, piece: &Piece, levels: &[Level], moving: Option<&[u16]>, moving_level: usize) -> Option<Candidate> {
        let [left, top, right, bottom] = piece.bounds;
        let map = &self.silhouettes;
        let touches = left == 0 || top == 0 || right >= map.columns || bottom >= map.rows;
        let (across, down) = (right - left, bottom - top);
        let elongation = piece.elongation();
        let is_line = elongation > 5.0 && across.max(down) > 12;
        let is_huge = across > map.columns * 2 / 3 || down > map.rows * 2 / 3;
        if is_line || is_huge || (touches && across.max(down) > 8) {
            return None;
        }
        let side = SQUARE as f64;
        let mut bounds = piece.bounds.map(|along| along as f64 * side);
        let mut place = piece.place().map(|along| (f64::from(along) + 0.5) * side - 0.5);
        let mut area_px = f64::from(piece.squares) * side * side;
        // The strongest pixel says whether it is bright, and outlines what is small.
        let index = if across.max(down) <= 4 { 0 } else { 1.min(levels.len() - 1) };
        let level = &levels[index];
        let mut best = (0, 0, 0);
        for y in ((top * SQUARE) >> index)..((bottom * SQUARE) >> index).min(level.height) {
            for x in ((left * SQUARE) >> index)..((right * SQUARE) >> index).min(level.width) {
                let contrast = level.contrast[y * level.width + x];
                if contrast.unsigned_abs() > best.0 {
                    best = (contrast.unsigned_abs(), x, y);
                }
            }
        }
        let (most, x, y) = best;
        let outline = outline(level, x, y);
        if let Some(outline) = outline.filter(|_| across.max(down) <= 4) {
            let scale = f64::from(1_u32 << index);
            place = outline.place.map(|along| (f64::from(along) + 0.5) * scale - 0.5);
            bounds = outline.bounds.map(|along| along as f64 * scale);
            area_px = f64::from(outline.area) * scale * scale;
        }
        let [mean, worst] = map.around(piece.bounds);
        let above_ln = self.above_ln(bounds);
        Some(Candidate {
            place,
            bounds,
            area_px,
            is_bright: level.contrast[y * level.width + x] > 0,
            cues: Cues {
                contrast_ln: piece.ratio.ln(),
                moving_ln: self.moving_in(bounds, levels, moving, moving_level),
                size_ln: 0.5 * single(area_px).ln(),
                openness: worst / piece.ratio,
                unrest: mean / piece.ratio,
                upright_ln: upright_ln(bounds),
                above_ln,
                goes_on: 0.0,
                foot: self.foot(bounds) / f32::from(most).max(FLOOR),
            },
        })
    }

    /// How much the most of what moves in the bounds stands out from what moves around, natural logarithm.
    fn moving_in(&self, bounds: [f64; 4], levels: &[Level], moving: Option<&[u16]>, moving_level: usize) -> f32 {
        moving.map_or(0.0, |map| {
            let [left, top, right, bottom] = bounds.map(|along| whole(along / f64::from(1_u32 << moving_level)));
            let wide = &levels[moving_level];
            let mut most = 0;
            for row in top..(bottom + 1).min(wide.height) {
                let line = &map[row * wide.width..][..wide.width];
                let run = &line[left.min(wide.width)..(right + 1).min(wide.width)];
                most = run.iter().copied().fold(most, u16::max);
            }
            let clutter = self.moving_cells.clutter_at(left.midpoint(right), top.midpoint(bottom));
            ((f32::from(most) + MOVING_FLOOR) / (clutter + MOVING_FLOOR)).ln().max(0.0)
        })
    }

    /// The most contrast in the 8 to 32 px below the bounds, within their columns.
    fn foot(&self, [left, _, right, bottom]: [f64; 4]) -> f32 {
        let cells = &self.cells[0];
        let side = SIDE as f64;
        let column = |x: f64| whole(x / side).min(cells.columns.saturating_sub(1));
        let first = whole(((bottom + 2.0) / side).ceil()).min(cells.rows);
        let mut most = 0;
        for row in first..(first + 3).min(cells.rows) {
            let run = row * cells.columns + column(left)..=row * cells.columns + column(right - 1.0);
            let run = cells.most.get(run).unwrap_or_default();
            most = run.iter().copied().fold(most, u16::max);
        }
        f32::from(most)
    }

    /// Mean contrast in the six cells above the bounds, gray levels, natural logarithm of one more.
    fn above_ln(&self, [left, top, right, _]: [f64; 4]) -> f32 {
        let index = 1.min(self.cells.len() - 1);
        let cells = &self.cells[index];
        let side = (SIDE << index) as f64;
        let last = cells.columns.saturating_sub(1);
        let (from, to) = (whole(left / side).min(last), whole(right / side).min(last));
        let end = whole(top / side - 1.0).min(cells.rows);
        let (mut sum, mut count) = (0.0, 0.0_f32);
        for row in end.saturating_sub(5)..end {
            let run = cells.mean.get(row * cells.columns + from..=row * cells.columns + to).unwrap_or_default();
            sum += run.iter().sum::<f32>();
            count += run.len() as f32;
        }
        (sum / count.max(1.0) / STEPS).ln_1p()
    }
}

fn upright_ln([left, top, right, bottom]: [f64; 4]) -> f32 {
    single(((bottom - top + 1.0) / (right - left + 1.0)).ln())
}

fn push_peaks(cells: &Cells, level: usize, floor: f32, is_moving: bool, peaks: &mut Vec<Peak>) {
    for (cell, (most, clutter)) in cells.most.iter().zip(&cells.clutter).enumerate() {
        let ratio = f32::from(*most) / (clutter + floor);
        if ratio > LEAST_RATIO {
            peaks.push(Peak { level, cell, is_moving, ratio });
        }
    }
}

/// Where in its cell the peak is; none if a neighbour outside is higher.
fn place_of(peak: &Peak, level: &Level, cells: &Cells, map: Option<&[u16]>) -> Option<(usize, usize)> {
    let (left, top) = (peak.cell % cells.columns * SIDE, peak.cell / cells.columns * SIDE);
    let value = |x: usize, y: usize| {
        let at = y * level.width + x;
        map.map_or_else(|| level.contrast[at].unsigned_abs(), |map| map[at])
    };
    let mut best = (value(left, top), left, top);
    for y in top..top + SIDE {
        for x in left..left + SIDE {
            if value(x, y) > best.0 {
                best = (value(x, y), x, y);
            }
        }
    }
    let (most, x, y) = best;
    let (right, bottom) = ((x + 1).min(level.width - 1), (y + 1).min(level.height - 1));
    for row in y.saturating_sub(1)..=bottom {
        for column in x.saturating_sub(1)..=right {
            if value(column, row) > most {
                return None;
            }
        }
    }
    Some((x, y))
}
