//! The outlier filter, blob by blob: a frame of noise has thousands of specks, and only the largest are ever told.

use std::cmp::Reverse;

use super::{Blob, EdgeOptions, centroid};
use crate::detect::{Detection, MAX_REFUSED, Refusal, Refused, bounds_in_frame};
use crate::frame::Region;

/// What is large enough, and what was refused, as far as it is told; picture after picture in the same memory.
#[derive(Default)]
pub(super) struct Sieve {
    min_area_px: f64,
    large: Largest,
    small: Largest,
}

impl Sieve {
    /// Empties it.
    pub(super) fn begin(&mut self, options: &EdgeOptions) {
        self.min_area_px = options.min_area_px;
        self.large.begin(options.max_centroids.saturating_add(MAX_REFUSED));
        self.small.begin(MAX_REFUSED);
    }

    /// One blob more.
    pub(super) fn take(&mut self, blob: Blob) {
        if blob.area_px() > self.min_area_px { self.large.take(blob) } else { self.small.take(blob) }
    }

    /// The largest as centroids, the next as refused.
    pub(super) fn detection(&mut self, region: Region, options: &EdgeOptions) -> Detection {
        let large = self.large.sorted();
        let (large, crowded) = large.split_at(options.max_centroids.min(large.len()));
        let crowded = crowded.iter().map(|blob| refused(blob, region, Refusal::Crowded));
        let small = self.small.sorted().iter().map(|blob| refused(blob, region, Refusal::TooSmall));
        Detection {
            refused: crowded.chain(small).take(MAX_REFUSED).collect(),
            centroids: large.iter().map(|blob| centroid(blob, region, options.window)).collect(),
        }
    }
}

fn refused(blob: &Blob, region: Region, reason: Refusal) -> Refused {
    let bounds = bounds_in_frame(region, blob.bounds);
    let middle = |start: u32, side: u32| f64::from(start) + 0.5 * f64::from(side - 1);
    Refused {
        pixel: nalgebra::Vector2::new(middle(bounds.x, bounds.width), middle(bounds.y, bounds.height)),
        area_px: blob.area_px(),
        bounds,
        reason,
    }
}

/// The largest of many.
#[derive(Default)]
struct Largest {
    most: usize,
    /// Up to four times as many, so that they are rarely sorted out.
    blobs: Vec<Blob>,
    /// What is smaller is not among them.
    least_eighths: u64,
}

impl Largest {
    /// Empties it, for so many.
    fn begin(&mut self, most: usize) {
        self.most = most;
        self.blobs.clear();
        self.least_eighths = 0;
    }

    fn take(&mut self, blob: Blob) {
        if blob.area_eighths < self.least_eighths {
            return;
        }
        self.blobs.push(blob);
        if self.blobs.len() >= self.most.saturating_mul(4) {
            self.cut();
        }
    }

    fn cut(&mut self) {
        if self.most == 0 {
            self.blobs.clear();
        } else if self.blobs.len() > self.most {
            let (_, last, _) = self.blobs.select_nth_unstable_by_key(self.most - 1, large_first);
            self.least_eighths = last.area_eighths;
            self.blobs.truncate(self.most);
        }
    }

    fn sorted(&mut self) -> &[Blob] {
        self.cut();
        self.blobs.sort_unstable_by_key(large_first);
        &self.blobs
    }
}

/// Of equals the first in reading order, by their bounds and then by their pixels.
const fn large_first(blob: &Blob) -> (Reverse<u64>, [u32; 2], [u64; 2]) {
    let bounds = blob.bounds;
    (Reverse(blob.area_eighths), [bounds.y, bounds.x], [blob.rows_total, blob.columns_total])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_of_many_are_those_of_a_sort() {
        let mut state = 7_u32;
        let blobs: Vec<Blob> = (0..3000)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let [size, y, x, _] = state.to_be_bytes().map(u64::from);
                let [x, y] = [x, y].map(|place| u32::try_from(place).expect("a byte"));
                Blob::square(Region { x, y, width: 1, height: 1 }, size)
            })
            .collect();
        let mut largest = Largest::default();
        for most in [0, 1, 64] {
            largest.begin(most);
            for blob in &blobs {
                largest.take(*blob);
            }
            let mut slow = blobs.clone();
            slow.sort_by_key(large_first);
            let keys = |list: &[Blob]| list.iter().map(large_first).collect::<Vec<_>>();
            assert_eq!(keys(largest.sorted()), keys(&slow[..most]), "{most}");
        }
    }
}
