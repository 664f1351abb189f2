//! Where everything is kept.

use std::fmt;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// What is kept.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct StoreSettings {
    /// The folder under which everything is stored; with a database only what is being received.
    pub data: PathBuf,
    /// The database that several processes share; none is a file under `data`.
    pub storage: Storage,
}

impl Default for StoreSettings {
    fn default() -> Self {
        Self { data: PathBuf::from("skypose-data"), storage: Storage::default() }
    }
}

/// Address of a database: `postgres://user@host/database`, or nothing. It may hold a password, so it is not shown.
#[derive(Clone, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Storage(String);

impl From<String> for Storage {
    fn from(address: String) -> Self {
        Self(address)
    }
}

impl Storage {
    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The address, for who connects to it.
    #[must_use]
    pub fn expose(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Storage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.is_empty() { "Storage(none)" } else { "Storage(..)" })
    }
}
