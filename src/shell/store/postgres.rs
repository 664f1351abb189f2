//! PostgreSQL: one database for the processes of many machines.

mod address;
mod files;
mod locks;
mod queue;
mod session;
#[allow(clippy::duplicate_mod, reason = "the queries are compiled for each database")]
#[path = "sql.rs"]
mod sql;

use std::time::Duration;

use sqlx::postgres::{PgConnectOptions, PgConnection, PgPool, PgPoolOptions};
use sqlx::{ConnectOptions, Connection as _, Executor, Postgres, Transaction};

use super::StoreError;

pub(super) use address::address;
pub(super) use files::{attach, attachment, upload};
pub(super) use queue::storage;
pub use session::Session;
pub(super) use session::key_of;

/// Connections for requests and for jobs' state; further work waits.
const CONNECTIONS: u32 = 8;
/// Connections of the worker that takes steps.
const WORKER_CONNECTIONS: u32 = 2;
/// Longest wait for a connection: within the deadline of a request.
const PATIENCE: Duration = Duration::from_secs(4);
/// What every connection begins with: nobody waits for ever for a lock, or holds one when its machine has gone.
const MANNERS: &str = "SET lock_timeout = '10s'; SET idle_in_transaction_session_timeout = '30s';
    SET tcp_keepalives_idle = 10; SET tcp_keepalives_interval = 5; SET tcp_keepalives_count = 3;";

type Connection = PgConnection;

/// The database, connected to.
#[derive(Clone, Debug)]
pub(super) struct Backend {
    pub(super) pool: PgPool,
    /// For what may be lost with the power: who is at which step.
    pub(super) fleeting: PgPool,
}

impl Backend {
    /// Connects, and makes the tables if need be.
    pub(super) async fn connect(url: &str) -> Result<Self, StoreError> {
        let options = address(url).map_err(StoreError::Address)?.disable_statement_logging();
        // First alone: a pool would try for long, and then only say that it did.
        connect(&options).await?.close().await?;
        let pool = |most: u32, durability: &'static str| {
            PgPoolOptions::new().max_connections(most).acquire_timeout(PATIENCE).after_connect(move |connection, _| {
                Box::pin(async move {
                    connection.execute(MANNERS).await?;
                    connection.execute(durability).await?;
                    Ok(())
                })
            })
        };
        let backend = Self {
            pool: pool(CONNECTIONS, "SET synchronous_commit = on").connect_lazy_with(options.clone()),
            fleeting: pool(WORKER_CONNECTIONS, "SET synchronous_commit = off").connect_lazy_with(options),
        };
        // One process after the other: the migrator sees to that.
        let mut migrations = sqlx::migrate!("src/shell/store/migrations/postgres");
        migrations.dangerous_set_table_name("skypose_migrations");
        migrations.run(&backend.pool).await?;
        queue::migrate(&backend.pool).await?;
        Ok(backend)
    }

    /// A process of this name is there, until what is returned is dropped.
    pub(super) async fn enter(&self, name: &str) -> Result<Session, StoreError> {
        Session::enter(self.pool.clone(), name).await
    }

    /// What is looked at after a lock was taken is what was committed until then, whatever the server's default.
    async fn begin(&self) -> Result<Transaction<'static, Postgres>, sqlx::Error> {
        self.pool.begin_with("BEGIN ISOLATION LEVEL READ COMMITTED").await
    }
}

async fn connect(options: &PgConnectOptions) -> Result<PgConnection, StoreError> {
    match tokio::time::timeout(PATIENCE, PgConnection::connect_with(options)).await {
        Ok(connected) => Ok(connected?),
        Err(_) => Err(StoreError::Database(sqlx::Error::PoolTimedOut)),
    }
}
