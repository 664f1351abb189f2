//! Stored things, all of a kind.

use serde::Serialize;
use utoipa::ToSchema;

use super::{CameraWire, StreamWire, TargetWire};

/// A stored camera.
#[derive(Debug, Serialize, ToSchema)]
pub struct NamedCamera {
    /// Its name.
    pub name: String,
    /// The camera.
    #[serde(flatten)]
    pub camera: CameraWire,
}

/// The stored cameras.
#[derive(Debug, Serialize, ToSchema)]
pub struct Cameras {
    /// By name.
    pub cameras: Vec<NamedCamera>,
}

/// The stored targets.
#[derive(Debug, Serialize, ToSchema)]
pub struct Targets {
    /// By name.
    pub targets: Vec<TargetWire>,
}

/// A stored stream.
#[derive(Debug, Serialize, ToSchema)]
pub struct NamedStream {
    /// The name under which the camera sends its frames.
    pub name: String,
    /// What is looked for in them.
    #[serde(flatten)]
    pub stream: StreamWire,
}

/// The stored streams.
#[derive(Debug, Serialize, ToSchema)]
pub struct Streams {
    /// By name.
    pub streams: Vec<NamedStream>,
}
