//! Which processes live on a store: each holds a lock on a file of its own in the data folder, which the system takes away from the dead;
//! with PostgreSQL, where the others may be on other machines, one in the database too.

use std::collections::HashSet;
use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use ulid::Ulid;

use super::StoreError;
use super::postgres::{Session, key_of};

/// A process that is there. It has left when this is dropped.
#[derive(Debug)]
pub struct Presence {
    name: String,
    folder: PathBuf,
    _lock: File,
    session: Option<Session>,
}

/// Who lived when it was looked.
#[derive(Debug)]
pub enum Living<'a> {
    /// The folder tells.
    Folder(&'a Presence),
    /// The database has told: the keys of the living, and us.
    Database(HashSet<u32>, &'a Presence),
}

impl Living<'_> {
    /// Whether the process of this name lives.
    #[must_use]
    pub fn is_alive(&self, name: &str) -> bool {
        match self {
            Self::Folder(presence) => presence.is_alive(name),
            Self::Database(keys, presence) => name == presence.name || keys.contains(&key_of(name)),
        }
    }
}

impl Presence {
    /// Enters the folder.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn enter(data: &Path) -> io::Result<Self> {
        let folder = data.join("processes");
        std::fs::create_dir_all(&folder)?;
        let name = Ulid::generate().to_string();
        let lock = File::create(folder.join(&name))?;
        // Where the file system knows no locks, the dead are known by their silence alone.
        if let Err(error) = lock.try_lock() {
            tracing::warn!(folder = %folder.display(), %error, "no locks on this file system");
        }
        Ok(Self { name, folder, _lock: lock, session: None })
    }

    /// In the database too.
    #[must_use]
    pub fn with_session(mut self, session: Session) -> Self {
        self.session = Some(session);
        self
    }

    /// Who lives, wherever the store is shared.
    ///
    /// # Errors
    /// If the database cannot be asked.
    pub async fn living(&self) -> Result<Living<'_>, StoreError> {
        Ok(match &self.session {
            Some(session) => Living::Database(session.living().await?, self),
            None => Living::Folder(self),
        })
    }

    /// A name that no other process has.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether the process of this name lives on this folder. One that cannot be asked is taken to live.
    #[must_use]
    pub fn is_alive(&self, name: &str) -> bool {
        if name == self.name {
            return true;
        }
        match File::open(self.folder.join(name)) {
            Ok(file) => match file.try_lock_shared() {
                Ok(()) => false,
                Err(TryLockError::WouldBlock | TryLockError::Error(_)) => true,
            },
            Err(error) => error.kind() != io::ErrorKind::NotFound,
        }
    }

    /// Removes what the dead have left; whether nobody else lives.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn is_alone(&self) -> io::Result<bool> {
        let mut is_alone = true;
        for entry in std::fs::read_dir(&self.folder)? {
            let entry = entry?;
            if self.is_alive(&entry.file_name().to_string_lossy()) {
                is_alone &= entry.file_name().to_string_lossy() == self.name;
            } else {
                let _ = std::fs::remove_file(entry.path());
            }
        }
        Ok(is_alone)
    }
}

impl Drop for Presence {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(self.folder.join(&self.name));
    }
}

/// Held while a process starts, so that two that start at once do not make the same tables, or sweep each other's files.
#[derive(Debug)]
pub struct Entrance {
    _lock: File,
}

impl Entrance {
    /// Waits until nobody else is starting.
    ///
    /// # Errors
    /// If the folder cannot be written.
    pub async fn pass(data: &Path) -> io::Result<Self> {
        let file = File::create(data.join("start.lock"))?;
        tokio::task::spawn_blocking(move || match file.lock() {
            Ok(()) => Ok(Self { _lock: file }),
            Err(error) if error.kind() == io::ErrorKind::Unsupported => Ok(Self { _lock: file }),
            Err(error) => Err(error),
        })
        .await
        .map_err(io::Error::other)?
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dead_are_told_from_the_living() {
        let data = tempfile::tempdir().expect("a folder");
        let first = Presence::enter(data.path()).expect("enters");
        assert!(first.is_alone().expect("reads"));
        let second = Presence::enter(data.path()).expect("enters");
        let name = second.name().to_owned();
        assert!(first.is_alive(&name) && second.is_alive(first.name()) && !first.is_alone().expect("reads"));
        drop(second);
        assert!(!first.is_alive(&name) && first.is_alone().expect("reads"));
        // A process that was killed leaves its file, without the lock.
        std::fs::write(data.path().join("processes/killed"), "").expect("writes");
        assert!(!first.is_alive("killed") && first.is_alone().expect("reads"));
        assert!(!data.path().join("processes/killed").exists());
    }

    #[tokio::test]
    async fn one_starts_after_the_other() {
        let data = tempfile::tempdir().expect("a folder");
        let first = Entrance::pass(data.path()).await.expect("passes");
        let second = Entrance::pass(data.path());
        tokio::pin!(second);
        let early = tokio::time::timeout(std::time::Duration::from_millis(50), &mut second).await;
        assert!(early.is_err(), "both are in");
        drop(first);
        second.await.expect("passes");
    }
}
