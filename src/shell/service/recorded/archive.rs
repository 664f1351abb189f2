//! Archives, read only. Their files are kept by number in a folder of our own, so that no name in them leads anywhere.

use std::collections::BTreeMap;
use std::fs::{DirBuilder, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::shell::fault::{Fault, FaultKind};

/// Most files in an archive.
const MOST_FILES: usize = 100_000;

/// Most bytes of all its files together: a packed bomb ends here, an hour of video does not.
pub(super) const MOST_BYTES: u64 = 16 << 30;

/// The files of an archive. They go when this does.
#[derive(Debug)]
pub(super) struct Unpacked {
    folder: PathBuf,
    files: BTreeMap<String, PathBuf>,
    bytes_left: u64,
}

impl Drop for Unpacked {
    fn drop(&mut self) {
        // What cannot be removed is in the system's folder for such things.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

fn unreadable(error: impl std::fmt::Display) -> Fault {
    Fault::new(FaultKind::Unreadable, format!("not an archive that can be read: {error}"))
}

fn internal(error: &io::Error) -> Fault {
    Fault::new(FaultKind::Internal, format!("the archive cannot be unpacked: {error}"))
}

/// The files of an archive, so many bytes of them; `None` if it is none.
pub(super) fn unpack(path: &Path, most_bytes: u64) -> Result<Option<Unpacked>, Fault> {
    let mut file = File::open(path).map_err(unreadable)?;
    let mut head = Vec::new();
    file.by_ref().take(512).read_to_end(&mut head).map_err(unreadable)?;
    file.seek(SeekFrom::Start(0)).map_err(unreadable)?;
    // An empty zip begins with its end.
    let is_zip = head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06");
    let is_tar = head.get(257..262) == Some(b"ustar");
    if !is_zip && !is_tar {
        return Ok(None);
    }
    let mut unpacked = Unpacked::new(most_bytes)?;
    if is_zip {
        unpacked.take_zip(file)?;
    } else {
        unpacked.take_tar(file)?;
    }
    Ok(Some(unpacked))
}

impl Unpacked {
    fn new(most_bytes: u64) -> Result<Self, Fault> {
        let folder = std::env::temp_dir().join(format!("skypose-{}", ulid::Ulid::generate()));
        let mut builder = DirBuilder::new();
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        builder.create(&folder).map_err(|error| internal(&error))?;
        Ok(Self { folder, files: BTreeMap::new(), bytes_left: most_bytes })
    }

    /// A folder with nothing in it yet.
    pub(super) fn empty() -> Result<Self, Fault> {
        Self::new(MOST_BYTES)
    }

    /// A file of this name will be there under this number.
    pub(super) fn name(&mut self, name: &str, number: usize) {
        self.files.insert(name.into(), self.place(number));
    }

    /// File number `number`, whole.
    pub(super) fn put(&mut self, number: usize, bytes: &[u8]) -> Result<PathBuf, Fault> {
        let path = self.place(number);
        std::fs::write(&path, bytes).map_err(|error| internal(&error))?;
        Ok(path)
    }

    fn place(&self, number: usize) -> PathBuf {
        self.folder.join(format!("{number:06}"))
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.files.keys().map(String::as_str)
    }

    pub(super) const fn files(&self) -> &BTreeMap<String, PathBuf> {
        &self.files
    }

    fn take_zip(&mut self, file: File) -> Result<(), Fault> {
        let mut archive = zip::ZipArchive::new(io::BufReader::new(file)).map_err(unreadable)?;
        for number in 0..archive.len() {
            let entry = archive.by_index(number).map_err(unreadable)?;
            if entry.is_file() {
                let name = entry.name().map_err(unreadable)?.into_owned();
                self.take(&name, entry)?;
            }
        }
        Ok(())
    }

    fn take_tar(&mut self, file: File) -> Result<(), Fault> {
        let mut archive = tar::Archive::new(io::BufReader::new(file));
        for entry in archive.entries().map_err(unreadable)? {
            let entry = entry.map_err(unreadable)?;
            // Links are not followed: they are no files.
            if entry.header().entry_type().is_file() {
                let name = String::from_utf8_lossy(&entry.path_bytes()).into_owned();
                self.take(&name, entry)?;
            }
        }
        Ok(())
    }

    fn take(&mut self, name: &str, content: impl Read) -> Result<(), Fault> {
        let too_large = |detail: String| Fault::new(FaultKind::TooLarge, detail);
        if self.files.len() >= MOST_FILES {
            return Err(too_large(format!("an archive of more than {MOST_FILES} files")));
        }
        let path = self.folder.join(format!("{:06}", self.files.len()));
        let mut file = File::create_new(&path).map_err(|error| internal(&error))?;
        // One byte more than there may be tells that there is more.
        let copied = io::copy(&mut content.take(self.bytes_left + 1), &mut file).map_err(unreadable)?;
        self.bytes_left = self.bytes_left.checked_sub(copied).ok_or_else(|| {
            too_large(format!("an archive whose files have more than {} GiB together", MOST_BYTES >> 30))
        })?;
        self.files.insert(name.trim_start_matches("./").to_owned(), path);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tar_of(files: &[(&str, &[u8])]) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().expect("a file");
        let mut builder = tar::Builder::new(file.as_file());
        for (name, content) in files {
            let mut header = tar::Header::new_ustar();
            header.set_size(content.len() as u64);
            // The name as it is, as nobody who means well would write it.
            header.as_mut_bytes()[..name.len()].copy_from_slice(name.as_bytes());
            header.set_cksum();
            builder.append(&header, *content).expect("appends");
        }
        builder.into_inner().expect("writes");
        file
    }

    #[test]
    fn names_lead_nowhere_and_nothing_is_left() {
        let file = tar_of(&[("truth.json", b"{}"), ("../../escaped", b"out"), ("/absolute", b"out")]);
        let unpacked = unpack(file.path(), MOST_BYTES).expect("reads").expect("an archive");
        assert_eq!(unpacked.names().collect::<Vec<_>>(), ["../../escaped", "/absolute", "truth.json"]);
        let folder = unpacked.folder.clone();
        assert!(unpacked.files().values().all(|path| path.parent() == Some(folder.as_path())));
        assert_eq!(std::fs::read(&unpacked.files()["truth.json"]).expect("reads"), b"{}");
        drop(unpacked);
        assert!(!folder.exists());
    }

    #[test]
    fn what_is_too_large_is_refused() {
        let mut unpacked = Unpacked::new(10).expect("a folder");
        assert_eq!(unpacked.take("a", &b"12345"[..]), Ok(()));
        assert_eq!(unpacked.take("b", &b"123456"[..]).expect_err("11 bytes").kind, FaultKind::TooLarge);
    }

    #[test]
    fn a_picture_is_no_archive_and_half_an_archive_is_told_of() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a");
        std::fs::write(&path, b"P6 1 1 255 abc").expect("writes");
        assert!(unpack(&path, MOST_BYTES).expect("reads").is_none());
        std::fs::write(&path, b"PK\x03\x04 and no more").expect("writes");
        assert_eq!(unpack(&path, MOST_BYTES).expect_err("half").kind, FaultKind::Unreadable);
    }
}
