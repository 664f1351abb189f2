//! Cameras, targets and streams by name, and jobs: in one SQLite file, or in PostgreSQL where several processes share them. What is asked is
//! written once, in `sql.rs`, and compiled for each; here is which of the two.

pub mod files;
pub mod jobs;
mod postgres;
pub mod presence;
pub mod queue;
mod sqlite;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use super::config::StoreSettings;
use super::fault::{Fault, FaultKind};
use jobs::JobStore;

/// What is wrong with the address of a database, if anything; never the address itself.
#[must_use]
pub fn address_problem(url: &str) -> Option<String> {
    postgres::address(url).err()
}

/// A store that does not answer for so long is not ready.
const READY_WITHIN: Duration = Duration::from_secs(2);

/// What is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A calibrated camera.
    Camera,
    /// A constellation of markers.
    Target,
    /// What is looked for in the frames that a camera sends.
    Stream,
}

impl Kind {
    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Target => "target",
            Self::Stream => "stream",
        }
    }
}

/// A stored thing: its name, its JSON, and a tag that changes with its content.
#[derive(Clone, Debug, PartialEq, Eq, sqlx::FromRow)]
pub struct Stored {
    /// The name.
    pub name: String,
    /// The content, JSON.
    pub body: String,
    /// Strong tag of the content.
    pub etag: String,
}

/// What must hold for a change to be made.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Precondition {
    /// Nothing.
    #[default]
    None,
    /// It exists with one of these tags (`If-Match`); `*` is any.
    Matches(Vec<String>),
    /// It does not exist (`If-None-Match: *`).
    Absent,
}

/// What a put did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Put {
    /// There was none of that name.
    Created,
    /// There was one.
    Replaced,
}

/// Where it is stored.
#[derive(Clone, Debug)]
enum Database {
    Sqlite(sqlite::Backend),
    Postgres(postgres::Backend),
}

/// The same call, whichever it is.
macro_rules! either {
    ($database:expr, $chosen:ident => $call:expr) => {
        match $database {
            $crate::shell::store::Database::Sqlite($chosen) => $call,
            $crate::shell::store::Database::Postgres($chosen) => $call,
        }
    };
}
use either;

/// The store.
#[derive(Clone, Debug)]
pub struct Store {
    database: Database,
    changes: Arc<AtomicU64>,
}

impl Store {
    /// Opens what the settings name.
    ///
    /// # Errors
    /// If the folder cannot be made, the file not be opened or the database not be reached, or if one of them is of a newer version.
    pub async fn connect(settings: &StoreSettings) -> Result<Self, StoreError> {
        if settings.storage.is_empty() {
            return Self::open(&settings.data).await;
        }
        std::fs::create_dir_all(&settings.data)?;
        let database = postgres::Backend::connect(settings.storage.expose()).await?;
        Ok(Self { database: Database::Postgres(database), changes: Arc::default() })
    }

    /// Opens the file under `folder`, made if need be.
    ///
    /// # Errors
    /// If the folder cannot be made, or the file cannot be opened or is of a newer version.
    pub async fn open(folder: &Path) -> Result<Self, StoreError> {
        let database = sqlite::Backend::open(folder).await?;
        Ok(Self { database: Database::Sqlite(database), changes: Arc::default() })
    }

    /// Its jobs.
    #[must_use]
    pub fn jobs(&self) -> JobStore {
        JobStore::new(self.database.clone())
    }

    /// How often this process has changed something: what was read at one count holds until the next.
    #[must_use]
    pub fn changes(&self) -> u64 {
        self.changes.load(Ordering::Acquire)
    }

    /// The thing of this name.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn get(&self, kind: Kind, name: &str) -> Result<Option<Stored>, StoreError> {
        either!(&self.database, database => database.get_thing(kind, name).await)
    }

    /// All things of a kind, by name.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn list(&self, kind: Kind) -> Result<Vec<Stored>, StoreError> {
        either!(&self.database, database => database.list_things(kind).await)
    }

    /// Stores `body` under `name`.
    ///
    /// # Errors
    /// [`StoreError::Precondition`] if that does not hold; otherwise if the store cannot be written.
    pub async fn put(
        &self,
        kind: Kind,
        name: &str,
        body: &str,
        precondition: &Precondition,
    ) -> Result<(Put, Stored), StoreError> {
        let put = either!(&self.database, database => database.put_thing(kind, name, body, precondition).await)?;
        self.changes.fetch_add(1, Ordering::Release);
        Ok(put)
    }

    /// Removes the thing of this name; false if there is none.
    ///
    /// # Errors
    /// [`StoreError::Precondition`] if that does not hold; otherwise if the store cannot be written.
    pub async fn delete(&self, kind: Kind, name: &str, precondition: &Precondition) -> Result<bool, StoreError> {
        let was_there = either!(&self.database, database => database.delete_thing(kind, name, precondition).await)?;
        self.changes.fetch_add(1, Ordering::Release);
        Ok(was_there)
    }

    /// Whether the store can be read, at once.
    pub async fn is_ready(&self) -> bool {
        let asked = async { either!(&self.database, database => database.ask().await) };
        matches!(tokio::time::timeout(READY_WITHIN, asked).await, Ok(Ok(())))
    }

    /// Closes it.
    pub async fn close(&self) {
        either!(&self.database, database => database.close().await);
    }
}

fn check(precondition: &Precondition, current: Option<&str>) -> Result<(), StoreError> {
    let holds = match (precondition, current) {
        (Precondition::None, _) | (Precondition::Absent, None) => true,
        (Precondition::Absent, Some(_)) | (Precondition::Matches(_), None) => false,
        (Precondition::Matches(tags), Some(current)) => tags.iter().any(|tag| tag == "*" || tag == current),
    };
    if holds { Ok(()) } else { Err(StoreError::Precondition { current: current.map(Into::into) }) }
}

/// FNV-1a of the content, quoted: the same content has the same tag on every machine.
fn etag_of(body: &str) -> String {
    let hash = body
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    format!("\"{hash:016x}\"")
}

/// Why the store did not do it.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The state is not the one that the caller requires.
    #[error("the stored one is {}", current.as_deref().map_or("absent".into(), |tag| format!("at {tag}")))]
    Precondition {
        /// The tag that it has, if it exists.
        current: Option<String>,
    },
    /// The address of the database.
    #[error("store.storage {0}")]
    Address(String),
    /// The database.
    #[error("store: {0}")]
    Database(#[from] sqlx::Error),
    /// A version of the tables that this program does not know.
    #[error("store: {0}")]
    Migration(#[from] sqlx::migrate::MigrateError),
    /// The job library, on SQLite.
    #[error("queue: {0}")]
    SqliteQueue(#[from] apalis_sqlite::Error),
    /// The job library, on PostgreSQL.
    #[error("queue: {0}")]
    PostgresQueue(#[from] apalis_postgres::Error),
    /// What is stored is not what was written.
    #[error("store: {0}")]
    Content(#[from] serde_json::Error),
    /// The folder.
    #[error("data folder: {0}")]
    Folder(#[from] std::io::Error),
}

impl StoreError {
    /// Whether the database cannot be reached, or not now: the same may succeed a moment later.
    #[must_use]
    pub fn is_passing(&self) -> bool {
        match self {
            Self::Database(error) | Self::PostgresQueue(apalis_postgres::Error::Database(error)) => is_passing(error),
            Self::Precondition { .. }
            | Self::Address(_)
            | Self::Migration(_)
            | Self::SqliteQueue(_)
            | Self::PostgresQueue(_)
            | Self::Content(_)
            | Self::Folder(_) => false,
        }
    }
}

/// Of the codes of PostgreSQL: no connection, the server is going or coming, has no place left, or a lock was waited for too long.
fn is_passing(error: &sqlx::Error) -> bool {
    match error {
        sqlx::Error::Io(_) | sqlx::Error::PoolTimedOut | sqlx::Error::WorkerCrashed => true,
        sqlx::Error::Database(error) => error.code().is_some_and(|code| {
            code.len() == 5 && (code.starts_with("08") || code.starts_with("57P") || code == "53300" || code == "55P03")
        }),
        _ => false,
    }
}

impl From<StoreError> for Fault {
    fn from(error: StoreError) -> Self {
        let kind = match error {
            StoreError::Precondition { .. } => FaultKind::PreconditionFailed,
            StoreError::Address(_) => FaultKind::Senseless,
            _ if error.is_passing() => FaultKind::Unreachable,
            _ => FaultKind::Internal,
        };
        Self::new(kind, error.to_string())
    }
}

/// A name that can stand in a path, a key and a file's name: 1 to 64 of letters, digits, `.`, `_` and `-`, the first a letter
/// or a digit.
///
/// # Errors
/// [`FaultKind::Senseless`] with the rule.
pub fn check_name(name: &str) -> Result<(), Fault> {
    let good = (1..=64).contains(&name.len())
        && name.starts_with(|c: char| c.is_ascii_alphanumeric())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-'));
    if good {
        return Ok(());
    }
    Err(Fault::new(
        FaultKind::Senseless,
        format!("{name:?} is no name: 1 to 64 letters, digits, '.', '_' or '-', the first a letter or a digit"),
    ))
}

#[cfg(test)]
pub(in crate::shell) mod trial;

#[cfg(test)]
mod tests {
    use super::trial::places;
    use super::*;

    #[tokio::test]
    async fn what_is_put_is_there_after_reopening() {
        for place in places().await {
            let store = place.open().await;
            let (put, stored) = store.put(Kind::Camera, "front", "{}", &Precondition::None).await.expect("stores");
            assert_eq!(put, Put::Created);
            store.close().await;
            let store = place.open().await;
            assert_eq!(store.get(Kind::Camera, "front").await.expect("reads"), Some(stored.clone()));
            assert_eq!(store.get(Kind::Target, "front").await.expect("reads"), None);
            assert_eq!(store.list(Kind::Camera).await.expect("lists"), [stored]);
        }
    }

    #[tokio::test]
    async fn of_two_writers_with_one_tag_one_wins() {
        for place in places().await {
            let store = place.open().await;
            let (_, first) = store.put(Kind::Target, "t", "1", &Precondition::Absent).await.expect("stores");
            let tag = Precondition::Matches(vec![first.etag]);
            let (a, b) = tokio::join!(store.put(Kind::Target, "t", "2", &tag), store.put(Kind::Target, "t", "3", &tag));
            assert_eq!([a.is_ok(), b.is_ok()].iter().filter(|ok| **ok).count(), 1);
            let refused = store.put(Kind::Target, "t", "4", &Precondition::Absent).await;
            assert!(matches!(refused, Err(StoreError::Precondition { current: Some(_) })));
            let absent = Precondition::Absent;
            let (a, b) = tokio::join!(
                store.put(Kind::Target, "new", "2", &absent),
                store.put(Kind::Target, "new", "3", &absent)
            );
            assert_eq!([a.is_ok(), b.is_ok()].iter().filter(|ok| **ok).count(), 1);
        }
    }

    #[tokio::test]
    async fn deleting_twice_says_so() {
        for place in places().await {
            let store = place.open().await;
            store.put(Kind::Target, "t", "1", &Precondition::None).await.expect("stores");
            assert!(store.delete(Kind::Target, "t", &Precondition::None).await.expect("deletes"));
            assert!(!store.delete(Kind::Target, "t", &Precondition::None).await.expect("finds nothing"));
        }
    }

    #[test]
    fn names_are_safe_in_paths_and_keys() {
        for good in ["front", "wing-six", "a", "7.up_x"] {
            assert!(check_name(good).is_ok(), "{good}");
        }
        for bad in ["", ".", "-x", "a/b", "a b", "ä", "@x", &"x".repeat(65)] {
            assert!(check_name(bad).is_err(), "{bad}");
        }
    }
}
