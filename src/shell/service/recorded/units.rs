//! The work cut into pieces, each checked before the first is begun.

use std::collections::BTreeMap;
use std::path::PathBuf;

use futures_util::FutureExt;

use super::files::{Files, LABELS};
use super::labels;
use crate::evaluate::recorded::Truth;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::compute::FrameTask;
use crate::shell::service::lookup::Lookup;
use crate::shell::wire::detector::Method;
use crate::shell::wire::recorded::{BoxWire, FrameTruthWire, Mode, Said, SidecarWire, VideoTruthWire};
use crate::shell::wire::{CameraWire, DetectorWire, FrameRequest, Ref, TargetWire, from_json};
use crate::target::Target;

/// The suite of frames that name none.
const NO_SUITE: &str = "frames";

/// A picture or a video with what is known of it.
#[derive(Clone, Debug)]
pub struct Unit {
    pub(super) name: String,
    pub(super) suite: String,
    pub(super) path: PathBuf,
    pub(super) task: FrameTask,
    pub(super) content: Content,
}

#[derive(Clone, Debug)]
pub(super) enum Content {
    Picture(Truth),
    /// By the number of the frame.
    Video(BTreeMap<u64, Truth>),
}

impl Unit {
    /// Name of its file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether it is a video.
    #[must_use]
    pub const fn is_video(&self) -> bool {
        matches!(self.content, Content::Video(_))
    }

    /// Frames with truth.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        match &self.content {
            Content::Picture(_) => 1,
            Content::Video(frames) => frames.len(),
        }
    }
}

/// The pieces of the work, in the order of the truth: pictures, then videos. `detector` is taken for all, whatever the truth names.
///
/// # Errors
/// No truth, or one that cannot be read or makes no sense, with the frame and the place.
pub fn units(files: &Files, detector: Option<&DetectorWire>) -> Result<Vec<Unit>, Fault> {
    let bytes = files.truth()?;
    let mut sidecar: SidecarWire =
        if files.truth_name() == LABELS { labels::read(&bytes)? } else { from_json(&bytes)? };
    if sidecar.frames.is_empty() && sidecar.videos.is_empty() {
        return Err(Fault::senseless("/frames", "a truth without frames and videos"));
    }
    if let Some(detector) = detector {
        let of_frames = sidecar.frames.iter_mut().map(|frame| &mut frame.detector);
        let of_videos = sidecar.videos.iter_mut().map(|video| &mut video.detector);
        of_frames.chain(of_videos).for_each(|own| *own = Some(detector.clone()));
    }
    let pictures = sidecar.frames.iter().enumerate().map(|(number, frame)| {
        let place = format!("/frames/{number}");
        picture(&sidecar, frame, files).map_err(|fault| placed(fault, &place, &frame.frame))
    });
    let videos = sidecar.videos.iter().enumerate().map(|(number, clip)| {
        let place = format!("/videos/{number}");
        video(&sidecar, clip, files).map_err(|fault| placed(fault, &place, &clip.video))
    });
    pictures.chain(videos).collect()
}

/// The fault with the frame and the place.
fn placed(fault: Fault, place: &str, name: &str) -> Fault {
    let pointer = format!("{place}{}", fault.pointer.unwrap_or_default());
    Fault { detail: format!("{name}: {}", fault.detail), pointer: Some(pointer), ..fault }
}

fn picture(sidecar: &SidecarWire, frame: &FrameTruthWire, files: &Files) -> Result<Unit, Fault> {
    let path = files.path(&frame.frame).map_err(|fault| fault.at("/frame"))?;
    let own = frame.said();
    if frame.targets.is_some() && (frame.target.is_some() || !own.is_nothing()) {
        return Err(Fault::senseless("/targets", "one target, or several in targets, not both"));
    }
    let said: Vec<(String, &Ref<TargetWire>, Said<'_>)> = match (&frame.targets, &frame.target) {
        (Some(targets), _) => targets
            .iter()
            .enumerate()
            .map(|(number, target)| (format!("/targets/{number}"), &target.target, target.said()))
            .collect(),
        (None, Some(target)) => vec![(String::new(), target, own)],
        (None, None) => Vec::new(),
    };
    check_target(said.is_empty(), &own)?;
    let detector = match (&frame.detector, frame.mode) {
        (Some(detector), _) => detector.clone(),
        (None, Some(Mode::Led)) => DetectorWire { method: Method::Beacon, ..DetectorWire::default() },
        (None, Some(Mode::Disc) | None) => DetectorWire::default(),
    };
    let asked = Asked {
        camera: frame.camera.as_ref(),
        targets: said.iter().map(|(place, target, _)| (format!("{place}/target"), *target)).collect(),
        request: FrameRequest {
            detector,
            region_px: frame.region_px,
            solver: frame.solver.unwrap_or_default(),
            ..FrameRequest::default()
        },
    };
    let task = asked.task(sidecar)?;
    let known = said
        .iter()
        .zip(task.targets())
        .map(|((place, _, said), target)| said.checked(target).map_err(|fault| fault.within(place)));
    let truth = Truth { targets: known.collect::<Result<_, _>>()?, boxes: boxes_of(frame.boxes.as_deref())? };
    if truth == Truth::default() {
        return Err(Fault::senseless(
            "",
            "nothing is known of it: give a target with its pose or its markers, or boxes",
        ));
    }
    let suite = frame.suite.clone().unwrap_or_else(|| NO_SUITE.into());
    Ok(Unit { name: frame.frame.clone(), suite, path, task, content: Content::Picture(truth) })
}

fn video(sidecar: &SidecarWire, clip: &VideoTruthWire, files: &Files) -> Result<Unit, Fault> {
    let path = files.path(&clip.video).map_err(|fault| fault.at("/video"))?;
    let asked = Asked {
        camera: clip.camera.as_ref(),
        targets: clip.target.iter().map(|target| ("/target".to_owned(), target)).collect(),
        request: FrameRequest {
            detector: clip.detector.clone().unwrap_or_default(),
            region_px: clip.region_px,
            solver: clip.solver.unwrap_or_default(),
            ..FrameRequest::default()
        },
    };
    let task = asked.task(sidecar)?;
    let target: Option<&Target> = task.targets().first();
    let mut frames = BTreeMap::new();
    for (number, frame) in clip.frames.iter().enumerate() {
        let truth = || {
            check_target(target.is_none(), &frame.said())?;
            let target = target.map(|target| frame.said().checked(target)).transpose()?;
            Ok(Truth { targets: target.into_iter().collect(), boxes: boxes_of(frame.boxes.as_deref())? })
        };
        let place = format!("/frames/{number}");
        let truth: Truth = truth().map_err(|fault: Fault| fault.within(&place))?;
        if truth == Truth::default() {
            return Err(Fault::senseless(place, "nothing is known of the frame: leave it out"));
        }
        if frames.insert(frame.frame_index, truth).is_some() {
            return Err(Fault::senseless(format!("{place}/frame_index"), "a frame that was named before"));
        }
    }
    if frames.is_empty() {
        return Err(Fault::senseless("/frames", "a video of which no frame is known"));
    }
    let suite = clip.suite.clone().unwrap_or_else(|| NO_SUITE.into());
    Ok(Unit { name: clip.video.clone(), suite, path, task, content: Content::Video(frames) })
}

fn check_target(has_none: bool, said: &Said<'_>) -> Result<(), Fault> {
    if has_none && !said.is_nothing() {
        return Err(Fault::senseless(
            "/target",
            "a pose or markers need their target: an object, or the name of one above",
        ));
    }
    Ok(())
}

fn boxes_of(boxes: Option<&[BoxWire]>) -> Result<Option<Vec<crate::evaluate::recorded::BoxTruth>>, Fault> {
    let Some(boxes) = boxes else { return Ok(None) };
    let one =
        |(number, wire): (usize, &BoxWire)| wire.checked().map_err(|fault| fault.within(&format!("/boxes/{number}")));
    boxes.iter().enumerate().map(one).collect::<Result<_, _>>().map(Some)
}

/// How a frame is to be looked at.
struct Asked<'a> {
    camera: Option<&'a Ref<CameraWire>>,
    /// With their places.
    targets: Vec<(String, &'a Ref<TargetWire>)>,
    request: FrameRequest,
}

impl Asked<'_> {
    fn task(self, sidecar: &SidecarWire) -> Result<FrameTask, Fault> {
        let camera = match self.camera {
            Some(Ref::Name(name)) => {
                Some(named(&sidecar.cameras, name, "cameras").map_err(|fault| fault.at("/camera"))?)
            }
            Some(Ref::Object(camera)) => Some(camera),
            None if self.targets.is_empty() => None,
            None => {
                let detail = "a pose needs the camera: an object, or the name of one of cameras";
                return Err(Fault::senseless("/camera", detail));
            }
        };
        let mut targets = Vec::with_capacity(self.targets.len());
        for (place, target) in &self.targets {
            let target = match target {
                Ref::Name(name) => named(&sidecar.targets, name, "targets").map_err(|fault| fault.at(place))?,
                Ref::Object(target) => target,
            };
            Target::try_from(target).map_err(|fault| fault.within(place))?;
            targets.push(Ref::Object(target.clone()));
        }
        let request = FrameRequest { camera: camera.cloned().map(Ref::Object), targets, ..self.request };
        // Without a store nothing is waited for.
        let lookup = Lookup::new(None, std::sync::Arc::default());
        let task = FrameTask::checked(request, &lookup).now_or_never();
        task.unwrap_or_else(|| Err(Fault::new(FaultKind::Internal, "a check that waits")))
    }
}

fn named<'a, T>(known: &'a BTreeMap<String, T>, name: &str, of: &str) -> Result<&'a T, Fault> {
    known.get(name).ok_or_else(|| Fault::senseless("", format!("{of} has no {name:?}")))
}
