//! Files on their way into a job: written as they come, within limits, and gone if anything goes wrong.

use std::path::PathBuf;

use serde_json::Value;
use sha2::{Digest, Sha256};
use tokio::fs::File;
use tokio::io::AsyncWriteExt;
use tokio::sync::OwnedSemaphorePermit;
use ulid::Ulid;

use crate::shell::config::JobSettings;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store::files::{file_name, uploads};
use crate::shell::store::jobs::JobFile;

/// Longest name of a file that is remembered, in characters.
const MAX_NAME: usize = 120;

/// Files on their way. Dropped before a job is made of it, it leaves nothing.
#[derive(Debug)]
pub struct Intake {
    pub(super) id: String,
    pub(super) files: Vec<JobFile>,
    folder: PathBuf,
    pub(super) uploads: PathBuf,
    settings: JobSettings,
    total: u64,
    seen: Sha256,
    open: Option<Open>,
    is_kept: bool,
    _place: OwnedSemaphorePermit,
}

#[derive(Debug)]
struct Open {
    file: File,
    bytes: u64,
    seen: Sha256,
}

impl Intake {
    pub(super) async fn open(
        jobs: &std::path::Path,
        settings: &JobSettings,
        place: OwnedSemaphorePermit,
    ) -> Result<Self, Fault> {
        let id = Ulid::generate().to_string();
        let intake = Self {
            folder: jobs.join(&id),
            uploads: uploads(jobs, &id),
            id,
            files: Vec::new(),
            settings: settings.clone(),
            total: 0,
            seen: Sha256::new(),
            open: None,
            is_kept: false,
            _place: place,
        };
        tokio::fs::create_dir_all(&intake.uploads).await.map_err(|error| unwritten(&error))?;
        Ok(intake)
    }

    /// How many files have begun.
    #[must_use]
    pub fn count(&self) -> usize {
        self.files.len()
    }

    /// Whether a file has come by this name.
    #[must_use]
    pub fn holds(&self, name: &str) -> bool {
        let name = shown(name);
        self.files.iter().any(|file| file.name == name)
    }

    /// A file begins. One of a name that has come before gets a number, so that the two can be told apart.
    ///
    /// # Errors
    /// [`FaultKind::TooLarge`] if it is one too many.
    pub async fn begin(&mut self, name: Option<&str>) -> Result<(), Fault> {
        self.end().await?;
        let number = self.files.len();
        let most = self.settings.max_pictures;
        if number >= most {
            let detail = format!("more pictures than the {most} that are accepted");
            return Err(Fault::new(FaultKind::TooLarge, detail));
        }
        let file = File::create(self.uploads.join(file_name(number))).await.map_err(|error| unwritten(&error))?;
        let name = name.map(shown).filter(|name| !name.is_empty()).unwrap_or_else(|| format!("picture-{}", number + 1));
        let name = distinct(name, |name| self.holds(name));
        self.files.push(JobFile { name, bytes: 0 });
        self.open = Some(Open { file, bytes: 0, seen: Sha256::new() });
        Ok(())
    }

    /// More of the file that has begun.
    ///
    /// # Errors
    /// [`FaultKind::TooLarge`] with the limit that it goes beyond.
    pub async fn write(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        let (Some(open), Some(file)) = (&mut self.open, self.files.last()) else {
            return Err(Fault::new(FaultKind::Internal, "bytes of no file"));
        };
        let too_large = |detail: String| Err(Fault::new(FaultKind::TooLarge, detail));
        open.bytes += bytes.len() as u64;
        self.total += bytes.len() as u64;
        let (most, most_of_all) = (self.settings.max_picture_bytes, self.settings.max_upload_bytes);
        if open.bytes > most {
            return too_large(format!("picture {:?} is larger than the {most} bytes that are accepted", file.name));
        }
        if self.total > most_of_all {
            return too_large(format!(
                "the pictures together are larger than the {most_of_all} bytes that are accepted"
            ));
        }
        open.seen.update(bytes);
        open.file.write_all(bytes).await.map_err(|error| unwritten(&error))
    }

    /// The file that has begun, if any, is complete.
    ///
    /// # Errors
    /// If it cannot be written.
    pub async fn end(&mut self) -> Result<(), Fault> {
        let Some(mut open) = self.open.take() else { return Ok(()) };
        open.file.flush().await.map_err(|error| unwritten(&error))?;
        // Once the client has been told that there is a job, its files outlive a power cut.
        open.file.sync_data().await.map_err(|error| unwritten(&error))?;
        if let Some(file) = self.files.last_mut() {
            file.bytes = open.bytes;
            self.seen.update((file.name.len() as u64).to_le_bytes());
            self.seen.update(file.name.as_bytes());
        }
        self.seen.update(open.seen.finalize());
        Ok(())
    }

    /// Tag of the files and the request: the same for the same.
    pub(super) fn fingerprint(&self, request: &Value) -> String {
        let mut seen = self.seen.clone();
        seen.update(request.to_string());
        seen.finalize().iter().fold(String::new(), |text, byte| text + &format!("{byte:02x}"))
    }

    /// The files belong to a job now.
    pub(super) fn keep(&mut self) {
        self.is_kept = true;
    }
}

impl Drop for Intake {
    fn drop(&mut self) {
        if self.is_kept {
            return;
        }
        let folder = std::mem::take(&mut self.folder);
        let remove = move || remove(&folder);
        match tokio::runtime::Handle::try_current() {
            Ok(runtime) => drop(runtime.spawn_blocking(remove)),
            Err(_) => remove(),
        }
    }
}

/// A file that was being made while its sender went may come into being after the folder was looked through: then again.
fn remove(folder: &std::path::Path) {
    for _ in 0..20 {
        match std::fs::remove_dir_all(folder) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                std::thread::sleep(std::time::Duration::from_millis(50));
            }
            Ok(()) | Err(_) => return,
        }
    }
    tracing::warn!(folder = %folder.display(), "an upload that broke off cannot be removed");
}

/// A name as it is shown: without the folders before it and what does not print.
fn shown(name: &str) -> String {
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    last.chars().filter(|c| !c.is_control()).take(MAX_NAME).collect()
}

/// The name, with a number before its ending if it is taken.
fn distinct(name: String, is_taken: impl Fn(&str) -> bool) -> String {
    if !is_taken(&name) {
        return name;
    }
    let (stem, ending) = name.rfind('.').filter(|dot| *dot > 0).map_or((name.as_str(), ""), |dot| name.split_at(dot));
    let numbered = (2..u32::MAX).map(|number| format!("{stem}-{number}{ending}")).find(|name| !is_taken(name));
    numbered.unwrap_or_else(|| name.clone())
}

fn unwritten(error: &std::io::Error) -> Fault {
    Fault::new(FaultKind::Internal, format!("an uploaded file cannot be stored: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_shown_without_folders_and_control_characters() {
        assert_eq!(shown("../../etc/left01.jpg"), "left01.jpg");
        assert_eq!(shown("C:\\pictures\\left01.jpg"), "left01.jpg");
        assert_eq!(shown("a\n\u{1b}[31mb.png"), "a[31mb.png");
        assert_eq!(shown(&"x".repeat(1000)).len(), MAX_NAME);
        assert_eq!(shown("folder/"), "");
    }

    #[test]
    fn a_name_that_is_taken_gets_a_number() {
        let taken = ["a.jpg", "a-2.jpg", "b", ".c"];
        let name = |name: &str| distinct(name.into(), |name| taken.contains(&name));
        assert_eq!(["d.jpg", "a.jpg", "b", ".c"].map(name), ["d.jpg", "a-3.jpg", "b-2", ".c-2"]);
    }
}
