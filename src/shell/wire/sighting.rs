//! What was seen in a frame: replies of `POST /v1/detections` and `POST /v1/estimates`.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use super::pose::Answer;
use crate::detect::{self, Detection, Watch};
use crate::frame::{Frame, Region};
use crate::pipeline::TargetEstimate;
use crate::target::Target;

/// What is known of the frame.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
pub struct FrameInfo {
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
    /// The request's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timestamp_us: Option<i64>,
    /// The orientation that the file states and that was not applied: EXIF, 2 to 8.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<u8>,
    /// The part that was searched: x, y, width, height in whole pixels. The whole frame if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region_px: Option<[u32; 4]>,
}

impl FrameInfo {
    /// Of a frame, of which a part was searched or all.
    #[must_use]
    pub fn of(frame: &Frame, timestamp_us: Option<i64>, region: Option<Region>) -> Self {
        let orientation = frame.orientation().exif();
        Self {
            width: frame.width(),
            height: frame.height(),
            timestamp_us,
            orientation: (orientation != 1).then_some(orientation),
            region_px: region.filter(|region| *region != frame.full()).map(box_of),
        }
    }
}

/// A blob that may be a marker.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Centroid)]
pub struct CentroidWire {
    /// Position, to the right.
    pub u_px: f64,
    /// Position, down.
    pub v_px: f64,
    /// Standard deviation of the position per axis.
    pub sigma_px: f64,
    /// Area.
    pub area_px: f64,
    /// x, y, width, height of the pixels that it spans.
    pub box_px: [u32; 4],
    /// How much it looks like a marker, 0 to 1; of `edge`, the probability that it flies.
    pub score: f64,
    /// What it is, where that is known: `aircraft` or `bird`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
    /// Its number in a sequence; the same thing has the same in every frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub track_id: Option<u32>,
    /// The marker that it was identified with; null where it belongs to no target.
    #[schema(required = true)]
    pub marker: Option<String>,
    /// The target of that marker, where several were looked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target: Option<String>,
    /// Which of several like it that target is, from 0, where more than one of each was looked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub instance: Option<usize>,
}

/// A blob that was looked at and is no marker.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RefusedBlob)]
pub struct RefusedWire {
    /// Middle of its box, to the right.
    pub u_px: f64,
    /// Middle of its box, down.
    pub v_px: f64,
    /// Area.
    pub area_px: f64,
    /// x, y, width, height of the pixels that it spans.
    pub box_px: [u32; 4],
    /// What speaks against it: `too_small`, `too_large`, `elongated`, `ragged`, `low_contrast`, `at_border`,
    /// `crowded`, `other_color`, `not_persistent`.
    pub reason: String,
}

const fn box_of(region: Region) -> [u32; 4] {
    [region.x, region.y, region.width, region.height]
}

/// The centroids of a detection, none of them identified.
#[must_use]
pub fn centroids_of(detection: &Detection) -> Vec<CentroidWire> {
    let centroid = |c: &detect::Centroid| CentroidWire {
        u_px: c.pixel.x,
        v_px: c.pixel.y,
        sigma_px: c.sigma_px,
        area_px: c.area_px,
        box_px: box_of(c.bounds),
        score: c.score,
        class: c.class.map(|class| class.name().into()),
        track_id: c.track_id,
        marker: None,
        target: None,
        instance: None,
    };
    detection.centroids.iter().map(centroid).collect()
}

/// The refused blobs of a detection.
#[must_use]
pub fn refused_of(detection: &Detection) -> Vec<RefusedWire> {
    let refused = |r: &detect::Refused| RefusedWire {
        u_px: r.pixel.x,
        v_px: r.pixel.y,
        area_px: r.area_px,
        box_px: box_of(r.bounds),
        reason: r.reason.name().into(),
    };
    detection.refused.iter().map(refused).collect()
}

/// Time taken by each stage, whole microseconds.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
pub struct Timing {
    /// Bytes to pixels.
    pub decode: u64,
    /// Pixels to centroids.
    pub detect: u64,
    /// Centroids to markers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identify: Option<u64>,
    /// Markers to poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solve: Option<u64>,
    /// All together.
    pub total: u64,
}

impl Timing {
    /// With what was done before for the same frame.
    #[must_use]
    pub fn after(self, before: &Self) -> Self {
        let both = |a: Option<u64>, b: Option<u64>| Some(a?.saturating_add(b.unwrap_or(0)));
        Self {
            decode: self.decode + before.decode,
            detect: self.detect + before.detect,
            identify: both(self.identify, before.identify),
            solve: both(self.solve, before.solve),
            total: self.total + before.total,
        }
    }
}

/// Where in its sequence a frame stands.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[schema(as = Sequence)]
pub struct SequenceWire {
    /// The sequence's name.
    pub name: String,
    /// Why tracks begin anew with this frame: `first`, `gap` (frames or time are missing, or it comes from earlier), `resized`, `cut`
    /// (another scene). Null where they go on.
    #[schema(required = true)]
    pub beginning: Option<String>,
}

impl SequenceWire {
    /// Of the frame that was looked at last.
    #[must_use]
    pub fn of(name: &str, watch: &Watch) -> Self {
        Self { name: name.into(), beginning: watch.beginning().map(|beginning| beginning.name().into()) }
    }
}

/// Reply to a detection request.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct DetectionReply {
    /// The request's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<Value>,
    /// The frame.
    pub frame: FrameInfo,
    /// Hues of the markers, from, to in degrees, learned from the request's `sample_px`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hue_range_deg: Option<[f64; 2]>,
    /// The sequence that it belongs to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequence: Option<SequenceWire>,
    /// Candidates for markers, the best first.
    pub centroids: Vec<CentroidWire>,
    /// What was refused and why, the largest first, at most 64.
    pub refused: Vec<RefusedWire>,
    /// Time taken.
    pub timing_us: Timing,
}

/// What a frame tells of one target.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = TargetEstimate)]
pub struct TargetEstimateWire {
    /// The target's name.
    pub name: String,
    /// Which of several like it, from 0, where more than one of each was looked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub instance: Option<usize>,
    /// At least four of its markers were found and identified.
    pub detected: bool,
    /// The pose.
    #[serde(flatten)]
    pub answer: Answer,
}

impl TargetEstimateWire {
    /// Of a target, or of one of several.
    #[must_use]
    pub fn of(target: &Target, estimate: &TargetEstimate, instance: Option<usize>) -> Self {
        Self {
            name: target.name().into(),
            instance,
            detected: estimate.is_detected(),
            answer: Answer::from(&estimate.answer),
        }
    }
}

/// Reply to an estimate request.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct EstimateReply {
    /// The request's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<Value>,
    /// The frame.
    pub frame: FrameInfo,
    /// Hues of the markers, from, to in degrees, learned from the request's `sample_px`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hue_range_deg: Option<[f64; 2]>,
    /// The sequence that it belongs to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequence: Option<SequenceWire>,
    /// Candidates for markers, the best first, each with the marker that it was identified with.
    pub centroids: Vec<CentroidWire>,
    /// One for each target asked for, in that order; with `max_instances`, where several of a target are in view, one for each
    /// of them, the most probable first.
    pub targets: Vec<TargetEstimateWire>,
    /// Time taken.
    pub timing_us: Timing,
}
