//! Whole things: parts of the frame that stand out from quiet surroundings, joined where they are near each other.
//!
//! A large thing has many peaks, bright and dark, at several levels. Its edges hang together, and around them is nothing; so it is
//! found as one piece of a coarse map of what stands out. A mast hangs together with the ground it stands on.

use multiversion::multiversion;

use super::cells::{Cells, SIDE};
use super::level::Level;

/// Side of a square of the map, px of the frame.
pub const SQUARE: usize = 4;
/// Levels that count: edges of a large thing are sharp, those of clouds are not.
const LEVELS: usize = 3;
/// Contrast over clutter of what belongs to a thing, and of its strongest part.
const RATIOS: [f32; 2] = [3.0, 4.5];

/// A piece of the map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Piece {
    /// First column and row, and one past the last, squares.
    pub bounds: [usize; 4],
    /// Squares.
    pub squares: u32,
    /// Sums of columns and rows.
    pub sums: [f32; 2],
    /// Sums of their squares and products.
    pub moments: [f32; 3],
    /// Largest contrast over clutter.
    pub ratio: f32,
    /// Its squares farthest left, up, right and down.
    pub ends: [[usize; 2]; 4],
}

/// The map and its pieces; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Silhouettes {
    /// Squares in a row.
    pub columns: usize,
    /// Rows of squares.
    pub rows: usize,
    /// Contrast over clutter of each square, the most of all levels.
    pub map: Vec<f32>,
    lines: Vec<u16>,
    pooled: Vec<u16>,
    scales: Vec<f32>,
    wide: Vec<bool>,
    labels: Vec<u32>,
    parents: Vec<u32>,
    pieces: Vec<Piece>,
    /// Those that stand out enough.
    pub found: Vec<Piece>,
}

impl Silhouettes {
    /// The pieces of a frame.
    pub fn take(&mut self, levels: &[Level], cells: &[Cells], floor: f32) {
        let Some(frame) = levels.first() else { return };
        (self.columns, self.rows) = (frame.width / SQUARE, frame.height / SQUARE);
        self.map.clear();
        self.map.resize(self.columns * self.rows, 0.0);
        for (index, level) in levels.iter().enumerate().take(LEVELS) {
            self.raise(level, index, cells, floor);
        }
        self.join();
    }

    /// Raises the map to the contrast of a level over the least clutter of that level and those above it: the surroundings of a fine
    /// level are narrow, and may be the thing itself.
    fn raise(&mut self, level: &Level, index: usize, cells: &[Cells], floor: f32) {
        let side = SQUARE >> index;
        let span = (SIDE << index) / SQUARE;
        self.lines.resize(level.width, 0);
        self.pooled.resize(level.width / side, 0);
        for row in 0..self.rows {
            let y = row * side;
            // One for each cell, and the next row of cells has its own.
            if y.is_multiple_of(SIDE) {
                let clutter =
                    |x: usize, above: usize| cells[above].clutter_at(x >> (above - index), y >> (above - index));
                let least =
                    |x| (index..cells.len().min(LEVELS + 1)).map(|above| clutter(x, above)).fold(f32::MAX, f32::min);
                self.scales.clear();
                self.scales.extend((0..self.columns.div_ceil(span)).map(|block| 1.0 / (least(block * SIDE) + floor)));
            }
            self.lines.fill(0);
            for line in y..y + side {
                if let Some(contrast) = level.contrast.get(line * level.width..) {
                    raise_lines(&mut self.lines, &contrast[..level.width.min(contrast.len())]);
                }
            }
            pool(&self.lines, &mut self.pooled, side);
            let blocks = self.map[row * self.columns..][..self.columns].chunks_mut(span).zip(self.pooled.chunks(span));
            for ((ratios, most), scale) in blocks.zip(&self.scales) {
                for (ratio, most) in ratios.iter_mut().zip(most) {
                    *ratio = ratio.max(f32::from(*most) * scale);
                }
            }
        }
    }

    /// Squares that stand out hang together if at most one lies between them.
    fn join(&mut self) {
        let (columns, rows) = (self.columns, self.rows);
        self.wide.clear();
        self.wide.resize(columns * rows, false);
        for row in 0..rows {
            for (column, ratio) in self.map[row * columns..][..columns].iter().enumerate() {
                if *ratio > RATIOS[0] {
                    let (left, right) = (column.saturating_sub(1), (column + 2).min(columns));
                    for line in row.saturating_sub(1)..(row + 2).min(rows) {
                        self.wide[line * columns + left..line * columns + right].fill(true);
                    }
                }
            }
        }
        self.labels.clear();
        self.labels.resize(columns * rows, u32::MAX);
        self.parents.clear();
        for row in 0..rows {
            if !self.wide[row * columns..][..columns].contains(&true) {
                continue;
            }
            for column in 0..columns {
                let at = row * columns + column;
                if !self.wide[at] {
                    continue;
                }
                let left = if column > 0 { self.labels[at - 1] } else { u32::MAX };
                let above = if row > 0 { self.labels[at - columns] } else { u32::MAX };
                self.labels[at] = match (left, above) {
                    (u32::MAX, u32::MAX) => {
                        #[expect(clippy::cast_possible_truncation, reason = "fewer labels than squares")]
                        let label = self.parents.len() as u32;
                        self.parents.push(label);
                        label
                    }
                    (u32::MAX, label) | (label, u32::MAX) => label,
                    (a, b) => {
                        let (a, b) = (root(&mut self.parents, a), root(&mut self.parents, b));
                        self.parents[a.max(b) as usize] = a.min(b);
                        a.min(b)
                    }
                };
            }
        }
        self.pieces.clear();
        self.pieces.resize(self.parents.len(), Piece::default());
        for row in 0..rows {
            for (column, &ratio) in self.map[row * columns..][..columns].iter().enumerate() {
                if ratio > RATIOS[0] {
                    let label = root(&mut self.parents, self.labels[row * columns + column]);
                    self.pieces[label as usize].add(column, row, ratio);
                }
            }
        }
        self.found.clear();
        self.found.extend(self.pieces.iter().filter(|piece| piece.ratio > RATIOS[1]));
    }

    /// Mean and largest of the map in a frame around bounds, two to three squares and a quarter of the piece away.
    #[must_use]
    pub fn around(&self, [left, top, right, bottom]: [usize; 4]) -> [f32; 2] {
        let (across, down) = ((right - left) / 4 + 3, (bottom - top) / 4 + 3);
        let (from, to) = (left.saturating_sub(across), (right + across).min(self.columns));
        let (first, last) = (top.saturating_sub(down), (bottom + down).min(self.rows));
        let (mut sum, mut most, mut count) = (0.0, 0.0_f32, 0.0_f32);
        for row in first..last {
            let is_inside = row + 1 >= top && row < bottom + 1;
            for column in from..to {
                if is_inside && column + 1 >= left && column < right + 1 {
                    continue;
                }
                let ratio = self.map[row * self.columns + column];
                sum += ratio;
                most = most.max(ratio);
                count += 1.0;
            }
        }
        [sum / count.max(1.0), most]
    }
}

impl Piece {
    fn add(&mut self, column: usize, row: usize, ratio: f32) {
        let here = [column, row];
        if self.squares == 0 {
            self.ends = [here; 4];
        }
        let [left, top, right, bottom] = &mut self.ends;
        if column < left[0] {
            *left = here;
        }
        if row < top[1] {
            *top = here;
        }
        if column > right[0] {
            *right = here;
        }
        if row >= bottom[1] {
            *bottom = here;
        }
        self.bounds = if self.squares == 0 {
            [column, row, column + 1, row + 1]
        } else {
            let [left, top, right, bottom] = self.bounds;
            [left.min(column), top.min(row), right.max(column + 1), bottom.max(row + 1)]
        };
        let (u, v) = (column as f32, row as f32);
        self.squares += 1;
        self.sums = [self.sums[0] + u, self.sums[1] + v];
        self.moments = [self.moments[0] + u * u, self.moments[1] + u * v, self.moments[2] + v * v];
        self.ratio = self.ratio.max(ratio);
    }

    /// Both ends of a line, squares.
    #[must_use]
    pub fn line_ends(&self) -> [[usize; 2]; 2] {
        let [left, top, right, bottom] = self.bounds;
        if right - left >= bottom - top { [self.ends[0], self.ends[2]] } else { [self.ends[1], self.ends[3]] }
    }

    /// Mean position, squares.
    #[must_use]
    pub fn place(&self) -> [f32; 2] {
        self.sums.map(|sum| sum / self.squares.max(1) as f32)
    }

    /// Whether it is a line: a mast, a wire, a contrail.
    #[must_use]
    pub fn is_line(&self) -> bool {
        let [left, top, right, bottom] = self.bounds;
        (right - left).max(bottom - top) > 12 && self.elongation() > 5.0
    }

    /// Length over width of the ellipse of the same moments.
    #[must_use]
    pub fn elongation(&self) -> f32 {
        let count = self.squares.max(1) as f32;
        let [u, v] = self.place();
        // A square has a twelfth of its own.
        let (xx, yy) = (self.moments[0] / count - u * u + 1.0 / 12.0, self.moments[2] / count - v * v + 1.0 / 12.0);
        let xy = self.moments[1] / count - u * v;
        let (mean, root) = (0.5 * (xx + yy), (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt());
        ((mean + root) / (mean - root).max(1.0 / 12.0)).sqrt()
    }
}

fn root(parents: &mut [u32], mut label: u32) -> u32 {
    while parents[label as usize] != label {
        let parent = parents[label as usize];
        parents[label as usize] = parents[parent as usize];
        label = parents[label as usize];
    }
    label
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn raise_lines(most: &mut [u16], contrast: &[i16]) {
    for (most, contrast) in most.iter_mut().zip(contrast) {
        *most = (*most).max(contrast.unsigned_abs());
    }
}

/// The most of every `side` values.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn pool(values: &[u16], most: &mut [u16], side: usize) {
    match side {
        4 => {
            for (most, [a, b, c, d]) in most.iter_mut().zip(values.as_chunks::<4>().0) {
                *most = (*a).max(*b).max((*c).max(*d));
            }
        }
        2 => {
            for (most, [a, b]) in most.iter_mut().zip(values.as_chunks::<2>().0) {
                *most = (*a).max(*b);
            }
        }
        _ => most.copy_from_slice(&values[..most.len()]),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use rand::RngExt;

    use super::*;
    use crate::random;

    /// Pieces by filling: squares belong together if at most one lies between them.
    fn slow(map: &[f32], columns: usize, rows: usize) -> BTreeSet<Vec<(usize, usize)>> {
        let mut left: BTreeSet<(usize, usize)> = (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (column, row)))
            .filter(|(column, row)| map[row * columns + column] > RATIOS[0])
            .collect();
        let mut pieces = BTreeSet::new();
        while let Some(first) = left.pop_first() {
            let (mut piece, mut open) = (vec![first], vec![first]);
            while let Some((x, y)) = open.pop() {
                // Their surroundings of 3 by 3 overlap or touch side by side.
                let near: Vec<_> = left
                    .iter()
                    .copied()
                    .filter(|(u, v)| {
                        let (across, down) = (x.abs_diff(*u), y.abs_diff(*v));
                        across.max(down) <= 3 && across.min(down) <= 2
                    })
                    .collect();
                for place in near {
                    left.remove(&place);
                    piece.push(place);
                    open.push(place);
                }
            }
            piece.sort_unstable();
            pieces.insert(piece);
        }
        pieces
    }

    #[test]
    fn what_is_pooled_is_the_most_of_every_few() {
        let mut rng = random::named("pooled");
        let values: Vec<u16> = (0..157).map(|_| rng.random()).collect();
        for side in [1, 2, SQUARE] {
            let mut found = vec![0; values.len() / side];
            pool(&values, &mut found, side);
            let most: Vec<u16> = values.chunks_exact(side).map(|few| few.iter().copied().fold(0, u16::max)).collect();
            assert_eq!(found, most, "{side}");
        }
    }

    #[test]
    fn pieces_are_those_of_filling() {
        let mut rng = random::named("silhouettes");
        for share in [0.01, 0.03, 0.08] {
            let mut found = Silhouettes { columns: 40, rows: 30, ..Silhouettes::default() };
            found.map = (0..40 * 30).map(|_| if rng.random::<f64>() < share { 9.0 } else { 1.0 }).collect();
            found.join();
            let slow = slow(&found.map, 40, 30);
            assert_eq!(found.found.len(), slow.len());
            let mut sizes: BTreeMap<(usize, usize, u32), i32> = BTreeMap::new();
            for piece in &found.found {
                *sizes.entry((piece.bounds[0], piece.bounds[1], piece.squares)).or_default() += 1;
            }
            for piece in &slow {
                let left = piece.iter().map(|place| place.0).min().expect("some");
                let top = piece.iter().map(|place| place.1).min().expect("some");
                let count = u32::try_from(piece.len()).expect("few");
                *sizes.entry((left, top, count)).or_default() -= 1;
            }
            assert!(sizes.values().all(|count| *count == 0), "{sizes:?}");
        }
    }
}
