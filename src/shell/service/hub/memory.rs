//! What is remembered of a camera from frame to frame, and what a frame shows in its light.

use bytes::Bytes;

use super::settings::StreamTask;
use crate::detect::{Watch, Workspace};
use crate::frame::{Frame, Region};
use crate::pipeline::Estimate;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::compute::{FrameTask, Seen, Terms};
use crate::shell::service::tracks::{Followed, Tracks, told};
use crate::shell::wire::sighting::{TargetEstimateWire, Timing};
use crate::shell::wire::stream::SearchName;

/// What is remembered of a camera from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Memory {
    tracks: Tracks,
    /// Of a stream of which the detector follows what it finds.
    watch: Watch,
}

/// What a frame showed, JSON.
#[derive(Debug, Default)]
pub(super) struct Seeing {
    pub(super) estimate: String,
    pub(super) tracks: Option<String>,
    pub(super) timing: Timing,
    /// The same of the targets, for those who write it otherwise.
    pub(super) targets: Vec<TargetEstimateWire>,
    /// The tracks themselves; none after a frame that was not younger than the last.
    pub(super) followed: Vec<Followed>,
}

impl Memory {
    /// The frame taken at `taken_us`.
    pub(super) fn see(
        &mut self,
        frame: &Bytes,
        stream: &StreamTask,
        taken_us: i64,
        terms: &Terms,
        workspace: &mut Workspace,
    ) -> Result<Seeing, Fault> {
        let StreamTask { task, search, track, means } = stream;
        let part = match search {
            SearchName::Full => None,
            SearchName::Predicted => self.part(task, taken_us),
        };
        let (task, frame, estimate, timing) = self.estimated(frame, task, part, terms, workspace)?;
        let followed = self.tracks.step(taken_us, task.targets(), &estimate.targets, track)?;
        let tracks = followed.as_ref().map(|followed| told(taken_us, followed, means.as_ref()));
        let reply = task.estimate_reply(&frame, &estimate, Some(&self.watch), timing);
        let (estimate, tracks) = (written(&reply)?, tracks.as_ref().map(written).transpose()?);
        Ok(Seeing { estimate, tracks, timing, targets: reply.targets, followed: followed.unwrap_or_default() })
    }

    /// The part of the frame to be searched; nothing if all that may be has to be.
    fn part(&self, task: &FrameTask, taken_us: i64) -> Option<Region> {
        let part = self.tracks.region(taken_us, task.camera()?, task.targets())?;
        task.region().map_or(Some(part), |allowed| allowed.common(part))
    }

    /// First in the part where the tracks predict the targets. Where one of them is not found there, everywhere, so that nothing is lost.
    fn estimated(
        &mut self,
        bytes: &Bytes,
        task: &FrameTask,
        part: Option<Region>,
        terms: &Terms,
        workspace: &mut Workspace,
    ) -> Result<(FrameTask, Frame, Estimate, Timing), Fault> {
        let Some(part) = part else {
            let (frame, estimate, timing) =
                task.estimated(Seen::Bytes(bytes), terms, Some(&mut self.watch), workspace)?;
            return Ok((task.clone(), frame, estimate, timing));
        };
        let in_part = task.clone().within(part);
        let (frame, estimate, timing) = in_part.estimated(Seen::Bytes(bytes), terms, None, workspace)?;
        if self.tracks.are_found(task.targets(), &estimate.targets) {
            return Ok((in_part, frame, estimate, timing));
        }
        // Of a frame that comes raw, only the part was taken.
        let seen = if task.is_raw() { Seen::Bytes(bytes) } else { Seen::Frame { frame, decode_us: 0 } };
        let (frame, estimate, again) = task.estimated(seen, terms, None, workspace)?;
        Ok((task.clone(), frame, estimate, again.after(&timing)))
    }
}

fn written(value: &impl serde::Serialize) -> Result<String, Fault> {
    serde_json::to_string(value).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))
}
