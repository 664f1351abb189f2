//! The median of 3 x 3 by its own short network.
//!
//! Each column of three is sorted once and serves three pixels. The median of the nine is the median of three: the largest of
//! the columns' least, the middle of their middles, the least of their largest. A. Paeth, "Median finding on a 3 x 3 grid",
//! Graphics Gems, 1990, has the sorted columns.

use super::Padded;

/// Samples that one instruction or two take.
const LANES: usize = 64;

/// The sorted columns of three rows, reused from row to row and from picture to picture.
#[derive(Clone, Debug, Default)]
pub(in crate::detect) struct Columns {
    low: Vec<u8>,
    middle: Vec<u8>,
    high: Vec<u8>,
}

impl Columns {
    /// Makes room for pictures of `width` columns.
    pub(in crate::detect) fn resize(&mut self, width: usize) {
        for row in [&mut self.low, &mut self.middle, &mut self.high] {
            row.resize(width + 2 + LANES, 0);
        }
    }

    /// The medians of a row. Rows are given with a sample more on either side.
    pub(in crate::detect) fn median(&mut self, rows: [&[u8]; 3], out: &mut [u8]) {
        sort(rows, &mut self.low, &mut self.middle, &mut self.high);
        choose(&self.low, &self.middle, &self.high, out);
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1+ssse3"))]
fn sort([above, here, below]: [&[u8]; 3], low: &mut [u8], middle: &mut [u8], high: &mut [u8]) {
    let length = above.len();
    let (here, below) = (&here[..length], &below[..length]);
    let (low, middle, high) = (&mut low[..length], &mut middle[..length], &mut high[..length]);
    for x in 0..length {
        let (least, most) = (above[x].min(here[x]), above[x].max(here[x]));
        low[x] = least.min(below[x]);
        middle[x] = least.max(most.min(below[x]));
        high[x] = most.max(below[x]);
    }
}

/// The columns hold a block more than the row, so that every block is whole.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1+ssse3"))]
fn choose(low: &[u8], middle: &[u8], high: &[u8], out: &mut [u8]) {
    for (block, out) in out.chunks_mut(LANES).enumerate() {
        let at = LANES * block;
        let (low_a, low_b, low_c) = (lanes(low, at), lanes(low, at + 1), lanes(low, at + 2));
        let (middle_a, middle_b, middle_c) = (lanes(middle, at), lanes(middle, at + 1), lanes(middle, at + 2));
        let (high_a, high_b, high_c) = (lanes(high, at), lanes(high, at + 1), lanes(high, at + 2));
        let mut medians = [0; LANES];
        for i in 0..LANES {
            let low = low_a[i].max(low_b[i]).max(low_c[i]);
            let middle = of_three(middle_a[i], middle_b[i], middle_c[i]);
            let high = high_a[i].min(high_b[i]).min(high_c[i]);
            medians[i] = of_three(low, middle, high);
        }
        out.copy_from_slice(&medians[..out.len()]);
    }
}

#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn lanes(row: &[u8], at: usize) -> [u8; LANES] {
    let mut lanes = [0; LANES];
    lanes.copy_from_slice(&row[at..][..LANES]);
    lanes
}

#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn of_three(a: u8, b: u8, c: u8) -> u8 {
    a.min(b).max(a.max(b).min(c))
}

/// What medians of pictures are made of.
#[derive(Default)]
pub(super) struct Three {
    columns: Columns,
    /// Padded rows, each where its number modulo three says.
    rows: [Vec<u8>; 3],
}

impl Three {
    /// Only for the window of 3 x 3.
    pub(super) fn write(&mut self, padded: &Padded<'_>, out: &mut [u8]) {
        let Self { columns, rows } = self;
        columns.resize(padded.plane.width);
        for row in &mut *rows {
            row.resize(padded.width(), 0);
        }
        padded.write_row(0, &mut rows[0]);
        padded.write_row(1, &mut rows[1]);
        for (y, out) in out.chunks_exact_mut(padded.plane.width).enumerate() {
            padded.write_row(y + 2, &mut rows[(y + 2) % 3]);
            columns.median([0, 1, 2].map(|row| rows[(y + row) % 3].as_slice()), out);
        }
    }
}
