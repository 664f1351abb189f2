//! Which processes live on a database: each holds a lock on a connection of its own, which the server takes away when that ends.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::Duration;

use sqlx::Executor;
use sqlx::postgres::{PgConnectOptions, PgConnection, PgPool};
use tokio::task::JoinHandle;

use super::{MANNERS, connect};
use crate::shell::store::StoreError;

/// First half of the numbers of these locks.
const PROCESSES: i32 = 0x736b_7903;
/// How often the connection is looked after.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// A server that does not answer for so long is not there.
const PATIENCE: Duration = Duration::from_secs(4);

/// A process that is there. It has left when this is dropped.
#[derive(Debug)]
pub struct Session {
    pool: PgPool,
    holding: JoinHandle<()>,
}

impl Session {
    pub(super) async fn enter(pool: PgPool, name: &str) -> Result<Self, StoreError> {
        let (options, key) = (pool.connect_options(), key_of(name));
        let held = locked(&options, key).await?;
        Ok(Self { pool, holding: tokio::spawn(hold(options, key, held)) })
    }

    /// The keys of the processes that live.
    pub(in crate::shell::store) async fn living(&self) -> Result<HashSet<u32>, StoreError> {
        let query = "SELECT objid::BIGINT FROM pg_locks
                     WHERE locktype = 'advisory' AND classid::BIGINT = $1 AND objsubid = 2 AND granted
                       AND database = (SELECT oid FROM pg_database WHERE datname = current_database())";
        let keys: Vec<i64> = sqlx::query_scalar(query).bind(i64::from(PROCESSES)).fetch_all(&self.pool).await?;
        Ok(keys.into_iter().filter_map(|key| u32::try_from(key).ok()).collect())
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.holding.abort();
    }
}

/// The number that stands for a process: two have the same once in four thousand million, and then one that is dead seems to live until
/// its silence shows.
pub(in crate::shell::store) fn key_of(name: &str) -> u32 {
    name.bytes().fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

async fn locked(options: &PgConnectOptions, key: u32) -> Result<PgConnection, StoreError> {
    let mut connection = connect(options).await?;
    connection.execute(MANNERS).await?;
    sqlx::query("SELECT pg_try_advisory_lock($1, $2)")
        .bind(PROCESSES)
        .bind(key.cast_signed())
        .execute(&mut connection)
        .await?;
    Ok(connection)
}

/// Holds the lock, and takes it again when the connection was lost. Others may have taken this process for dead meanwhile: its steps
/// are done twice then, and counted once.
async fn hold(options: Arc<PgConnectOptions>, key: u32, mut held: PgConnection) {
    loop {
        tokio::time::sleep(LOOK_EVERY).await;
        // Asked for again each time: that of a lost connection may have been held still. Once more is once more to be let go, which never is.
        let asked = sqlx::query(
            "SELECT pg_try_advisory_lock($1, $2) WHERE NOT EXISTS (
                 SELECT 1 FROM pg_locks WHERE locktype = 'advisory' AND pid = pg_backend_pid())",
        )
        .bind(PROCESSES)
        .bind(key.cast_signed());
        if matches!(tokio::time::timeout(PATIENCE, asked.execute(&mut held)).await, Ok(Ok(_))) {
            continue;
        }
        tracing::warn!("the database does not answer; other processes may take this one for dead until it does");
        loop {
            if let Ok(connection) = locked(&options, key).await {
                held = connection;
                tracing::info!("the database answers again");
                break;
            }
            tokio::time::sleep(LOOK_EVERY).await;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::store::presence::Presence;
    use crate::shell::store::trial::places;
    use crate::shell::store::{Database, Store};

    async fn becomes(presence: &Presence, name: &str, is_alive: bool) {
        for _ in 0..1_000 {
            if presence.living().await.expect("asks").is_alive(name) == is_alive {
                return;
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        panic!("{name} never becomes {}", if is_alive { "alive" } else { "dead" });
    }

    /// Cuts the connection that says that the process of this name lives.
    async fn cut(store: &Store, name: &str) {
        let Database::Postgres(database) = &store.database else { panic!("no PostgreSQL") };
        let query =
            "SELECT COUNT(pg_terminate_backend(pid)) FROM pg_locks WHERE classid::BIGINT = $1 AND objid::BIGINT = $2";
        let cut: i64 = sqlx::query_scalar(query)
            .bind(i64::from(PROCESSES))
            .bind(i64::from(key_of(name)))
            .fetch_one(&database.pool)
            .await
            .expect("asks");
        assert_eq!(cut, 1);
    }

    #[tokio::test]
    async fn the_dead_are_known_at_once_and_who_is_cut_off_comes_back() {
        for place in places().await.iter().filter(|place| !place.is_folder()) {
            let store = place.open().await;
            let first = store.jobs().enter(place.data.path()).await.expect("enters");
            let second = store.jobs().enter(place.data.path()).await.expect("enters");
            let name = second.name().to_owned();
            becomes(&first, &name, true).await;
            becomes(&first, "nobody", false).await;
            cut(&store, &name).await;
            becomes(&first, &name, false).await;
            becomes(&first, &name, true).await;
            assert!(first.living().await.expect("asks").is_alive(first.name()));
            drop(second);
            becomes(&first, &name, false).await;
        }
    }
}
