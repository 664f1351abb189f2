//! What was given: a folder, an archive, or files with names.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use super::archive::{self, MOST_BYTES, Unpacked};
use crate::shell::fault::{Fault, FaultKind};

/// The truth of the project's own form.
pub(super) const TRUTH: &str = "truth.json";

/// The truth of clips of the sky, as `sky/labels.json` of the data set has it.
pub(super) const LABELS: &str = "labels.json";

/// Files by the names that the truth gives.
#[derive(Debug)]
pub struct Files {
    place: Place,
    /// What stands before every name: where in an archive the truth is.
    prefix: String,
    /// Name of the truth.
    truth: String,
}

#[derive(Debug)]
enum Place {
    /// A folder.
    Folder(PathBuf),
    /// Files by their names in the archive.
    Unpacked(Unpacked),
    /// Files by the names with which they came.
    Listed(BTreeMap<String, PathBuf>),
}

fn missing(detail: String) -> Fault {
    Fault::new(FaultKind::NotFound, detail)
}

impl Files {
    /// Whether this is a file that says what frames show, by its name.
    #[must_use]
    pub fn is_truth(path: &Path) -> bool {
        path.file_name().is_some_and(|name| name == TRUTH || name == LABELS)
    }

    /// What a path names: a folder with the truth in it, the truth itself, or an archive (zip, tar).
    ///
    /// # Errors
    /// No such thing, or no truth in it.
    pub fn open(path: &Path) -> Result<Self, Fault> {
        Self::open_within(path, MOST_BYTES)
    }

    /// The same with at most so many bytes of an archive.
    ///
    /// # Errors
    /// No such thing, no truth in it, or more bytes.
    pub fn open_within(path: &Path, most_bytes: u64) -> Result<Self, Fault> {
        let metadata = path.metadata().map_err(|error| missing(error.to_string()))?;
        if metadata.is_dir() {
            let truth = [TRUTH, LABELS].into_iter().find(|name| path.join(name).is_file()).ok_or_else(|| {
                missing(format!("a folder without {TRUTH} (or {LABELS}), which says what its frames show"))
            })?;
            return Ok(Self { place: Place::Folder(path.into()), prefix: String::new(), truth: truth.into() });
        }
        if let Some(unpacked) = archive::unpack(path, most_bytes)? {
            let (prefix, truth) = truth_among(unpacked.names())?;
            return Ok(Self { place: Place::Unpacked(unpacked), prefix, truth });
        }
        let is_json = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
        match (is_json, path.file_name()) {
            (true, Some(name)) => {
                let folder = path.parent().unwrap_or(Path::new("")).to_owned();
                let truth = name.to_string_lossy().into_owned();
                Ok(Self { place: Place::Folder(folder), prefix: String::new(), truth })
            }
            _ => Err(Fault::new(
                FaultKind::NotAFrame,
                "neither a folder nor an archive (zip, tar) nor a truth in JSON".to_owned(),
            )),
        }
    }

    /// Files with their names, as they come with a job.
    ///
    /// # Errors
    /// No truth among them.
    pub fn listed(files: impl IntoIterator<Item = (String, PathBuf)>) -> Result<Self, Fault> {
        let files: BTreeMap<String, PathBuf> = files.into_iter().collect();
        let (prefix, truth) = truth_among(files.keys().map(String::as_str))?;
        Ok(Self { place: Place::Listed(files), prefix, truth })
    }

    /// Name of the truth.
    #[must_use]
    pub fn truth_name(&self) -> &str {
        &self.truth
    }

    /// The truth.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn truth(&self) -> Result<Vec<u8>, Fault> {
        let path = self.path(&self.truth)?;
        std::fs::read(path).map_err(|error| Fault::new(FaultKind::Unreadable, error.to_string()))
    }

    /// Where a file is.
    ///
    /// # Errors
    /// None of that name, or a name that leads out of the folder.
    pub fn path(&self, name: &str) -> Result<PathBuf, Fault> {
        match &self.place {
            Place::Folder(folder) => {
                let is_inside =
                    Path::new(name).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
                if !is_inside || name.is_empty() {
                    return Err(Fault::new(FaultKind::Senseless, "a name that leads out of the folder of the truth"));
                }
                let path = folder.join(name);
                if path.is_file() { Ok(path) } else { Err(missing(format!("no such file in {}", folder.display()))) }
            }
            Place::Unpacked(unpacked) => self.among(unpacked.files(), name),
            Place::Listed(files) => self.among(files, name),
        }
    }

    fn among(&self, files: &BTreeMap<String, PathBuf>, name: &str) -> Result<PathBuf, Fault> {
        let name = name.trim_start_matches("./");
        let found = files.get(&format!("{}{name}", self.prefix));
        found.cloned().ok_or_else(|| missing("no such file beside the truth".into()))
    }
}

/// The truth that is least deep, with what stands before it.
fn truth_among<'a>(names: impl Iterator<Item = &'a str>) -> Result<(String, String), Fault> {
    let split =
        |name: &'a str| name.rsplit_once('/').map_or(("", name), |(_, last)| (&name[..name.len() - last.len()], last));
    let truths = names.map(split).filter(|(_, last)| [TRUTH, LABELS].contains(last));
    let least = truths.min_by_key(|(prefix, last)| (prefix.matches('/').count(), *last == LABELS));
    let (prefix, truth) = least.ok_or_else(|| missing(format!("there is no {TRUTH} (or {LABELS}) in it")))?;
    Ok((prefix.into(), truth.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_inside() {
        let folder = tempfile::tempdir().expect("a folder");
        let inner = folder.path().join("set");
        std::fs::create_dir(&inner).expect("makes");
        for file in [inner.join(TRUTH), inner.join("a.jpg"), folder.path().join("secret.jpg")] {
            std::fs::write(file, b"{}").expect("writes");
        }
        let files = Files::open(&inner).expect("opens");
        assert!(files.path("a.jpg").is_ok() && files.path("./a.jpg").is_ok());
        let absolute = folder.path().join("secret.jpg").display().to_string();
        for name in ["../secret.jpg", absolute.as_str(), "", "a/../../secret.jpg"] {
            assert_eq!(files.path(name).expect_err(name).kind, FaultKind::Senseless, "{name}");
        }
        assert_eq!(files.path("b.jpg").expect_err("none").kind, FaultKind::NotFound);
        assert_eq!(Files::open(folder.path()).expect_err("no truth").kind, FaultKind::NotFound);
    }

    #[test]
    fn the_truth_of_an_archive_may_be_in_a_folder_of_it() {
        let names = ["set/inner/truth.json", "set/truth.json", "set/a.jpg", "set/labels.json"];
        assert_eq!(truth_among(names.into_iter()), Ok(("set/".into(), "truth.json".into())));
        assert_eq!(truth_among(["labels.json"].into_iter()), Ok((String::new(), "labels.json".into())));
        assert!(truth_among(["a.jpg", "mytruth.json"].into_iter()).is_err());
    }
}
