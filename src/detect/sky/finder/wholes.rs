//! Whole things: pieces that hang together in otherwise quiet sky, and the ends of lines.

use super::around::{cut, upright_ln};
use super::{FLOOR, Finder, Shown};
use crate::detect::sky::candidate::{Candidate, Cues};
use crate::detect::sky::outline::outline;
use crate::detect::sky::silhouette::{Piece, SQUARE};
use crate::detect::sky::{single, whole};

/// Half a side of the window around the end of a line, squares.
const HEAD: usize = 4;
/// How far from the end of a line its place is sought, squares.
const TIP: usize = 2;
/// What belongs to a line, contrast over clutter.
const LEAST_HEAD: f32 = 3.0;
/// Most squares of that window that belong to a line: it is narrow.
const WIDEST_HEAD: f32 = 30.0;

impl Finder {
    /// A piece as a candidate, if it is a thing of its own: within the frame, and no line.
    pub(super) fn whole(&self, piece: &Piece, shown: Shown<'_>) -> Option<Candidate> {
        let [left, top, right, bottom] = piece.bounds;
        let map = &self.silhouettes;
        let touches = left == 0 || top == 0 || right >= map.columns || bottom >= map.rows;
        let (across, down) = (right - left, bottom - top);
        let is_huge = across > map.columns * 2 / 3 || down > map.rows * 2 / 3;
        if piece.is_line() || is_huge || (touches && across.max(down) > 8) {
            return None;
        }
        let side = SQUARE as f64;
        let mut bounds = piece.bounds.map(|along| along as f64 * side);
        let mut place = piece.place().map(|along| (f64::from(along) + 0.5) * side - 0.5);
        let mut area_px = f64::from(piece.squares) * side * side;
        // The strongest pixel says whether it is bright, and outlines what is small.
        let index = if across.max(down) <= 4 { 0 } else { 1.min(shown.levels.len() - 1) };
        let level = &shown.levels[index];
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
                moving_ln: self.moving_in(bounds, shown),
                size_ln: 0.5 * single(area_px).ln(),
                openness: worst / piece.ratio,
                unrest: mean / piece.ratio,
                upright_ln: upright_ln(bounds),
                above_ln,
                goes_on: 0.0,
                foot: self.foot(bounds) / f32::from(most).max(FLOOR),
                beside_ln: ((self.cells[index].clutter_at(x, y) + FLOOR) / (self.cells[index].quiet_at(x, y) + FLOOR))
                    .ln(),
                cut: cut(bounds, shown),
            },
        })
    }

    /// The end of a line in otherwise empty sky: the head of a contrail. A mast has none.
    pub(super) fn head(&self, piece: &Piece, [column, row]: [usize; 2], shown: Shown<'_>) -> Option<Candidate> {
        let map = &self.silhouettes;
        let [left, top, right, bottom] = piece.bounds;
        let is_mast = bottom - top > 3 * (right - left);
        let is_inside = |along: usize, sides: usize| along >= HEAD && along + HEAD < sides;
        if is_mast || !is_inside(column, map.columns) || !is_inside(row, map.rows) {
            return None;
        }
        let (mut most, mut sums, mut tip, mut count) = (0.0_f32, [0.0_f32; 2], 0.0_f32, 0.0_f32);
        for y in row - HEAD..=row + HEAD {
            for x in column - HEAD..=column + HEAD {
                let ratio = map.map[y * map.columns + x];
                if ratio > LEAST_HEAD {
                    most = most.max(ratio);
                    count += 1.0;
                    if x.abs_diff(column).max(y.abs_diff(row)) <= TIP {
                        sums = [sums[0] + x as f32, sums[1] + y as f32];
                        tip += 1.0;
                    }
                }
            }
        }
        // A line is as narrow as a line.
        if tip == 0.0 || count > WIDEST_HEAD {
            return None;
        }
        let side = SQUARE as f64;
        let place = sums.map(|sum| (f64::from(sum / tip) + 0.5) * side - 0.5);
        let bounds = [column - HEAD, row - HEAD, column + HEAD + 1, row + HEAD + 1].map(|along| along as f64 * side);
        let [mean, _] = map.around([column - HEAD, row - HEAD, column + HEAD + 1, row + HEAD + 1]);
        let index = 1.min(shown.levels.len() - 1);
        let level = &shown.levels[index];
        let (x, y) =
            ((whole(place[0]) >> index).min(level.width - 1), (whole(place[1]) >> index).min(level.height - 1));
        let contrast = level.contrast[y * level.width + x];
        let area_px = f64::from(count) * side * side;
        Some(Candidate {
            place,
            bounds,
            area_px,
            is_bright: contrast > 0,
            cues: Cues {
                contrast_ln: most.ln(),
                moving_ln: self.moving_in(bounds, shown),
                size_ln: 0.5 * single(area_px).ln(),
                // Its line goes on.
                openness: 1.0,
                unrest: mean / most,
                upright_ln: upright_ln(piece.bounds.map(|along| along as f64 * side)),
                above_ln: self.above_ln(bounds),
                goes_on: 0.0,
                foot: self.foot(bounds) / f32::from(contrast.unsigned_abs()).max(FLOOR),
                beside_ln: 0.0,
                cut: cut(bounds, shown),
            },
        })
    }
}
