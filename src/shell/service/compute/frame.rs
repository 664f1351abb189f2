//! Frame to centroids and poses.

use std::time::Instant;

use serde_json::Value;

use super::Terms;
use crate::camera::Camera;
use crate::detect::{Detection, Detector, Stamp, Watch, detect};
use crate::frame::{Decoding, Frame, RawFormat, Region};
use crate::pipeline::{self, Estimate, Stage, TargetEstimate};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::lookup::Lookup;
use crate::shell::wire::frame::OrientationHandling;
use crate::shell::wire::sighting::{FrameInfo, TargetEstimateWire, Timing, centroids_of, refused_of};
use crate::shell::wire::{DetectionReply, EstimateReply, FrameRequest};
use crate::target::Target;

/// A frame request that makes sense.
#[derive(Debug)]
pub struct FrameTask {
    id: Option<Value>,
    camera: Option<Camera>,
    targets: Vec<Target>,
    detector: Detector,
    region: Option<Region>,
    max_instances: usize,
    pose: crate::pose::PoseOptions,
    timestamp_us: Option<i64>,
    sequence: Option<String>,
    frame_index: Option<u64>,
    apply_orientation: bool,
    raw: Option<(RawFormat, u32, u32)>,
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
            region: request.region_px.map(|[x, y, width, height]| Region { x, y, width, height }),
            max_instances,
            pose: request.solver.options(request.refine),
            timestamp_us: request.timestamp_us,
            sequence: request.sequence,
            frame_index: request.frame_index,
            apply_orientation: request.orientation == OrientationHandling::Apply,
            raw,
        })
    }

    /// As [`checked`](Self::checked), with what a pose needs.
    ///
    /// # Errors
    /// Also for a missing camera or target.
    pub async fn for_estimate(request: FrameRequest, lookup: &Lookup<'_>) -> Result<Self, Fault> {
        if request.camera.is_none() {
            return Err(Fault::senseless(
                "/camera",
                "an estimate needs a camera: an object, or the name of a stored one",
            ));
        }
        if request.targets.is_empty() {
            return Err(Fault::senseless("/targets", "an estimate needs at least one target"));
        }
        if request.sequence.is_some() {
            return Err(Fault::senseless(
                "/sequence",
                "an estimate looks at a single frame; detections follow a sequence",
            ));
        }
        Self::checked(request, lookup).await
    }

    /// The frame of these bytes.
    ///
    /// # Errors
    /// Bytes that are no frame, or not one of the camera.
    pub fn decode(&self, bytes: &[u8], terms: &Terms) -> Result<Frame, Fault> {
        let frame = if let Some((format, width, height)) = self.raw {
            Frame::from_raw(format, width, height, bytes, terms.limits)
        } else {
            let decoding = Decoding {
                wanted: self.detector.wanted(),
                apply_orientation: self.apply_orientation,
                limits: terms.limits,
            };
            Frame::decode(bytes, &decoding)
        };
        let frame = frame.map_err(|error| Fault::of_frame(&error))?;
        if let Some(camera) = &self.camera {
            frame.check_camera(camera).map_err(|error| Fault::of_frame(&error).at("/camera"))?;
        }
        Ok(frame)
    }

    /// The frame and its blobs, with the time that it took.
    ///
    /// # Errors
    /// As [`decode`](Self::decode); a region that is not on the frame.
    pub fn detected(&self, bytes: &[u8], terms: &Terms) -> Result<(Frame, Detection, Timing), Fault> {
        self.sighted(bytes, terms, |frame, region| detect(frame, region, &self.detector))
    }

    /// As [`detected`](Self::detected), for the next frame of a sequence. What knows no sequences takes it as a single frame.
    ///
    /// # Errors
    /// As [`detected`](Self::detected); the sequence then is as it was.
    pub fn followed(
        &self,
        bytes: &[u8],
        terms: &Terms,
        watch: &mut Watch,
    ) -> Result<(Frame, Detection, Timing), Fault> {
        let Detector::Sky(options) = &self.detector else { return self.detected(bytes, terms) };
        let stamp = Stamp { index: self.frame_index, timestamp_us: self.timestamp_us };
        self.sighted(bytes, terms, |frame, region| watch.observe(frame, region, stamp, options))
    }

    fn sighted(
        &self,
        bytes: &[u8],
        terms: &Terms,
        look: impl FnOnce(&Frame, Region) -> Detection,
    ) -> Result<(Frame, Detection, Timing), Fault> {
        let mut stopwatch = Stopwatch::start();
        let frame = self.decode(bytes, terms)?;
        let decode = stopwatch.lap("decode");
        let region = self.region.unwrap_or_else(|| frame.full()).checked(frame.width(), frame.height());
        let detection = look(&frame, region.map_err(|error| Fault::of_frame(&error))?);
        let detect = stopwatch.lap("detect");
        let timing = Timing { decode, detect, identify: None, solve: None, total: stopwatch.total() };
        Ok((frame, detection, timing))
    }

    /// The sequence that the frame belongs to.
    #[must_use]
    pub fn sequence(&self) -> Option<&str> {
        self.sequence.as_deref()
    }

    /// The blobs as a reply.
    #[must_use]
    pub fn detection_reply(&self, frame: &Frame, detection: &Detection, timing_us: Timing) -> DetectionReply {
        DetectionReply {
            id: self.id.clone(),
            frame: FrameInfo::of(frame, self.timestamp_us),
            sequence: None,
            centroids: centroids_of(detection),
            refused: refused_of(detection),
            timing_us,
        }
    }

    /// The frame and what it shows, with the time that it took.
    ///
    /// # Errors
    /// As [`detected`](Self::detected).
    pub fn estimated(&self, bytes: &[u8], terms: &Terms) -> Result<(Frame, Estimate, Timing), Fault> {
        let mut watch = Stopwatch::start();
        let frame = self.decode(bytes, terms)?;
        let mut timing = Timing { decode: watch.lap("decode"), ..Timing::default() };
        let Some(camera) = &self.camera else {
            return Err(Fault::new(FaultKind::Internal, "an estimate without a camera"));
        };
        let options = pipeline::Options {
            detector: self.detector.clone(),
            region: self.region,
            identify: terms.identify,
            max_instances: self.max_instances,
            pose: self.pose,
            model_sigma_px: terms.model_sigma_px,
        };
        let estimate = pipeline::estimate(&frame, camera, &self.targets, &options, |stage| match stage {
            Stage::Detect => timing.detect = watch.lap("detect"),
            Stage::Identify => timing.identify = Some(watch.lap("identify")),
            Stage::Solve => timing.solve = Some(watch.lap("solve")),
        })
        .map_err(|error| Fault::of_frame(&error))?;
        timing.total = watch.total();
        let posed = estimate.targets.iter().filter(|target| target.answer.is_ok()).count();
        let outcome = if posed > 0 { "posed" } else { "not_posed" };
        metrics::counter!("skypose_frames_total", "outcome" => outcome).increment(1);
        Ok((frame, estimate, timing))
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

    /// What was found as a reply.
    #[must_use]
    pub fn estimate_reply(&self, frame: &Frame, estimate: &Estimate, timing_us: Timing) -> EstimateReply {
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
            frame: FrameInfo::of(frame, self.timestamp_us),
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
