//! How a job moves on. A change goes with the steps that follow from it in one transaction, and may be tried again: a shard counts once, a
//! job ends once. Who changes a job holds its lock first, so what is looked at then is still so when it is changed.

use serde_json::Value;

use super::jobs::{count_unfinished, get};
use super::rows::JobRow;
use super::{Backend, Connection, files, locks, queue};
use crate::shell::store::StoreError;
use crate::shell::store::jobs::{Ending, Job, Made, NewJob, now_us};
use crate::shell::store::queue::{Part, Step};

impl Backend {
    pub(in crate::shell::store) async fn make_job(&self, new: &NewJob, most: usize) -> Result<Made, StoreError> {
        let mut change = self.begin().await?;
        // Once before the files, which may take their time, and once when nobody else makes a job.
        if let Some(made) = standing(&mut change, new, most).await? {
            return Ok(made);
        }
        files::take_in(&mut change, new).await?;
        locks::makers(&mut change).await?;
        if let Some(made) = standing(&mut change, new, most).await? {
            return Ok(made);
        }
        sqlx::query(
            "INSERT INTO skypose_jobs (id, kind, status, request, files, idempotency_key, fingerprint, created_us)
             VALUES ($1, $2, 'queued', $3, $4, $5, $6, $7)",
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

    pub(in crate::shell::store) async fn job_prepared(
        &self,
        id: &str,
        shards: u32,
        finish_shards: u32,
    ) -> Result<bool, StoreError> {
        let mut change = self.begin().await?;
        locks::job(&mut change, id).await?;
        let changed = sqlx::query(
            "UPDATE skypose_jobs SET status = 'running', shards = $2, finish_shards = $3, started_us = $4
             WHERE id = $1 AND status = 'queued'",
        )
        .bind(id)
        .bind(i64::from(shards))
        .bind(i64::from(finish_shards))
        .bind(now_us())
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

    pub(in crate::shell::store) async fn put_shard(
        &self,
        id: &str,
        number: u32,
        result: &Value,
        message: &str,
    ) -> Result<bool, StoreError> {
        let mut change = self.begin().await?;
        locks::job(&mut change, id).await?;
        let counted = sqlx::query(
            "UPDATE skypose_jobs SET done = done + 1
             WHERE id = $1 AND status = 'running' AND NOT EXISTS (SELECT 1 FROM skypose_shards WHERE job = $1 AND number = $2)",
        )
        .bind(id)
        .bind(i64::from(number))
        .execute(&mut *change)
        .await?
        .rows_affected();
        if counted == 0 {
            return Ok(false);
        }
        sqlx::query("INSERT INTO skypose_shards (job, number, result) VALUES ($1, $2, $3)")
            .bind(id)
            .bind(i64::from(number))
            .bind(serde_json::to_string(result)?)
            .execute(&mut *change)
            .await?;
        tell(&mut change, id, message).await?;
        let is_last: bool = sqlx::query_scalar("SELECT done >= shards FROM skypose_jobs WHERE id = $1")
            .bind(id)
            .fetch_one(&mut *change)
            .await?;
        if is_last {
            queue::push(&mut change, [Step { job: id.into(), part: Part::Finish }]).await?;
        }
        change.commit().await?;
        Ok(true)
    }

    pub(in crate::shell::store) async fn job_finishing(
        &self,
        id: &str,
        permille: u32,
        message: &str,
    ) -> Result<bool, StoreError> {
        let mut change = self.begin().await?;
        locks::job(&mut change, id).await?;
        let changed = sqlx::query(
            "UPDATE skypose_jobs SET finish_permille = $2 WHERE id = $1 AND status = 'running' AND finish_permille < $2",
        )
        .bind(id)
        .bind(i64::from(permille))
        .execute(&mut *change)
        .await?
        .rows_affected();
        if changed == 0 {
            return Ok(false);
        }
        tell(&mut change, id, message).await?;
        change.commit().await?;
        Ok(true)
    }

    pub(in crate::shell::store) async fn end_job(&self, id: &str, ending: &Ending) -> Result<bool, StoreError> {
        let mut change = self.begin().await?;
        locks::job(&mut change, id).await?;
        let text = |value: &Option<Value>| value.as_ref().map(serde_json::to_string).transpose();
        let changed = sqlx::query(
            "UPDATE skypose_jobs SET status = $2, result = $3, problem = $4, finished_us = $5
             WHERE id = $1 AND status IN ('queued', 'running')",
        )
        .bind(id)
        .bind(ending.status)
        .bind(text(&ending.result)?)
        .bind(text(&ending.problem)?)
        .bind(now_us())
        .execute(&mut *change)
        .await?
        .rows_affected();
        if changed == 0 {
            return Ok(false);
        }
        tell(&mut change, id, &ending.message).await?;
        queue::forget(&mut change, id).await?;
        sqlx::query("DELETE FROM skypose_shards WHERE job = $1").bind(id).execute(&mut *change).await?;
        files::forget_uploads(&mut change, id).await?;
        change.commit().await?;
        Ok(true)
    }

    pub(in crate::shell::store) async fn remove_job(&self, id: &str) -> Result<bool, StoreError> {
        let query = "DELETE FROM skypose_jobs WHERE id = $1 AND status NOT IN ('queued', 'running')";
        Ok(sqlx::query(query).bind(id).execute(&self.pool).await?.rows_affected() > 0)
    }
}

/// Why there is nothing to be made, if so.
async fn standing(from: &mut Connection, new: &NewJob, most: usize) -> Result<Option<Made>, StoreError> {
    if let Some(key) = &new.idempotency_key {
        let known: Option<JobRow> =
            sqlx::query_as("SELECT * FROM skypose_jobs WHERE kind = $1 AND idempotency_key = $2")
                .bind(new.kind)
                .bind(key)
                .fetch_optional(&mut *from)
                .await?;
        if let Some(row) = known {
            let job = Job::try_from(row)?;
            let is_same = job.fingerprint == new.fingerprint;
            return Ok(Some(if is_same { Made::Known(job) } else { Made::OtherRequest(job) }));
        }
    }
    let unfinished = count_unfinished(from).await?;
    Ok((unfinished >= most).then_some(Made::Full { unfinished }))
}

/// Notes what has happened to a job, in the state in which it is now.
async fn tell(to: &mut Connection, id: &str, message: &str) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO skypose_events
             (job, number, status, shards, done, finish_shards, finish_permille, message, time_us)
         SELECT id, 1 + (SELECT COALESCE(MAX(number), 0) FROM skypose_events WHERE job = $1), status, shards, done,
             finish_shards, finish_permille, $2, $3
         FROM skypose_jobs WHERE id = $1",
    )
    .bind(id)
    // PostgreSQL has no text with a zero in it.
    .bind(message.replace('\0', " "))
    .bind(now_us())
    .execute(to)
    .await?;
    Ok(())
}
