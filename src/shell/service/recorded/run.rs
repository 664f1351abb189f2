//! One unit through the whole pipeline, judged.

use std::collections::BTreeMap;

use super::units::{Content, Unit};
use crate::detect::{Detection, Watch, Workspace};
use crate::evaluate::recorded::{Truth, judge};
use crate::pipeline::TargetEstimate;
use crate::shell::fault::Fault;
use crate::shell::grab::{Grabber, Options, Source};
use crate::shell::service::compute::{FrameTask, Seen, Terms};
use crate::shell::wire::recorded::{FailedWire, FrameOutcome, UnitOutcome};
use crate::shell::wire::sighting::Timing;

/// What a unit comes to. `go_on` is told of every frame with truth that is done and says whether to go on; where it does not, the
/// outcome is of no use. What cannot be looked at is part of the outcome.
pub fn run_unit(unit: &Unit, terms: &Terms, workspace: &mut Workspace, go_on: &mut dyn FnMut() -> bool) -> UnitOutcome {
    let mut outcome =
        UnitOutcome { name: unit.name.clone(), suite: unit.suite.clone(), frames: Vec::new(), failed: Vec::new() };
    match &unit.content {
        Content::Picture(truth) => {
            match looked_at_file(unit, terms, workspace) {
                Ok(looked) => outcome.frames.push(looked.judged(None, truth)),
                Err(fault) => outcome.failed.push(failed(unit, None, 1, &fault)),
            }
            go_on();
        }
        Content::Video(truths) => {
            if let Err(fault) = video(unit, truths, terms, workspace, &mut outcome, go_on) {
                let next = outcome.frames.last().and_then(|last| last.frame_index).map_or(0, |index| index + 1);
                let rest = truths.range(next..).count();
                let first = truths.range(next..).next().map(|(index, _)| *index);
                outcome.failed.push(failed(unit, first, rest, &fault));
            }
        }
    }
    outcome
}

fn failed(unit: &Unit, frame_index: Option<u64>, frames: usize, fault: &Fault) -> FailedWire {
    let frames = u32::try_from(frames).unwrap_or(u32::MAX);
    FailedWire { frame: unit.name.clone(), frame_index, frames, reason: fault.to_string() }
}

/// What was found in a frame.
struct Looked {
    detection: Detection,
    targets: Vec<TargetEstimate>,
    timing: Timing,
}

impl Looked {
    fn judged(self, frame_index: Option<u64>, truth: &Truth) -> FrameOutcome {
        FrameOutcome::of(frame_index, judge(truth, &self.detection, &self.targets), self.timing)
    }
}

fn looked_at_file(unit: &Unit, terms: &Terms, workspace: &mut Workspace) -> Result<Looked, Fault> {
    let bytes = std::fs::read(&unit.path)
        .map_err(|error| Fault::new(crate::shell::fault::FaultKind::Unreadable, error.to_string()))?;
    looked_at(&unit.task, Seen::Bytes(&bytes), terms, None, workspace)
}

/// A frame, which may be the next of a video.
fn looked_at(
    task: &FrameTask,
    seen: Seen<'_>,
    terms: &Terms,
    watch: Option<&mut Watch>,
    workspace: &mut Workspace,
) -> Result<Looked, Fault> {
    if task.targets().is_empty() {
        let (_, detection, timing) = task.seen(seen, terms, watch, workspace)?;
        return Ok(Looked { detection, targets: Vec::new(), timing });
    }
    let (_, estimate, timing) = task.estimated(seen, terms, watch, workspace)?;
    Ok(Looked { detection: estimate.detection, targets: estimate.targets, timing })
}

fn video(
    unit: &Unit,
    truths: &BTreeMap<u64, Truth>,
    terms: &Terms,
    workspace: &mut Workspace,
    outcome: &mut UnitOutcome,
    go_on: &mut dyn FnMut() -> bool,
) -> Result<(), Fault> {
    let options = Options { wanted: unit.task.wanted(), limits: terms.limits, ..Options::default() };
    let last = truths.last_key_value().map_or(0, |(index, _)| *index);
    let mut task = unit.task.clone();
    let mut watch = Watch::new();
    let mut next = 0;
    for grabbed in Grabber::open(&Source::File(unit.path.clone()), &options)? {
        let grabbed = grabbed?;
        task.set_place(grabbed.index, grabbed.timestamp_us);
        let seen = Seen::Frame { frame: grabbed.frame, decode_us: grabbed.decode_us };
        let looked = looked_at(&task, seen, terms, Some(&mut watch), workspace)?;
        next = grabbed.index + 1;
        if let Some(truth) = truths.get(&grabbed.index) {
            outcome.frames.push(looked.judged(Some(grabbed.index), truth));
            if !go_on() {
                return Ok(());
            }
        }
        if grabbed.index >= last {
            return Ok(());
        }
    }
    let detail = format!("the truth has frame {last}, but the video has {next} frames");
    Err(Fault::senseless("", detail))
}
