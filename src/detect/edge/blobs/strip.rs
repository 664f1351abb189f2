//! Two rows at a time: pixels in neighbouring columns of two rows touch, so a stretch of columns none of which is empty is one piece.

use super::sum::Sum;
use crate::detect::sobel::Bits;

/// Two rows of bits and the one above them. Each has a word of zeros before it and two behind it, so that nothing has to ask where it ends:
/// places are columns plus 64.
#[derive(Default)]
pub(super) struct Strip {
    above: Vec<u64>,
    top: Vec<u64>,
    bottom: Vec<u64>,
    /// What is counted of runs, word by word side by side, so that one look has all of it.
    counted: Vec<Counted>,
}

/// Pixels of the top row and of the bottom; squares of four pixels of which two across are set, and then those of which three are, at their
/// right columns: of the row above and the top, and of both rows.
type Counted = [u64; 6];

/// What places are more than columns.
const BEFORE: u32 = 64;

/// Places that are looked at together: those of both rows fill a word.
const PIECE: u32 = 32;

/// Which of the places of a piece have each bit of their number set, in both halves of a word.
const NUMBERED: [u64; 5] =
    [0xAAAA_AAAA_AAAA_AAAA, 0xCCCC_CCCC_CCCC_CCCC, 0xF0F0_F0F0_F0F0_F0F0, 0xFF00_FF00_FF00_FF00, 0xFFFF_0000_FFFF_0000];

impl Strip {
    /// Becomes empty, of rows like those of `bits`.
    pub(super) fn begin(&mut self, bits: &Bits) {
        for row in [&mut self.above, &mut self.top, &mut self.bottom] {
            row.clear();
            row.resize(bits.stride() + 3, 0);
        }
        self.counted.clear();
        self.counted.resize(bits.stride() + 3, [0; 6]);
    }

    /// Words of a row.
    pub(super) const fn words(&self) -> usize {
        self.top.len()
    }

    /// Goes on to the next two rows, or to a last one.
    pub(super) fn next(&mut self, rows: &[u64]) {
        let stride = self.words() - 3;
        std::mem::swap(&mut self.above, &mut self.bottom);
        let (top, bottom) = rows.split_at(stride);
        self.top[1..=stride].copy_from_slice(top);
        self.bottom[1..=bottom.len()].copy_from_slice(bottom);
        self.bottom[1 + bottom.len()..].fill(0);
    }

    /// Columns in which a pixel is set.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their instructions")]
    #[inline(always)]
    pub(super) fn columns(&self) -> impl Iterator<Item = u64> {
        self.top.iter().zip(&self.bottom).map(|(top, bottom)| top | bottom)
    }

    /// Pixels of the top row that touch one of the row above.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their instructions")]
    #[inline(always)]
    pub(super) fn touching(&self) -> impl Iterator<Item = u64> {
        let above = |index: usize| self.above.get(index).copied().unwrap_or(0);
        self.top.iter().enumerate().map(move |(index, top)| {
            let left = above(index) << 1 | above(index.wrapping_sub(1)) >> 63;
            let right = above(index) >> 1 | above(index + 1) << 63;
            top & (left | above(index) | right)
        })
    }

    /// The first and the last pixel of the row above that a run of [`Self::touching`] touches.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their instructions")]
    #[inline(always)]
    pub(super) fn touched(&self, [first, end]: [u32; 2]) -> [u32; 2] {
        let three_from = |place: u32| piece(&self.above, place) & 7;
        [first - 1 + three_from(first - 1).trailing_zeros(), end - 2 + three_from(end - 2).ilog2()]
    }

    /// Finds the squares.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their instructions")]
    #[inline(always)]
    pub(super) fn find_squares(&mut self) {
        let length = self.counted.len();
        let (above, top, bottom) = (&self.above[..length], &self.top[..length], &self.bottom[..length]);
        for index in 1..length {
            let before = |row: &[u64]| row[index] << 1 | row[index - 1] >> 63;
            let squares = |upper: &[u64], lower: &[u64]| {
                let [a, b, c, d] = [before(upper), upper[index], before(lower), lower[index]];
                [(a & d & !b & !c) | (b & c & !a & !d), (a ^ b ^ c ^ d) & ((a & b) | (c & d))]
            };
            let ([across, three], [across_below, three_below]) = (squares(above, top), squares(top, bottom));
            self.counted[index] = [top[index], bottom[index], across, across_below, three, three_below];
        }
    }

    /// What a run of [`Self::columns`] holds, the top row being row `y`.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their instructions")]
    #[inline(always)]
    pub(super) fn sum(&self, [first, end]: [u32; 2], y: u32) -> Sum {
        let (mut upper, mut lower, mut columns_total, mut corners) = (0, 0, 0, 0);
        // The column behind the run is empty, but squares end there.
        let mut place = first;
        while place <= end {
            let mask = u64::from(u32::MAX >> (PIECE - 1 - (end - place).min(PIECE - 1)));
            let [top, bottom, across, across_below, three, three_below] = self.counted(place).map(|word| word & mask);
            let pixels = top | bottom << PIECE;
            let [all, below] = [pixels, bottom].map(|word| u64::from(word.count_ones()));
            upper += all - below;
            lower += below;
            let bits = NUMBERED.iter().map(|numbered| u64::from((pixels & numbered).count_ones()));
            columns_total += u64::from(place - BEFORE) * all + bits.rev().fold(0, |sum, bit| 2 * sum + bit);
            let [across, three] = [across | across_below << PIECE, three | three_below << PIECE].map(u64::count_ones);
            corners += u64::from(2 * across + three);
            place += PIECE;
        }
        Sum {
            first: [first - BEFORE, y + u32::from(upper == 0)],
            last: [end - 1 - BEFORE, y + u32::from(lower > 0)],
            pixels: upper + lower,
            corners,
            columns_total,
            rows_total: u64::from(y) * (upper + lower) + lower,
        }
    }

    /// What is counted from a place on.
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their instructions")]
    #[inline(always)]
    fn counted(&self, place: u32) -> Counted {
        let (word, bit) = (place as usize / 64, place % 64);
        let [here, next] = [self.counted[word], self.counted[word + 1]];
        std::array::from_fn(|k| here[k] >> bit | next[k] << 1 << (63 - bit))
    }
}

/// What stands at a place and behind it.
#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their instructions")]
#[inline(always)]
fn piece(row: &[u64], place: u32) -> u64 {
    let (word, bit) = (place as usize / 64, place % 64);
    row[word] >> bit | row[word + 1] << 1 << (63 - bit)
}
