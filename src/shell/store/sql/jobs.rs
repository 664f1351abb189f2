//! What can be asked of jobs.

use serde_json::Value;

use super::rows::{EventRow, JobRow, count};
use super::{Backend, Connection, queue};
use crate::shell::store::StoreError;
use crate::shell::store::jobs::{Job, JobEvent, JobStatus, now_us};

impl Backend {
    pub(in crate::shell::store) async fn release_steps(
        &self,
        is_alive: impl Fn(&str) -> bool,
    ) -> Result<u64, StoreError> {
        queue::release(&self.fleeting, is_alive).await
    }

    pub(in crate::shell::store) async fn unfinished_jobs(&self) -> Result<usize, StoreError> {
        count_unfinished(&mut *self.pool.acquire().await?).await
    }

    pub(in crate::shell::store) async fn get_job(&self, id: &str) -> Result<Option<Job>, StoreError> {
        get(&mut *self.pool.acquire().await?, id).await
    }

    pub(in crate::shell::store) async fn job_status(&self, id: &str) -> Result<Option<JobStatus>, StoreError> {
        let query = "SELECT status FROM skypose_jobs WHERE id = $1";
        Ok(sqlx::query_scalar(query).bind(id).fetch_optional(&self.pool).await?)
    }

    pub(in crate::shell::store) async fn list_jobs(&self, kind: &str) -> Result<Vec<Job>, StoreError> {
        let query =
            "SELECT id, kind, status, request, files, fingerprint, shards, done, finish_shards, finish_permille, NULL AS result, problem, created_us,
                            started_us, finished_us
                     FROM skypose_jobs WHERE kind = $1 ORDER BY created_us DESC, id DESC";
        let rows: Vec<JobRow> = sqlx::query_as(query).bind(kind).fetch_all(&self.pool).await?;
        rows.into_iter().map(Job::try_from).collect()
    }

    pub(in crate::shell::store) async fn job_ids(&self) -> Result<Vec<String>, StoreError> {
        Ok(sqlx::query_scalar("SELECT id FROM skypose_jobs").fetch_all(&self.pool).await?)
    }

    pub(in crate::shell::store) async fn job_counts(&self) -> Result<Vec<(String, JobStatus, u32)>, StoreError> {
        let query = "SELECT kind, status, COUNT(*) FROM skypose_jobs GROUP BY kind, status";
        let rows: Vec<(String, JobStatus, i64)> = sqlx::query_as(query).fetch_all(&self.pool).await?;
        Ok(rows.into_iter().map(|(kind, status, number)| (kind, status, count(number))).collect())
    }

    pub(in crate::shell::store) async fn job_events(&self, id: &str, after: i64) -> Result<Vec<JobEvent>, StoreError> {
        let query =
            "SELECT number, status, shards, done, finish_shards, finish_permille, message, time_us FROM skypose_events
                     WHERE job = $1 AND number > $2 ORDER BY number LIMIT 256";
        let rows: Vec<EventRow> = sqlx::query_as(query).bind(id).bind(after).fetch_all(&self.pool).await?;
        Ok(rows.into_iter().map(JobEvent::from).collect())
    }

    pub(in crate::shell::store) async fn has_shard(&self, id: &str, number: u32) -> Result<bool, StoreError> {
        let query = "SELECT EXISTS (SELECT 1 FROM skypose_shards WHERE job = $1 AND number = $2)";
        Ok(sqlx::query_scalar(query).bind(id).bind(i64::from(number)).fetch_one(&self.pool).await?)
    }

    pub(in crate::shell::store) async fn job_shards(&self, id: &str) -> Result<Vec<Value>, StoreError> {
        let rows: Vec<String> = sqlx::query_scalar("SELECT result FROM skypose_shards WHERE job = $1 ORDER BY number")
            .bind(id)
            .fetch_all(&self.pool)
            .await?;
        Ok(rows.iter().map(|row| serde_json::from_str(row)).collect::<Result<_, _>>()?)
    }

    pub(in crate::shell::store) async fn outlived_jobs(
        &self,
        keep_s: u64,
        most: usize,
    ) -> Result<Vec<String>, StoreError> {
        let before = now_us().saturating_sub(i64::try_from(keep_s).unwrap_or(i64::MAX).saturating_mul(1_000_000));
        let query = "SELECT id FROM (
                         SELECT id, finished_us, ROW_NUMBER() OVER (ORDER BY finished_us IS NULL DESC, finished_us DESC) AS age
                         FROM skypose_jobs) AS aged
                     WHERE finished_us IS NOT NULL AND (finished_us < $1 OR age > $2)";
        let most = i64::try_from(most).unwrap_or(i64::MAX);
        Ok(sqlx::query_scalar(query).bind(before).bind(most).fetch_all(&self.pool).await?)
    }
}

pub(super) async fn get(from: &mut Connection, id: &str) -> Result<Option<Job>, StoreError> {
    let row: Option<JobRow> =
        sqlx::query_as("SELECT * FROM skypose_jobs WHERE id = $1").bind(id).fetch_optional(from).await?;
    row.map(Job::try_from).transpose()
}

pub(super) async fn count_unfinished(from: &mut Connection) -> Result<usize, StoreError> {
    let query = "SELECT COUNT(*) FROM skypose_jobs WHERE status IN ('queued', 'running')";
    let number: i64 = sqlx::query_scalar(query).fetch_one(from).await?;
    Ok(count(number) as usize)
}
