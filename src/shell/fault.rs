//! What is wrong with a request, before anybody knows whether it came over HTTP or from the command line.

use crate::camera::CameraError;
use crate::frame::FrameError;
use crate::target::TargetError;

/// A request that cannot be answered, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// The kind of fault.
    pub kind: FaultKind,
    /// One sentence for a person, with the numbers.
    pub detail: String,
    /// Where in the request (RFC 6901), for a fault of a field.
    pub pointer: Option<String>,
}

/// The kinds of faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FaultKind {
    /// It cannot be parsed.
    Unreadable,
    /// No such thing, or no such place.
    NotFound,
    /// The place exists, but not for this method.
    MethodNotAllowed,
    /// It contradicts what is stored.
    Conflict,
    /// The stored thing is not in the state that the request requires.
    PreconditionFailed,
    /// More bytes or pixels than are accepted.
    TooLarge,
    /// Bytes that are not a frame, or a content type that is not read here.
    NotAFrame,
    /// It can be read but makes no sense.
    Senseless,
    /// A frame in whose place a newer one of its camera has come.
    Replaced,
    /// A frame that is too old to be of use.
    TooOld,
    /// All workers are busy and the queue is full, or the service is shutting down.
    Overloaded,
    /// The store cannot be reached now.
    Unreachable,
    /// It took longer than a request may.
    DeadlineExceeded,
    /// Our own failure.
    Internal,
}

impl Fault {
    /// A fault of the request as a whole.
    pub fn new(kind: FaultKind, detail: impl Into<String>) -> Self {
        Self { kind, detail: detail.into(), pointer: None }
    }

    /// A readable but senseless value at `pointer`.
    pub fn senseless(pointer: impl Into<String>, detail: impl Into<String>) -> Self {
        Self { kind: FaultKind::Senseless, detail: detail.into(), pointer: Some(pointer.into()) }
    }

    /// The same fault inside a larger request: `prefix` goes before the pointer.
    #[must_use]
    pub fn within(mut self, prefix: &str) -> Self {
        self.pointer = self.pointer.map(|pointer| format!("{prefix}{pointer}"));
        self
    }

    /// The same fault at another place.
    #[must_use]
    pub fn at(mut self, pointer: &str) -> Self {
        self.pointer = Some(pointer.into());
        self
    }

    /// A camera that is none.
    #[must_use]
    pub fn of_camera(error: &CameraError) -> Self {
        Self::senseless(format!("/{}", error.field()), error.to_string())
    }

    /// A target that is none.
    #[must_use]
    pub fn of_target(error: &TargetError) -> Self {
        let pointer = error.place().map_or_else(|| "/markers".into(), |(i, field)| format!("/markers/{i}/{field}"));
        Self::senseless(pointer, error.to_string())
    }

    /// A frame that is none, or not one that fits.
    #[must_use]
    pub fn of_frame(error: &FrameError) -> Self {
        let kind = match error {
            FrameError::Empty => FaultKind::Unreadable,
            FrameError::UnknownFormat { .. } | FrameError::Truncated { .. } | FrameError::Corrupt { .. } => {
                FaultKind::NotAFrame
            }
            FrameError::TooManyPixels { .. } => FaultKind::TooLarge,
            FrameError::EmptyRegion { .. } | FrameError::RegionOutside { .. } => {
                return Self::senseless("/region_px", error.to_string());
            }
            FrameError::ZeroSize { .. }
            | FrameError::SampleCount { .. }
            | FrameError::RawLength { .. }
            | FrameError::OddSize { .. } => FaultKind::Senseless,
            FrameError::NotOfCamera { frame: [width, height], .. } => {
                let how = format!(
                    "{error}; if its pictures were scaled or cut out, derive a camera from it: PUT /v1/cameras/NAME with \
                     {{\"derived_from\": \"ITS NAME\", \"width\": {width}, \"height\": {height}}} or with \
                     \"crop_px\": [X, Y, {width}, {height}], or skypose camera with --size or --crop"
                );
                return Self::new(FaultKind::Senseless, how);
            }
        };
        Self::new(kind, error.to_string())
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.pointer {
            Some(pointer) if !pointer.is_empty() => write!(f, "{pointer}: {}", self.detail),
            _ => f.write_str(&self.detail),
        }
    }
}

impl std::error::Error for Fault {}
