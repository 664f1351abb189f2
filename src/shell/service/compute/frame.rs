//! Frame to centroids and poses.

use std::borrow::Cow;
use std::time::Instant;

use serde_json::Value;

use super::Terms;
use crate::camera::Camera;
use crate::detect::color::learned;
use crate::detect::{Detection, Detector, HueRange, Stamp, Watch, Workspace, detect_with, looked_at};
use crate::frame::{Decoding, Frame, FrameError, RawFormat, Region, Wanted};
use crate::pipeline::{self, Estimate, Stage, TargetEstimate};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::lookup::Lookup;
use crate::shell::wire::frame::OrientationHandling;
use crate::shell::wire::sighting::{FrameInfo, SequenceWire, TargetEstimateWire, Timing, centroids_of, refused_of};
use crate::shell::wire::{DetectionReply, EstimateReply, FrameRequest};
use crate::target::Target;

/// A frame request that makes sense.
#[derive(Clone, Debug)]
pub struct FrameTask {
    id: Option<Value>,
    camera: Option<Camera>,
    targets: Vec<Target>,
    detector: Detector,
    /// Where the markers' hue is to be learned.
    sample: Option<Region>,
    region: Option<Region>,
    max_instances: usize,
    pose: crate::pose::PoseOptions,
    timestamp_us: Option<i64>,
    sequence: Option<String>,
    frame_index: Option<u64>,
    apply_orientation: bool,
    /// Whether somebody will look at the frame.
    is_shown: bool,
    raw: Option<(RawFormat, u32, u32)>,
}

/// A frame, still encoded or not.
pub enum Seen<'a> {
    /// Its bytes.
    Bytes(&'a [u8]),
    /// Itself, with the time that it took to decode.
    Frame {
        /// The frame.
        frame: Frame,
        /// Whole microseconds.
        decode_us: u64,
    },
}

/// Most targets looked for in one frame.
const MAX_TARGETS: usize = 16;

/// Longest name of a sequence, bytes.
const MAX_SEQUENCE_NAME: usize = 128;

/// Most of each target looked for in one frame.
const MAX_INSTANCES: usize = 16;

impl FrameTask {
    /// Checks everything that can be wrong with a request, the frame aside.
    ///
    /// # Errors
    /// Names the field.
    pub async fn checked(request: FrameRequest, lookup: &Lookup<'_>) -> Result<Self, Fault> {
        let camera = match &request.camera {
            Some(wanted) => Some(lookup.camera(wanted).await.map_err(|fault| fault.within("/camera"))?),
            None => None,
        };
        if request.targets.len() > MAX_TARGETS {
            let detail =
                format!("{} targets: at most {MAX_TARGETS} are looked for in one frame", request.targets.len());
            return Err(Fault::senseless("/targets", detail));
        }
        let mut targets = Vec::with_capacity(request.targets.len());
        for (index, wanted) in request.targets.iter().enumerate() {
            let target = lookup.target(wanted).await.map_err(|fault| fault.within(&format!("/targets/{index}")))?;
            targets.push(target);
        }
        let max_instances = request.max_instances;
        if !(1..=MAX_INSTANCES).contains(&max_instances) {
            let detail = format!("max_instances = {max_instances}: from 1 to {MAX_INSTANCES} is accepted");
            return Err(Fault::senseless("/max_instances", detail));
        }
        let raw = match (request.format, request.width, request.height) {
            (None, None, None) => None,
            (Some(format), Some(width), Some(height)) => Some((format.format(), width, height)),
            _ => return Err(Fault::senseless("/format", "a raw frame needs format, width and height, all three")),
        };
        let detector = Detector::try_from(&request.detector).map_err(|fault| fault.within("/detector"))?;
        if let Some(name) = &request.sequence {
            if !matches!(detector, Detector::Sky(_)) {
                let detail = "only the method edge, without the preset thesis, follows a sequence";
                return Err(Fault::senseless("/sequence", detail));
            }
            if !(1..=MAX_SEQUENCE_NAME).contains(&name.len()) {
                let detail = format!("a name of {} bytes: from 1 to {MAX_SEQUENCE_NAME} are accepted", name.len());
                return Err(Fault::senseless("/sequence", detail));
            }
        }
        Ok(Self {
            id: request.id,
            camera,
            targets,
            detector,
            sample: request.detector.sample_px.map(region_of),
            region: request.region_px.map(region_of),
            max_instances,
            pose: request.solver.options(request.refine),
            timestamp_us: request.timestamp_us,
            sequence: request.sequence,
            frame_index: request.frame_index,
            apply_orientation: request.orientation == OrientationHandling::Apply,
            is_shown: false,
            raw,
        })
    }

    /// As [`checked`](Self::checked), with what a pose needs.
    ///
    /// # Errors
    /// Also for a missing camera, or a missing target where only its markers could be found.
    pub async fn for_estimate(request: FrameRequest, lookup: &Lookup<'_>) -> Result<Self, Fault> {
        if request.camera.is_none() {
            return Err(Fault::senseless(
                "/camera",
                "an estimate needs a camera: an object, or the name of a stored one",
            ));
        }
        let task = Self::checked(request, lookup).await?;
        if task.targets.is_empty() && !task.is_sequential() {
            return Err(Fault::senseless(
                "/targets",
                "an estimate needs at least one target, except by the method edge",
            ));
        }
        Ok(task)
    }

    /// Whether the detector makes more of a frame that follows others.
    #[must_use]
    pub const fn is_sequential(&self) -> bool {
        matches!(self.detector, Detector::Sky(_))
    }

    /// The same for a frame of a sequence of this name.
    #[must_use]
    pub fn of_sequence(self, name: &str) -> Self {
        Self { sequence: Some(name.into()), ..self }
    }

    /// The same in this part of the frame alone.
    #[must_use]
    pub fn within(self, region: Region) -> Self {
        Self { region: Some(region), ..self }
    }

    /// The frame of these bytes.
    ///
    /// # Errors
    /// Bytes that are no frame, or not one of the camera.
    pub fn decode(&self, bytes: &[u8], terms: &Terms) -> Result<Frame, Fault> {
        let frame = if let Some((format, width, height)) = self.raw {
            self.looked_at(width, height)
                .and_then(|part| Frame::from_raw_within(format, width, height, bytes, part, terms.limits))
        } else {
            let decoding =
                Decoding { wanted: self.wanted(), apply_orientation: self.apply_orientation, limits: terms.limits };
            Frame::decode(bytes, &decoding)
        };
        let frame = frame.map_err(|error| Fault::of_frame(&error))?;
        self.check(&frame)?;
        Ok(frame)
    }

    /// Whether the frame comes raw: then only the part that is looked at is taken of it.
    #[must_use]
    pub const fn is_raw(&self) -> bool {
        self.raw.is_some()
    }

    /// What of a raw frame of this size is needed.
    fn looked_at(&self, width: u32, height: u32) -> Result<Region, FrameError> {
        let whole = Region { x: 0, y: 0, width, height };
        let Some(region) = self.region.filter(|_| !self.is_shown) else { return Ok(whole) };
        let part = looked_at(region.checked(width, height)?, width, height);
        // A sample that is not on the frame is told of where its hue is learned.
        let sample = self.sample.and_then(|sample| sample.checked(width, height).ok());
        Ok(sample.map_or(part, |sample| part.with(sample)))
    }

    /// The task of which the frames will be shown, and so are decoded in colour.
    #[must_use]
    pub fn shown(self) -> Self {
        Self { is_shown: true, ..self }
    }

    /// As the detector wants it, but in colour where people look at it or a hue is learned.
    /// What of its frames is needed.
    #[must_use]
    pub const fn wanted(&self) -> Wanted {
        match self.detector.wanted() {
            Wanted::Luma if self.is_shown || self.sample.is_some() => Wanted::Native,
            wanted => wanted,
        }
    }

    /// The hue of the frame's sample, if there is to be one.
    fn learned(&self, frame: &Frame) -> Result<Option<HueRange>, Fault> {
        let Some(sample) = self.sample else { return Ok(None) };
        let senseless = |detail: String| Fault::senseless("/detector/sample_px", detail);
        let sample = sample.checked(frame.width(), frame.height()).map_err(|error| senseless(error.to_string()))?;
        learned(frame, sample).map(Some).map_err(|error| senseless(error.to_string()))
    }

    /// The detector for this frame.
    fn detector_for(&self, frame: &Frame) -> Result<Cow<'_, Detector>, Fault> {
        let with_hue = self.learned(frame)?.and_then(|hue| self.detector.with_hue(hue));
        Ok(with_hue.map_or(Cow::Borrowed(&self.detector), Cow::Owned))
    }

    fn hue_range_deg(&self, frame: &Frame) -> Option<[f64; 2]> {
        Some(self.learned(frame).ok()??.ends_deg())
    }

    /// Whether the frame can be one of the camera.
    fn check(&self, frame: &Frame) -> Result<(), Fault> {
        match &self.camera {
            Some(camera) => frame.check_camera(camera).map_err(|error| Fault::of_frame(&error).at("/camera")),
            None => Ok(()),
        }
    }

    /// Which frame is the next, and when it was taken: of a video, all frames have one task.
    pub const fn set_place(&mut self, index: u64, timestamp_us: i64) {
        self.frame_index = Some(index);
        self.timestamp_us = Some(timestamp_us);
    }

    /// The blobs of a frame, decoded or not, with the time that it took. It may be the next of a sequence; what knows no sequences
    /// takes it as a single frame. Frames that come one after the other are looked at in one workspace.
    ///
    /// # Errors
    /// As [`decode`](Self::decode); a frame that is not one of the camera; a region that is not on the frame. The sequence then
    /// is as it was.
    pub fn seen(
        &self,
        seen: Seen<'_>,
        terms: &Terms,
        watch: Option<&mut Watch>,
        workspace: &mut Workspace,
    ) -> Result<(Frame, Detection, Timing), Fault> {
        let mut stopwatch = Stopwatch::start();
        let (frame, decode, before) = match seen {
            Seen::Bytes(bytes) => {
                let frame = self.decode(bytes, terms)?;
                (frame, stopwatch.lap("decode"), 0)
            }
            Seen::Frame { frame, decode_us } => {
                self.check(&frame)?;
                (frame, decode_us, decode_us)
            }
        };
        let region = self.region.unwrap_or_else(|| frame.full()).checked(frame.width(), frame.height());
        let region = region.map_err(|error| Fault::of_frame(&error))?;
        let detection = match (self.detector_for(&frame)?.as_ref(), watch) {
            (Detector::Sky(options), Some(watch)) => {
                let stamp = Stamp { index: self.frame_index, timestamp_us: self.timestamp_us };
                watch.observe(&frame, region, stamp, options)
            }
            (detector, _) => detect_with(workspace, &frame, region, detector),
        };
        let detect = stopwatch.lap("detect");
        let total = before + stopwatch.total();
        Ok((frame, detection, Timing { decode, detect, identify: None, solve: None, total }))
    }

    /// The sequence that the frame belongs to.
    #[must_use]
    pub fn sequence(&self) -> Option<&str> {
        self.sequence.as_deref()
    }

    fn place_in_sequence(&self, watch: Option<&Watch>) -> Option<SequenceWire> {
        Some(SequenceWire::of(self.sequence()?, watch?))
    }

    /// The blobs as a reply; of a frame of a sequence, after it was observed.
    #[must_use]
    pub fn detection_reply(
        &self,
        frame: &Frame,
        detection: &Detection,
        watch: Option<&Watch>,
        timing_us: Timing,
    ) -> DetectionReply {
        DetectionReply {
            id: self.id.clone(),
            frame: FrameInfo::of(frame, self.timestamp_us, self.region),
            hue_range_deg: self.hue_range_deg(frame),
            sequence: self.place_in_sequence(watch),
            centroids: centroids_of(detection),
            refused: refused_of(detection),
            timing_us,
        }
    }

    /// The frame and what it shows, with the time that it took; the frame as in [`seen`](Self::seen).
    ///
    /// # Errors
    /// As [`seen`](Self::seen).
    pub fn estimated(
        &self,
        seen: Seen<'_>,
        terms: &Terms,
        watch: Option<&mut Watch>,
        workspace: &mut Workspace,
    ) -> Result<(Frame, Estimate, Timing), Fault> {
        let Some(camera) = &self.camera else {
            return Err(Fault::new(FaultKind::Internal, "an estimate without a camera"));
        };
        let (frame, detection, mut timing) = self.seen(seen, terms, watch, workspace)?;
        let mut stopwatch = Stopwatch::start();
        let options = pipeline::Options {
            detector: self.detector.clone(),
            region: self.region,
            identify: terms.identify,
            max_instances: self.max_instances,
            pose: self.pose,
            model_sigma_px: terms.model_sigma_px,
        };
        let looked_at = Some((&frame, workspace));
        let estimate =
            pipeline::estimate_of(detection, looked_at, camera, &self.targets, &options, |stage| match stage {
                Stage::Detect => {}
                Stage::Identify => timing.identify = Some(stopwatch.lap("identify")),
                Stage::Solve => timing.solve = Some(stopwatch.lap("solve")),
            });
        timing.total += stopwatch.total();
        let posed = estimate.targets.iter().filter(|target| target.answer.is_ok()).count();
        let outcome = if posed > 0 { "posed" } else { "not_posed" };
        metrics::counter!("skypose_frames_total", "outcome" => outcome).increment(1);
        Ok((frame, estimate, timing))
    }

    /// Where to look; the whole frame if nothing.
    #[must_use]
    pub const fn region(&self) -> Option<Region> {
        self.region
    }

    /// The targets looked for.
    #[must_use]
    pub fn targets(&self) -> &[Target] {
        &self.targets
    }

    /// The camera, if one was given.
    #[must_use]
    pub const fn camera(&self) -> Option<&Camera> {
        self.camera.as_ref()
    }

    /// What was found as a reply; of a frame of a sequence, after it was observed.
    #[must_use]
    pub fn estimate_reply(
        &self,
        frame: &Frame,
        estimate: &Estimate,
        watch: Option<&Watch>,
        timing_us: Timing,
    ) -> EstimateReply {
        let mut centroids = centroids_of(&estimate.detection);
        let numbers = instances(&estimate.targets);
        for (found, number) in estimate.targets.iter().zip(&numbers) {
            let target = &self.targets[found.target];
            for (marker, centroid) in target.markers().iter().zip(&found.centroid_of_marker) {
                if let Some(centroid) = centroid.and_then(|index| centroids.get_mut(index)) {
                    centroid.marker = Some(marker.id.clone());
                    centroid.target = (self.targets.len() > 1).then(|| target.name().into());
                    centroid.instance = (self.max_instances > 1).then_some(*number);
                }
            }
        }
        EstimateReply {
            id: self.id.clone(),
            frame: FrameInfo::of(frame, self.timestamp_us, self.region),
            hue_range_deg: self.hue_range_deg(frame),
            sequence: self.place_in_sequence(watch),
            centroids,
            targets: estimate
                .targets
                .iter()
                .zip(numbers)
                .map(|(found, number)| {
                    let instance = (self.max_instances > 1).then_some(number);
                    TargetEstimateWire::of(&self.targets[found.target], found, instance)
                })
                .collect(),
            timing_us,
        }
    }
}

/// For each estimate the number of those of its target before it.
fn instances(estimates: &[TargetEstimate]) -> Vec<usize> {
    let before = |index: usize| estimates[..index].iter().filter(|e| e.target == estimates[index].target).count();
    (0..estimates.len()).map(before).collect()
}

const fn region_of([x, y, width, height]: [u32; 4]) -> Region {
    Region { x, y, width, height }
}

/// Times of stages, in whole microseconds for the reply and to the metrics.
struct Stopwatch {
    start: Instant,
    lap: Instant,
}

impl Stopwatch {
    fn start() -> Self {
        let now = Instant::now();
        Self { start: now, lap: now }
    }

    fn lap(&mut self, stage: &'static str) -> u64 {
        let now = Instant::now();
        let span = now - self.lap;
        self.lap = now;
        metrics::histogram!("skypose_stage_seconds", "stage" => stage).record(span.as_secs_f64());
        u64::try_from(span.as_micros()).unwrap_or(u64::MAX)
    }

    fn total(&self) -> u64 {
        u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX)
    }
}
