//! An answer against the truth.

use crate::geometry::{CameraFromTarget, EulerAngles, PoseCovariance, rotation};
use crate::pose::{NoPose, PoseAnswer, PoseEstimate};
use crate::scene::protocols::Trial;
use crate::scene::verdict::Verdict;

use super::method::Said;
use super::row::{ANSWER, CLAIMS, COLUMNS, ERRORS, ESTIMATE, FIRST_ERROR, OUTCOMES, Row, TRUTH};

/// The pose nearest to the truth is the right one if its normalised error squared is at most this: of right ones with a right
/// covariance, four in ten million exceed it.
const MAX_RIGHT_SQUARED: f64 = 40.0;
/// Larger normalised errors squared count as this, so that one that is absurd does not hide how many there are.
const MOST_SQUARED: f64 = 1e6;

/// What is found of one answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// Place in [`OUTCOMES`].
    pub outcome: usize,
    /// Of the best pose, where there is one.
    pub pose: Option<PoseJudgement>,
}

/// What is found of the poses of an answer.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseJudgement {
    /// The [`ERRORS`] of the best pose.
    pub errors: [f64; ERRORS.len()],
    /// Near the truth; see [`Verdict::is_good`].
    pub is_good: bool,
    /// See [`Verdict::is_flip`].
    pub is_flip: bool,
    /// Whether the answer calls itself ambiguous.
    pub is_ambiguous: bool,
    /// Squared error of the best pose in units of the Cramer-Rao bound, where that is sharp and the pose no flip.
    pub over_bound_squared: Option<f64>,
    /// What the answer says of itself, where it does.
    pub claims: Option<Claims>,
}

/// What an answer says of itself, against the truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Claims {
    /// Squared error of the pose nearest to the truth, by its own covariance.
    pub nearest_squared: f64,
    /// Whether that covariance calls itself reliable.
    pub is_reliable: bool,
    /// The stated probability of each pose, and whether it is the right one; the best first.
    pub stated: Vec<(f64, bool)>,
    /// See [`PoseEstimate`].
    pub reprojection_rms_px: f64,
}

/// Compares an answer with the truth of `trial`, whose Cramer-Rao bound is given where it is sharp.
#[must_use]
pub fn judge(trial: &Trial, bound: Option<&PoseCovariance>, said: &Result<Said, NoPose>) -> Judgement {
    match said {
        Ok(said) => Judgement { outcome: 0, pose: Some(judge_pose(trial, bound, said)) },
        Err(reason) => {
            let outcome = OUTCOMES.iter().position(|name| *name == reason.reason()).unwrap_or_default();
            Judgement { outcome, pose: None }
        }
    }
}

fn judge_pose(trial: &Trial, bound: Option<&PoseCovariance>, said: &Said) -> PoseJudgement {
    let truth = &trial.case.camera_from_target;
    let (found, answer) = match said {
        Said::Pose(pose) => (pose, None),
        Said::Answer(answer) => (&answer.best.camera_from_target, Some(answer)),
    };
    let verdict = Verdict::of(trial, bound, found);
    PoseJudgement {
        errors: errors(found, truth, &verdict),
        is_good: verdict.is_good(),
        is_flip: verdict.is_flip(),
        is_ambiguous: answer.is_some_and(PoseAnswer::is_ambiguous),
        over_bound_squared: verdict.normalized_error_squared.filter(|_| !verdict.is_flip()),
        claims: answer.map(|answer| Claims::of(answer, truth)),
    }
}

impl Claims {
    fn of(answer: &PoseAnswer, truth: &CameraFromTarget) -> Self {
        let poses: Vec<&PoseEstimate> = std::iter::once(&answer.best).chain(&answer.alternatives).collect();
        let off = |estimate: &PoseEstimate| {
            rotation::angle_between_rad(&estimate.camera_from_target.rotation, &truth.rotation)
        };
        let nearest = poses.iter().copied().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(&answer.best);
        let nearest_squared =
            nearest.covariance.normalized_error_squared(&nearest.camera_from_target, truth).min(MOST_SQUARED);
        let is_right = |pose: &PoseEstimate| std::ptr::eq(pose, nearest) && nearest_squared <= MAX_RIGHT_SQUARED;
        Self {
            nearest_squared,
            is_reliable: nearest.covariance_reliable,
            stated: poses.iter().map(|pose| (pose.probability, is_right(pose))).collect(),
            reprojection_rms_px: answer.best.reprojection_rms_px,
        }
    }
}

fn errors(found: &CameraFromTarget, truth: &CameraFromTarget, verdict: &Verdict) -> [f64; ERRORS.len()] {
    let [roll, pitch, yaw] = degrees(found);
    let [true_roll, true_pitch, true_yaw] = degrees(truth);
    let moved = found.translation - truth.translation;
    [
        turned(roll - true_roll),
        turned(pitch - true_pitch),
        turned(yaw - true_yaw),
        moved.x,
        moved.y,
        moved.z,
        verdict.rotation_deg,
        moved.norm(),
        verdict.range_ratio,
    ]
}

fn degrees(pose: &CameraFromTarget) -> [f64; 3] {
    let EulerAngles { roll_rad, pitch_rad, yaw_rad } = EulerAngles::from_rotation(&pose.rotation);
    [roll_rad, pitch_rad, yaw_rad].map(f64::to_degrees)
}

/// The same turn between -180 and 180 degrees.
fn turned(degrees: f64) -> f64 {
    (degrees + 180.0).rem_euclid(360.0) - 180.0
}

impl Judgement {
    /// As a row of the table.
    #[must_use]
    pub fn row(&self, [step, run, method]: [u64; 3], truth: &CameraFromTarget, answer_s: f64) -> Row {
        let mut values = [None; COLUMNS.len()];
        let mut put = |first: usize, of: &[f64]| {
            for (place, value) in of.iter().enumerate() {
                values[first + place] = Some(*value).filter(|value| value.is_finite());
            }
        };
        put(TRUTH, &degrees(truth));
        put(TRUTH + 3, truth.translation.as_slice());
        put(ANSWER, &[answer_s * 1e6]);
        if let Some(pose) = &self.pose {
            let flag = |holds: bool| f64::from(u8::from(holds));
            put(FIRST_ERROR, &pose.errors);
            put(ESTIMATE, &[flag(pose.is_good), flag(pose.is_flip), pose.over_bound_squared.unwrap_or(f64::NAN)]);
            if let Some(claims) = &pose.claims {
                let (probability, is_right) = claims.stated.first().copied().unwrap_or_default();
                let count = claims.stated.len() as f64;
                let reliable = flag(claims.is_reliable);
                let said =
                    [claims.reprojection_rms_px, probability, count, flag(is_right), reliable, claims.nearest_squared];
                put(CLAIMS, &said);
            }
        }
        Row { step, run, method, outcome: self.outcome as u64, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_the_short_way_round() {
        for (given, wanted) in [(0.0, 0.0), (190.0, -170.0), (-359.0, 1.0), (180.0, -180.0), (720.5, 0.5)] {
            assert!((turned(given) - wanted).abs() < 1e-12, "{given}");
        }
    }
}
