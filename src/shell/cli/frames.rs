//! `skypose detect` and `skypose estimate`.

mod job;

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use self::job::jobs;
use super::inputs::{given, given_camera, unreadable_source};
use super::moving::{self, MovingArgs};
use super::pictures::Pictures;
use super::{Failures, SettingsArgs, Stop, runtime};
use crate::annotate::Overlay;
use crate::detect::{Persistence, PersistenceOptions, Watch, Workspace};
use crate::shell::console::{Timeline, print_line, progress};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::grab::{Grabber, Options, Source, is_interrupted};
use crate::shell::service::compute::{FrameTask, Seen, Terms};
use crate::shell::service::lookup::Lookup;
use crate::shell::store::Store;
use crate::shell::wire::detector::{DetectorWire, GrayName, Method, Preset};
use crate::shell::wire::frame::OrientationHandling;
use crate::shell::wire::pose::SolverName;
use crate::shell::wire::{FrameRequest, Problem, TargetWire};

/// What both commands take.
#[derive(Args, Debug)]
struct Frames {
    /// Pictures (JPEG, PNG, WebP, BMP, TIFF, PNM), videos, folders of them, streams (rtsp://...) and webcams (/dev/video0).
    #[arg(value_name = "FRAME|VIDEO|FOLDER", required_unless_present = "requests")]
    inputs: Vec<PathBuf>,
    /// Read requests instead, JSON objects as in the API one after another, each with "frame": "path"; - is standard input.
    #[arg(long, value_name = "FILE", conflicts_with_all = [
        "inputs", "method", "preset", "color", "hue", "sample", "gray", "median", "threshold", "min_score", "min_area", "region",
    ])]
    requests: Option<PathBuf>,
    /// Take the frames as a sequence: each reply carries its number, and edge follows what it finds from frame to frame. Those of a
    /// video always are one.
    #[arg(long)]
    sequence: bool,
    /// Draw what was found: a picture (PNG, JPEG, BMP, TIFF, WebP or PNM) for a single frame, a folder for several.
    #[arg(long, value_name = "OUT")]
    annotate: Option<PathBuf>,
    /// Method of detection: color (markers), beacon (LEDs in the dark), or edge (what flies, without markers).
    #[arg(long, value_name = "METHOD", default_value = "color", value_parser = named::<Method>)]
    method: Method,
    /// Preset of the method: thesis is that of the 2012 thesis, step for step.
    #[arg(long, value_name = "PRESET", value_parser = named::<Preset>)]
    preset: Option<Preset>,
    /// The markers' colour: red, orange, yellow, green, cyan, blue or magenta.
    #[arg(long)]
    color: Option<String>,
    /// The markers' hues instead, in degrees of the colour circle: from,to, as in 340,20.
    #[arg(long, value_name = "FROM,TO", value_parser = hues, conflicts_with = "color", allow_hyphen_values = true)]
    hue: Option<[f64; 2]>,
    /// Learn the markers' hue from this place in each frame, as from a click: x,y,width,height in pixels. The reply has the hues for --hue.
    #[arg(long, value_name = "X,Y,W,H", value_parser = region, conflicts_with_all = ["color", "hue"])]
    sample: Option<[u32; 4]>,
    /// edge, preset thesis: how colour becomes gray: luminosity, average or lightness.
    #[arg(long, value_name = "WAY", value_parser = named::<GrayName>)]
    gray: Option<GrayName>,
    /// edge, preset thesis: the median's window, as in 9,10.
    #[arg(long, value_name = "ROWS,COLUMNS", value_parser = window)]
    median: Option<[usize; 2]>,
    /// edge, preset thesis: gradient above which a pixel is an edge, as a share of full scale.
    #[arg(long, value_name = "RATIO")]
    threshold: Option<f64>,
    /// edge: least probability of what is reported, 0 to 1.
    #[arg(long, value_name = "PROBABILITY")]
    min_score: Option<f64>,
    /// Smallest area in pixels.
    #[arg(long, value_name = "AREA")]
    min_area: Option<f64>,
    /// Look only here: x,y,width,height in pixels.
    #[arg(long, value_name = "X,Y,W,H", value_parser = region, allow_hyphen_values = true)]
    region: Option<[u32; 4]>,
    /// What to do with an orientation that a file states (EXIF): ignore or apply.
    #[arg(long, default_value = "ignore", value_parser = named::<OrientationHandling>)]
    orientation: OrientationHandling,
    #[command(flatten)]
    moving: MovingArgs,
    #[command(flatten)]
    settings: SettingsArgs,
}

#[derive(Args, Debug)]
pub(super) struct Detect {
    #[command(flatten)]
    frames: Frames,
    /// With --sequence, or of a video: keep only what was seen in so many frames in a row, nearly where it was.
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(1..=1000))]
    persistent: Option<u32>,
}

#[derive(Args, Debug)]
pub(super) struct Estimate {
    #[command(flatten)]
    frames: Frames,
    /// The camera: a file (JSON, ROS' YAML, OpenCV's YAML or XML), or with --data the name of a stored one.
    #[arg(long, value_name = "FILE", required_unless_present = "requests", conflicts_with = "requests")]
    camera: Option<PathBuf>,
    /// A target to look for: a JSON file, or with --data the name of a stored one. May be given several times; edge needs none.
    #[arg(long, value_name = "FILE", conflicts_with = "requests")]
    target: Vec<PathBuf>,
    /// Most of each target to look for; further ones are further entries of the reply.
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "requests")]
    max_instances: usize,
    /// Method for the pose: auto, homography, epnp, posit, ippe, p3p or sqpnp.
    #[arg(long, default_value = "auto", value_parser = named::<SolverName>, conflicts_with = "requests")]
    solver: SolverName,
    /// Leave the pose as the method gives it, without refinement.
    #[arg(long, conflicts_with = "requests")]
    no_refine: bool,
}

impl Detect {
    pub(super) fn run(self) -> Result<(), Stop> {
        let request = self.frames.request();
        let options = |least_frames| PersistenceOptions { least_frames, ..PersistenceOptions::default() };
        let persistence = self.persistent.map(options);
        run(&self.frames, &request, Kind::Detection, persistence)
    }
}

impl Estimate {
    pub(super) fn run(self) -> Result<(), Stop> {
        let stored = self.frames.settings.data.is_some();
        let camera = self.camera.as_deref().map(|path| given_camera(path, stored)).transpose()?;
        let targets: Result<Vec<_>, Fault> = self.target.iter().map(|path| given::<TargetWire>(path, stored)).collect();
        let request = FrameRequest {
            camera,
            targets: targets?,
            max_instances: self.max_instances,
            solver: self.solver,
            refine: !self.no_refine,
            ..self.frames.request()
        };
        run(&self.frames, &request, Kind::Estimate, None)
    }
}

/// A word of the API.
pub(super) fn named<T: serde::de::DeserializeOwned>(word: &str) -> Result<T, String> {
    serde_json::from_value(Value::String(word.into())).map_err(|error| error.to_string())
}

/// x,y,width,height.
pub(super) fn region(text: &str) -> Result<[u32; 4], String> {
    numbers(text).ok_or_else(|| "four whole numbers are expected: x,y,width,height".into())
}

/// from,to.
fn hues(text: &str) -> Result<[f64; 2], String> {
    numbers(text).ok_or_else(|| "two numbers are expected: from,to in degrees".into())
}

/// rows,columns.
fn window(text: &str) -> Result<[usize; 2], String> {
    numbers(text).ok_or_else(|| "two whole numbers are expected: rows,columns".into())
}

fn numbers<T: std::str::FromStr, const N: usize>(text: &str) -> Option<[T; N]> {
    let numbers: Result<Vec<T>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    numbers.ok()?.try_into().ok()
}

impl Frames {
    fn request(&self) -> FrameRequest {
        FrameRequest {
            detector: DetectorWire {
                method: self.method,
                preset: self.preset,
                color: self.color.clone(),
                hue_range_deg: self.hue,
                sample_px: self.sample,
                gray: self.gray,
                median_px: self.median,
                threshold: self.threshold,
                min_area_px: self.min_area,
                min_score: self.min_score,
                ..DetectorWire::default()
            },
            region_px: self.region,
            orientation: self.orientation,
            ..FrameRequest::default()
        }
    }
}

#[derive(Clone, Copy)]
enum Kind {
    Detection,
    Estimate,
}

/// What a reply is about.
#[derive(Clone, Copy)]
struct Asked<'a> {
    /// The frame's file, empty where a request names none, or the video.
    source: &'a str,
    /// Where the request stands, if in a file.
    line: Option<&'a str>,
}

impl<'a> Asked<'a> {
    const fn of(source: &'a str) -> Self {
        Self { source, line: None }
    }

    /// For people.
    fn place(self) -> String {
        match self.line {
            None => self.source.into(),
            Some(line) if self.source.is_empty() => line.into(),
            Some(line) => format!("{line}: {}", self.source),
        }
    }
}

/// A reply with the file that it is about.
#[derive(Serialize)]
struct Line<'a, T> {
    source: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    frame_index: Option<u64>,
    /// Of a video: since its start.
    #[serde(skip_serializing_if = "Option::is_none")]
    time_us: Option<i64>,
    #[serde(flatten)]
    reply: T,
}

#[derive(Serialize)]
struct Failed {
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<Value>,
    error: Problem,
}

fn run(
    frames: &Frames,
    request: &FrameRequest,
    kind: Kind,
    persistence: Option<PersistenceOptions>,
) -> Result<(), Stop> {
    let settings = frames.settings.load(Vec::new())?;
    let runtime = runtime()?;
    let store = match &frames.settings.data {
        Some(folder) => Some(runtime.block_on(Store::open(folder)).map_err(Fault::from)?),
        None => None,
    };
    let lookup = Lookup::new(store.as_ref(), std::sync::Arc::default());
    let jobs = jobs(&frames.inputs, frames.requests.as_deref(), request)?;
    let sources: Vec<&Path> = jobs.iter().map(|job| job.path.as_path()).collect();
    let has_videos = jobs.iter().any(|job| job.is_video);
    if persistence.is_some() && !frames.sequence && !has_videos {
        let detail = "--persistent is for frames that follow each other: --sequence, or a video";
        return Err(Fault::new(FaultKind::Senseless, detail.to_owned()).into());
    }
    let mut looking = Looking {
        kind,
        terms: Terms::of(&settings),
        memory: Memory::new(frames.sequence, persistence),
        workspace: Workspace::default(),
        pictures: Pictures::new(frames.annotate.as_deref(), &sources, jobs.len() == 1 && !has_videos)?,
        failures: Failures::default(),
    };
    let apply_orientation = frames.orientation == OrientationHandling::Apply;
    let grabbing = frames.moving.options(apply_orientation, looking.terms.limits);
    // Each video has a bar of its own.
    let bar = progress(if has_videos { 0 } else { jobs.len() }, "frames");
    for (index, job) in jobs.into_iter().enumerate() {
        let task = job.request.and_then(|mut request| {
            if frames.sequence {
                request.frame_index = request.frame_index.or(Some(index as u64));
            }
            runtime.block_on(async {
                match kind {
                    Kind::Detection => FrameTask::checked(request, &lookup).await,
                    Kind::Estimate => FrameTask::for_estimate(request, &lookup).await,
                }
            })
        });
        if let (true, Ok(task)) = (job.is_video, &task) {
            // What lasted in one video tells nothing of the next.
            looking.memory = Memory::new(true, persistence);
            let source = Source::of(&job.path);
            let task = if frames.annotate.is_some() { task.clone().shown() } else { task.clone() };
            let grabbing = Options { wanted: task.wanted(), ..grabbing.clone() };
            looking.at_video(&source, in_sequence(task, &source.to_string()), &grabbing)?;
        } else {
            let source = Asked { source: &job.path.display().to_string(), line: job.line.as_deref() };
            let answer = task.and_then(|task| {
                let bytes = std::fs::read(&job.path).map_err(|error| unreadable_source(&error))?;
                let task = if frames.annotate.is_some() { task.shown() } else { task };
                let task = if frames.sequence { in_sequence(task, SEQUENCE) } else { task };
                looking.answer(Seen::Bytes(&bytes), &task, &job.path)
            });
            bar.suspend(|| looking.tell(source, (frames.sequence.then_some(index as u64), None), job.id, answer))?;
            bar.inc(1);
        }
        if is_interrupted() {
            return Err(Stop::Interrupted);
        }
    }
    bar.finish_and_clear();
    looking.failures.into_result()
}

/// Name of the sequence that single frames make.
const SEQUENCE: &str = "frames";

/// Of a sequence, so that the reply says where one begins, if the method follows any and the request names none.
fn in_sequence(task: FrameTask, name: &str) -> FrameTask {
    if task.is_sequential() && task.sequence().is_none() { task.of_sequence(name) } else { task }
}

/// What is known of the frames before.
struct Memory {
    watch: Option<Watch>,
    persistence: Option<Persistence>,
}

impl Memory {
    fn new(is_sequence: bool, persistence: Option<PersistenceOptions>) -> Self {
        Self { watch: is_sequence.then(Watch::new), persistence: persistence.map(Persistence::new) }
    }
}

/// What goes with us from frame to frame.
struct Looking {
    kind: Kind,
    terms: Terms,
    memory: Memory,
    workspace: Workspace,
    pictures: Pictures,
    failures: Failures,
}

impl Looking {
    /// All frames of a video, one line each.
    fn at_video(&mut self, source: &Source, mut task: FrameTask, options: &Options) -> Result<(), Stop> {
        let name = source.to_string();
        let mut grabber = match Grabber::open(source, options) {
            Ok(grabber) => grabber,
            Err(error) => return self.tell(Asked::of(&name), (None, None), None, Err(error.into())),
        };
        let mut timeline = Timeline::new(grabber.duration_us());
        for grabbed in &mut grabber {
            let grabbed = match grabbed {
                Ok(grabbed) => grabbed,
                Err(error) => {
                    timeline.suspend(|| self.tell(Asked::of(&name), (None, None), None, Err(error.into())))?;
                    break;
                }
            };
            let place = (Some(grabbed.index), Some(grabbed.time_us));
            timeline.step(grabbed.time_us);
            task.set_place(grabbed.index, grabbed.timestamp_us);
            let seen = Seen::Frame { frame: grabbed.frame, decode_us: grabbed.decode_us };
            let answer = self.answer(seen, &task, &moving::frame_name(source, grabbed.index));
            // What is wrong with one frame of a video (its size, the region) is wrong with all.
            let is_over = answer.is_err();
            timeline.suspend(|| self.tell(Asked::of(&name), place, None, answer))?;
            if is_over {
                break;
            }
        }
        drop(timeline);
        moving::tell_oddities(source, &grabber);
        Ok(())
    }

    fn answer(&mut self, seen: Seen<'_>, task: &FrameTask, path: &Path) -> Result<Value, Fault> {
        let internal = |error: serde_json::Error| Fault::new(FaultKind::Internal, error.to_string());
        let (watch, workspace) = (&mut self.memory.watch, &mut self.workspace);
        match self.kind {
            Kind::Detection => {
                let (frame, mut detection, timing) = task.seen(seen, &self.terms, watch.as_mut(), workspace)?;
                if let Some(persistence) = &mut self.memory.persistence {
                    persistence.sift(&mut detection);
                }
                self.pictures.write(path, &frame, task, &Overlay::of(&detection, &[], &[]))?;
                let reply = task.detection_reply(&frame, &detection, watch.as_ref(), timing);
                serde_json::to_value(reply).map_err(internal)
            }
            Kind::Estimate => {
                let (frame, estimate, timing) = task.estimated(seen, &self.terms, watch.as_mut(), workspace)?;
                let overlay = Overlay::of(&estimate.detection, task.targets(), &estimate.targets);
                self.pictures.write(path, &frame, task, &overlay)?;
                serde_json::to_value(task.estimate_reply(&frame, &estimate, watch.as_ref(), timing)).map_err(internal)
            }
        }
    }

    /// The line of an answer, or of a fault, which is complained of too.
    fn tell(
        &mut self,
        asked: Asked<'_>,
        (frame_index, time_us): (Option<u64>, Option<i64>),
        id: Option<Value>,
        answer: Result<Value, Fault>,
    ) -> Result<(), Stop> {
        let source = asked.source;
        let line = match answer {
            Ok(reply) => to_line(Line { source, frame_index, time_us, reply })?,
            Err(fault) => {
                self.failures.add(&asked.place(), &fault);
                to_line(Line { source, frame_index, time_us, reply: Failed { id, error: (&fault).into() } })?
            }
        };
        Ok(print_line(&line)?)
    }
}

fn to_line<T: Serialize>(line: T) -> Result<String, Fault> {
    serde_json::to_string(&line).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))
}
