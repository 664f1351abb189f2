//! The frames of a command with what is asked of each: the same of all, or what a file says of each.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::shell::cli::inputs::{bytes_of, frames_of};
use crate::shell::cli::requests::Requests;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::grab::Source;
use crate::shell::wire::{FrameRequest, from_value};

/// One frame and what is asked of it.
pub(super) struct Job {
    pub path: PathBuf,
    /// Not one frame but all that it shows.
    pub is_video: bool,
    /// Where the request stands, if in a file.
    pub line: Option<String>,
    pub id: Option<Value>,
    pub request: Result<FrameRequest, Fault>,
}

impl Job {
    /// A relative path counts from here, or else from the folder of the file.
    fn of(request: Result<Value, Fault>, folder: &Path, line: String) -> Self {
        let mut path = PathBuf::new();
        let id = request.as_ref().ok().and_then(|request| request.get("id").cloned());
        let request = request.and_then(|mut request| {
            let frame = request.as_object_mut().and_then(|object| object.remove("frame"));
            let Some(Value::String(frame)) = frame else {
                return Err(Fault::senseless("/frame", "a request in a file names its frame: \"frame\": \"path\""));
            };
            path = PathBuf::from(frame);
            if path.is_relative() && !path.exists() {
                path = folder.join(&path);
            }
            from_value(request)
        });
        Self { path, is_video: false, line: Some(line), id, request }
    }
}

/// All of them: those of `requests`, a file or `-`, or `request` of each of the inputs.
pub(super) fn jobs(inputs: &[PathBuf], requests: Option<&Path>, request: &FrameRequest) -> Result<Vec<Job>, Fault> {
    let Some(file) = requests else {
        let job = |path: PathBuf| {
            let is_video = Source::is_video(&path);
            Job { path, is_video, line: None, id: None, request: Ok(request.clone()) }
        };
        return Ok(frames_of(inputs)?.into_iter().map(job).collect());
    };
    let unusable = |error: std::io::Error| Fault::new(FaultKind::Unreadable, error.to_string());
    let is_input = file.as_os_str() == "-";
    let name = if is_input { "standard input".into() } else { file.display().to_string() };
    let text = if is_input {
        let mut text = Vec::new();
        std::io::Read::read_to_end(&mut std::io::stdin().lock(), &mut text).map_err(unusable)?;
        text
    } else {
        bytes_of(file)?
    };
    let folder = file.parent().unwrap_or(Path::new(""));
    let jobs = Requests::of(text.as_slice()).map(|read| {
        let (number, request) = read.map_err(unusable)?;
        Ok(Job::of(request, folder, format!("{name}:{number}")))
    });
    jobs.collect()
}
