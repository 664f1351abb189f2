//! Files that commands read.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use crate::board::Board;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::grab::Source;
use crate::shell::wire::{CameraWire, PatternOrText, Ref, from_json, read_camera};

/// Names that pictures end in.
const PICTURES: [&str; 11] = ["jpg", "jpeg", "png", "webp", "bmp", "tif", "tiff", "ppm", "pgm", "pbm", "pnm"];

/// The fault of a file that cannot be read.
pub(super) fn unreadable(path: &Path, error: &std::io::Error) -> Fault {
    let fault = unreadable_source(error);
    Fault { detail: format!("{}: {}", path.display(), fault.detail), ..fault }
}

/// The same where the reply names the file.
pub(super) fn unreadable_source(error: &std::io::Error) -> Fault {
    let kind = if error.kind() == std::io::ErrorKind::NotFound { FaultKind::NotFound } else { FaultKind::Unreadable };
    Fault::new(kind, error.to_string())
}

/// The fault of a file that cannot be written: of the place that was given, or of the machine.
pub(super) fn unwritable(path: &Path, error: &std::io::Error) -> Fault {
    use std::io::ErrorKind::{
        AlreadyExists, InvalidFilename, IsADirectory, NotADirectory, NotFound, PermissionDenied, ReadOnlyFilesystem,
    };
    let kind = match error.kind() {
        AlreadyExists | InvalidFilename | IsADirectory | NotADirectory | NotFound | PermissionDenied
        | ReadOnlyFilesystem => FaultKind::Unreadable,
        _ => FaultKind::Internal,
    };
    Fault::new(kind, format!("{}: cannot be written: {error}", path.display()))
}

/// The bytes of a file.
pub(super) fn bytes_of(path: &Path) -> Result<Vec<u8>, Fault> {
    std::fs::read(path).map_err(|error| unreadable(path, &error))
}

/// A JSON file.
pub(super) fn json_of<T: DeserializeOwned>(path: &Path) -> Result<T, Fault> {
    from_json(&bytes_of(path)?).map_err(|fault| Fault {
        detail: format!("{}: {fault}", path.display()),
        pointer: None,
        ..fault
    })
}

/// A file, or a name if there is a store and no such file.
pub(super) fn given<T: DeserializeOwned>(path: &Path, stored: bool) -> Result<Ref<T>, Fault> {
    if stored && !path.exists() {
        return Ok(Ref::Name(path.display().to_string()));
    }
    json_of(path).map(Ref::Object)
}

/// A camera in a file of any format.
pub(super) fn camera_of(path: &Path) -> Result<CameraWire, Fault> {
    read_camera(&bytes_of(path)?).map_err(|fault| Fault {
        detail: format!("{}: {fault}", path.display()),
        pointer: None,
        ..fault
    })
}

/// A camera's file, or a name if there is a store and no such file.
pub(super) fn given_camera(path: &Path, stored: bool) -> Result<Ref<CameraWire>, Fault> {
    if stored && !path.exists() {
        return Ok(Ref::Name(path.display().to_string()));
    }
    camera_of(path).map(Ref::Object)
}

/// A pattern and its board: the text form, or a JSON file.
pub(super) fn pattern_of(text: &str) -> Result<(PatternOrText, Board), Fault> {
    let path = Path::new(text);
    let is_file = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json")) || path.is_file();
    let pattern = if is_file { json_of(path)? } else { PatternOrText::Text(text.into()) };
    let board = Board::try_from(&pattern).map_err(|fault| Fault {
        detail: if is_file { format!("{text}: {fault}") } else { fault.to_string() },
        pointer: None,
        ..fault
    })?;
    Ok((pattern, board))
}

/// The frames and videos that paths name: a file is itself, a folder its pictures and videos in the order of their names,
/// numbers by value.
pub(super) fn frames_of(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Fault> {
    let mut frames = Vec::new();
    for path in paths {
        if !path.is_dir() {
            frames.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(path).map_err(|error| unreadable(path, &error))?;
        let mut found: Vec<PathBuf> =
            entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|p| is_picture(p) || is_video(p)).collect();
        if found.is_empty() {
            let detail = format!("{}: a folder without pictures ({}) or videos", path.display(), PICTURES.join(", "));
            return Err(Fault::new(FaultKind::NotFound, detail));
        }
        found.sort_by_key(|path| natural_key(path.file_name().unwrap_or_default()));
        frames.extend(found);
    }
    Ok(frames)
}

fn is_picture(path: &Path) -> bool {
    let ending = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_ascii_lowercase();
    path.is_file() && PICTURES.contains(&ending.as_str())
}

fn is_video(path: &Path) -> bool {
    path.is_file() && Source::is_video(path)
}

/// Text and numbers in turn, so that frame 10 comes after frame 9.
fn natural_key(name: &OsStr) -> Vec<(String, u128)> {
    let name = name.to_string_lossy();
    let mut key = Vec::new();
    let mut rest = name.as_ref();
    while !rest.is_empty() {
        let digits_at = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let (text, tail) = rest.split_at(digits_at);
        let digits_end = tail.find(|c: char| !c.is_ascii_digit()).unwrap_or(tail.len());
        let (digits, tail) = tail.split_at(digits_end);
        key.push((text.to_owned(), digits.parse().unwrap_or(0)));
        rest = tail;
    }
    key
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_in_the_order_in_which_they_were_counted() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["f10.png", "f9.jpg", "f1.PNG", "f11.mp4", "notes.txt"] {
            std::fs::write(folder.path().join(name), b"").expect("writes");
        }
        let frames = frames_of(&[folder.path().to_owned()]).expect("frames");
        let names: Vec<_> = frames.iter().filter_map(|p| p.file_name()?.to_str()).collect();
        assert_eq!(names, ["f1.PNG", "f9.jpg", "f10.png", "f11.mp4"]);
    }

    #[test]
    fn a_folder_without_pictures_says_so() {
        let folder = tempfile::tempdir().expect("a folder");
        assert_eq!(frames_of(&[folder.path().to_owned()]).expect_err("empty").kind, FaultKind::NotFound);
    }
}
