//! The seed's filter against features that do not last: a thing in the sky is there in the next frame too, nearly where it was;
//! noise is not. The seed names the filter (section 3.1.1) and gives no numbers; the defaults are ours.

use crate::camera::Pixel;
use crate::detect::{Centroid, Detection, MAX_REFUSED, Refusal, Refused};

/// What counts as lasting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PersistenceOptions {
    /// Frames in a row in which a feature must have been seen, this one included.
    pub least_frames: u32,
    /// How far it may have moved from one frame to the next, px.
    pub reach_px: f64,
}

impl Default for PersistenceOptions {
    /// Three frames, a tenth of a second of video, and 20 px: half the width of the frame in a second.
    fn default() -> Self {
        Self { least_frames: 3, reach_px: 20.0 }
    }
}

/// Which features were seen lately, and for how many frames in a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Persistence {
    options: PersistenceOptions,
    seen: Vec<(Pixel, u32)>,
}

impl Persistence {
    /// Before the first frame.
    #[must_use]
    pub const fn new(options: PersistenceOptions) -> Self {
        Self { options, seen: Vec::new() }
    }

    /// The next frame's detection, from which what has not lasted is refused.
    pub fn sift(&mut self, detection: &mut Detection) {
        let lasts = self.feed(&detection.centroids);
        let mut refused = Vec::new();
        let mut lasts = lasts.into_iter();
        detection.centroids.retain(|centroid| {
            let keeps = lasts.next().unwrap_or(true);
            if !keeps {
                let Centroid { pixel, area_px, bounds, .. } = *centroid;
                refused.push(Refused { pixel, area_px, bounds, reason: Refusal::NotPersistent });
            }
            keeps
        });
        refused.append(&mut detection.refused);
        refused.sort_by(|a, b| b.area_px.total_cmp(&a.area_px));
        refused.truncate(MAX_REFUSED);
        detection.refused = refused;
    }

    /// The next frame's features: for each, whether it has lasted. Each is the continuation of at most one of the frame before:
    /// the nearest pairs first, those within reach.
    pub fn feed(&mut self, centroids: &[Centroid]) -> Vec<bool> {
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (now, centroid) in centroids.iter().enumerate() {
            for (before, (pixel, _)) in self.seen.iter().enumerate() {
                let distance = (centroid.pixel - pixel).norm();
                if distance <= self.options.reach_px {
                    pairs.push((distance, now, before));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut frames = vec![1_u32; centroids.len()];
        let mut is_continued = vec![false; self.seen.len()];
        for (_, now, before) in pairs {
            if frames[now] == 1 && !is_continued[before] {
                frames[now] = self.seen[before].1.saturating_add(1);
                is_continued[before] = true;
            }
        }
        self.seen = centroids.iter().map(|centroid| centroid.pixel).zip(frames.iter().copied()).collect();
        frames.into_iter().map(|frames| frames >= self.options.least_frames).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Region;

    fn at(places: &[f64]) -> Vec<Centroid> {
        let bounds = Region { x: 0, y: 0, width: 1, height: 1 };
        let centroid = |x: &f64| Centroid {
            pixel: Pixel::new(*x, 0.0),
            sigma_px: 1.0,
            area_px: 1.0,
            bounds,
            score: 1.0,
            class: None,
            track_id: None,
        };
        places.iter().map(centroid).collect()
    }

    #[test]
    fn what_stays_lasts_from_the_third_frame_on() {
        let mut filter = Persistence::new(PersistenceOptions::default());
        let lasts: Vec<_> = [100.0, 115.0, 130.0, 145.0].iter().map(|x| filter.feed(&at(&[*x]))).collect();
        assert_eq!(lasts, [[false], [false], [true], [true]]);
    }

    #[test]
    fn a_jump_or_a_gap_begins_anew() {
        for second in [vec![150.0], vec![]] {
            let mut filter = Persistence::new(PersistenceOptions { least_frames: 2, reach_px: 20.0 });
            filter.feed(&at(&[100.0]));
            filter.feed(&at(&second));
            assert_eq!(filter.feed(&at(&[100.0])), [false], "{second:?}");
            assert_eq!(filter.feed(&at(&[100.0])), [true], "{second:?}");
        }
    }

    #[test]
    fn of_two_near_one_the_nearer_continues_it() {
        let mut filter = Persistence::new(PersistenceOptions { least_frames: 2, reach_px: 20.0 });
        filter.feed(&at(&[100.0]));
        assert_eq!(filter.feed(&at(&[108.0, 103.0, 90.0])), [false, true, false]);
    }

    #[test]
    fn what_has_not_lasted_is_refused_with_its_reason() {
        let mut filter = Persistence::new(PersistenceOptions { least_frames: 2, reach_px: 20.0 });
        filter.feed(&at(&[100.0]));
        let mut detection = Detection { centroids: at(&[300.0, 101.0]), refused: Vec::new() };
        filter.sift(&mut detection);
        assert_eq!(detection.centroids, at(&[101.0]));
        assert_eq!(
            detection.refused.iter().map(|r| (r.pixel.x, r.reason)).collect::<Vec<_>>(),
            [(300.0, Refusal::NotPersistent)]
        );
    }

    #[test]
    fn one_frame_is_enough_where_one_is_asked_for() {
        let mut filter = Persistence::new(PersistenceOptions { least_frames: 1, reach_px: 1.0 });
        assert_eq!(filter.feed(&at(&[1.0, 50.0])), [true, true]);
        assert_eq!(filter.feed(&[]), Vec::<bool>::new());
    }
}
