//! What is known of a piece so far.

use super::Blob;
use crate::frame::Region;

/// Corners are inclusive.
#[derive(Clone, Copy)]
pub(super) struct Sum {
    pub first: [u32; 2],
    pub last: [u32; 2],
    pub pixels: u64,
    /// What `bwarea` adds, in eighths. It weighs each square of four pixels by what of it is set: a quarter for one, half for two side by
    /// side, three quarters for two across, seven eighths for three, one for four. Summed, that is the number of pixels, and a quarter
    /// more for each square of two across, and an eighth more for each of three.
    pub corners: u64,
    pub columns_total: u64,
    pub rows_total: u64,
}

impl Sum {
    #[inline]
    pub(super) fn take(&mut self, other: &Self) {
        self.first = [self.first[0].min(other.first[0]), self.first[1].min(other.first[1])];
        self.last = [self.last[0].max(other.last[0]), self.last[1].max(other.last[1])];
        self.pixels += other.pixels;
        self.corners += other.corners;
        self.columns_total += other.columns_total;
        self.rows_total += other.rows_total;
    }

    pub(super) const fn blob(&self) -> Blob {
        Blob {
            pixels: self.pixels,
            area_eighths: 8 * self.pixels + self.corners,
            bounds: Region {
                x: self.first[0],
                y: self.first[1],
                width: self.last[0] + 1 - self.first[0],
                height: self.last[1] + 1 - self.first[1],
            },
            columns_total: self.columns_total,
            rows_total: self.rows_total,
        }
    }
}
