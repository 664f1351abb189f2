//! Every serialised shape, named as in the contract, and its way into and out of the core's types.

pub mod act;
pub mod assessment;
pub mod calibration;
pub mod camera;
pub mod camera_file;
pub mod detector;
pub mod encounter;
pub mod evaluation;
pub mod frame;
pub mod health;
pub mod job;
pub mod listing;
pub mod pattern;
pub mod pose;
pub mod prior;
pub mod problem;
pub mod rate;
pub mod recorded;
pub mod reference;
pub mod relative;
pub mod sighting;
pub mod stream;
pub mod swarm;
pub mod target;
pub mod track;
pub mod track_options;

use serde::de::DeserializeOwned;

use super::fault::{Fault, FaultKind};

pub use act::ActOptionsWire;
pub use assessment::{AssessmentReply, AssessmentRequest};
pub use calibration::CalibrationRequest;
pub use camera::{CameraPut, CameraWire, DerivedCameraWire, DistortionWire};
pub use camera_file::{CameraFormat, read_camera, write_camera};
pub use detector::DetectorWire;
pub use encounter::{EncounterReply, EncounterRequest};
pub use evaluation::EvaluationRequest;
pub use frame::FrameRequest;
pub use health::Health;
pub use job::{JobEventWire, JobWire};
pub use listing::{Cameras, NamedCamera, NamedStream, Streams, Targets};
pub use pattern::{PatternOrText, PatternWire};
pub use pose::{OneOrManyReplies, PoseBatch, PoseReplies, PoseReply, PoseRequest, PoseWire};
pub use prior::PriorWire;
pub use problem::Problem;
pub use reference::Ref;
pub use sighting::{DetectionReply, EstimateReply};
pub use stream::StreamWire;
pub use target::{MarkerWire, TargetWire};
pub use track_options::TrackOptionsWire;

/// Parses JSON; a fault names the place. What is no JSON is unreadable; JSON of the wrong shape is senseless.
///
/// # Errors
/// [`FaultKind::Unreadable`] or [`FaultKind::Senseless`] with a pointer.
pub fn from_json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Fault> {
    if bytes.is_empty() {
        return Err(Fault::new(FaultKind::Unreadable, "the body is empty: JSON is expected"));
    }
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let value: T = serde_path_to_error::deserialize(&mut deserializer).map_err(fault_of)?;
    deserializer.end().map_err(|error| Fault::new(FaultKind::Unreadable, format!("not JSON: {error}")))?;
    Ok(value)
}

/// Reads JSON that is already a value.
///
/// # Errors
/// [`FaultKind::Senseless`] with a pointer.
pub fn from_value<T: DeserializeOwned>(value: serde_json::Value) -> Result<T, Fault> {
    serde_path_to_error::deserialize(value).map_err(fault_of)
}

fn fault_of(error: serde_path_to_error::Error<serde_json::Error>) -> Fault {
    let pointer = pointer_of(error.path());
    let inner = error.into_inner();
    // Syntax, and numbers out of range, which serde_json counts as syntax.
    if !inner.is_data() {
        return Fault::new(FaultKind::Unreadable, format!("not JSON: {inner}"));
    }
    Fault { kind: FaultKind::Senseless, detail: inner.to_string(), pointer: Some(pointer) }
}

/// A path as a JSON pointer (RFC 6901).
fn pointer_of(path: &serde_path_to_error::Path) -> String {
    use serde_path_to_error::Segment;
    path.iter()
        .map(|segment| match segment {
            Segment::Seq { index } => format!("/{index}"),
            Segment::Map { key } => format!("/{}", key.replace('~', "~0").replace('/', "~1")),
            Segment::Enum { .. } | Segment::Unknown => String::new(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_names_its_place() {
        let fault = from_json::<CameraWire>(br#"{"width": 640, "height": 480, "fx": "long"}"#).expect_err("a string");
        assert_eq!((fault.kind, fault.pointer.as_deref()), (FaultKind::Senseless, Some("/fx")));
        let fault =
            from_json::<TargetWire>(br#"{"markers": [{"id": "a", "position_m": [0, null, 1]}]}"#).expect_err("a null");
        assert_eq!(fault.pointer.as_deref(), Some("/markers/0/position_m/1"));
    }

    #[test]
    fn nothing_may_follow() {
        let fault = from_json::<serde_json::Value>(b"{} {}").expect_err("two values");
        assert_eq!(fault.kind, FaultKind::Unreadable);
    }

    #[test]
    fn what_is_no_json_is_unreadable() {
        for bytes in [&b""[..], b"{", b"NaN", b"{\"fx\": 1e999}", b"\xff"] {
            assert_eq!(from_json::<CameraWire>(bytes).expect_err("no JSON").kind, FaultKind::Unreadable, "{bytes:?}");
        }
    }
}
