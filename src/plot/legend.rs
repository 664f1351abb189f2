//! The legend: below all panels, in as many rows as it takes.

use super::canvas::{Align, Canvas};
use super::style::Style;

const ROW_PX: f64 = 22.0;
const SAMPLE_PX: f64 = 34.0;
const TEXT_PX: f64 = 12.5;

/// Width of a letter on average, of the text's size: a guess on the safe side.
const LETTER_RATIO: f64 = 0.58;

/// Longer names are cut.
const MAX_LETTERS: usize = 80;

pub(super) struct Legend {
    /// Name, style and left end of each entry, row by row.
    rows: Vec<Vec<(String, Style, f64)>>,
}

impl Legend {
    pub(super) fn of(names: &[&str], width_px: f64) -> Self {
        let mut rows: Vec<Vec<(String, Style, f64)>> = Vec::new();
        let mut used = f64::INFINITY;
        for (index, name) in names.iter().enumerate() {
            let name: String = name.chars().take(MAX_LETTERS).collect();
            let needed = SAMPLE_PX + 30.0 + name.chars().count() as f64 * TEXT_PX * LETTER_RATIO;
            if used + needed > width_px {
                rows.push(Vec::new());
                used = 0.0;
            }
            if let Some(row) = rows.last_mut() {
                row.push((name, Style::of(index), used));
            }
            used += needed;
        }
        // Each row in the middle.
        for row in &mut rows {
            let end = row.last().map_or(0.0, |(name, _, left)| {
                left + SAMPLE_PX + 8.0 + name.chars().count() as f64 * TEXT_PX * LETTER_RATIO
            });
            for entry in row {
                entry.2 += 0.5 * (width_px - end).max(0.0);
            }
        }
        Self { rows }
    }

    pub(super) fn height_px(&self) -> f64 {
        if self.rows.is_empty() { 0.0 } else { self.rows.len() as f64 * ROW_PX + 6.0 }
    }

    pub(super) fn draw(&self, canvas: &mut Canvas, [left, top]: [f64; 2]) {
        for (number, row) in self.rows.iter().enumerate() {
            let y = top + (number as f64 + 0.5) * ROW_PX + 3.0;
            for (name, style, offset) in row {
                let x = left + offset;
                canvas.curve(vec![[x, y], [x + SAMPLE_PX, y]], style);
                canvas.mark([x + SAMPLE_PX / 2.0, y], style);
                canvas.text(name, [x + SAMPLE_PX + 7.0, y], TEXT_PX, Align::Start);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_its_place_within_the_width() {
        let names: Vec<String> = (0..30).map(|i| format!("series number {i}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let legend = Legend::of(&names, 400.0);
        assert_eq!(legend.rows.iter().map(Vec::len).sum::<usize>(), 30);
        for (name, _, left) in legend.rows.iter().flatten() {
            assert!(left + SAMPLE_PX + name.len() as f64 * TEXT_PX * LETTER_RATIO <= 400.0, "{name} at {left}");
        }
    }
}
