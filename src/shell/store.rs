//! Cameras and targets by name, and jobs, in one SQLite file.

pub mod jobs;
pub mod presence;
pub mod queue;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous};

use super::fault::{Fault, FaultKind};
use jobs::JobStore;
use presence::Entrance;

/// The file's name under the data folder.
const FILE: &str = "skypose.sqlite3";

/// What is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A calibrated camera.
    Camera,
    /// A constellation of markers.
    Target,
}

impl Kind {
    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Target => "target",
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

/// The store.
#[derive(Clone, Debug)]
pub struct Store {
    pool: SqlitePool,
    /// For what may be lost with the power: who is at which step.
    fleeting: SqlitePool,
    changes: Arc<AtomicU64>,
}

impl Store {
    /// Opens the store under `folder`, made if need be.
    ///
    /// # Errors
    /// If the folder cannot be made, or the file cannot be opened or is of a newer version.
    pub async fn open(folder: &Path) -> Result<Self, StoreError> {
        std::fs::create_dir_all(folder)?;
        let _entrance = Entrance::pass(folder).await?;
        let options = SqliteConnectOptions::new()
            .filename(folder.join(FILE))
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .busy_timeout(std::time::Duration::from_secs(5));
        let pool = SqlitePoolOptions::new().max_connections(4).connect_with(options.clone()).await?;
        let fleeting = SqlitePoolOptions::new()
            .max_connections(2)
            .connect_lazy_with(options.synchronous(SqliteSynchronous::Normal));
        sqlx::migrate!("src/shell/store/migrations").run(&pool).await?;
        queue::migrate(&pool).await?;
        Ok(Self { pool, fleeting, changes: Arc::default() })
    }

    /// Its jobs.
    #[must_use]
    pub fn jobs(&self) -> JobStore {
        JobStore::new(self.pool.clone(), self.fleeting.clone())
    }

    /// How often this process has changed something: what was read at one count holds until the next.
    #[must_use]
    pub fn changes(&self) -> u64 {
        self.changes.load(Ordering::Acquire)
    }

    /// The thing of this name.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn get(&self, kind: Kind, name: &str) -> Result<Option<Stored>, StoreError> {
        let query = "SELECT name, body, etag FROM things WHERE kind = ? AND name = ?";
        Ok(sqlx::query_as(query).bind(kind.name()).bind(name).fetch_optional(&self.pool).await?)
    }

    /// All things of a kind, by name.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub async fn list(&self, kind: Kind) -> Result<Vec<Stored>, StoreError> {
        let query = "SELECT name, body, etag FROM things WHERE kind = ? ORDER BY name";
        Ok(sqlx::query_as(query).bind(kind.name()).fetch_all(&self.pool).await?)
    }

    /// Stores `body` under `name`.
    ///
    /// # Errors
    /// [`StoreError::Precondition`] if that does not hold; otherwise if the file cannot be written.
    pub async fn put(
        &self,
        kind: Kind,
        name: &str,
        body: &str,
        precondition: &Precondition,
    ) -> Result<(Put, Stored), StoreError> {
        // Immediate: nobody else writes between the look and the change.
        let mut change = self.pool.begin_with("BEGIN IMMEDIATE").await?;
        let current: Option<String> = sqlx::query_scalar("SELECT etag FROM things WHERE kind = ? AND name = ?")
            .bind(kind.name())
            .bind(name)
            .fetch_optional(&mut *change)
            .await?;
        check(precondition, current.as_deref())?;
        let stored = Stored { name: name.into(), body: body.into(), etag: etag_of(body) };
        sqlx::query(
            "INSERT INTO things (kind, name, body, etag) VALUES (?, ?, ?, ?)
             ON CONFLICT (kind, name) DO UPDATE SET body = excluded.body, etag = excluded.etag",
        )
        .bind(kind.name())
        .bind(name)
        .bind(body)
        .bind(&stored.etag)
        .execute(&mut *change)
        .await?;
        change.commit().await?;
        self.changes.fetch_add(1, Ordering::Release);
        Ok((if current.is_some() { Put::Replaced } else { Put::Created }, stored))
    }

    /// Removes the thing of this name; false if there is none.
    ///
    /// # Errors
    /// [`StoreError::Precondition`] if that does not hold; otherwise if the file cannot be written.
    pub async fn delete(&self, kind: Kind, name: &str, precondition: &Precondition) -> Result<bool, StoreError> {
        let mut change = self.pool.begin_with("BEGIN IMMEDIATE").await?;
        let current: Option<String> = sqlx::query_scalar("SELECT etag FROM things WHERE kind = ? AND name = ?")
            .bind(kind.name())
            .bind(name)
            .fetch_optional(&mut *change)
            .await?;
        if current.is_none() && *precondition == Precondition::None {
            return Ok(false);
        }
        check(precondition, current.as_deref())?;
        sqlx::query("DELETE FROM things WHERE kind = ? AND name = ?")
            .bind(kind.name())
            .bind(name)
            .execute(&mut *change)
            .await?;
        change.commit().await?;
        self.changes.fetch_add(1, Ordering::Release);
        Ok(true)
    }

    /// Whether the file can be read.
    pub async fn is_ready(&self) -> bool {
        sqlx::query("SELECT 1").execute(&self.pool).await.is_ok()
    }

    /// Closes the file.
    pub async fn close(&self) {
        self.fleeting.close().await;
        self.pool.close().await;
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
    /// The database.
    #[error("store: {0}")]
    Database(#[from] sqlx::Error),
    /// A version of the file that this program does not know.
    #[error("store: {0}")]
    Migration(#[from] sqlx::migrate::MigrateError),
    /// The job library.
    #[error("queue: {0}")]
    Queue(#[from] apalis_sqlite::Error),
    /// What is stored is not what was written.
    #[error("store: {0}")]
    Content(#[from] serde_json::Error),
    /// The folder.
    #[error("data folder: {0}")]
    Folder(#[from] std::io::Error),
}

impl From<StoreError> for Fault {
    fn from(error: StoreError) -> Self {
        let kind = match error {
            StoreError::Precondition { .. } => FaultKind::PreconditionFailed,
            StoreError::Database(_)
            | StoreError::Migration(_)
            | StoreError::Queue(_)
            | StoreError::Content(_)
            | StoreError::Folder(_) => FaultKind::Internal,
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
mod tests {
    use super::*;

    #[tokio::test]
    async fn what_is_put_is_there_after_reopening() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).await.expect("opens");
        let (put, stored) = store.put(Kind::Camera, "front", "{}", &Precondition::None).await.expect("stores");
        assert_eq!(put, Put::Created);
        store.close().await;
        let store = Store::open(folder.path()).await.expect("opens again");
        assert_eq!(store.get(Kind::Camera, "front").await.expect("reads"), Some(stored.clone()));
        assert_eq!(store.get(Kind::Target, "front").await.expect("reads"), None);
        assert_eq!(store.list(Kind::Camera).await.expect("lists"), [stored]);
    }

    #[tokio::test]
    async fn of_two_writers_with_one_tag_one_wins() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).await.expect("opens");
        let (_, first) = store.put(Kind::Target, "t", "1", &Precondition::Absent).await.expect("stores");
        let tag = Precondition::Matches(vec![first.etag]);
        let (a, b) = tokio::join!(store.put(Kind::Target, "t", "2", &tag), store.put(Kind::Target, "t", "3", &tag));
        assert_eq!([a.is_ok(), b.is_ok()].iter().filter(|ok| **ok).count(), 1);
        let refused = store.put(Kind::Target, "t", "4", &Precondition::Absent).await;
        assert!(matches!(refused, Err(StoreError::Precondition { current: Some(_) })));
    }

    #[tokio::test]
    async fn deleting_twice_says_so() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).await.expect("opens");
        store.put(Kind::Target, "t", "1", &Precondition::None).await.expect("stores");
        assert!(store.delete(Kind::Target, "t", &Precondition::None).await.expect("deletes"));
        assert!(!store.delete(Kind::Target, "t", &Precondition::None).await.expect("finds nothing"));
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
