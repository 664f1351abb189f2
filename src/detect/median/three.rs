//! The median of 3 x 3 by its own short network.
//!
//! Each column of three is sorted once and serves three pixels. The median of the nine is the median of three: the largest of
//! the columns' least, the middle of their middles, the least of their largest. A. Paeth, "Median finding on a 3 x 3 grid",
//! Graphics Gems, 1990, has the sorted columns.

use super::{Padded, Plane};

/// The sorted columns of three rows, reused from row to row.
#[derive(Clone, Debug)]
pub(in crate::detect) struct Columns {
    low: Vec<u8>,
    middle: Vec<u8>,
    high: Vec<u8>,
}

impl Columns {
    /// For pictures of `width` columns.
    pub(in crate::detect) fn of_width(width: usize) -> Self {
        let row = vec![0; width + 2];
        Self { low: row.clone(), middle: row.clone(), high: row }
    }

    /// The medians of a row. Rows are given with a sample more on either side.
    pub(in crate::detect) fn median(&mut self, rows: [&[u8]; 3], out: &mut [u8]) {
        sort(rows, &mut self.low, &mut self.middle, &mut self.high);
        choose(&self.low, &self.middle, &self.high, out);
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1+ssse3"))]
fn sort([above, here, below]: [&[u8]; 3], low: &mut [u8], middle: &mut [u8], high: &mut [u8]) {
    let length = low.len();
    let (above, here, below) = (&above[..length], &here[..length], &below[..length]);
    let (middle, high) = (&mut middle[..length], &mut high[..length]);
    for x in 0..length {
        let (least, most) = (above[x].min(here[x]), above[x].max(here[x]));
        low[x] = least.min(below[x]);
        middle[x] = least.max(most.min(below[x]));
        high[x] = most.max(below[x]);
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2", "x86_64+sse4.1+ssse3"))]
fn choose(low: &[u8], middle: &[u8], high: &[u8], out: &mut [u8]) {
    let length = out.len();
    let [low_a, low_b, low_c] = [0, 1, 2].map(|at| &low[at..][..length]);
    let [middle_a, middle_b, middle_c] = [0, 1, 2].map(|at| &middle[at..][..length]);
    let [high_a, high_b, high_c] = [0, 1, 2].map(|at| &high[at..][..length]);
    for x in 0..length {
        let low = low_a[x].max(low_b[x]).max(low_c[x]);
        let middle = of_three(middle_a[x], middle_b[x], middle_c[x]);
        let high = high_a[x].min(high_b[x]).min(high_c[x]);
        out[x] = of_three(low, middle, high);
    }
}

#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn of_three(a: u8, b: u8, c: u8) -> u8 {
    a.min(b).max(a.max(b).min(c))
}

/// Only for the window of 3 x 3.
pub(super) fn median(padded: &Padded<'_>) -> Plane {
    let (width, height) = (padded.plane.width, padded.plane.height);
    let mut out = Plane::black(width, height);
    let mut columns = Columns::of_width(width);
    let mut rows: [Vec<u8>; 3] = std::array::from_fn(|_| vec![0; padded.width()]);
    padded.write_row(0, &mut rows[0]);
    padded.write_row(1, &mut rows[1]);
    for (y, out) in out.samples.chunks_exact_mut(width).enumerate() {
        padded.write_row(y + 2, &mut rows[(y + 2) % 3]);
        columns.median([0, 1, 2].map(|row| rows[(y + row) % 3].as_slice()), out);
    }
    out
}
