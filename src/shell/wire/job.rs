//! Jobs: what is told of them, whatever they compute.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use super::Problem;
use crate::shell::store::jobs::{Finishing, Job, JobEvent, JobFile, JobStatus};

/// A job.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct JobWire {
    /// Names it.
    pub id: String,
    /// `calibration` or `evaluation`.
    pub kind: String,
    /// Where it stands.
    pub status: JobStatus,
    /// The part of it that is done, 0 to 1.
    pub progress: f64,
    /// Its parts, known once it is prepared. A calibration has one for each picture, an evaluation one for each part of its
    /// runs.
    pub shards: Option<u32>,
    /// Those that are done.
    pub shards_done: u32,
    /// What was asked.
    pub request: Value,
    /// The pictures that came with it; they are removed when the job has ended.
    pub files: Vec<JobFile>,
    /// What came of it. A failed job may have one too: what could be found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub result: Option<Value>,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<Problem>,
    /// When it was made, us since 1970.
    pub created_us: i64,
    /// When it was begun.
    pub started_us: Option<i64>,
    /// When it ended.
    pub finished_us: Option<i64>,
}

impl From<Job> for JobWire {
    fn from(job: Job) -> Self {
        Self {
            progress: progress(job.status, job.done, job.shards, job.finishing),
            id: job.id,
            kind: job.kind,
            status: job.status,
            shards: job.shards,
            shards_done: job.done,
            request: job.request,
            files: job.files,
            result: job.result,
            error: job.problem.and_then(|problem| serde_json::from_value(problem).ok()),
            created_us: job.created_us,
            started_us: job.started_us,
            finished_us: job.finished_us,
        }
    }
}

/// Something that happened to a job.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct JobEventWire {
    /// Where the job stood then.
    pub status: JobStatus,
    /// The part that was done, 0 to 1.
    pub progress: f64,
    /// Its parts, known once it is prepared.
    pub shards: Option<u32>,
    /// Those that were done.
    pub shards_done: u32,
    /// In words: `left03.jpg: 54 points`.
    pub message: String,
    /// When, us since 1970.
    pub time_us: i64,
}

impl From<JobEvent> for JobEventWire {
    fn from(event: JobEvent) -> Self {
        Self {
            progress: progress(event.status, event.done, event.shards, event.finishing),
            status: event.status,
            shards: event.shards,
            shards_done: event.done,
            message: event.message,
            time_us: event.time_us,
        }
    }
}

/// Putting the parts together counts as some of them.
fn progress(status: JobStatus, done: u32, shards: Option<u32>, finishing: Finishing) -> f64 {
    match (status, shards) {
        (JobStatus::Succeeded, _) => 1.0,
        (_, Some(shards)) => {
            let finish = f64::from(finishing.shards);
            (f64::from(done) + finish * f64::from(finishing.permille) / 1000.0) / (f64::from(shards) + finish)
        }
        (_, None) => 0.0,
    }
}
