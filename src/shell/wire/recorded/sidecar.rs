//! `truth.json`: what is known of the frames in a folder or an archive.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::camera::Pixel;
use crate::evaluate::recorded::{BoxTruth, MarkerTruth, Presence, TargetTruth};
use crate::geometry::{CameraFromTarget, rotation};
use crate::shell::fault::Fault;
use crate::shell::wire::pose::SolverName;
use crate::shell::wire::{CameraWire, DetectorWire, Ref, TargetWire};
use crate::target::Target;

/// The truth of a folder or an archive of frames. Files are named relative to it and are inside; names of things are the contract's.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = RecordedTruth)]
pub struct SidecarWire {
    /// Cameras by the names that frames give.
    pub cameras: BTreeMap<String, CameraWire>,
    /// Targets by the names that frames give.
    pub targets: BTreeMap<String, TargetWire>,
    /// Pictures.
    pub frames: Vec<FrameTruthWire>,
    /// Videos.
    pub videos: Vec<VideoTruthWire>,
}

/// What is known of a picture. `target`, `target_present`, `front_facing`, `pose` and `markers` are of one target; several targets are
/// listed in `targets`.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = RecordedFrame)]
pub struct FrameTruthWire {
    /// Name of its file.
    pub frame: String,
    /// Figures are given for each suite; `frames` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub suite: Option<String>,
    /// The camera, or the name of one of `cameras`. Poses need it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<crate::shell::wire::reference::CameraOrName>)]
    pub camera: Option<Ref<CameraWire>>,
    /// The detector, as in a request to the API; `color` if left out, or what `mode` says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detector: Option<DetectorWire>,
    /// What the markers are, in place of a detector.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mode: Option<Mode>,
    /// Region of interest: x, y, width, height.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub region_px: Option<[u32; 4]>,
    /// The method for the pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solver: Option<SolverName>,
    /// The target to look for, or the name of one of `targets` at the top.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<crate::shell::wire::reference::TargetOrName>)]
    pub target: Option<Ref<TargetWire>>,
    /// False: the target is not in the frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_present: Option<bool>,
    /// False: it shows its back, so that no marker can be seen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub front_facing: Option<bool>,
    /// Where it is: `camera_from_target`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose: Option<PoseTruthWire>,
    /// Where its markers are; those that are not listed are not seen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub markers: Option<Vec<MarkerTruthWire>>,
    /// Several targets.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub targets: Option<Vec<TargetTruthWire>>,
    /// What a detector ought to report; an empty list says that there is nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub boxes: Option<Vec<BoxWire>>,
}

/// What is known of a target in a frame.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RecordedTarget)]
pub struct TargetTruthWire {
    /// The target, or the name of one of `targets` at the top.
    #[schema(value_type = crate::shell::wire::reference::TargetOrName)]
    pub target: Ref<TargetWire>,
    /// False: it is not in the frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_present: Option<bool>,
    /// False: it shows its back.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub front_facing: Option<bool>,
    /// Where it is: `camera_from_target`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<PoseTruthWire>,
    /// Where its markers are; those that are not listed are not seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub markers: Option<Vec<MarkerTruthWire>>,
}

/// What is known of a video. Its frames are taken in their order, those without truth too, which then only are part of the sequence.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = RecordedVideo)]
pub struct VideoTruthWire {
    /// Name of its file.
    pub video: String,
    /// Figures are given for each suite; `frames` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub suite: Option<String>,
    /// The camera, or the name of one of `cameras`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<crate::shell::wire::reference::CameraOrName>)]
    pub camera: Option<Ref<CameraWire>>,
    /// The target to look for; without it detections alone are judged.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<crate::shell::wire::reference::TargetOrName>)]
    pub target: Option<Ref<TargetWire>>,
    /// The detector; `edge` follows what it finds from frame to frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detector: Option<DetectorWire>,
    /// Region of interest: x, y, width, height.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub region_px: Option<[u32; 4]>,
    /// The method for the pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solver: Option<SolverName>,
    /// Frames of which something is known.
    pub frames: Vec<VideoFrameWire>,
}

/// What is known of a frame of a video.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = RecordedVideoFrame)]
pub struct VideoFrameWire {
    /// Its number, from 0.
    pub frame_index: u64,
    /// False: the target is not in the frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_present: Option<bool>,
    /// False: it shows its back.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub front_facing: Option<bool>,
    /// Where it is: `camera_from_target`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose: Option<PoseTruthWire>,
    /// Where its markers are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub markers: Option<Vec<MarkerTruthWire>>,
    /// What a detector ought to report; an empty list says that there is nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub boxes: Option<Vec<BoxWire>>,
}

/// What markers are.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RecordedMarkerMode)]
pub enum Mode {
    /// Coloured discs: the detector is `color`.
    Disc,
    /// LEDs: the detector is `beacon`.
    Led,
}

/// A true pose; further fields, as those of a reply, are not looked at.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedPose)]
pub struct PoseTruthWire {
    /// Its rotation.
    pub rotation: RotationTruthWire,
    /// Its translation.
    pub translation_m: [f64; 3],
}

/// A true rotation, as a matrix or as a quaternion.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default)]
#[schema(as = RecordedRotation)]
pub struct RotationTruthWire {
    /// Rows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub matrix: Option<[[f64; 3]; 3]>,
    /// x, y, z, w.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quaternion_xyzw: Option<[f64; 4]>,
}

/// Where a marker is.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RecordedMarker)]
pub struct MarkerTruthWire {
    /// Its id in the target.
    pub marker: String,
    /// Whether it is seen.
    #[serde(default)]
    pub state: MarkerState,
    /// Centroid of its light, to the right. The centre of the top-left pixel is 0.
    pub u_px: f64,
    /// Centroid of its light, down.
    pub v_px: f64,
    /// Image of the disc's centre; not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre_px: Option<[f64; 2]>,
    /// Area of its image; not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area_px: Option<f64>,
    /// Share of it that is seen; not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visible_fraction: Option<f64>,
}

/// Whether a marker is seen.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RecordedMarkerState)]
pub enum MarkerState {
    /// It is to be reported.
    #[default]
    Visible,
    /// It is covered, perhaps not wholly: a report of it is neither right nor wrong.
    Hidden,
}

/// A thing by its box.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RecordedBox)]
pub struct BoxWire {
    /// x, y of the upper left corner, width, height; need not be whole.
    pub box_px: [f64; 4],
    /// What it is: `aircraft`, `bird`, or any other word.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
}

/// A matrix may be off from a rotation by so much in each entry: truth is written with four digits and more.
const MAX_ROTATION_ERROR: f64 = 1e-3;

impl RotationTruthWire {
    fn checked(&self) -> Result<nalgebra::Rotation3<f64>, Fault> {
        match (self.matrix, self.quaternion_xyzw) {
            (Some(rows), _) => {
                let matrix = Matrix3::from_fn(|row, column| rows[row][column]);
                let nearest = rotation::nearest(&matrix).filter(|nearest| {
                    (nearest.matrix() - matrix).amax() < MAX_ROTATION_ERROR && matrix.iter().all(|x| x.is_finite())
                });
                nearest.ok_or_else(|| {
                    let detail = format!(
                        "no rotation: rows of length 1, at right angles, with determinant +1 are needed; the determinant is {:.4}",
                        matrix.determinant()
                    );
                    Fault::senseless("/matrix", detail)
                })
            }
            (None, Some([x, y, z, w])) => {
                let quaternion = Quaternion::new(w, x, y, z);
                let norm = quaternion.norm();
                if !((norm - 1.0).abs() < MAX_ROTATION_ERROR) {
                    let detail = format!("no rotation: a quaternion of length 1 is needed, not {norm:.4}");
                    return Err(Fault::senseless("/quaternion_xyzw", detail));
                }
                Ok(rotation::from_quaternion(&UnitQuaternion::from_quaternion(quaternion)))
            }
            (None, None) => Err(Fault::senseless("", "a rotation is given as matrix or as quaternion_xyzw")),
        }
    }
}

impl PoseTruthWire {
    /// The pose.
    ///
    /// # Errors
    /// What is no rotation, or no place.
    pub fn checked(&self) -> Result<CameraFromTarget, Fault> {
        let rotation = self.rotation.checked().map_err(|fault| fault.within("/rotation"))?;
        let translation = Vector3::from(self.translation_m);
        if !(translation.norm() > 0.0) || !translation.norm().is_finite() {
            return Err(Fault::senseless("/translation_m", "a target in the camera itself"));
        }
        Ok(CameraFromTarget::new(rotation, translation))
    }
}

impl BoxWire {
    /// The box.
    ///
    /// # Errors
    /// One without a size.
    pub fn checked(&self) -> Result<BoxTruth, Fault> {
        let [x, y, width, height] = self.box_px;
        if !(width > 0.0 && height > 0.0) {
            return Err(Fault::senseless("/box_px", format!("{width} x {height} px: a box has a width and a height")));
        }
        Ok(BoxTruth { corner_px: [x, y], size_px: [width, height], class: self.class.clone() })
    }
}

/// What a frame says of one target, wherever it stands.
#[derive(Clone, Copy, Debug)]
pub struct Said<'a> {
    /// Whether it is in the frame.
    pub target_present: Option<bool>,
    /// Whether it shows its markers.
    pub front_facing: Option<bool>,
    /// Where it is.
    pub pose: Option<&'a PoseTruthWire>,
    /// Where its markers are.
    pub markers: Option<&'a [MarkerTruthWire]>,
}

macro_rules! says {
    ($($frame:ty),*) => {$(
        impl $frame {
            /// What it says of its target.
            #[must_use]
            pub fn said(&self) -> Said<'_> {
                Said {
                    target_present: self.target_present,
                    front_facing: self.front_facing,
                    pose: self.pose.as_ref(),
                    markers: self.markers.as_deref(),
                }
            }
        }
    )*};
}

says!(FrameTruthWire, TargetTruthWire, VideoFrameWire);

impl Said<'_> {
    /// Whether nothing is said.
    #[must_use]
    pub const fn is_nothing(&self) -> bool {
        self.target_present.is_none() && self.front_facing.is_none() && self.pose.is_none() && self.markers.is_none()
    }

    /// The truth of `target`.
    ///
    /// # Errors
    /// Nothing said, no rotation, or a marker that the target does not have.
    pub fn checked(&self, target: &Target) -> Result<TargetTruth, Fault> {
        if self.is_nothing() {
            let detail = "nothing is known of the target: give its pose, its markers, or target_present";
            return Err(Fault::senseless("", detail));
        }
        let pose = self.pose.map(PoseTruthWire::checked).transpose().map_err(|fault| fault.within("/pose"))?;
        let presence = if self.target_present == Some(false) {
            Presence::Absent
        } else if self.front_facing == Some(false) {
            Presence::TurnedAway
        } else {
            Presence::Seen
        };
        if presence == Presence::Absent && pose.is_some() {
            return Err(Fault::senseless("/target_present", "a target that is not in the frame has no pose"));
        }
        Ok(TargetTruth { presence, camera_from_target: pose, markers: self.markers_of(target)? })
    }

    fn markers_of(&self, target: &Target) -> Result<Option<Vec<MarkerTruth>>, Fault> {
        let Some(said) = self.markers else { return Ok(None) };
        let mut known = vec![MarkerTruth::Unseen; target.markers().len()];
        for (number, marker) in said.iter().enumerate() {
            let place = target.markers().iter().position(|placed| placed.id == marker.marker).ok_or_else(|| {
                let detail = format!("the target {} has no marker {:?}", target.name(), marker.marker);
                Fault::senseless(format!("/markers/{number}/marker"), detail)
            })?;
            if known[place] != MarkerTruth::Unseen {
                return Err(Fault::senseless(format!("/markers/{number}"), "a marker that was named before"));
            }
            let pixel = Pixel::new(marker.u_px, marker.v_px);
            known[place] = match marker.state {
                MarkerState::Visible => MarkerTruth::Visible(pixel),
                MarkerState::Hidden => MarkerTruth::Hidden(pixel),
            };
        }
        Ok(Some(known))
    }
}

/// How recorded frames are looked at.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordedRequest {
    /// Taken for all frames, whatever their truth names.
    #[serde(default)]
    pub detector: Option<DetectorWire>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::wire::from_json;

    #[test]
    fn a_matrix_and_a_quaternion_say_the_same() {
        let (half, angle) = (0.35_f64, 0.7_f64);
        let (c, s) = (angle.cos(), angle.sin());
        let by_matrix =
            RotationTruthWire { matrix: Some([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), ..Default::default() };
        let by_quaternion =
            RotationTruthWire { quaternion_xyzw: Some([0.0, 0.0, half.sin(), half.cos()]), ..Default::default() };
        let [a, b] = [by_matrix, by_quaternion].map(|wire| wire.checked().expect("a rotation"));
        assert!(rotation::angle_between_rad(&a, &b) < 1e-12);
    }

    #[test]
    fn what_is_no_rotation_is_refused_with_its_place() {
        let refused = |rotation: &str| {
            let text = format!(r#"{{"rotation": {rotation}, "translation_m": [0, 0, 5]}}"#);
            let pose: PoseTruthWire = from_json(text.as_bytes()).expect("parses");
            pose.checked().expect_err("no rotation").pointer.expect("a place")
        };
        assert_eq!(refused(r#"{"matrix": [[1,0,0],[0,1,0],[0,0,-1]]}"#), "/rotation/matrix");
        assert_eq!(refused(r#"{"matrix": [[2,0,0],[0,1,0],[0,0,1]]}"#), "/rotation/matrix");
        assert_eq!(refused(r#"{"quaternion_xyzw": [0,0,0,0.5]}"#), "/rotation/quaternion_xyzw");
        assert_eq!(refused("{}"), "/rotation");
    }

    #[test]
    fn a_misspelt_field_is_refused() {
        let fault = from_json::<SidecarWire>(br#"{"frames": [{"frame": "a.jpg", "boxs": []}]}"#).expect_err("misspelt");
        assert!(fault.pointer.as_deref().is_some_and(|pointer| pointer.starts_with("/frames/0")), "{fault:?}");
    }
}
