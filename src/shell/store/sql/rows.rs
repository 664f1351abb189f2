//! Jobs and events as they stand in the tables: counts as the signed numbers that both databases have, JSON as text.

use serde_json::Value;

use crate::shell::store::StoreError;
use crate::shell::store::jobs::{Finishing, Job, JobEvent, JobStatus};

#[derive(sqlx::FromRow)]
pub(super) struct JobRow {
    id: String,
    kind: String,
    status: JobStatus,
    request: String,
    files: String,
    fingerprint: String,
    shards: Option<i64>,
    done: i64,
    finish_shards: i64,
    finish_permille: i64,
    result: Option<String>,
    problem: Option<String>,
    created_us: i64,
    started_us: Option<i64>,
    finished_us: Option<i64>,
}

impl TryFrom<JobRow> for Job {
    type Error = StoreError;

    fn try_from(row: JobRow) -> Result<Self, StoreError> {
        let json = |text: Option<String>| text.as_deref().map(serde_json::from_str::<Value>).transpose();
        Ok(Self {
            id: row.id,
            kind: row.kind,
            status: row.status,
            request: serde_json::from_str(&row.request)?,
            files: serde_json::from_str(&row.files)?,
            fingerprint: row.fingerprint,
            shards: row.shards.map(count),
            done: count(row.done),
            finishing: Finishing { shards: count(row.finish_shards), permille: count(row.finish_permille) },
            result: json(row.result)?,
            problem: json(row.problem)?,
            created_us: row.created_us,
            started_us: row.started_us,
            finished_us: row.finished_us,
        })
    }
}

#[derive(sqlx::FromRow)]
pub(super) struct EventRow {
    number: i64,
    status: JobStatus,
    shards: Option<i64>,
    done: i64,
    finish_shards: i64,
    finish_permille: i64,
    message: String,
    time_us: i64,
}

impl From<EventRow> for JobEvent {
    fn from(row: EventRow) -> Self {
        Self {
            number: row.number,
            status: row.status,
            shards: row.shards.map(count),
            done: count(row.done),
            finishing: Finishing { shards: count(row.finish_shards), permille: count(row.finish_permille) },
            message: row.message,
            time_us: row.time_us,
        }
    }
}

/// What was written was a `u32`.
pub(super) fn count(number: i64) -> u32 {
    u32::try_from(number).unwrap_or_default()
}
