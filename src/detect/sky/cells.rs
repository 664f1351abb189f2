//! A map in cells of 8 by 8: how much there is in each, how much the strongest pixel has, and how restless it is around.

use multiversion::multiversion;

/// Side of a cell, px of its level.
pub const SIDE: usize = 8;

/// Sums and maxima of a map, and the clutter around each cell.
#[derive(Clone, Debug, Default)]
pub struct Cells {
    /// Cells in a row.
    pub columns: usize,
    /// Rows of cells.
    pub rows: usize,
    /// Mean of each cell.
    pub mean: Vec<f32>,
    /// Largest of each cell.
    pub most: Vec<u16>,
    /// Mean of the ring around each cell.
    pub clutter: Vec<f32>,
    /// Mean of the quietest of the four sides of that ring: beside a mast or over a roof the ring's mean is that of the mast or the roof.
    pub quiet: Vec<f32>,
    partial: Vec<f32>,
}

impl Cells {
    /// Of a map of absolute values; columns and rows that fill no cell are left out.
    pub fn take(&mut self, map: &[u16], width: usize, height: usize) {
        (self.columns, self.rows) = (width / SIDE, height / SIDE);
        let count = self.columns * self.rows;
        self.mean.resize(count, 0.0);
        self.most.resize(count, 0);
        for row in 0..self.rows {
            let lines = &map[row * SIDE * width..(row + 1) * SIDE * width];
            let at = row * self.columns..(row + 1) * self.columns;
            sum_up(lines, width, &mut self.mean[at.clone()], &mut self.most[at]);
        }
        self.ring();
    }

    /// Means of 7 by 7 cells less the middle 3 by 3, as far as they lie on the map: the target itself is not clutter.
    fn ring(&mut self) {
        let (columns, rows) = (self.columns, self.rows);
        self.clutter.clear();
        self.clutter.resize(columns * rows, 0.0);
        self.quiet.clear();
        self.quiet.resize(columns * rows, 0.0);
        if columns == 0 || rows == 0 {
            return;
        }
        // An integral with a row and a column of zeros before it.
        let stride = columns + 1;
        self.partial.clear();
        self.partial.resize(stride * (rows + 1), 0.0);
        for row in 0..rows {
            let mut line = 0.0;
            for column in 0..columns {
                line += self.mean[row * columns + column];
                self.partial[(row + 1) * stride + column + 1] = self.partial[row * stride + column + 1] + line;
            }
        }
        let partial = &self.partial;
        // Sum and number of the cells of a block, as far as they lie on the map.
        let block = |top: usize, bottom: usize, left: usize, right: usize| {
            let (bottom, right) = (bottom.min(rows), right.min(columns));
            if top >= bottom || left >= right {
                return (0.0, 0.0);
            }
            let total =
                partial[bottom * stride + right] - partial[top * stride + right] - partial[bottom * stride + left]
                    + partial[top * stride + left];
            (total, ((bottom - top) * (right - left)) as f32)
        };
        for row in 0..rows {
            let (top, bottom) = (row.saturating_sub(3), row + 4);
            for column in 0..columns {
                let (left, right) = (column.saturating_sub(3), column + 4);
                let (outer, all) = block(top, bottom, left, right);
                let (inner, middle) = block(row.saturating_sub(1), row + 2, column.saturating_sub(1), column + 2);
                let count = all - middle;
                let clutter = if count > 0.0 { ((outer - inner) / count).max(0.0) } else { outer / all };
                let sides = [
                    block(top, row.saturating_sub(1), left, right),
                    block(row + 2, bottom, left, right),
                    block(top, bottom, left, column.saturating_sub(1)),
                    block(top, bottom, column + 2, right),
                ];
                let quietest =
                    |least: f32, (sum, count): (f32, f32)| if count > 0.0 { least.min(sum / count) } else { least };
                self.clutter[row * columns + column] = clutter;
                self.quiet[row * columns + column] = sides.into_iter().fold(clutter, quietest).max(0.0);
            }
        }
    }

    /// Clutter at a pixel of the map.
    #[must_use]
    pub fn clutter_at(&self, x: usize, y: usize) -> f32 {
        self.clutter.get(self.index(x, y)).copied().unwrap_or(0.0)
    }

    /// Clutter at a pixel of the map, of the quietest side.
    #[must_use]
    pub fn quiet_at(&self, x: usize, y: usize) -> f32 {
        self.quiet.get(self.index(x, y)).copied().unwrap_or(0.0)
    }

    /// Mean of a pixel's cell.
    #[must_use]
    pub fn mean_at(&self, x: usize, y: usize) -> f32 {
        self.mean.get(self.index(x, y)).copied().unwrap_or(0.0)
    }

    fn index(&self, x: usize, y: usize) -> usize {
        let column = (x / SIDE).min(self.columns.saturating_sub(1));
        let row = (y / SIDE).min(self.rows.saturating_sub(1));
        row * self.columns + column
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1"))]
fn sum_up(lines: &[u16], width: usize, mean: &mut [f32], most: &mut [u16]) {
    for (cell, (mean, most)) in mean.iter_mut().zip(most).enumerate() {
        let mut sums = [0_u32; SIDE];
        let mut peaks = [0_u16; SIDE];
        for line in 0..SIDE {
            let Some(samples) = lines[line * width + cell * SIDE..].first_chunk::<SIDE>() else { continue };
            for i in 0..SIDE {
                sums[i] += u32::from(samples[i]);
                peaks[i] = peaks[i].max(samples[i]);
            }
        }
        *mean = sums.iter().sum::<u32>() as f32 / (SIDE * SIDE) as f32;
        *most = peaks.iter().copied().max().unwrap_or(0);
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::random;

    #[test]
    fn sums_and_rings_are_those_of_their_definition() {
        let mut rng = random::named("cells");
        for (width, height) in [(8, 8), (75, 60), (160, 90), (9, 7)] {
            let map: Vec<u16> = (0..width * height).map(|_| rng.random_range(0..32_640)).collect();
            let mut cells = Cells::default();
            cells.take(&map, width, height);
            let (columns, rows) = (width / SIDE, height / SIDE);
            assert_eq!([cells.columns, cells.rows], [columns, rows]);
            let inside = |column: usize, row: usize| {
                (0..SIDE * SIDE).map(move |i| (row * SIDE + i / SIDE) * width + column * SIDE + i % SIDE)
            };
            let mean = |column: usize, row: usize| {
                inside(column, row).map(|at| f64::from(map[at])).sum::<f64>() / (SIDE * SIDE) as f64
            };
            for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
                let at = row * columns + column;
                assert!((f64::from(cells.mean[at]) - mean(column, row)).abs() < 0.01);
                assert_eq!(Some(cells.most[at]), inside(column, row).map(|at| map[at]).max());
                let side = |within: &dyn Fn(isize, isize) -> bool| {
                    let away = |r: usize, c: usize| {
                        (r.cast_signed() - row.cast_signed(), c.cast_signed() - column.cast_signed())
                    };
                    let cells: Vec<f64> = (0..rows)
                        .flat_map(|r| (0..columns).map(move |c| (r, c)))
                        .filter(|(r, c)| {
                            let (down, across) = away(*r, *c);
                            down.abs().max(across.abs()) <= 3 && within(down, across)
                        })
                        .map(|(r, c)| mean(c, r))
                        .collect();
                    cells.iter().sum::<f64>() / cells.len() as f64
                };
                let sides = [
                    side(&|down, _| down <= -2),
                    side(&|down, _| down >= 2),
                    side(&|_, across| across <= -2),
                    side(&|_, across| across >= 2),
                    f64::from(cells.clutter[at]),
                ];
                // A side that is not on the map is no number, and no least.
                let quiet = sides.into_iter().fold(f64::INFINITY, f64::min);
                assert!(
                    (f64::from(cells.quiet[at]) - quiet).abs() < 2e-3 * quiet.max(1.0),
                    "{} {quiet}",
                    cells.quiet[at]
                );
                let ring: Vec<f64> = (0..rows)
                    .flat_map(|r| (0..columns).map(move |c| (r, c)))
                    .filter(|(r, c)| (2..=3).contains(&r.abs_diff(row).max(c.abs_diff(column))))
                    .map(|(r, c)| mean(c, r))
                    .collect();
                if !ring.is_empty() {
                    let clutter = ring.iter().sum::<f64>() / ring.len() as f64;
                    // An integral in single precision.
                    assert!((f64::from(cells.clutter[at]) / clutter - 1.0).abs() < 1e-3);
                }
            }
        }
    }
}
