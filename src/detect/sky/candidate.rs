//! Places of one frame where something may be: peaks of contrast over clutter at any level, and of what moves over clutter.

use super::cells::{Cells, SIDE};
use super::level::{Level, STEPS};
use super::outline::outline;
use super::silhouette::{Piece, SQUARE, Silhouettes};

/// What one frame tells of a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cues {
    /// Contrast at the peak over the mean of its surroundings, natural logarithm.
    pub contrast_ln: f32,
    /// The same of what moves against the camera's own motion; 0 where that is not known.
    pub moving_ln: f32,
    /// Contrast in gray levels, natural logarithm.
    pub height_ln: f32,
    /// Square root of the area in px of the frame, natural logarithm.
    pub size_ln: f32,
    /// How much goes on beyond its outline in the worst direction, of its contrast.
    pub openness: f32,
    /// How restless the ring around it is, of its contrast.
    pub unrest: f32,
    /// Height over width, natural logarithm: what stands is taller, what flies is wider.
    pub upright_ln: f32,
    /// Others near it, each counted as far as it stands out as much.
    pub crowd: f32,
    /// Contrast above it in the frame, mean, gray levels, natural logarithm of one more.
    pub above_ln: f32,
    /// Contrast below it in the frame.
    pub below_ln: f32,
    /// 1 where it goes on beyond the window in which it was looked at.
    pub goes_on: f32,
    /// Largest contrast right below it, of its own contrast: what stands on the ground has a foot.
    pub foot: f32,
}

impl Cues {
    /// Every cue.
    #[must_use]
    pub const fn numbers(&self) -> [f32; 12] {
        [
            self.contrast_ln,
            self.moving_ln,
            self.height_ln,
            self.size_ln,
            self.openness,
            self.unrest,
            self.upright_ln,
            self.crowd,
            self.above_ln,
            self.below_ln,
            self.goes_on,
            self.foot,
        ]
    }

    /// Of every cue.
    #[must_use]
    pub const fn of_numbers(numbers: [f32; 12]) -> Self {
        let [
            contrast_ln,
            moving_ln,
            height_ln,
            size_ln,
            openness,
            unrest,
            upright_ln,
            crowd,
            above_ln,
            below_ln,
            goes_on,
            foot,
        ] = numbers;
        Self {
            contrast_ln,
            moving_ln,
            height_ln,
            size_ln,
            openness,
            unrest,
            upright_ln,
            crowd,
            above_ln,
            below_ln,
            goes_on,
            foot,
        }
    }
}

/// A place of one frame where something may be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Candidate {
    /// Its centre, px of the frame.
    pub place: [f64; 2],
    /// Left, top, right, bottom, px of the frame; the last two are one past.
    pub bounds: [f64; 4],
    /// Area, px of the frame.
    pub area_px: f64,
    /// Whether it is brighter than its background.
    pub is_bright: bool,
    /// What speaks for and against it.
    pub cues: Cues,
}

impl Candidate {
    /// Whether a place lies in its bounds, grown by a fifth and a pixel.
    #[must_use]
    pub fn holds(&self, place: [f64; 2]) -> bool {
        let [left, top, right, bottom] = self.bounds;
        let (margin_x, margin_y) = (0.2 * (right - left) + 1.0, 0.2 * (bottom - top) + 1.0);
        place[0] >= left - margin_x
            && place[0] < right + margin_x
            && place[1] >= top - margin_y
            && place[1] < bottom + margin_y
    }
}

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
/// Others count as near within this, px.
const CROWD_REACH_PX: f64 = 64.0;

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
        self.raw.sort_by(|a, b| b.0.total_cmp(&a.0));
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
        self.raw.sort_by(|a, b| b.0.total_cmp(&a.0));
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
        for index in 0..found.len() {
            let here = found[index];
            let crowd = found.iter().enumerate().filter(|(other, _)| *other != index).map(|(_, other)| {
                let away = (other.place[0] - here.place[0]).hypot(other.place[1] - here.place[1]);
                let nearness = (2.0 - away / CROWD_REACH_PX).clamp(0.0, 1.0) as f32;
                nearness * (other.cues.contrast_ln - here.cues.contrast_ln).exp().min(1.0)
            });
            found[index].cues.crowd = crowd.sum();
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
        let (above_ln, below_ln) = self.above_and_below(bounds);
        Some(Candidate {
            place,
            bounds,
            area_px: f64::from(outline.area) * scale * scale,
            is_bright: outline.contrast > 0.0,
            cues: Cues {
                contrast_ln: (contrast / (clutter + FLOOR)).max(0.1).ln(),
                moving_ln,
                height_ln: (outline.contrast.abs() / STEPS).max(0.1).ln(),
                size_ln: (outline.area.sqrt() * scale as f32).ln(),
                openness: outline.openness,
                unrest: outline.unrest,
                upright_ln: upright_ln(bounds),
                crowd: 0.0,
                above_ln,
                below_ln,
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
        for y in (top * SQUARE >> index)..(bottom * SQUARE >> index).min(level.height) {
            for x in (left * SQUARE >> index)..(right * SQUARE >> index).min(level.width) {
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
        let (above_ln, below_ln) = self.above_and_below(bounds);
        Some(Candidate {
            place,
            bounds,
            area_px,
            is_bright: level.contrast[y * level.width + x] > 0,
            cues: Cues {
                contrast_ln: piece.ratio.ln(),
                moving_ln: self.moving_in(bounds, levels, moving, moving_level),
                height_ln: (f32::from(most) / STEPS).max(0.1).ln(),
                size_ln: 0.5 * (area_px as f32).ln(),
                openness: worst / piece.ratio,
                unrest: mean / piece.ratio,
                upright_ln: upright_ln(bounds),
                crowd: 0.0,
                above_ln,
                below_ln,
                goes_on: 0.0,
                foot: self.foot(bounds) / f32::from(most).max(FLOOR),
            },
        })
    }

    /// How much the most of what moves in the bounds stands out from what moves around, natural logarithm.
    fn moving_in(&self, bounds: [f64; 4], levels: &[Level], moving: Option<&[u16]>, moving_level: usize) -> f32 {
        moving.map_or(0.0, |map| {
            let [left, top, right, bottom] =
                bounds.map(|along| (along / f64::from(1_u32 << moving_level)).max(0.0) as usize);
            let wide = &levels[moving_level];
            let mut most = 0;
            for row in top..(bottom + 1).min(wide.height) {
                let line = &map[row * wide.width..][..wide.width];
                let run = &line[left.min(wide.width)..(right + 1).min(wide.width)];
                most = run.iter().copied().fold(most, u16::max);
            }
            let clutter = self.moving_cells.clutter_at((left + right) / 2, (top + bottom) / 2);
            ((f32::from(most) + MOVING_FLOOR) / (clutter + MOVING_FLOOR)).ln().max(0.0)
        })
    }

    /// The most contrast in the 8 to 32 px below the bounds, within their columns.
    fn foot(&self, [left, _, right, bottom]: [f64; 4]) -> f32 {
        let cells = &self.cells[0];
        let side = SIDE as f64;
        let column = |x: f64| (x / side).clamp(0.0, (cells.columns.max(1) - 1) as f64) as usize;
        let first = (((bottom + 2.0) / side).ceil().max(0.0) as usize).min(cells.rows);
        let mut most = 0;
        for row in first..(first + 3).min(cells.rows) {
            let run = &cells.most[row * cells.columns + column(left)..=row * cells.columns + column(right - 1.0)];
            most = run.iter().copied().fold(most, u16::max);
        }
        f32::from(most)
    }

    /// Contrast in the six cells above the bounds, and in those below.
    fn above_and_below(&self, [left, top, right, bottom]: [f64; 4]) -> (f32, f32) {
        let index = 1.min(self.cells.len() - 1);
        let cells = &self.cells[index];
        let side = (SIDE << index) as f64;
        let column = |x: f64| (x / side).clamp(0.0, (cells.columns.max(1) - 1) as f64) as usize;
        let (from, to) = (column(left), column(right));
        let mean = |first: i64, last: i64| {
            let (mut sum, mut count) = (0.0, 0.0_f32);
            for row in first.max(0)..last.min(cells.rows as i64) {
                for column in from..=to {
                    sum += cells.mean[row as usize * cells.columns + column];
                    count += 1.0;
                }
            }
            (sum / count.max(1.0) / STEPS).ln_1p()
        };
        let (top, bottom) = ((top / side).floor() as i64, (bottom / side).ceil() as i64);
        (mean(top - 6, top - 1), mean(bottom + 1, bottom + 6))
    }
}

fn upright_ln([left, top, right, bottom]: [f64; 4]) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "a ratio of sides")]
    let ratio = ((bottom - top + 1.0) / (right - left + 1.0)) as f32;
    ratio.ln()
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
