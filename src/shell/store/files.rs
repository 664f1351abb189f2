//! The files of jobs: what came with them, and what is attached to their results. With SQLite they stand in the data folder, as all
//! processes are on its machine; with PostgreSQL in the database.

use std::io;
use std::path::{Path, PathBuf};

use sqlx::postgres::PgPool;
use tokio::runtime::Handle;

use super::{StoreError, postgres};

/// The files of the jobs of a store.
#[derive(Clone, Debug)]
pub struct JobFiles {
    /// Where files are received, and may stay.
    folder: PathBuf,
    place: Place,
    runtime: Handle,
}

#[derive(Clone, Debug)]
enum Place {
    Folder,
    Database(PgPool),
}

impl JobFiles {
    pub(super) fn in_folder(data: &Path) -> Self {
        Self { folder: data.join("jobs"), place: Place::Folder, runtime: Handle::current() }
    }

    /// What is received has a folder of its own: that of a file that was used before stays as it is.
    pub(super) fn in_database(data: &Path, pool: PgPool) -> Self {
        Self { folder: data.join("received"), place: Place::Database(pool), runtime: Handle::current() }
    }

    /// Where files are received, each job's in a folder with its id.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether a job's files stay in the folder where they were received; otherwise nobody needs it once the job is made.
    #[must_use]
    pub const fn stay_in_folder(&self) -> bool {
        matches!(self.place, Place::Folder)
    }

    /// One of the files that came with a job, by its number. Blocks: for threads of jobs only.
    ///
    /// # Errors
    /// If it is not there any more.
    pub fn read_upload(&self, id: &str, number: usize) -> Result<Vec<u8>, StoreError> {
        match &self.place {
            Place::Folder => Ok(std::fs::read(uploads(&self.folder, id).join(file_name(number)))?),
            Place::Database(pool) => {
                let found = self.runtime.block_on(postgres::upload(pool, id, number))?;
                Ok(found.ok_or_else(|| io::Error::from(io::ErrorKind::NotFound))?)
            }
        }
    }

    /// Attaches something to a job's result: whole or not at all.
    ///
    /// # Errors
    /// If it cannot be written.
    pub async fn attach(&self, id: &str, name: &str, content: Vec<u8>) -> Result<(), StoreError> {
        match &self.place {
            Place::Folder => {
                let path = self.folder.join(id).join(name);
                let partial = self.folder.join(id).join(format!("{name}.partial"));
                tokio::fs::write(&partial, content).await?;
                Ok(tokio::fs::rename(&partial, &path).await?)
            }
            Place::Database(pool) => postgres::attach(pool, id, name, &content).await,
        }
    }

    /// What is attached to a job's result under this name, if anything.
    ///
    /// # Errors
    /// If it cannot be read.
    pub async fn attachment(&self, id: &str, name: &str) -> Result<Option<Vec<u8>>, StoreError> {
        match &self.place {
            Place::Folder => match tokio::fs::read(self.folder.join(id).join(name)).await {
                Ok(content) => Ok(Some(content)),
                Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
                Err(error) => Err(error.into()),
            },
            Place::Database(pool) => postgres::attachment(pool, id, name).await,
        }
    }

    /// Removes what came with a job that has ended. The database has done so as the job ended.
    pub async fn remove_uploads(&self, id: &str) {
        if self.stay_in_folder() {
            let _ = tokio::fs::remove_dir_all(uploads(&self.folder, id)).await;
        }
    }

    /// Removes what is left of a job that is not there any more. The database has done so with the job.
    pub async fn remove(&self, id: &str) {
        if self.stay_in_folder() {
            let _ = tokio::fs::remove_dir_all(self.folder.join(id)).await;
        }
    }
}

/// Where the files of a job are received.
#[must_use]
pub fn uploads(folder: &Path, id: &str) -> PathBuf {
    folder.join(id).join("uploads")
}

/// A file has its number only: its name is the sender's affair.
#[must_use]
pub fn file_name(number: usize) -> String {
    format!("{number:06}")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::shell::store::jobs::{Ending, JobFile, JobStatus, Made, NewJob};
    use crate::shell::store::trial::places;

    /// A file of more than two pieces, one of exactly one, and an empty one.
    const SIZES: [usize; 3] = [(5 << 20) / 2, 1 << 20, 0];

    fn bytes(size: usize) -> Vec<u8> {
        (0..size).map(|at| (at / 3).to_le_bytes()[0] ^ (at >> 8).to_le_bytes()[0]).collect()
    }

    #[tokio::test]
    async fn files_come_back_as_they_came_and_go_with_their_job() {
        for place in places().await {
            let store = place.open().await.jobs();
            let files = store.files(place.data.path());
            let received = uploads(files.folder(), "1");
            std::fs::create_dir_all(&received).expect("makes");
            for (number, size) in SIZES.into_iter().enumerate() {
                std::fs::write(received.join(file_name(number)), bytes(size)).expect("writes");
            }
            let new = NewJob {
                id: "1".into(),
                kind: "calibration",
                request: json!({}),
                files: SIZES.map(|size| JobFile { name: "a".into(), bytes: size as u64 }).to_vec(),
                fingerprint: String::new(),
                idempotency_key: None,
                uploads: Some(received.clone()),
            };
            assert!(matches!(store.make(&new, 1).await, Ok(Made::New(_))));
            if !files.stay_in_folder() {
                std::fs::remove_dir_all(&received).expect("removes");
            }
            let read = async |number| {
                let files = files.clone();
                tokio::task::spawn_blocking(move || files.read_upload("1", number)).await.expect("ends")
            };
            for (number, size) in SIZES.into_iter().enumerate() {
                assert_eq!(read(number).await.expect("reads"), bytes(size));
            }
            assert!(read(3).await.is_err());
            for content in [bytes(SIZES[0]), b"<p>".to_vec()] {
                files.attach("1", "report.html", content.clone()).await.expect("writes");
                assert_eq!(files.attachment("1", "report.html").await.expect("reads"), Some(content));
            }
            files.attach("1", "empty.csv", Vec::new()).await.expect("writes");
            assert_eq!(files.attachment("1", "empty.csv").await.expect("reads"), Some(Vec::new()));
            assert_eq!(files.attachment("1", "other.csv").await.expect("reads"), None);
            let ending = Ending { status: JobStatus::Succeeded, result: None, problem: None, message: "done".into() };
            assert!(store.end("1", &ending).await.expect("ends"));
            files.remove_uploads("1").await;
            assert!(read(0).await.is_err());
            assert!(files.attachment("1", "report.html").await.expect("reads").is_some());
            assert!(store.remove("1").await.expect("removes"));
            files.remove("1").await;
            assert_eq!(files.attachment("1", "report.html").await.expect("reads"), None);
        }
    }
}
