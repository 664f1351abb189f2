//! Where in one frame something may be: whole things, and peaks of contrast and of what moves over clutter, at any level.

mod around;
mod peaks;
mod wholes;

use super::candidate::Candidate;
use super::cells::Cells;
use super::level::{Level, STEPS};
use super::silhouette::Silhouettes;
use peaks::{Kind, Peak, place_of, push_peaks};

/// What a frame shows.
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    /// Its levels, the frame itself first.
    pub levels: &'a [Level],
    /// What moves against the camera's own motion, if that is known.
    pub moving: Option<&'a [u16]>,
    /// The level of that map.
    pub moving_level: usize,
}

/// Contrast that is nothing yet: noise of a third of a gray level.
const FLOOR: f32 = 0.35 * STEPS;
/// A change that is nothing yet.
const MOVING_FLOOR: f32 = 0.25 * STEPS;
/// How much may go on beyond the outline of what stands beside other things, of its contrast.
const MOST_OPEN: f32 = 0.5;
/// What has so much right below it stands on something.
const LEAST_FOOT: f32 = 0.5;
/// Peaks looked at in a frame, of contrast and of what moves.
const MOST_PEAKS: [usize; 3] = [96, 64, 64];
/// Candidates of a frame.
pub const MOST_CANDIDATES: usize = 72;

impl Shown<'_> {
    /// Width and height of the frame, px.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.levels.first().map_or([0; 2], |frame| [frame.width, frame.height])
    }
}

/// Finds candidates; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Finder {
    peaks: [Vec<Peak>; 3],
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

    /// The candidates, the best first.
    pub fn find(&mut self, shown: Shown<'_>, found: &mut Vec<Candidate>) {
        found.clear();
        let [still, moved, beside] = &mut self.peaks;
        still.clear();
        moved.clear();
        beside.clear();
        for (index, cells) in self.cells.iter().enumerate() {
            push_peaks(cells, &cells.clutter, index, FLOOR, Kind::Still, still);
            push_peaks(cells, &cells.quiet, index, FLOOR, Kind::Beside, beside);
        }
        if let Some(map) = shown.moving {
            let level = &shown.levels[shown.moving_level];
            self.moving_cells.take(map, level.width, level.height);
            push_peaks(
                &self.moving_cells,
                &self.moving_cells.clutter,
                shown.moving_level,
                MOVING_FLOOR,
                Kind::Moving,
                moved,
            );
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
            if let Some(candidate) = self.whole(piece, shown) {
                self.raw.push((candidate.cues.contrast_ln + 0.7 * candidate.cues.moving_ln, candidate));
            } else if piece.is_line() {
                let heads = piece.line_ends().map(|end| self.head(piece, end, shown));
                self.raw.extend(heads.into_iter().flatten().map(|head| (head.cues.contrast_ln, head)));
            }
        }
        self.raw.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        found.extend(self.raw.iter().take(MOST_CANDIDATES / 2).map(|(_, candidate)| *candidate));
        self.raw.clear();
        for peak in self.peaks.iter().flatten() {
            let level = &shown.levels[peak.level];
            let map = shown.moving.filter(|_| peak.kind == Kind::Moving);
            let Some((x, y)) = place_of(peak, level, &self.cells[peak.level], map) else { continue };
            let Some(candidate) = self.candidate(shown, peak.level, x, y) else { continue };
            let cues = &candidate.cues;
            // The edge of what it stands beside is no thing of its own.
            if peak.kind == Kind::Beside && cues.openness > MOST_OPEN {
                continue;
            }
            let strength = cues.contrast_ln + 0.7 * cues.moving_ln - 1.5 * cues.openness.min(1.2) - cues.goes_on;
            self.raw.push((strength, candidate));
        }
        self.raw.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        for (_, candidate) in &self.raw {
            if found.len() == MOST_CANDIDATES {
                break;
            }
            let is_apart = candidate.cues.openness < MOST_OPEN;
            let is_known = found.iter().any(|known| {
                // What stands on the ground may have something before it or beside it.
                if is_apart && known.cues.foot > LEAST_FOOT && known.area_px > 4.0 * candidate.area_px {
                    return false;
                }
                known.holds(candidate.place)
                    || (known.cues.goes_on > 0.0 || known.area_px < 4.0 * candidate.area_px)
                        && candidate.holds(known.place)
            });
            if !is_known {
                found.push(*candidate);
            }
        }
    }
}
