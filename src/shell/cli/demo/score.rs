//! How well a reply fits the truth.

use std::time::Duration;

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3};

use crate::geometry::CameraFromTarget;
use crate::shell::wire::{EstimateReply, PoseWire};

/// 95 % of chi-square with three degrees of freedom.
const CHI_SQUARE_3_95: f64 = 7.815;

/// One frame.
pub(super) struct Score {
    range_m: f64,
    markers: usize,
    latency: Duration,
    outcome: Outcome,
}

enum Outcome {
    Pose { position_m: f64, attitude_rad: f64, position_within: bool, attitude_within: bool, ambiguous: bool },
    None { reason: String },
}

pub(super) fn head(flight: &str) -> String {
    format!(
        "{flight:<10}{:>9}{:>9}{:>14}{:>14}{:>22}{:>11}",
        "range", "markers", "position off", "attitude off", "both within 95 %", "latency"
    )
}

impl Score {
    pub(super) fn of(truth: &CameraFromTarget, reply: &EstimateReply, latency: Duration) -> Self {
        let answer = reply.targets.first().map(|target| &target.answer);
        let outcome = match answer.and_then(|answer| answer.pose.as_ref()) {
            Some(pose) => compared(truth, pose, answer.is_some_and(|answer| answer.ambiguous)),
            None => {
                Outcome::None { reason: answer.and_then(|a| a.detail.clone()).unwrap_or_else(|| "no answer".into()) }
            }
        };
        let markers = reply.centroids.iter().filter(|c| c.marker.is_some()).count();
        Self { range_m: truth.translation.norm(), markers, latency, outcome }
    }

    pub(super) fn line(&self, number: u32) -> String {
        let start = format!("  {number:>4}    {:>7.2} m{:>9}", self.range_m, self.markers);
        let end = format!("{:>8.1} ms", self.latency.as_secs_f64() * 1e3);
        match &self.outcome {
            Outcome::Pose { position_m, attitude_rad, position_within, attitude_within, ambiguous } => {
                let within = match (position_within, attitude_within) {
                    (true, true) => "yes",
                    (false, true) => "position outside",
                    (true, false) => "attitude outside",
                    (false, false) => "both outside",
                };
                let note = if *ambiguous { " (ambiguous)" } else { "" };
                let (position, attitude) = (position_m * 1e3, attitude_rad.to_degrees());
                format!("{start}{position:>11.1} mm{attitude:>10.2} deg{:>22}{end}", format!("{within}{note}"))
            }
            Outcome::None { reason } => format!("{start}   no pose: {reason}{end}"),
        }
    }
}

fn compared(truth: &CameraFromTarget, pose: &PoseWire, ambiguous: bool) -> Outcome {
    let m = pose.rotation.matrix;
    let matrix = Matrix3::from_fn(|row, column| m[row][column]);
    let found = CameraFromTarget::new(Rotation3::from_matrix_unchecked(matrix), Vector3::from(pose.translation_m));
    let covariance = Matrix6::from_fn(|row, column| pose.covariance[row][column]);
    let error = found.difference_to(truth);
    let (position, attitude) = (error.fixed_rows::<3>(0).into_owned(), error.fixed_rows::<3>(3).into_owned());
    let within = |error: &Vector3<f64>, at: usize| {
        let block = covariance.fixed_view::<3, 3>(at, at).into_owned();
        block.cholesky().is_some_and(|c| error.dot(&c.solve(error)) < CHI_SQUARE_3_95)
    };
    Outcome::Pose {
        position_m: position.norm(),
        attitude_rad: attitude.norm(),
        position_within: within(&position, 0),
        attitude_within: within(&attitude, 3),
        ambiguous,
    }
}

/// Many frames.
#[derive(Default)]
pub(super) struct Scores(Vec<Score>);

impl Scores {
    pub(super) fn add(&mut self, score: Score) {
        self.0.push(score);
    }

    pub(super) fn append(&mut self, mut other: Self) {
        self.0.append(&mut other.0);
    }

    pub(super) fn summary(&self) -> String {
        let (mut position, mut attitude, mut within) = (Vec::new(), Vec::new(), 0);
        for score in &self.0 {
            if let Outcome::Pose { position_m, attitude_rad, position_within, attitude_within, .. } = score.outcome {
                position.push(position_m / score.range_m * 100.0);
                attitude.push(attitude_rad.to_degrees());
                within += usize::from(position_within) + usize::from(attitude_within);
            }
        }
        let latency: Vec<f64> = self.0.iter().map(|score| score.latency.as_secs_f64() * 1e3).collect();
        let share = within as f64 / (2 * position.len()).max(1) as f64 * 100.0;
        format!(
            "{} frames, {} poses. Position off by {:.3} % of the range (median), {:.3} % at worst; attitude by {:.3} deg, \
             {:.2} deg at worst.\nWithin the 95 % of their covariance: {share:.0} % of positions and attitudes. Latency over \
             HTTP: {:.1} ms (median), {:.1} ms (95 %).",
            self.0.len(),
            position.len(),
            quantile(&position, 0.5),
            quantile(&position, 1.0),
            quantile(&attitude, 0.5),
            quantile(&attitude, 1.0),
            quantile(&latency, 0.5),
            quantile(&latency, 0.95),
        )
    }
}

/// Of values in any order; `NaN` for none.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "a position")]
    let index = ((sorted.len().saturating_sub(1)) as f64 * share).round() as usize;
    sorted.get(index).copied().unwrap_or(f64::NAN)
}
