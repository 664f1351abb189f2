//! Jobs, the results of their shards, and what is told of them. How they move on is told in `sql/changes.rs`.

mod job;
#[cfg(test)]
mod tests;

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use serde_json::Value;

use super::files::JobFiles;
use super::presence::Presence;
use super::queue::Steps;
use super::{Database, StoreError, either, postgres, sqlite};

pub use job::{Ending, Finishing, Job, JobEvent, JobFile, JobStatus, Made, NewJob};

/// The jobs of a store.
#[derive(Clone, Debug)]
pub struct JobStore {
    database: Database,
}

impl JobStore {
    pub(super) const fn new(database: Database) -> Self {
        Self { database }
    }

    /// The steps that wait, as a worker of the job library takes them.
    #[must_use]
    pub fn steps(&self) -> Steps {
        match &self.database {
            Database::Sqlite(database) => Steps::Sqlite(sqlite::storage(&database.fleeting)),
            Database::Postgres(database) => Steps::Postgres(postgres::storage(&database.fleeting)),
        }
    }

    /// The files of its jobs, which are received under the folder `data`.
    #[must_use]
    pub fn files(&self, data: &Path) -> JobFiles {
        match &self.database {
            Database::Sqlite(_) => JobFiles::in_folder(data),
            Database::Postgres(database) => JobFiles::in_database(data, database.pool.clone()),
        }
    }

    /// Tells all who share the store that a process is there, until what is returned is dropped.
    ///
    /// # Errors
    /// If the folder cannot be written or the database not be reached.
    pub async fn enter(&self, data: &Path) -> Result<Presence, StoreError> {
        let presence = Presence::enter(data)?;
        match &self.database {
            Database::Sqlite(_) => Ok(presence),
            Database::Postgres(database) => {
                let session = database.enter(presence.name()).await?;
                Ok(presence.with_session(session))
            }
        }
    }

    /// Gives back the steps that were taken by workers that are not alive; their number.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub async fn release(&self, is_alive: impl Fn(&str) -> bool) -> Result<u64, StoreError> {
        either!(&self.database, database => database.release_steps(is_alive).await)
    }

    /// How many are not finished.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn unfinished(&self) -> Result<usize, StoreError> {
        either!(&self.database, database => database.unfinished_jobs().await)
    }

    /// The job of this id.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn get(&self, id: &str) -> Result<Option<Job>, StoreError> {
        either!(&self.database, database => database.get_job(id).await)
    }

    /// Where the job of this id stands.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn status(&self, id: &str) -> Result<Option<JobStatus>, StoreError> {
        either!(&self.database, database => database.job_status(id).await)
    }

    /// The jobs of a kind, the last made first, without their results.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn list(&self, kind: &str) -> Result<Vec<Job>, StoreError> {
        either!(&self.database, database => database.list_jobs(kind).await)
    }

    /// Ids of all jobs.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn ids(&self) -> Result<Vec<String>, StoreError> {
        either!(&self.database, database => database.job_ids().await)
    }

    /// How many there are, by kind and state.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn counts(&self) -> Result<Vec<(String, JobStatus, u32)>, StoreError> {
        either!(&self.database, database => database.job_counts().await)
    }

    /// What happened to a job after the event of this number.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn events(&self, id: &str, after: i64) -> Result<Vec<JobEvent>, StoreError> {
        either!(&self.database, database => database.job_events(id, after).await)
    }

    /// Whether this shard's result is stored.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn has_shard(&self, id: &str, number: u32) -> Result<bool, StoreError> {
        either!(&self.database, database => database.has_shard(id, number).await)
    }

    /// The results of a job's shards, in their order.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn shards(&self, id: &str) -> Result<Vec<Value>, StoreError> {
        either!(&self.database, database => database.job_shards(id).await)
    }

    /// Jobs that ended more than `keep_s` ago, and the oldest of those that ended while there are more than `most`.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn outlived(&self, keep_s: u64, most: usize) -> Result<Vec<String>, StoreError> {
        either!(&self.database, database => database.outlived_jobs(keep_s, most).await)
    }

    /// Makes a job, unless its key is known or `most` are unfinished.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub async fn make(&self, new: &NewJob, most: usize) -> Result<Made, StoreError> {
        either!(&self.database, database => database.make_job(new, most).await)
    }

    /// The job is prepared: it has so many shards, and each is to be computed; to make one result of them counts as so many. False
    /// if somebody was faster or the job has ended.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub async fn prepared(&self, id: &str, shards: u32, finish_shards: u32) -> Result<bool, StoreError> {
        either!(&self.database, database => database.job_prepared(id, shards, finish_shards).await)
    }

    /// So many thousandths of making one result of all shards are done. False if it is not more than was known, or the job has ended.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub async fn finishing(&self, id: &str, permille: u32, message: &str) -> Result<bool, StoreError> {
        either!(&self.database, database => database.job_finishing(id, permille, message).await)
    }

    /// Stores a shard's result, once, and has the job finished when it was the last. False if it was stored already or the job has
    /// ended.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub async fn put_shard(&self, id: &str, number: u32, result: &Value, message: &str) -> Result<bool, StoreError> {
        either!(&self.database, database => database.put_shard(id, number, result, message).await)
    }

    /// Ends a job, and forgets its steps, the results of its shards and what came with it. False if it had ended before.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub async fn end(&self, id: &str, ending: &Ending) -> Result<bool, StoreError> {
        either!(&self.database, database => database.end_job(id, ending).await)
    }

    /// Removes a job that has ended; false if there is none.
    ///
    /// # Errors
    /// If the store cannot be written.
    pub async fn remove(&self, id: &str) -> Result<bool, StoreError> {
        either!(&self.database, database => database.remove_job(id).await)
    }
}

pub(super) fn now_us() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_micros()).unwrap_or(i64::MAX)
}
