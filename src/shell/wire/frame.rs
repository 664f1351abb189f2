//! How a frame is to be looked at: requests of `POST /v1/detections` and `POST /v1/estimates`.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use super::detector::DetectorWire;
use super::pose::SolverName;
use super::reference::{CameraOrName, TargetOrName};
use super::{CameraWire, Ref, TargetWire};
use crate::frame::RawFormat;

/// How a frame is to be looked at. The frame itself comes beside it.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FrameRequest {
    /// Copied to the reply.
    pub id: Option<Value>,
    /// The camera, or the name of a stored one. Estimates need it; for detections only its size is checked.
    #[schema(value_type = Option<CameraOrName>)]
    pub camera: Option<Ref<CameraWire>>,
    /// The targets to look for, or the names of stored ones.
    #[schema(value_type = Vec<TargetOrName>)]
    pub targets: Vec<Ref<TargetWire>>,
    /// Most of each target that are looked for: with more than 1, several of one target in view are several entries of the
    /// reply under its name.
    #[schema(default = 1, minimum = 1, maximum = 16)]
    pub max_instances: usize,
    /// The detector.
    pub detector: DetectorWire,
    /// Region of interest x, y, width, height in whole pixels; the whole frame if left out.
    pub region_px: Option<[u32; 4]>,
    /// The method for the pose.
    pub solver: SolverName,
    /// Minimise the reprojection error from the method's pose.
    #[schema(default = true)]
    pub refine: bool,
    /// When the frame was taken, microseconds since the Unix epoch; copied to the reply.
    pub timestamp_us: Option<i64>,
    /// Method `edge`: the sequence that the frame belongs to, by a name of the client's choice. Frames of one name are taken in
    /// the order in which they come, and what is found in them is followed from frame to frame.
    #[schema(max_length = 128)]
    pub sequence: Option<String>,
    /// Number of the frame in its sequence. Up to 3 may be missing, as may half a second between timestamps; over more, over a frame
    /// from earlier, another size or a cut, tracks begin anew.
    pub frame_index: Option<u64>,
    /// What to do with an orientation that the file states (EXIF).
    pub orientation: OrientationHandling,
    /// Width of a raw frame.
    pub width: Option<u32>,
    /// Height of a raw frame.
    pub height: Option<u32>,
    /// Pixel format of a raw frame; none for encoded pictures.
    pub format: Option<RawFormatName>,
}

/// What to do with an orientation that the file states (EXIF).
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum OrientationHandling {
    /// Take the pixels as they are stored, and state the orientation in the reply: intrinsics belong to the sensor's grid.
    #[default]
    Ignore,
    /// Turn the frame upright first; the camera must be that of the turned frame.
    Apply,
}

/// Raw pixel formats, 8 bits a sample, rows without padding.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the names of the formats are their documentation")]
pub enum RawFormatName {
    Rgb8,
    Bgr8,
    Mono8,
    BayerRggb8,
    BayerBggr8,
    BayerGbrg8,
    BayerGrbg8,
    Yuyv,
    Nv12,
}

impl RawFormatName {
    /// The core's name for it.
    #[must_use]
    pub const fn format(self) -> RawFormat {
        use crate::frame::bayer::Mosaic;
        match self {
            Self::Rgb8 => RawFormat::Rgb8,
            Self::Bgr8 => RawFormat::Bgr8,
            Self::Mono8 => RawFormat::Mono8,
            Self::BayerRggb8 => RawFormat::Bayer(Mosaic::Rggb),
            Self::BayerBggr8 => RawFormat::Bayer(Mosaic::Bggr),
            Self::BayerGbrg8 => RawFormat::Bayer(Mosaic::Gbrg),
            Self::BayerGrbg8 => RawFormat::Bayer(Mosaic::Grbg),
            Self::Yuyv => RawFormat::Yuyv,
            Self::Nv12 => RawFormat::Nv12,
        }
    }
}

impl Default for FrameRequest {
    fn default() -> Self {
        Self {
            id: None,
            camera: None,
            targets: Vec::new(),
            max_instances: 1,
            detector: DetectorWire::default(),
            region_px: None,
            solver: SolverName::default(),
            refine: true,
            timestamp_us: None,
            sequence: None,
            frame_index: None,
            orientation: OrientationHandling::default(),
            width: None,
            height: None,
            format: None,
        }
    }
}
