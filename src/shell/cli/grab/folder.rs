//! The folder into which frames are grabbed.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::Format;
use crate::scene::encode;
use crate::shell::cli::inputs::{unreadable, unwritable};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::grab::{Grabbed, Source};

/// The list of frames with their times.
const LIST: &str = "frames.jsonl";

/// A line of the list.
#[derive(Serialize)]
struct Entry<'a> {
    source: String,
    frame_index: u64,
    /// Since the source's start.
    time_us: i64,
    /// Since the Unix epoch where that is known.
    timestamp_us: i64,
    file: &'a str,
}

/// Where frames go.
pub(super) struct Folder {
    path: PathBuf,
    /// Made with the first frame: what gives no frame leaves nothing behind.
    list: Option<File>,
    written: u64,
    size: [u32; 2],
}

impl Folder {
    /// A folder that is not there, is empty, or is to be written over.
    pub(super) fn at(path: &Path, overwrite: bool) -> Result<Self, Fault> {
        let is_empty = match std::fs::read_dir(path) {
            Ok(mut entries) => entries.next().is_none(),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => true,
            Err(error) => return Err(unreadable(path, &error)),
        };
        if !is_empty && !overwrite {
            let detail =
                format!("{}: not an empty folder; --overwrite replaces what has the same name", path.display());
            return Err(Fault::new(FaultKind::Conflict, detail));
        }
        Ok(Self { path: path.to_owned(), list: None, written: 0, size: [0; 2] })
    }

    /// Writes a frame, then its line: what the list names is whole.
    pub(super) fn write(
        &mut self,
        source: &Source,
        grabbed: &Grabbed,
        format: Format,
        quality: u8,
    ) -> Result<(), Fault> {
        let (encoded, ending) = match format {
            Format::Png => (encode::png(&grabbed.frame), "png"),
            Format::Jpg => (encode::jpeg(&grabbed.frame, quality), "jpg"),
        };
        let encoded = encoded.map_err(|error| Fault::new(FaultKind::Senseless, error.to_string()))?;
        let name = format!("frame-{:06}-{:010}us.{ending}", grabbed.index, grabbed.time_us);
        let entry = Entry {
            source: source.to_string(),
            frame_index: grabbed.index,
            time_us: grabbed.time_us,
            timestamp_us: grabbed.timestamp_us,
            file: &name,
        };
        let mut line = serde_json::to_vec(&entry).map_err(|e| Fault::new(FaultKind::Internal, e.to_string()))?;
        line.push(b'\n');
        let list_path = self.path.join(LIST);
        let list = match &mut self.list {
            Some(list) => list,
            none => {
                std::fs::create_dir_all(&self.path).map_err(|error| unwritable(&self.path, &error))?;
                none.insert(File::create(&list_path).map_err(|error| unwritable(&list_path, &error))?)
            }
        };
        let path = self.path.join(&name);
        if let Err(error) = std::fs::write(&path, encoded) {
            // Half a picture is none.
            let _ = std::fs::remove_file(&path);
            return Err(unwritable(&path, &error));
        }
        list.write_all(&line).map_err(|error| unwritable(&list_path, &error))?;
        self.written += 1;
        self.size = [grabbed.frame.width(), grabbed.frame.height()];
        Ok(())
    }

    /// What is in it now.
    pub(super) fn summary(&self) -> Option<String> {
        let (path, list) = (self.path.display(), self.path.join(LIST));
        let ([width, height], list) = (self.size, list.display());
        let frames = if self.written == 1 { "frame" } else { "frames" };
        (self.written > 0)
            .then(|| format!("{} {frames} of {width} x {height} px in {path}, their times in {list}", self.written))
    }
}
