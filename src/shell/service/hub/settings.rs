//! What is done with the frames of a stream.

use crate::encounter::Means;
use crate::shell::config::Settings;
use crate::shell::fault::Fault;
use crate::shell::service::compute::FrameTask;
use crate::shell::service::lookup::Lookup;
use crate::shell::wire::stream::SearchName;
use crate::shell::wire::swarm::FrameNote;
use crate::shell::wire::{FrameRequest, StreamWire};
use crate::track::TrackOptions;

/// What is done with a frame of a stream, and makes sense.
#[derive(Debug)]
pub(in crate::shell::service) struct StreamTask {
    pub(super) task: FrameTask,
    pub(super) search: SearchName,
    pub(super) track: TrackOptions,
    /// What our aircraft can do; nothing where our speed is not known.
    pub(super) means: Option<Means>,
}

impl StreamTask {
    /// With a frame of the camera that sends under this name.
    ///
    /// # Errors
    /// Names the field.
    pub(in crate::shell::service) async fn checked(
        name: &str,
        stream: StreamWire,
        note: &FrameNote,
        lookup: &Lookup<'_>,
        settings: &Settings,
    ) -> Result<Self, Fault> {
        let search = stream.search;
        let track = match &stream.track {
            Some(changes) => settings.track.with(changes).and_then(|track| track.options()),
            None => settings.track.options(),
        };
        let track = track.map_err(|fault| fault.within("/track"))?;
        let means = match &stream.encounter {
            Some(changes) => settings.encounter.with(changes).and_then(|options| options.means()),
            None => settings.encounter.means(),
        };
        let means = means.map_err(|fault| fault.within("/encounter"))?;
        let request = FrameRequest {
            timestamp_us: note.timestamp_us,
            frame_index: note.sequence,
            width: note.width,
            height: note.height,
            format: note.format,
            ..stream.into()
        };
        let mut task = FrameTask::for_estimate(request, lookup).await?;
        if task.is_sequential() {
            if search == SearchName::Predicted {
                let detail = "the method edge compares whole frames: only full is accepted";
                return Err(Fault::senseless("/search", detail));
            }
            task = task.of_sequence(name);
        }
        Ok(Self { task, search, track, means })
    }
}
