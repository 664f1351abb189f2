//! The steps of jobs that wait to be taken, in the tables of the job library, apalis. What is put into the queue or taken out of
//! it with the state of a job goes in one transaction with it, so neither is ever there without the other.
//!
//! Traps of apalis 1.0 that are gone round here and in `worker.rs`: a worker sends no heartbeat while it has fetched more tasks than
//! it has begun, so it fetches one at a time; a worker ends at the first error of the database, so who runs one
//! starts another, which takes over what the last one held.

use std::time::Duration;

use apalis_core::task::Task;
use apalis_core::task::builder::TaskBuilder;
use apalis_core::task::task_id::TaskId;
use apalis_postgres::PostgresStorage;
use apalis_sqlite::SqliteStorage;
use serde::{Deserialize, Serialize};
use ulid::Ulid;

use super::StoreError;

/// Name of the queue in the library's tables.
pub(super) const QUEUE: &str = "skypose";
/// A process that lives says so this often.
pub(super) const HEARTBEAT: Duration = Duration::from_secs(5);
/// One that has missed so many is taken for dead, and what it held is given to others.
pub(super) const MISSED_HEARTBEATS: usize = 4;
/// How often a step is tried is for the service to say.
const MAX_ATTEMPTS: usize = 1_000_000;

/// The queue as a worker takes from it. The state of a job says who is at it, so that of a task need not: tasks are not locked.
pub enum Steps {
    /// In the file.
    Sqlite(SqliteStorage<Step>),
    /// In the database.
    Postgres(PostgresStorage<Step>),
}

/// A step of a job.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize)]
pub struct Step {
    /// The job.
    pub job: String,
    /// Which step of it.
    pub part: Part,
}

/// The steps that every job has.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// Its shards are counted.
    Prepare,
    /// One of its shards is computed.
    Shard(u32),
    /// Its result is made of those of its shards.
    Finish,
}

impl Step {
    fn key(&self) -> String {
        let Self { job, part } = self;
        match part {
            Part::Prepare => format!("{job}/prepare"),
            Part::Shard(number) => format!("{job}/{number}"),
            Part::Finish => format!("{job}/finish"),
        }
    }

    fn task(&self, id: Ulid, now_s: Option<u64>) -> Result<Task<Vec<u8>>, StoreError> {
        let task = TaskBuilder::new(serde_json::to_vec(self)?)
            .task_id(TaskId::from_ulid(id))
            .idempotency_key(self.key())
            .max_attempts(MAX_ATTEMPTS)
            // A job that lacks only this is to be done before the next is begun.
            .priority(usize::from(self.part == Part::Finish));
        Ok(match now_s {
            Some(now_s) => task.run_at_timestamp(now_s).build(),
            None => task.build(),
        })
    }
}

/// Steps as tasks of the library, in their order, to be taken from `now_s` on or at once.
pub(super) fn tasks(
    steps: impl IntoIterator<Item = Step>,
    now_s: Option<u64>,
) -> Result<Vec<Task<Vec<u8>>>, StoreError> {
    let mut id = Ulid::generate();
    let mut tasks = Vec::new();
    for step in steps {
        tasks.push(step.task(id, now_s)?);
        id = id.increment().unwrap_or_else(|_| Ulid::generate());
    }
    Ok(tasks)
}
