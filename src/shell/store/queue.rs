//! The steps of jobs that wait to be taken, in the tables of the job library, apalis. What is put into the queue or taken out of
//! it with the state of a job goes in one transaction with it, so neither is ever there without the other.
//!
//! Traps of apalis-sqlite 1.0 that are gone round here: its `setup` would switch a connection of our pool to `synchronous = OFF`, so
//! its migrations are run alone, under a table of their own; a worker sends no heartbeat while it has fetched more tasks than
//! it has begun, so it fetches one at a time; a worker ends at the first error of the database, so who runs one
//! starts another, which takes over what the last one held.

use std::time::Duration;

use apalis_core::backend::WorkerFilter;
use apalis_core::task::builder::TaskBuilder;
use apalis_core::task::task_id::TaskId;
use apalis_sqlite::{Config, SqliteStorage, SqliteTask, queries};
use serde::{Deserialize, Serialize};
use sqlx::SqliteConnection;
use sqlx::sqlite::SqlitePool;
use ulid::Ulid;

use super::StoreError;

/// Name of the queue in the library's tables.
const QUEUE: &str = "skypose";
/// Where the library's migrations are noted: ours have the usual table.
const MIGRATIONS: &str = "_apalis_migrations";
/// A process that lives says so this often.
const HEARTBEAT: Duration = Duration::from_secs(5);
/// One that has missed so many is taken for dead, and what it held is given to others.
const MISSED_HEARTBEATS: usize = 4;
/// How often a step is tried is for the service to say.
const MAX_ATTEMPTS: usize = 1_000_000;

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

    fn task(&self, id: Ulid) -> Result<SqliteTask, StoreError> {
        let task = TaskBuilder::new(serde_json::to_vec(self)?)
            .task_id(TaskId::from_ulid(id))
            .idempotency_key(self.key())
            .max_attempts(MAX_ATTEMPTS)
            // A job that lacks only this is to be done before the next is begun.
            .priority(usize::from(self.part == Part::Finish));
        Ok(task.build())
    }
}

/// Makes the library's tables.
pub(super) async fn migrate(pool: &SqlitePool) -> Result<(), StoreError> {
    let mut migrations = SqliteStorage::migrations();
    migrations.dangerous_set_table_name(MIGRATIONS);
    Ok(migrations.run(pool).await?)
}

/// Puts steps into the queue, in their order. One that is there already is left alone.
pub(super) async fn push(to: &mut SqliteConnection, steps: impl IntoIterator<Item = Step>) -> Result<(), StoreError> {
    let mut id = Ulid::generate();
    let mut tasks = Vec::new();
    for step in steps {
        tasks.push(step.task(id)?);
        id = id.increment().unwrap_or_else(|_| Ulid::generate());
    }
    Ok(queries::push_tasks(to, QUEUE, &tasks).await?)
}

/// Takes all steps of a job out of the queue; who is at one of them goes on undisturbed.
pub(super) async fn forget(from: &mut SqliteConnection, job: &str) -> Result<(), StoreError> {
    // '0' comes after '/': all keys that begin with the job and a slash, by the index.
    sqlx::query("DELETE FROM Jobs WHERE job_type = ? AND idempotency_key >= ? || '/' AND idempotency_key < ? || '0'")
        .bind(QUEUE)
        .bind(job)
        .bind(job)
        .execute(from)
        .await?;
    Ok(())
}

/// The queue as a worker takes from it.
pub(super) fn storage(pool: &SqlitePool) -> SqliteStorage<Step> {
    let config = Config::default()
        .queue(QUEUE)
        .batch_size(1)
        // The state of a job says who is at it; that of the task need not.
        .lock_tasks(false)
        .heartbeat_interval(HEARTBEAT)
        .missed_heartbeats(MISSED_HEARTBEATS);
    SqliteStorage::new(pool).with_config(config)
}

/// Gives back what the workers hold that are not alive, and forgets them; their number.
pub(super) async fn release(pool: &SqlitePool, is_alive: impl Fn(&str) -> bool) -> Result<u64, StoreError> {
    let workers: Vec<String> =
        sqlx::query_scalar("SELECT id FROM Workers WHERE worker_type = ?").bind(QUEUE).fetch_all(pool).await?;
    let mut released = 0;
    for worker in workers.into_iter().filter(|worker| !is_alive(worker)) {
        let mut change = pool.begin_with("BEGIN IMMEDIATE").await?;
        let only = WorkerFilter::Only(worker.clone());
        released += queries::reenqueue_orphaned(&mut *change, 0, QUEUE, &only).await?;
        // Tasks that it has done or failed still name it.
        sqlx::query("UPDATE Jobs SET lock_by = NULL WHERE lock_by = ?").bind(&worker).execute(&mut *change).await?;
        sqlx::query("DELETE FROM Workers WHERE id = ?").bind(&worker).execute(&mut *change).await?;
        change.commit().await?;
    }
    Ok(released)
}
