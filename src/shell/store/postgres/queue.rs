//! The queue in the tables of apalis-postgres.
//!
//! Traps of its 1.0 that are gone round here: a task waits until the server's clock is past the time at which it is to be run, which the
//! library takes from the client's clock, so it is asked for here; two tasks with one key are an error, where apalis-sqlite keeps
//! the first, so a job's lock is held when its steps are pushed; steps are given back by their ids, where apalis-sqlite takes the
//! worker's name; the client's clock says when a worker was last seen until its first heartbeat, so with a clock that is slow by
//! more than the time after which it is dead, its first steps are done twice, and counted once.

use apalis_postgres::{Config, PostgresStorage, queries};
use sqlx::Connection as _;
use sqlx::postgres::{PgConnection, PgPool};

use crate::shell::store::StoreError;
use crate::shell::store::queue::{HEARTBEAT, MISSED_HEARTBEATS, QUEUE, Step, tasks};

/// Makes the library's tables, in a schema of their own, with its own notes of what was made.
pub(super) async fn migrate(pool: &PgPool) -> Result<(), StoreError> {
    Ok(PostgresStorage::setup(pool).await?)
}

/// Puts steps into the queue.
pub(super) async fn push(to: &mut PgConnection, steps: impl IntoIterator<Item = Step>) -> Result<(), StoreError> {
    let now_s: i64 = sqlx::query_scalar("SELECT FLOOR(EXTRACT(EPOCH FROM now()))::BIGINT").fetch_one(&mut *to).await?;
    // One second back, as it is to be past.
    let tasks = tasks(steps, Some(u64::try_from(now_s - 1).unwrap_or_default()))?;
    Ok(queries::push_tasks(to, QUEUE, tasks).await?)
}

/// Takes all steps of a job out of the queue; who is at one of them goes on undisturbed.
pub(super) async fn forget(from: &mut PgConnection, job: &str) -> Result<(), StoreError> {
    // Locked in the order in which the library does it.
    sqlx::query(
        "WITH gone AS (
             SELECT id FROM apalis.jobs WHERE job_type = $1 AND starts_with(idempotency_key, $2) ORDER BY id FOR UPDATE)
         DELETE FROM apalis.jobs WHERE id IN (SELECT id FROM gone)",
    )
    .bind(QUEUE)
    .bind(format!("{job}/"))
    .execute(from)
    .await?;
    Ok(())
}

/// The queue as a worker takes from it.
pub(in crate::shell::store) fn storage(pool: &PgPool) -> PostgresStorage<Step> {
    let config = Config::default()
        .queue(QUEUE)
        .batch_size(1)
        .lock_tasks(false)
        .heartbeat_interval(HEARTBEAT)
        .missed_heartbeats(MISSED_HEARTBEATS);
    PostgresStorage::new(pool).with_config(config)
}

/// Gives back what the workers hold that are not alive, and forgets them; their number.
pub(super) async fn release(pool: &PgPool, is_alive: impl Fn(&str) -> bool) -> Result<u64, StoreError> {
    let workers: Vec<String> =
        sqlx::query_scalar("SELECT id FROM apalis.workers WHERE worker_type = $1").bind(QUEUE).fetch_all(pool).await?;
    let mut released = 0;
    for worker in workers.into_iter().filter(|worker| !is_alive(worker)) {
        let mut connection = pool.acquire().await?;
        let mut change = connection.begin().await?;
        // Another process may be at it.
        let is_ours: Option<i32> =
            sqlx::query_scalar("SELECT 1 FROM apalis.workers WHERE id = $1 FOR UPDATE SKIP LOCKED")
                .bind(&worker)
                .fetch_optional(&mut *change)
                .await?;
        if is_ours.is_none() {
            continue;
        }
        let held: Vec<String> =
            sqlx::query_scalar("SELECT id FROM apalis.jobs WHERE lock_by = $1 ORDER BY id FOR UPDATE")
                .bind(&worker)
                .fetch_all(&mut *change)
                .await?;
        released += queries::reenqueue_abandoned(&mut *change, QUEUE, &worker, &held).await?;
        // Tasks that it has done or failed still name it.
        sqlx::query("UPDATE apalis.jobs SET lock_by = NULL WHERE lock_by = $1")
            .bind(&worker)
            .execute(&mut *change)
            .await?;
        sqlx::query("DELETE FROM apalis.workers WHERE id = $1").bind(&worker).execute(&mut *change).await?;
        change.commit().await?;
    }
    Ok(released)
}
