//! How the answer for one frame stands to the truth.

use super::truth::Presence;
use crate::detect::Class;

/// How the answer for one frame stands to the truth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Of the detector, where it is known what it ought to report.
    pub detection: Option<DetectionVerdict>,
    /// Of each target looked for.
    pub targets: Vec<TargetVerdict>,
}

/// What a detector reported.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DetectionVerdict {
    /// Things that it ought to have reported.
    pub objects: u32,
    /// Reports of a thing, one a thing.
    pub hits: Vec<Hit>,
    /// Reports of nothing, and further reports of a thing.
    pub false_alarms: Vec<FalseAlarm>,
}

/// A report of a thing.
#[derive(Clone, Debug, PartialEq)]
pub struct Hit {
    /// How sure the detector is.
    pub score: f64,
    /// Reported place minus the true one, px; of a box the true place is its middle.
    pub error_px: [f64; 2],
    /// Stated standard deviation per axis, px; of markers alone, as the middle of a box is no centroid.
    pub sigma_px: Option<f64>,
    /// How far the thing is, where that is known.
    pub range_m: Option<f64>,
    /// What the detector calls it.
    pub class: Option<Class>,
    /// What it is.
    pub true_class: Option<String>,
}

/// A report of nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FalseAlarm {
    /// How sure the detector is.
    pub score: f64,
}

/// What was said of a target.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetVerdict {
    /// Whether it is there.
    pub presence: Presence,
    /// Whether a pose can be asked for.
    pub is_solvable: bool,
    /// The seed's word: at least four of its markers were found.
    pub is_detected: bool,
    /// Its markers that are seen; `None` if that is not known.
    pub visible_markers: Option<u32>,
    /// Of its markers, those identified where they are.
    pub right_markers: u32,
    /// Of its markers, those identified elsewhere.
    pub wrong_markers: u32,
    /// How far it is, where that is known.
    pub range_m: Option<f64>,
    /// What became of its pose, where that is known or there must be none.
    pub outcome: Option<Outcome>,
    /// Why there is no pose.
    pub reason: Option<String>,
    /// The pose against the truth, if both are there.
    pub pose: Option<PoseVerdict>,
}

/// What became of a target's pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The best pose is the right one.
    Right,
    /// The right one is among the alternatives, and the answer calls itself ambiguous.
    Flagged,
    /// There is no pose of a target that is seen.
    Missed,
    /// The right one is nowhere, or the answer does not warn of it.
    Wrong,
    /// There is no pose of a target that is not seen.
    Refused,
    /// A pose of a target that is not seen.
    Invented,
}

/// The best pose against the truth.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseVerdict {
    /// `(t_true - t, Log(R_true R^T))`, m and rad.
    pub error: [f64; 6],
    /// Roll, pitch and yaw, true minus estimated, in (-pi, pi].
    pub euler_error_rad: [f64; 3],
    /// Squared error over the stated covariance: chi-square with six degrees of freedom where that holds.
    pub normalized_squared: f64,
    /// Whether the answer says that its covariance holds as such.
    pub is_reliable: bool,
    /// That this pose is the right one, as stated.
    pub probability: f64,
    /// All poses of the answer, the best first.
    pub candidates: Vec<Candidate>,
}

/// A pose of an answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// That it is the right one, as stated.
    pub probability: f64,
    /// Whether it is: of the poses given the nearest to the truth, and near it or as far off as its covariance allows.
    pub is_right: bool,
}
