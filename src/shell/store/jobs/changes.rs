//! How a job moves on. A change goes with the steps that follow from it in one transaction, and may be tried again: a shard counts once, a
//! job ends once.

use serde_json::Value;
use sqlx::SqliteConnection;

use super::job::{Ending, Job, Made, NewJob};
use super::{JobStore, count_unfinished, get, now_us};
use crate::shell::store::StoreError;
use crate::shell::store::queue::{self, Part, Step};

impl JobStore {
    /// Makes a job, unless its key is known or `most` are unfinished.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub async fn make(&self, new: NewJob, most: usize) -> Result<Made, StoreError> {
        let mut change = self.pool.begin_with("BEGIN IMMEDIATE").await?;
        if let Some(key) = &new.idempotency_key {
            let known: Option<Job> =
                sqlx::query_as("SELECT * FROM skypose_jobs WHERE kind = ? AND idempotency_key = ?")
                    .bind(new.kind)
                    .bind(key)
                    .fetch_optional(&mut *change)
                    .await?;
            if let Some(job) = known {
                let is_same = job.fingerprint == new.fingerprint;
                return Ok(if is_same { Made::Known(job) } else { Made::OtherRequest(job) });
            }
        }
        let unfinished = count_unfinished(&mut change).await?;
        if unfinished >= most {
            return Ok(Made::Full { unfinished });
        }
        sqlx::query(
            "INSERT INTO skypose_jobs (id, kind, status, request, files, idempotency_key, fingerprint, created_us)
             VALUES (?, ?, 'queued', ?, ?, ?, ?, ?)",
        )
        .bind(&new.id)
        .bind(new.kind)
        .bind(serde_json::to_string(&new.request)?)
        .bind(serde_json::to_string(&new.files)?)
        .bind(&new.idempotency_key)
        .bind(&new.fingerprint)
        .bind(now_us())
        .execute(&mut *change)
        .await?;
        tell(&mut change, &new.id, "queued").await?;
        queue::push(&mut change, [Step { job: new.id.clone(), part: Part::Prepare }]).await?;
        let job = get(&mut change, &new.id).await?.ok_or(sqlx::Error::RowNotFound)?;
        change.commit().await?;
        Ok(Made::New(job))
    }

    /// The job is prepared: it has so many shards, and each is to be computed. False if somebody was faster or the job has ended.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub async fn prepared(&self, id: &str, shards: u32) -> Result<bool, StoreError> {
        let mut change = self.pool.begin_with("BEGIN IMMEDIATE").await?;
        let changed = sqlx::query(
            "UPDATE skypose_jobs SET status = 'running', shards = ?, started_us = ? WHERE id = ? AND status = 'queued'",
        )
        .bind(shards)
        .bind(now_us())
        .bind(id)
        .execute(&mut *change)
        .await?
        .rows_affected();
        if changed == 0 {
            return Ok(false);
        }
        tell(&mut change, id, "running").await?;
        let step = |part| Step { job: id.into(), part };
        if shards == 0 {
            queue::push(&mut change, [step(Part::Finish)]).await?;
        } else {
            queue::push(&mut change, (0..shards).map(|number| step(Part::Shard(number)))).await?;
        }
        change.commit().await?;
        Ok(true)
    }

    /// Stores a shard's result, once, and has the job finished when it was the last. False if it was stored already or the job has
    /// ended.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub async fn put_shard(&self, id: &str, number: u32, result: &Value, message: &str) -> Result<bool, StoreError> {
        let mut change = self.pool.begin_with("BEGIN IMMEDIATE").await?;
        let counted = sqlx::query(
            "UPDATE skypose_jobs SET done = done + 1
             WHERE id = ? AND status = 'running' AND NOT EXISTS (SELECT 1 FROM skypose_shards WHERE job = ? AND number = ?)",
        )
        .bind(id)
        .bind(id)
        .bind(number)
        .execute(&mut *change)
        .await?
        .rows_affected();
        if counted == 0 {
            return Ok(false);
        }
        sqlx::query("INSERT INTO skypose_shards (job, number, result) VALUES (?, ?, ?)")
            .bind(id)
            .bind(number)
            .bind(serde_json::to_string(result)?)
            .execute(&mut *change)
            .await?;
        tell(&mut change, id, message).await?;
        let is_last: bool = sqlx::query_scalar("SELECT done >= shards FROM skypose_jobs WHERE id = ?")
            .bind(id)
            .fetch_one(&mut *change)
            .await?;
        if is_last {
            queue::push(&mut change, [Step { job: id.into(), part: Part::Finish }]).await?;
        }
        change.commit().await?;
        Ok(true)
    }

    /// Ends a job, and forgets its steps and the results of its shards. False if it had ended before.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub async fn end(&self, id: &str, ending: &Ending) -> Result<bool, StoreError> {
        let mut change = self.pool.begin_with("BEGIN IMMEDIATE").await?;
        let text = |value: &Option<Value>| value.as_ref().map(serde_json::to_string).transpose();
        let changed = sqlx::query(
            "UPDATE skypose_jobs SET status = ?, result = ?, problem = ?, finished_us = ?
             WHERE id = ? AND status IN ('queued', 'running')",
        )
        .bind(ending.status)
        .bind(text(&ending.result)?)
        .bind(text(&ending.problem)?)
        .bind(now_us())
        .bind(id)
        .execute(&mut *change)
        .await?
        .rows_affected();
        if changed == 0 {
            return Ok(false);
        }
        tell(&mut change, id, &ending.message).await?;
        queue::forget(&mut change, id).await?;
        sqlx::query("DELETE FROM skypose_shards WHERE job = ?").bind(id).execute(&mut *change).await?;
        change.commit().await?;
        Ok(true)
    }

    /// Removes a job that has ended; false if there is none.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub async fn remove(&self, id: &str) -> Result<bool, StoreError> {
        let query = "DELETE FROM skypose_jobs WHERE id = ? AND status NOT IN ('queued', 'running')";
        Ok(sqlx::query(query).bind(id).execute(&self.pool).await?.rows_affected() > 0)
    }
}

/// Notes what has happened to a job, in the state in which it is now.
async fn tell(to: &mut SqliteConnection, id: &str, message: &str) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO skypose_events (job, number, status, shards, done, message, time_us)
         SELECT id, 1 + (SELECT COALESCE(MAX(number), 0) FROM skypose_events WHERE job = id), status, shards, done, ?, ?
         FROM skypose_jobs WHERE id = ?",
    )
    .bind(message)
    .bind(now_us())
    .bind(id)
    .execute(to)
    .await?;
    Ok(())
}
