//! The queue in the tables of apalis-sqlite.
//!
//! Traps of its 1.0 that are gone round here: its `setup` would switch a connection of our pool to `synchronous = OFF`, so its migrations
//! are run alone, under a table of their own.

use apalis_core::backend::WorkerFilter;
use apalis_sqlite::{Config, SqliteStorage, queries};
use sqlx::SqliteConnection;
use sqlx::sqlite::SqlitePool;

use crate::shell::store::StoreError;
use crate::shell::store::queue::{HEARTBEAT, MISSED_HEARTBEATS, QUEUE, Step, tasks};

/// Where the library's migrations are noted: ours have the usual table.
const MIGRATIONS: &str = "_apalis_migrations";

/// Makes the library's tables.
pub(super) async fn migrate(pool: &SqlitePool) -> Result<(), StoreError> {
    let mut migrations = SqliteStorage::migrations();
    migrations.dangerous_set_table_name(MIGRATIONS);
    Ok(migrations.run(pool).await?)
}

/// Puts steps into the queue, in their order. One that is there already is left alone.
pub(super) async fn push(to: &mut SqliteConnection, steps: impl IntoIterator<Item = Step>) -> Result<(), StoreError> {
    Ok(queries::push_tasks(to, QUEUE, &tasks(steps, None)?).await?)
}

/// Takes all steps of a job out of the queue; who is at one of them goes on undisturbed.
pub(super) async fn forget(from: &mut SqliteConnection, job: &str) -> Result<(), StoreError> {
    // '0' comes after '/': all keys that begin with the job and a slash, by the index.
    sqlx::query(
        "DELETE FROM Jobs WHERE job_type = $1 AND idempotency_key >= $2 || '/' AND idempotency_key < $2 || '0'",
    )
    .bind(QUEUE)
    .bind(job)
    .execute(from)
    .await?;
    Ok(())
}

/// The queue as a worker takes from it.
pub(in crate::shell::store) fn storage(pool: &SqlitePool) -> SqliteStorage<Step> {
    let config = Config::default()
        .queue(QUEUE)
        .batch_size(1)
        .lock_tasks(false)
        .heartbeat_interval(HEARTBEAT)
        .missed_heartbeats(MISSED_HEARTBEATS);
    SqliteStorage::new(pool).with_config(config)
}

/// Gives back what the workers hold that are not alive, and forgets them; their number.
pub(super) async fn release(pool: &SqlitePool, is_alive: impl Fn(&str) -> bool) -> Result<u64, StoreError> {
    let workers: Vec<String> =
        sqlx::query_scalar("SELECT id FROM Workers WHERE worker_type = $1").bind(QUEUE).fetch_all(pool).await?;
    let mut released = 0;
    for worker in workers.into_iter().filter(|worker| !is_alive(worker)) {
        let mut change = pool.begin_with("BEGIN IMMEDIATE").await?;
        let only = WorkerFilter::Only(worker.clone());
        released += queries::reenqueue_orphaned(&mut *change, 0, QUEUE, &only).await?;
        // Tasks that it has done or failed still name it.
        sqlx::query("UPDATE Jobs SET lock_by = NULL WHERE lock_by = $1").bind(&worker).execute(&mut *change).await?;
        sqlx::query("DELETE FROM Workers WHERE id = $1").bind(&worker).execute(&mut *change).await?;
        change.commit().await?;
    }
    Ok(released)
}
