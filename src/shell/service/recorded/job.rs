//! Recorded frames as a job: uploads in, one shard for each picture, or for an eighth of those of an archive.

use std::ops::Range;

use serde_json::{Value, json};

use super::archive::Unpacked;
use super::{Files, Unit, csv, finish, page, run_unit, units};
use crate::detect::Workspace;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::compute::Terms;
use crate::shell::service::jobs::{Attachment, Cancel, Input, JobFolder, Outcome, REPORT, Shard};
use crate::shell::wire::from_value;
use crate::shell::wire::recorded::{RecordedRequest, UnitOutcome};

/// Name of the attachment with a row for each frame.
pub const CASES: &str = "cases.csv";

/// An archive is unpacked for each of its shards, so they are few.
const ARCHIVE_SHARDS: usize = 8;

/// What computing them may cost.
#[derive(Clone, Copy, Debug)]
pub struct RecordedTerms {
    /// Of a frame.
    pub terms: Terms,
    /// Bytes of an archive when it is unpacked.
    pub max_unpacked_bytes: u64,
}

/// The uploads of a job, and its work.
struct Work {
    units: Vec<Unit>,
    is_archive: bool,
    /// Goes after the units, whose files it holds.
    files: Place,
}

enum Place {
    /// Uploads are fetched when they are looked at: the name of each file, and its place among the uploads.
    Uploads(Unpacked),
    Archive {
        _files: Files,
        _folder: Unpacked,
    },
}

impl Work {
    fn of(input: &Input, terms: &RecordedTerms) -> Result<Self, Fault> {
        let request: RecordedRequest = from_value(input.request.get("recorded").cloned().unwrap_or_default())?;
        let detector = request.detector.as_ref();
        let names: Vec<&str> = input.files.names().collect();
        let mut folder = Unpacked::empty()?;
        let is_archive = names.len() == 1;
        let files = if is_archive {
            let path = fetched(&input.files, 0, &mut folder)?;
            Files::open_within(&path, terms.max_unpacked_bytes)?
        } else {
            for (number, name) in names.iter().enumerate() {
                folder.name(name, number);
            }
            let files = Files::listed(folder.files().clone())?;
            let truth = names.iter().position(|name| *name == files.truth_name());
            fetched(&input.files, truth.unwrap_or_default(), &mut folder)?;
            files
        };
        let units = units(&files, detector)?;
        if let Some(video) = units.iter().find(|unit| unit.is_video()) {
            let detail = format!("{}: videos are evaluated by the command line; here pictures are", video.name());
            return Err(Fault::senseless("/videos", detail));
        }
        let files = if is_archive { Place::Archive { _files: files, _folder: folder } } else { Place::Uploads(folder) };
        Ok(Self { units, is_archive, files })
    }

    fn shards(&self) -> usize {
        if self.is_archive { self.units.len().min(ARCHIVE_SHARDS) } else { self.units.len() }
    }

    fn units_of(&self, shard: usize) -> Range<usize> {
        let start = |shard: usize| self.units.len() * shard / self.shards().max(1);
        start(shard)..start(shard + 1)
    }
}

/// Upload number `number` as a file.
fn fetched(uploads: &JobFolder, number: usize, folder: &mut Unpacked) -> Result<std::path::PathBuf, Fault> {
    let bytes = uploads.read(u32::try_from(number).unwrap_or(u32::MAX))?;
    folder.put(number, &bytes)
}

/// How many shards the job has.
///
/// # Errors
/// What is wrong with the truth.
pub fn shard_count(input: &Input, terms: &RecordedTerms) -> Result<u32, Fault> {
    let shards = Work::of(input, terms)?.shards();
    u32::try_from(shards).map_err(|error| Fault::new(FaultKind::TooLarge, error.to_string()))
}

/// Looks at the frames of one shard.
///
/// # Errors
/// If they are not there any more.
pub fn run_shard(input: &Input, number: u32, terms: &RecordedTerms, cancel: &Cancel) -> Result<Shard, Fault> {
    let mut work = Work::of(input, terms)?;
    let (mut outcomes, mut workspace) = (Vec::new(), Workspace::default());
    let range = work.units_of(number as usize);
    for unit in &work.units[range] {
        if let Place::Uploads(folder) = &mut work.files {
            let place = input.files.names().position(|name| name == unit.name());
            fetched(&input.files, place.unwrap_or_default(), folder)?;
        }
        outcomes.push(run_unit(unit, &terms.terms, &mut workspace, &mut || !cancel.is_cancelled()));
        if cancel.is_cancelled() {
            return Err(Fault::new(FaultKind::Internal, "cancelled"));
        }
    }
    let message = match &outcomes[..] {
        [only] => only.name.clone(),
        [first, .., last] => format!("{} to {}", first.name, last.name),
        [] => String::new(),
    };
    Ok(Shard { result: json!(outcomes), message })
}

/// The figures of all shards.
///
/// # Errors
/// If what was stored cannot be read.
pub fn finished(shards: Vec<Value>) -> Result<Outcome, Fault> {
    let mut outcomes: Vec<UnitOutcome> = Vec::new();
    for shard in shards {
        let part: Vec<UnitOutcome> = serde_json::from_value(shard)
            .map_err(|error| Fault::new(FaultKind::Internal, format!("a stored frame cannot be read: {error}")))?;
        outcomes.extend(part);
    }
    let table = csv(&outcomes);
    let finished = finish(outcomes);
    let attachments = vec![
        Attachment { name: REPORT, content: page("recorded frames", &finished)?.into_bytes() },
        Attachment { name: CASES, content: table.into_bytes() },
    ];
    Ok(Outcome { result: json!(finished.wire), attachments, ..Outcome::default() })
}
