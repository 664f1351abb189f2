//! What a unit of recorded frames came to: exact, so that it may be stored and read again before figures are made of it.

use serde::{Deserialize, Serialize};

use crate::detect::Class;
use crate::evaluate::recorded::{
    Candidate, DetectionVerdict, FalseAlarm, Hit, Outcome, PoseVerdict, Presence, TargetVerdict, Verdict,
};
use crate::shell::wire::sighting::Timing;

/// What a picture or a video came to.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct UnitOutcome {
    /// Name of its file.
    pub name: String,
    /// The suite that it belongs to.
    pub suite: String,
    /// Frames in their order.
    pub frames: Vec<FrameOutcome>,
    /// What could not be looked at.
    pub failed: Vec<FailedWire>,
}

/// Frames that could not be looked at.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize, utoipa::ToSchema)]
#[schema(as = RecordedFailure)]
pub struct FailedWire {
    /// Name of the file.
    pub frame: String,
    /// Of a video: the first of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame_index: Option<u64>,
    /// How many.
    pub frames: u32,
    /// Why.
    pub reason: String,
}

/// What a frame came to.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct FrameOutcome {
    /// Of a video: its number.
    pub frame_index: Option<u64>,
    detection: Option<DetectionOutcome>,
    targets: Vec<TargetOutcome>,
    /// Time taken.
    pub timing_us: Timing,
}

#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
struct DetectionOutcome {
    objects: u32,
    hits: Vec<HitOutcome>,
    false_alarm_scores: Vec<f64>,
}

#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
struct HitOutcome {
    score: f64,
    error_px: [f64; 2],
    sigma_px: Option<f64>,
    range_m: Option<f64>,
    class: Option<ClassName>,
    true_class: Option<String>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum ClassName {
    Aircraft,
    Bird,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum PresenceName {
    Absent,
    TurnedAway,
    Seen,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum OutcomeName {
    Right,
    Flagged,
    Missed,
    Wrong,
    Refused,
    Invented,
}

#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
struct TargetOutcome {
    presence: PresenceName,
    is_solvable: bool,
    is_detected: bool,
    visible_markers: Option<u32>,
    right_markers: u32,
    wrong_markers: u32,
    range_m: Option<f64>,
    outcome: Option<OutcomeName>,
    reason: Option<String>,
    pose: Option<PoseOutcome>,
}

#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
struct PoseOutcome {
    error: [f64; 6],
    euler_error_rad: [f64; 3],
    normalized_squared: f64,
    is_reliable: bool,
    probability: f64,
    candidates: Vec<(f64, bool)>,
}

/// Each of the one is one of the other.
macro_rules! same_names {
    ($name:ident, $core:ident: $($variant:ident),*) => {
        impl From<$core> for $name {
            fn from(core: $core) -> Self {
                match core { $($core::$variant => Self::$variant),* }
            }
        }

        impl From<$name> for $core {
            fn from(name: $name) -> Self {
                match name { $($name::$variant => Self::$variant),* }
            }
        }
    };
}

same_names!(ClassName, Class: Aircraft, Bird);
same_names!(PresenceName, Presence: Absent, TurnedAway, Seen);
same_names!(OutcomeName, Outcome: Right, Flagged, Missed, Wrong, Refused, Invented);

impl OutcomeName {
    const fn word(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Flagged => "flagged",
            Self::Missed => "missed",
            Self::Wrong => "wrong",
            Self::Refused => "refused",
            Self::Invented => "invented",
        }
    }
}

impl FrameOutcome {
    /// Of a verdict.
    #[must_use]
    pub fn of(frame_index: Option<u64>, verdict: Verdict, timing_us: Timing) -> Self {
        Self {
            frame_index,
            detection: verdict.detection.map(DetectionOutcome::from),
            targets: verdict.targets.into_iter().map(TargetOutcome::from).collect(),
            timing_us,
        }
    }

    /// The verdict again.
    #[must_use]
    pub fn verdict(self) -> Verdict {
        Verdict {
            detection: self.detection.map(DetectionVerdict::from),
            targets: self.targets.into_iter().map(TargetVerdict::from).collect(),
        }
    }

    /// Heads of [`cells`](Self::cells).
    pub const HEADS: [&'static str; 19] = [
        "objects",
        "hits",
        "false_alarms",
        "detected",
        "visible_markers",
        "right_markers",
        "wrong_markers",
        "outcome",
        "reason",
        "range_m",
        "position_error_m",
        "attitude_error_rad",
        "normalized_error_squared",
        "probability",
        "decode_us",
        "detect_us",
        "identify_us",
        "solve_us",
        "total_us",
    ];

    /// A row of a table, of its first target.
    #[must_use]
    pub fn cells(&self) -> [String; 19] {
        fn shown<T: ToString>(value: Option<T>) -> String {
            value.map_or_else(String::new, |value| value.to_string())
        }
        let (detection, target) = (self.detection.as_ref(), self.targets.first());
        let pose = target.and_then(|target| target.pose.as_ref());
        let length = |error: &[f64]| error.iter().map(|x| x * x).sum::<f64>().sqrt();
        let timing = &self.timing_us;
        [
            shown(detection.map(|detection| detection.objects)),
            shown(detection.map(|detection| detection.hits.len())),
            shown(detection.map(|detection| detection.false_alarm_scores.len())),
            shown(target.map(|target| target.is_detected)),
            shown(target.and_then(|target| target.visible_markers)),
            shown(target.map(|target| target.right_markers)),
            shown(target.map(|target| target.wrong_markers)),
            shown(target.and_then(|target| target.outcome).map(OutcomeName::word)),
            shown(target.and_then(|target| target.reason.as_deref())),
            shown(target.and_then(|target| target.range_m)),
            shown(pose.map(|pose| length(&pose.error[..3]))),
            shown(pose.map(|pose| length(&pose.error[3..]))),
            shown(pose.map(|pose| pose.normalized_squared)),
            shown(pose.map(|pose| pose.probability)),
            timing.decode.to_string(),
            timing.detect.to_string(),
            shown(timing.identify),
            shown(timing.solve),
            timing.total.to_string(),
        ]
    }
}

impl From<DetectionVerdict> for DetectionOutcome {
    fn from(verdict: DetectionVerdict) -> Self {
        let hit = |hit: Hit| HitOutcome {
            score: hit.score,
            error_px: hit.error_px,
            sigma_px: hit.sigma_px,
            range_m: hit.range_m,
            class: hit.class.map(ClassName::from),
            true_class: hit.true_class,
        };
        Self {
            objects: verdict.objects,
            hits: verdict.hits.into_iter().map(hit).collect(),
            false_alarm_scores: verdict.false_alarms.iter().map(|alarm| alarm.score).collect(),
        }
    }
}

impl From<DetectionOutcome> for DetectionVerdict {
    fn from(outcome: DetectionOutcome) -> Self {
        let hit = |hit: HitOutcome| Hit {
            score: hit.score,
            error_px: hit.error_px,
            sigma_px: hit.sigma_px,
            range_m: hit.range_m,
            class: hit.class.map(Class::from),
            true_class: hit.true_class,
        };
        Self {
            objects: outcome.objects,
            hits: outcome.hits.into_iter().map(hit).collect(),
            false_alarms: outcome.false_alarm_scores.into_iter().map(|score| FalseAlarm { score }).collect(),
        }
    }
}

impl From<TargetVerdict> for TargetOutcome {
    fn from(verdict: TargetVerdict) -> Self {
        let pose = |pose: PoseVerdict| PoseOutcome {
            error: pose.error,
            euler_error_rad: pose.euler_error_rad,
            normalized_squared: pose.normalized_squared,
            is_reliable: pose.is_reliable,
            probability: pose.probability,
            candidates: pose.candidates.iter().map(|c| (c.probability, c.is_right)).collect(),
        };
        Self {
            presence: verdict.presence.into(),
            is_solvable: verdict.is_solvable,
            is_detected: verdict.is_detected,
            visible_markers: verdict.visible_markers,
            right_markers: verdict.right_markers,
            wrong_markers: verdict.wrong_markers,
            range_m: verdict.range_m,
            outcome: verdict.outcome.map(OutcomeName::from),
            reason: verdict.reason,
            pose: verdict.pose.map(pose),
        }
    }
}

impl From<TargetOutcome> for TargetVerdict {
    fn from(outcome: TargetOutcome) -> Self {
        let candidate = |(probability, is_right)| Candidate { probability, is_right };
        let pose = |pose: PoseOutcome| PoseVerdict {
            error: pose.error,
            euler_error_rad: pose.euler_error_rad,
            normalized_squared: pose.normalized_squared,
            is_reliable: pose.is_reliable,
            probability: pose.probability,
            candidates: pose.candidates.into_iter().map(candidate).collect(),
        };
        Self {
            presence: outcome.presence.into(),
            is_solvable: outcome.is_solvable,
            is_detected: outcome.is_detected,
            visible_markers: outcome.visible_markers,
            right_markers: outcome.right_markers,
            wrong_markers: outcome.wrong_markers,
            range_m: outcome.range_m,
            outcome: outcome.outcome.map(Outcome::from),
            reason: outcome.reason,
            pose: outcome.pose.map(pose),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_stored_is_read_to_the_last_digit() {
        let hit = Hit {
            score: 0.1 + 0.2,
            error_px: [1.0 / 3.0, -2e-17],
            sigma_px: Some(0.7_f64.sqrt()),
            range_m: None,
            class: Some(Class::Bird),
            true_class: Some("kite".into()),
        };
        let pose = PoseVerdict {
            error: std::array::from_fn(|axis| (axis as f64 + 2.0).ln() * 1e-3),
            euler_error_rad: [0.1, -1.0 / 7.0, std::f64::consts::PI],
            normalized_squared: f64::MAX,
            is_reliable: true,
            probability: 0.9,
            candidates: vec![Candidate { probability: 2.0 / 3.0, is_right: true }],
        };
        let target = TargetVerdict {
            presence: Presence::TurnedAway,
            is_solvable: false,
            is_detected: true,
            visible_markers: Some(3),
            right_markers: 1,
            wrong_markers: 2,
            range_m: Some(1e-300),
            outcome: Some(Outcome::Invented),
            reason: Some("not_identified".into()),
            pose: Some(pose),
        };
        let false_alarms = vec![FalseAlarm { score: 0.05 * 0.7 }];
        let detection = DetectionVerdict { objects: 7, hits: vec![hit], false_alarms };
        let verdict = Verdict { detection: Some(detection), targets: vec![target] };
        let stored = serde_json::to_string(&FrameOutcome::of(None, verdict.clone(), Timing::default())).expect("JSON");
        let read: FrameOutcome = serde_json::from_str(&stored).expect("reads");
        assert_eq!(read.verdict(), verdict);
    }
}
