//! What is around a thing: what moves there, what is below and above, and the border of the frame.

use super::{Finder, MOVING_FLOOR, Shown};
use crate::detect::sky::cells::SIDE;
use crate::detect::sky::level::STEPS;
use crate::detect::sky::{single, whole};

/// What is so near the border of the frame may be only a part of something, px.
const BORDER_PX: f64 = 8.0;

impl Finder {
    /// How much the most of what moves in the bounds stands out from what moves around, natural logarithm.
    pub(super) fn moving_in(&self, bounds: [f64; 4], shown: Shown<'_>) -> f32 {
        shown.moving.map_or(0.0, |map| {
            let scale = f64::from(1_u32 << shown.moving_level);
            let [left, top, right, bottom] = bounds.map(|along| whole(along / scale));
            let wide = &shown.levels[shown.moving_level];
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
    pub(super) fn foot(&self, [left, _, right, bottom]: [f64; 4]) -> f32 {
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
    pub(super) fn above_ln(&self, [left, top, right, _]: [f64; 4]) -> f32 {
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

/// 1 where the bounds come near the border of the frame.
pub(super) fn cut([left, top, right, bottom]: [f64; 4], shown: Shown<'_>) -> f32 {
    let [width, height] = shown.size().map(|side| side as f64);
    let nearest = left.min(top).min(width - right).min(height - bottom);
    f32::from(u8::from(nearest < BORDER_PX))
}

/// Height over width, natural logarithm.
pub(super) fn upright_ln([left, top, right, bottom]: [f64; 4]) -> f32 {
    single(((bottom - top + 1.0) / (right - left + 1.0)).ln())
}
