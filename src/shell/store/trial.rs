//! Stores for tests: one of each kind, so that what is said of one is said of both.

use tempfile::TempDir;
use tokio::sync::OnceCell;

use super::Store;
use crate::shell::config::{Storage, StoreSettings};

#[path = "../../../tests/http/postgres/cluster.rs"]
#[allow(clippy::print_stdout, reason = "a test says what is left out")]
mod cluster;

use cluster::Cluster;

/// Where a store is.
#[derive(Debug)]
pub(in crate::shell) struct Place {
    pub(in crate::shell) data: TempDir,
    storage: Storage,
}

impl Place {
    pub(in crate::shell) async fn open(&self) -> Store {
        let settings = StoreSettings { data: self.data.path().to_owned(), storage: self.storage.clone() };
        Store::connect(&settings).await.expect("opens")
    }

    /// Whether the files of jobs stand in the folder.
    pub(in crate::shell) const fn is_folder(&self) -> bool {
        self.storage.is_empty()
    }
}

/// A new one of each kind that there is here.
pub(in crate::shell) async fn places() -> Vec<Place> {
    static CLUSTER: OnceCell<Option<Cluster>> = OnceCell::const_new();
    let place = |storage| Place { data: tempfile::tempdir().expect("a folder"), storage };
    let mut places = vec![place(Storage::default())];
    if let Some(cluster) = CLUSTER.get_or_init(Cluster::start).await {
        places.push(place(Storage::from(cluster.database().await)));
    }
    places
}
