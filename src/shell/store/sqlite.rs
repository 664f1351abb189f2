//! SQLite: one file under the data folder, for the processes of one machine.

mod files;
mod locks;
mod queue;
#[allow(clippy::duplicate_mod, reason = "the queries are compiled for each database")]
#[path = "sql.rs"]
mod sql;

use std::path::Path;
use std::time::Duration;

use sqlx::sqlite::{
    SqliteConnectOptions, SqliteConnection, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{Sqlite, Transaction};

use super::StoreError;
use super::presence::Entrance;

pub(super) use queue::storage;

/// The file's name under the data folder.
const FILE: &str = "skypose.sqlite3";

type Connection = SqliteConnection;

/// The file, opened.
#[derive(Clone, Debug)]
pub(super) struct Backend {
    pub(super) pool: SqlitePool,
    /// For what may be lost with the power: who is at which step.
    pub(super) fleeting: SqlitePool,
}

impl Backend {
    /// Opens the file under `folder`, made if need be.
    pub(super) async fn open(folder: &Path) -> Result<Self, StoreError> {
        std::fs::create_dir_all(folder)?;
        let _entrance = Entrance::pass(folder).await?;
        let options = SqliteConnectOptions::new()
            .filename(folder.join(FILE))
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .busy_timeout(Duration::from_secs(5));
        let pool = SqlitePoolOptions::new().max_connections(4).connect_with(options.clone()).await?;
        let fleeting = SqlitePoolOptions::new()
            .max_connections(2)
            .connect_lazy_with(options.synchronous(SqliteSynchronous::Normal));
        sqlx::migrate!("src/shell/store/migrations/sqlite").run(&pool).await?;
        queue::migrate(&pool).await?;
        Ok(Self { pool, fleeting })
    }

    /// Immediate: nobody else writes between the look and the change.
    async fn begin(&self) -> Result<Transaction<'static, Sqlite>, sqlx::Error> {
        self.pool.begin_with("BEGIN IMMEDIATE").await
    }
}
