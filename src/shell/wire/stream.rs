//! What is looked for in the frames that a camera sends.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;

use super::pose::SolverName;
use super::{ActOptionsWire, DetectorWire, FrameRequest, Ref, TrackOptionsWire};

/// What is looked for in the frames that a camera sends, over Zenoh or HTTP.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = Stream)]
pub struct StreamWire {
    /// Name of the stored camera.
    pub camera: String,
    /// Names of the stored targets to look for: at least one, but by the method `edge`.
    #[serde(default)]
    #[schema(max_items = 16)]
    pub targets: Vec<String>,
    /// The detector.
    #[serde(default)]
    pub detector: DetectorWire,
    /// The method for the pose.
    #[serde(default)]
    pub solver: SolverName,
    /// Minimise the reprojection error from the method's pose.
    #[serde(default = "yes")]
    #[schema(default = true)]
    pub refine: bool,
    /// Most of each target that are looked for.
    #[serde(default = "one")]
    #[schema(default = 1, minimum = 1, maximum = 16)]
    pub max_instances: usize,
    /// Region of interest x, y, width, height in whole pixels; the whole frame if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region_px: Option<[u32; 4]>,
    /// How much of a frame is searched.
    #[serde(default)]
    pub search: SearchName,
    /// How tracks are kept; what is left out is as the settings of the service have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<TrackOptionsWire>)]
    pub track: Option<Map<String, Value>>,
    /// What our aircraft can do about an encounter; what is left out is as the settings of the service have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<ActOptionsWire>)]
    pub encounter: Option<Map<String, Value>>,
}

/// How much of a frame is searched.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = Search)]
pub enum SearchName {
    /// All of it, or all of `region_px`. The estimate of a frame then hangs on that frame alone, and a new target is found at once.
    #[default]
    Full,
    /// The part where the tracks predict the targets, which takes less time. All is searched where no track is believed, where one of them
    /// is not found in that part, and every `full_search_every` frames: so a new target is found so many frames later at most. The
    /// estimate says which part was searched, and is that of a request with this part as `region_px`.
    Predicted,
}

const fn yes() -> bool {
    true
}

const fn one() -> usize {
    1
}

impl From<StreamWire> for FrameRequest {
    fn from(stream: StreamWire) -> Self {
        Self {
            camera: Some(Ref::Name(stream.camera)),
            targets: stream.targets.into_iter().map(Ref::Name).collect(),
            detector: stream.detector,
            solver: stream.solver,
            refine: stream.refine,
            max_instances: stream.max_instances,
            region_px: stream.region_px,
            ..Self::default()
        }
    }
}
