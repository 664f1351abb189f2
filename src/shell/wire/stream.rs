//! What is looked for in the frames that a camera sends.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::pose::SolverName;
use super::{DetectorWire, FrameRequest, Ref};

/// What is looked for in the frames that a camera sends over Zenoh.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = Stream)]
pub struct StreamWire {
    /// Name of the stored camera.
    pub camera: String,
    /// Names of the stored targets to look for.
    #[schema(min_items = 1, max_items = 16)]
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
