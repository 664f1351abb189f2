//! Jobs, the results of their shards, and what is told of them: what can be asked here, what moves them on in `changes`.

mod changes;
mod job;
#[cfg(test)]
mod tests;

use std::time::{SystemTime, UNIX_EPOCH};

use apalis_sqlite::SqliteStorage;
use serde_json::Value;
use sqlx::SqliteConnection;
use sqlx::sqlite::SqlitePool;

use super::StoreError;
use super::queue::{self, Step};

pub use job::{Ending, Job, JobEvent, JobFile, JobStatus, Made, NewJob};

/// The jobs of a store.
#[derive(Clone, Debug)]
pub struct JobStore {
    pool: SqlitePool,
    fleeting: SqlitePool,
}

impl JobStore {
    pub(super) const fn new(pool: SqlitePool, fleeting: SqlitePool) -> Self {
        Self { pool, fleeting }
    }

    /// The steps that wait, as a worker of the job library takes them.
    #[must_use]
    pub fn steps(&self) -> SqliteStorage<Step> {
        queue::storage(&self.fleeting)
    }

    /// Gives back the steps that were taken by workers that are not alive; their number.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub async fn release(&self, is_alive: impl Fn(&str) -> bool) -> Result<u64, StoreError> {
        queue::release(&self.fleeting, is_alive).await
    }

    /// How many are not finished.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn unfinished(&self) -> Result<usize, StoreError> {
        count_unfinished(&mut *self.pool.acquire().await?).await
    }

    /// The job of this id.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn get(&self, id: &str) -> Result<Option<Job>, StoreError> {
        get(&mut *self.pool.acquire().await?, id).await
    }

    /// Where the job of this id stands.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn status(&self, id: &str) -> Result<Option<JobStatus>, StoreError> {
        let query = "SELECT status FROM skypose_jobs WHERE id = ?";
        Ok(sqlx::query_scalar(query).bind(id).fetch_optional(&self.pool).await?)
    }

    /// The jobs of a kind, the last made first, without their results.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn list(&self, kind: &str) -> Result<Vec<Job>, StoreError> {
        let query =
            "SELECT id, kind, status, request, files, fingerprint, shards, done, NULL AS result, problem, created_us,
                            started_us, finished_us
                     FROM skypose_jobs WHERE kind = ? ORDER BY created_us DESC, id DESC";
        Ok(sqlx::query_as(query).bind(kind).fetch_all(&self.pool).await?)
    }

    /// Ids of all jobs.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn ids(&self) -> Result<Vec<String>, StoreError> {
        Ok(sqlx::query_scalar("SELECT id FROM skypose_jobs").fetch_all(&self.pool).await?)
    }

    /// How many there are, by kind and state.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn counts(&self) -> Result<Vec<(String, JobStatus, u32)>, StoreError> {
        let query = "SELECT kind, status, COUNT(*) FROM skypose_jobs GROUP BY kind, status";
        Ok(sqlx::query_as(query).fetch_all(&self.pool).await?)
    }

    /// What happened to a job after the event of this number.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn events(&self, id: &str, after: i64) -> Result<Vec<JobEvent>, StoreError> {
        let query = "SELECT number, status, shards, done, message, time_us FROM skypose_events
                     WHERE job = ? AND number > ? ORDER BY number LIMIT 256";
        Ok(sqlx::query_as(query).bind(id).bind(after).fetch_all(&self.pool).await?)
    }

    /// Whether this shard's result is stored.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn has_shard(&self, id: &str, number: u32) -> Result<bool, StoreError> {
        let query = "SELECT EXISTS (SELECT 1 FROM skypose_shards WHERE job = ? AND number = ?)";
        Ok(sqlx::query_scalar(query).bind(id).bind(number).fetch_one(&self.pool).await?)
    }

    /// The results of a job's shards, in their order.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn shards(&self, id: &str) -> Result<Vec<Value>, StoreError> {
        let rows: Vec<String> = sqlx::query_scalar("SELECT result FROM skypose_shards WHERE job = ? ORDER BY number")
            .bind(id)
            .fetch_all(&self.pool)
            .await?;
        Ok(rows.iter().map(|row| serde_json::from_str(row)).collect::<Result<_, _>>()?)
    }

    /// Jobs that ended more than `keep_s` ago, and the oldest of those that ended while there are more than `most`.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn outlived(&self, keep_s: u64, most: usize) -> Result<Vec<String>, StoreError> {
        let before = now_us().saturating_sub(i64::try_from(keep_s).unwrap_or(i64::MAX).saturating_mul(1_000_000));
        let query = "SELECT id FROM (
                         SELECT id, finished_us, ROW_NUMBER() OVER (ORDER BY finished_us IS NULL DESC, finished_us DESC) AS age
                         FROM skypose_jobs)
                     WHERE finished_us IS NOT NULL AND (finished_us < ? OR age > ?)";
        let most = i64::try_from(most).unwrap_or(i64::MAX);
        Ok(sqlx::query_scalar(query).bind(before).bind(most).fetch_all(&self.pool).await?)
    }
}

async fn get(from: &mut SqliteConnection, id: &str) -> Result<Option<Job>, StoreError> {
    Ok(sqlx::query_as("SELECT * FROM skypose_jobs WHERE id = ?").bind(id).fetch_optional(from).await?)
}

async fn count_unfinished(from: &mut SqliteConnection) -> Result<usize, StoreError> {
    let query = "SELECT COUNT(*) FROM skypose_jobs WHERE status IN ('queued', 'running')";
    let count: u32 = sqlx::query_scalar(query).fetch_one(from).await?;
    Ok(count as usize)
}

fn now_us() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_micros()).unwrap_or(i64::MAX)
}
