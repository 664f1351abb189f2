//! Jobs, the results of their shards, and what is told of them.
//!
//! Every change of state goes with the steps that follow from it in one transaction, and every change may be tried again: a shard
//! counts once, a job ends once.

use std::time::{SystemTime, UNIX_EPOCH};

use apalis_sqlite::SqliteStorage;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sqlx::SqliteConnection;
use sqlx::sqlite::SqlitePool;

use super::StoreError;
use super::queue::{self, Part, Step};

/// Where a job stands.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Hash, Serialize, sqlx::Type, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
#[sqlx(rename_all = "snake_case")]
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

/// A job.
#[derive(Clone, Debug, PartialEq, sqlx::FromRow)]
pub struct Job {
    /// Names it everywhere; not to be guessed.
    pub id: String,
    /// What is done.
    pub kind: String,
    /// Where it stands.
    pub status: JobStatus,
    /// What was asked.
    #[sqlx(json)]
    pub request: Value,
    /// What came with it.
    #[sqlx(json)]
    pub files: Vec<JobFile>,
    /// Tag of request and files.
    pub fingerprint: String,
    /// Its shards, once it is prepared.
    pub shards: Option<u32>,
    /// Those whose result is stored.
    pub done: u32,
    /// What came of it.
    #[sqlx(json(nullable))]
    pub result: Option<Value>,
    /// Why it failed: the problem of the contract.
    #[sqlx(json(nullable))]
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
#[derive(Clone, Debug, PartialEq, Eq, sqlx::FromRow)]
pub struct JobEvent {
    /// Counts from 1.
    pub number: i64,
    /// Where the job stood then.
    pub status: JobStatus,
    /// Its shards, once it was prepared.
    pub shards: Option<u32>,
    /// Those that were done.
    pub done: u32,
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

    /// Whether this shard's result is stored.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn has_shard(&self, id: &str, number: u32) -> Result<bool, StoreError> {
        let query = "SELECT EXISTS (SELECT 1 FROM skypose_shards WHERE job = ? AND number = ?)";
        Ok(sqlx::query_scalar(query).bind(id).bind(number).fetch_one(&self.pool).await?)
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

fn now_us() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_micros()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::shell::store::Store;

    fn job(id: &str, key: Option<&str>, fingerprint: &str) -> NewJob {
        NewJob {
            id: id.into(),
            kind: "calibration",
            request: json!({"a": 1}),
            files: vec![JobFile { name: "left.jpg".into(), bytes: 7 }],
            fingerprint: fingerprint.into(),
            idempotency_key: key.map(Into::into),
        }
    }

    async fn store() -> (tempfile::TempDir, JobStore) {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).await.expect("opens");
        (folder, store.jobs())
    }

    async fn waiting(store: &JobStore) -> u32 {
        sqlx::query_scalar("SELECT COUNT(*) FROM Jobs").fetch_one(&store.pool).await.expect("counts")
    }

    fn ending(status: JobStatus) -> Ending {
        Ending { status, result: Some(json!(5)), problem: None, message: status.name().into() }
    }

    #[tokio::test]
    async fn a_key_names_one_job() {
        let (_folder, store) = store().await;
        let made = store.make(job("1", Some("k"), "x"), 9).await.expect("makes");
        assert!(
            matches!(&made, Made::New(job) if job.status == JobStatus::Queued && job.files[0].bytes == 7),
            "{made:?}"
        );
        assert!(matches!(store.make(job("2", Some("k"), "x"), 9).await, Ok(Made::Known(job)) if job.id == "1"));
        assert!(matches!(store.make(job("2", Some("k"), "y"), 9).await, Ok(Made::OtherRequest(_))));
        assert!(matches!(store.make(job("2", None, "x"), 1).await, Ok(Made::Full { unfinished: 1 })));
        assert!(matches!(store.make(job("2", None, "x"), 2).await, Ok(Made::New(_))));
    }

    #[tokio::test]
    async fn a_shard_counts_once_and_a_job_ends_once() {
        let (_folder, store) = store().await;
        store.make(job("1", None, "x"), 9).await.expect("makes");
        assert!(!store.put_shard("1", 0, &json!(1), "early").await.expect("looks"), "it is not running");
        assert!(store.prepared("1", 2).await.expect("stores"));
        assert!(!store.prepared("1", 3).await.expect("looks"), "twice");
        assert_eq!(waiting(&store).await, 3);
        assert!(store.put_shard("1", 1, &json!("b"), "second").await.expect("stores"));
        assert!(!store.put_shard("1", 1, &json!("c"), "again").await.expect("looks"));
        assert_eq!(waiting(&store).await, 3, "it is not to be finished yet");
        assert!(store.put_shard("1", 0, &json!("a"), "first").await.expect("stores"));
        assert_eq!(waiting(&store).await, 4);
        assert_eq!(store.shards("1").await.expect("reads"), [json!("a"), json!("b")]);
        assert!(store.end("1", &ending(JobStatus::Succeeded)).await.expect("stores"));
        assert!(!store.end("1", &ending(JobStatus::Cancelled)).await.expect("looks"));
        assert_eq!(waiting(&store).await, 0);
        let told: Vec<String> =
            store.events("1", 1).await.expect("reads").into_iter().map(|event| event.message).collect();
        assert_eq!(told, ["running", "second", "first", "succeeded"]);
        let job = store.get("1").await.expect("reads").expect("is there");
        assert_eq!((job.status, job.done, job.result), (JobStatus::Succeeded, 2, Some(json!(5))));
    }

    #[tokio::test]
    async fn what_is_old_or_too_many_is_outlived() {
        let (_folder, store) = store().await;
        for id in ["1", "2", "3", "4"] {
            store.make(job(id, None, "x"), 9).await.expect("makes");
        }
        for id in ["1", "2", "3"] {
            store.end(id, &ending(JobStatus::Cancelled)).await.expect("ends");
            tokio::time::sleep(std::time::Duration::from_millis(2)).await;
        }
        assert!(!store.remove("4").await.expect("looks"), "it has not ended");
        assert_eq!(store.outlived(60, 9).await.expect("reads"), Vec::<String>::new());
        assert_eq!(store.outlived(60, 3).await.expect("reads"), ["1"], "the unfinished stays, whatever its age");
        assert_eq!(store.outlived(0, 9).await.expect("reads").len(), 3);
        assert!(store.remove("1").await.expect("removes"));
        assert_eq!(store.events("1", 0).await.expect("reads"), []);
    }
}
