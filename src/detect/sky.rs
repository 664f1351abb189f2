//! Things in the sky without markers, as one who watches it to keep clear of them wants them: causal, one report for each thing, with
//! the probability that it is one.
//!
//! A frame's walk: a pyramid of five levels ([`level`]); what stands out at each from its surroundings, over the clutter around
//! ([`cells`]); whole things as pieces that hang together in otherwise quiet sky ([`silhouette`]), the ends of lines, as contrails have
//! them, and single peaks where there is no quiet, or quiet on one side only ([`finder`], [`outline`]). In a sequence also the camera's
//! own motion ([`camera_motion`]) and what moves against it ([`change`]); candidates become tracks at the sequence's full rate ([`track`],
//! [`bank`]); what their late frames told, and what else is in the frame, makes a probability ([`score`]) and, where shape and motion
//! allow, a class ([`kind`]). What is reported is looked at once more, for its silhouette (`measure`). [`Watch`] is all of it, frame by frame.
//!
//! Contrast over local clutter is the cell-averaging detector of radar (Finn and Johnson, RCA Review 1968) on differences of Gaussians;
//! confirming small targets by motion against a compensated background follows Reed, Gagliardi and Stotts, "Optical moving target
//! detection with 3-D matched filtering", IEEE T-AES 1988. Image tracks live here and not with those of poses: they know pixels
//! only, no camera and no target.

pub mod bank;
pub mod camera_motion;
pub mod candidate;
pub mod cells;
pub mod change;
pub mod finder;
pub mod kind;
pub mod level;
mod measure;
pub mod outline;
pub mod scene_change;
pub mod score;
pub mod silhouette;
pub mod track;
pub mod watch;

#[cfg(test)]
mod tests;

use super::{Centroid, Detection, in_frame, luma, single, whole};
use crate::frame::{Frame, Region};
use measure::Measured;
use track::Track;

pub use watch::{Beginning, Stamp, Watch};

/// What is reported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyOptions {
    /// Things less probable than this are left out.
    pub min_score: f64,
    /// Smallest area, px.
    pub min_area_px: f64,
    /// Most centroids returned, the most probable.
    pub max_centroids: usize,
}

impl Default for SkyOptions {
    /// A caller who wants few false alarms sets a higher score; at one in fifty some three a frame are left, at one in two one in
    /// twenty-three frames.
    fn default() -> Self {
        Self { min_score: 0.02, min_area_px: 1.0, max_centroids: 64 }
    }
}

/// What is in `region` of a single frame. Of motion nothing is known, so the scores are lower than in a sequence. `watch` lends its memory
/// and forgets what it saw.
pub(super) fn detect(watch: &mut Watch, frame: &Frame, region: Region, options: &SkyOptions) -> Detection {
    watch.forget();
    let mut detection = watch.observe(frame, region, Stamp::default(), options);
    detection.centroids.iter_mut().for_each(|centroid| centroid.track_id = None);
    detection
}

impl Watch {
    /// The next frame of the sequence, of which `region` is looked at; it must lie on the frame.
    pub fn observe(&mut self, frame: &Frame, region: Region, stamp: Stamp, options: &SkyOptions) -> Detection {
        self.look_at(region);
        let mut samples = std::mem::take(&mut self.samples);
        luma::take(frame, region, &mut samples);
        self.observe_luma(&samples, [region.width as usize, region.height as usize], stamp);
        self.samples = samples;
        let (mut reported, mut measurer) = (std::mem::take(&mut self.reported), std::mem::take(&mut self.measurer));
        reported.clear();
        reported.extend(
            self.tracks()
                .iter()
                // What is not seen in this frame is not reported in it.
                .filter(|track| track.misses == 0)
                .map(|track| (track, score::probability(track)))
                .filter(|(_, score)| *score >= options.min_score)
                .map(|(track, score)| centroid(track, score, measurer.measure(self.levels(), &track.seen), region))
                .filter(|centroid| centroid.area_px >= options.min_area_px),
        );
        reported.sort_unstable_by(|a, b| b.score.total_cmp(&a.score));
        reported.truncate(options.max_centroids);
        let centroids = reported.clone();
        (self.reported, self.measurer) = (reported, measurer);
        Detection { centroids, refused: Vec::new() }
    }
}

/// What cannot be measured stands before clouds or ground, and its place is this much less sure than that of a candidate in the mean.
const ROUGHER: f64 = 1.5;

fn centroid(track: &Track, score: f64, measured: Option<Measured>, region: Region) -> Centroid {
    let seen = &track.seen;
    let measured = measured.unwrap_or_else(|| Measured {
        place: seen.place,
        sigma_px: ROUGHER * track::spread_px(seen),
        area_px: seen.area_px,
        bounds: seen.bounds,
    });
    let within = |along: f64, side: u32| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the region")]
        let along = along.clamp(0.0, f64::from(side)).round() as u32;
        along
    };
    // The place is that of its light, the bounds those of its outline, which may miss a faint part of it.
    let place = [(measured.place[0], region.width), (measured.place[1], region.height)]
        .map(|(along, side)| along.clamp(-0.5, f64::from(side) - 0.5));
    let [left, top, right, bottom] = measured.bounds;
    let (left, top) = (left.min((place[0] + 0.5).floor()), top.min((place[1] + 0.5).floor()));
    let (right, bottom) = (right.max((place[0] + 0.5).ceil()), bottom.max((place[1] + 0.5).ceil()));
    let (x, y) = (within(left, region.width - 1), within(top, region.height - 1));
    let bounds = Region {
        x: x + region.x,
        y: y + region.y,
        width: within(right, region.width).saturating_sub(x).max(1),
        height: within(bottom, region.height).saturating_sub(y).max(1),
    };
    Centroid {
        pixel: in_frame(region, place[0], place[1]),
        sigma_px: measured.sigma_px,
        area_px: measured.area_px,
        bounds,
        score,
        // What rather does not fly is neither.
        class: kind::class(track).filter(|_| score >= kind::LEAST_SCORE),
        track_id: Some(track.id),
    }
}
