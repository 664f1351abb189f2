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
    place: Place,
    runtime: Handle,
}

#[derive(Clone, Debug)]
enum Place {
    Folder(PathBuf),
    Database(PgPool),
}

impl JobFiles {
    pub(super) fn in_folder(folder: &Path) -> Self {
        Self { place: Place::Folder(folder.to_owned()), runtime: Handle::current() }
    }

    pub(super) fn in_database(pool: PgPool) -> Self {
        Self { place: Place::Database(pool), runtime: Handle::current() }
    }

    /// Whether a job's files stay in the folder where they were received; otherwise nobody needs it once the job is made.
    #[must_use]
    pub const fn stay_in_folder(&self) -> bool {
        matches!(self.place, Place::Folder(_))
    }

    /// One of the files that came with a job, by its number. Blocks: for threads of jobs only.
    ///
    /// # Errors
    /// If it is not there any more.
    pub fn read_upload(&self, id: &str, number: usize) -> Result<Vec<u8>, StoreError> {
        match &self.place {
            Place::Folder(folder) => Ok(std::fs::read(uploads(folder, id).join(file_name(number)))?),
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
            Place::Folder(folder) => {
                let path = folder.join(id).join(name);
                let partial = folder.join(id).join(format!("{name}.partial"));
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
            Place::Folder(folder) => match tokio::fs::read(folder.join(id).join(name)).await {
                Ok(content) => Ok(Some(content)),
                Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
                Err(error) => Err(error.into()),
            },
            Place::Database(pool) => postgres::attachment(pool, id, name).await,
        }
    }

    /// Removes what came with a job that has ended. The database has done so as the job ended.
    pub async fn remove_uploads(&self, id: &str) {
        if let Place::Folder(folder) = &self.place {
            let _ = tokio::fs::remove_dir_all(uploads(folder, id)).await;
        }
    }

    /// Removes what is left of a job that is not there any more. The database has done so with the job.
    pub async fn remove(&self, id: &str) {
        if let Place::Folder(folder) = &self.place {
            let _ = tokio::fs::remove_dir_all(folder.join(id)).await;
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
