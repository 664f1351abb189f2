//! What a job is, and what becomes of it.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Where a job stands.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Hash, Serialize, sqlx::Type, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
#[sqlx(type_name = "text", rename_all = "snake_case")]
pub enum JobStatus {
    /// Nobody has begun it.
    Queued,
    /// Somebody is at it.
    Running,
    /// It has a result.
    Succeeded,
    /// It has a reason.
    Failed,
    /// It was given up on request.
    Cancelled,
}

impl JobStatus {
    /// In a word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// Whether nothing changes any more.
    #[must_use]
    pub const fn is_final(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

/// A file that came with a job.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize, utoipa::ToSchema)]
pub struct JobFile {
    /// Its name with who sent it.
    pub name: String,
    /// Its size.
    pub bytes: u64,
}

/// How far the step is that makes one result of all shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Finishing {
    /// As how many shards it counts.
    pub shards: u32,
    /// Thousandths of it that are done.
    pub permille: u32,
}

/// A job.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Names it everywhere; not to be guessed.
    pub id: String,
    /// What is done.
    pub kind: String,
    /// Where it stands.
    pub status: JobStatus,
    /// What was asked.
    pub request: Value,
    /// What came with it.
    pub files: Vec<JobFile>,
    /// Tag of request and files.
    pub fingerprint: String,
    /// Its shards, once it is prepared.
    pub shards: Option<u32>,
    /// Those whose result is stored.
    pub done: u32,
    /// How far it is with what comes after them.
    pub finishing: Finishing,
    /// What came of it.
    pub result: Option<Value>,
    /// Why it failed: the problem of the contract.
    pub problem: Option<Value>,
    /// When it was made, us since 1970.
    pub created_us: i64,
    /// When somebody began it.
    pub started_us: Option<i64>,
    /// When it ended.
    pub finished_us: Option<i64>,
}

/// A job that is to be made.
#[derive(Clone, Debug)]
pub struct NewJob {
    /// See [`Job`].
    pub id: String,
    /// See [`Job`].
    pub kind: &'static str,
    /// See [`Job`].
    pub request: Value,
    /// See [`Job`].
    pub files: Vec<JobFile>,
    /// See [`Job`].
    pub fingerprint: String,
    /// The client's name for it.
    pub idempotency_key: Option<String>,
    /// The folder in which its files were received, if there are any.
    pub uploads: Option<PathBuf>,
}

/// What became of a job that was to be made.
#[derive(Clone, Debug, PartialEq)]
pub enum Made {
    /// It is there.
    New(Job),
    /// It was there already, under the same key.
    Known(Job),
    /// The key belongs to another request.
    OtherRequest(Job),
    /// So many wait already.
    Full {
        /// How many.
        unfinished: usize,
    },
}

/// Something that happened to a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JobEvent {
    /// Counts from 1.
    pub number: i64,
    /// Where the job stood then.
    pub status: JobStatus,
    /// Its shards, once it was prepared.
    pub shards: Option<u32>,
    /// Those that were done.
    pub done: u32,
    /// How far it was with what comes after them.
    pub finishing: Finishing,
    /// In words.
    pub message: String,
    /// When, us since 1970.
    pub time_us: i64,
}

/// How a job ends.
#[derive(Clone, Debug)]
pub struct Ending {
    /// In which state.
    pub status: JobStatus,
    /// What came of it.
    pub result: Option<Value>,
    /// Why it failed.
    pub problem: Option<Value>,
    /// In words.
    pub message: String,
}
