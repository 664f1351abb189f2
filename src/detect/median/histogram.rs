//! Medians by histograms of columns: constant time a pixel, however large the window.
//!
//! S. Perreault and P. Hébert, "Median filtering in constant time", IEEE Transactions on Image Processing 2007. Each column
//! has a histogram of the samples that the window sees in it; the window's own is their sum. It is kept at two scales: sixteen
//! levels of sixteen always, the fine ones only where the median is.

use super::Padded;

/// A column's counts: of sixteen ranges of sixteen levels, and of each level.
#[derive(Clone)]
struct Column {
    coarse: [u16; 16],
    fine: [[u16; 16]; 16],
}

/// What medians of pictures are made of.
#[derive(Default)]
pub(super) struct Histograms {
    columns: Vec<Column>,
    /// A padded row.
    row: Vec<u8>,
}

impl Histograms {
    pub(super) fn write(&mut self, padded: &Padded<'_>, out: &mut [u8]) {
        let window = padded.window;
        let Self { columns, row } = self;
        columns.clear();
        columns.resize(padded.width(), Column { coarse: [0; 16], fine: [[0; 16]; 16] });
        row.resize(padded.width(), 0);
        let ranks = window.ranks();
        for y in 0..window.rows - 1 {
            padded.write_row(y, row);
            count(columns, row, 1);
        }
        for (y, out) in out.chunks_exact_mut(padded.plane.width).enumerate() {
            padded.write_row(y + window.rows - 1, row);
            count(columns, row, 1);
            let mut sum = Sum::of(&columns[..window.columns - 1], window.columns);
            for (x, out) in out.iter_mut().enumerate() {
                add(&mut sum.coarse, &columns[x + window.columns - 1].coarse);
                let low = sum.level(columns, x, ranks[0]);
                let high = if ranks[0] == ranks[1] { low } else { sum.level(columns, x, ranks[1]) };
                *out = low.midpoint(high) + ((low ^ high) & 1);
                subtract(&mut sum.coarse, &columns[x].coarse);
            }
            padded.write_row(y, row);
            count(columns, row, u16::MAX);
        }
    }
}

/// One more sample (`by` 1) or one less (`by` -1, wrapping) in each column.
fn count(columns: &mut [Column], row: &[u8], by: u16) {
    for (column, sample) in columns.iter_mut().zip(row) {
        let [coarse, fine] = [sample >> 4, sample & 15].map(usize::from);
        column.coarse[coarse] = column.coarse[coarse].wrapping_add(by);
        column.fine[coarse][fine] = column.fine[coarse][fine].wrapping_add(by);
    }
}

fn add(sum: &mut [u16; 16], counts: &[u16; 16]) {
    sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
}

fn subtract(sum: &mut [u16; 16], counts: &[u16; 16]) {
    sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum -= count);
}

/// The window's histogram while it moves along a row.
struct Sum {
    coarse: [u16; 16],
    fine: [[u16; 16]; 16],
    /// For each range the columns that its fine counts hold: this one and so many from it as the window has.
    held_at: [Option<usize>; 16],
    columns: usize,
}

impl Sum {
    fn of(first: &[Column], columns: usize) -> Self {
        let mut coarse = [0; 16];
        for column in first {
            add(&mut coarse, &column.coarse);
        }
        Self { coarse, fine: [[0; 16]; 16], held_at: [None; 16], columns }
    }

    /// The level of the sample of that rank in the window that begins at column `x`.
    fn level(&mut self, columns: &[Column], x: usize, rank: usize) -> u8 {
        let (range, rest) = find(&self.coarse, rank);
        let fine = &mut self.fine[range];
        match self.held_at[range] {
            Some(held) if x - held < self.columns => {
                for moved in held..x {
                    add(fine, &columns[moved + self.columns].fine[range]);
                    subtract(fine, &columns[moved].fine[range]);
                }
            }
            _ => {
                *fine = [0; 16];
                columns[x..x + self.columns].iter().for_each(|column| add(fine, &column.fine[range]));
            }
        }
        self.held_at[range] = Some(x);
        let (level, _) = find(fine, rest);
        #[expect(clippy::cast_possible_truncation, reason = "both are below sixteen")]
        let level = (range * 16 + level) as u8;
        level
    }
}

/// Where the sample of that rank is, and its rank among those there.
fn find(counts: &[u16; 16], rank: usize) -> (usize, usize) {
    let mut rest = rank;
    for (index, count) in counts.iter().enumerate() {
        let count = usize::from(*count);
        if rest < count {
            return (index, rest);
        }
        rest -= count;
    }
    (15, 0)
}
