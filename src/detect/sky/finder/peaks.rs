//! Single peaks: what stands out at one level from what is around, at large or on its quietest side.
//!
//! Clutter on the quietest side is the smallest-of test for targets beside the edge of clutter (Trunk, "Range resolution of targets using
//! automatic detectors", IEEE T-AES 1978): beside a mast or over a roof the mean of all sides hides what stands in clear sky.

use super::around::{cut, upright_ln};
use super::{FLOOR, Finder, Shown};
use crate::detect::sky::candidate::{Candidate, Cues};
use crate::detect::sky::cells::{Cells, SIDE};
use crate::detect::sky::level::Level;
use crate::detect::sky::outline::outline;
use crate::detect::sky::track::Track;
use crate::detect::sky::{single, whole};

/// A peak stands out from its surroundings by this at least.
const LEAST_RATIO: f32 = 2.5;

/// A peak of a level.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peak {
    pub(super) level: usize,
    pub(super) cell: usize,
    pub(super) kind: Kind,
    pub(super) ratio: f32,
}

/// What a peak stands out from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The contrast all around.
    Still,
    /// What moves all around.
    Moving,
    /// The contrast on the quietest side.
    Beside,
}

impl Finder {
    /// A track's thing where the track expects it, if anything stands out there in its way.
    #[must_use]
    pub fn again(&self, shown: Shown<'_>, track: &Track) -> Option<Candidate> {
        let size = f64::from(track.seen.cues.size_ln).exp();
        let index = whole((size / 3.0).max(1.0).log2()).min(shown.levels.len() - 1);
        let (level, scale) = (&shown.levels[index], f64::from(1_u32 << index));
        let reach = (track.reach_px() / scale).clamp(1.0, 6.0);
        let [u, v] = track.place.map(|along| (along + 0.5) / scale - 0.5);
        let (left, right) = (whole(u - reach), whole(u + reach + 1.0).min(level.width));
        let (top, bottom) = (whole(v - reach), whole(v + reach + 1.0).min(level.height));
        let mut best = (0, 0, 0);
        for y in top..bottom {
            for x in left..right {
                let contrast = i32::from(level.contrast[y * level.width + x]);
                let contrast = if track.seen.is_bright { contrast } else { -contrast };
                if contrast > best.0 {
                    best = (contrast, x, y);
                }
            }
        }
        let (most, x, y) = best;
        let quiet = self.cells[index].quiet_at(x, y);
        if most as f32 <= LEAST_RATIO * (quiet + FLOOR) {
            return None;
        }
        self.candidate(shown, index, x, y)
    }

    /// The thing whose peak is at a place of a level.
    pub(super) fn candidate(&self, shown: Shown<'_>, index: usize, x: usize, y: usize) -> Option<Candidate> {
        let level = &shown.levels[index];
        let outline = outline(level, x, y)?;
        let scale = f64::from(1_u32 << index);
        let place = outline.place.map(|along| (f64::from(along) + 0.5) * scale - 0.5);
        let bounds = outline.bounds.map(|along| along as f64 * scale);
        let contrast = f32::from(level.contrast[y * level.width + x].unsigned_abs());
        let clutter = self.cells[index].clutter_at(x, y);
        let moving_ln = self.moving_in(bounds, shown);
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
                cut: cut(bounds, shown),
                foot: self.foot(bounds) / contrast.max(FLOOR),
                beside_ln: ((clutter + FLOOR) / (self.cells[index].quiet_at(x, y) + FLOOR)).ln(),
            },
        })
    }
}

/// The cells of a level whose peaks stand out from the clutter.
pub(super) fn push_peaks(cells: &Cells, clutter: &[f32], level: usize, floor: f32, kind: Kind, peaks: &mut Vec<Peak>) {
    for (cell, (most, clutter)) in cells.most.iter().zip(clutter).enumerate() {
        let ratio = f32::from(*most) / (clutter + floor);
        if ratio > LEAST_RATIO {
            peaks.push(Peak { level, cell, kind, ratio });
        }
    }
}

/// Where in its cell the peak is; none if a neighbour outside is higher.
pub(super) fn place_of(peak: &Peak, level: &Level, cells: &Cells, map: Option<&[u16]>) -> Option<(usize, usize)> {
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
