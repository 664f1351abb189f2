//! One encounter, frame by frame, as the own aircraft's camera, solver and tracker have it.

use std::time::Duration;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::alarm::Alert;
use super::study::{EncounterStudy, MAX_FRAMES, Sensing};
use crate::camera::Pixel;
use crate::detect::{Detection, Detector};
use crate::frame::Frame;
use crate::geometry::{BodyFromCamera, CameraFromTarget, Point, space};
use crate::pipeline::{Estimate, Options, estimate, estimate_of};
use crate::random::case;
use crate::scene::encounters::course::camera_turned;
use crate::scene::encounters::{Encounter, Sight};
use crate::scene::render::{Model, Optics, Sky, render};
use crate::target::Target;
use crate::track::{Report, Tracker};

/// An encounter on its way. An iterator over what its frames show, up to the closest approach if nobody turns.
#[derive(Debug)]
pub struct Lookout<'a> {
    study: &'a EncounterStudy,
    encounter: Encounter,
    camera: BodyFromCamera,
    model: Model,
    targets: [Target; 1],
    options: Options,
    eye: Eye,
    tracker: Tracker,
    noise: ChaCha8Rng,
    start_s: f64,
    next: u32,
    alert: Option<Alert>,
}

/// From what blobs come.
#[derive(Debug)]
enum Eye {
    Simulated(Sight),
    Rendered { sky: Sky, optics: Optics },
}

/// What one frame shows.
#[derive(Clone, Debug)]
pub struct Look {
    /// When it was taken, s; negative before the closest approach.
    pub time_s: f64,
    /// Where the target is.
    pub truth: CameraFromTarget,
    /// Whether its middle is in the picture.
    pub is_in_view: bool,
    /// The picture, if it was rendered.
    pub frame: Option<Frame>,
    /// What was made of it.
    pub estimate: Estimate,
    /// What that made of the tracks.
    pub report: Report,
    /// The alarm, once it is given: in its frame and all later ones.
    pub alert: Option<Alert>,
}

/// The largest marker has at least this area when frames begin, px: half of what the detectors need.
const FIRST_AREA_PX: f64 = 1.5;

/// LEDs are seen as long as they can be told apart: frames begin when the constellation is so long, px.
const FIRST_LENGTH_PX: f64 = 12.0;

impl<'a> Lookout<'a> {
    /// Encounter number `index` of a study. `None` where none can be drawn, or an option of the tracker makes no sense.
    #[must_use]
    pub fn of(study: &'a EncounterStudy, index: u64) -> Option<Self> {
        let mut drawing = case(&format!("encounters {}", study.seed), index);
        let encounter = study.traffic.draw(&mut drawing)?;
        let light = study.light();
        let eye = match study.sensing {
            Sensing::Centroids(disturbance) => Eye::Simulated(Sight::of(&study.detector, disturbance)?),
            Sensing::Frames => Eye::Rendered {
                sky: light.sky(drawing.random_range(0..u64::MAX), &study.camera, study.camera_elevation_rad),
                optics: light.optics(),
            },
        };
        // Frames come whenever they come: the last one a part of a step before the closest approach.
        let phase = drawing.random_range(0.0..1.0);
        let from_s = encounter.within_from_s(first_range_m(study));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the number of frames")]
        let frames = (-from_s * study.rate_hz).clamp(0.0, f64::from(MAX_FRAMES - 1)) as u32;
        let options = Options { detector: study.detector.clone(), pose: study.pose, ..Options::default() };
        Some(Self {
            study,
            encounter,
            camera: camera_turned(study.camera_azimuth_rad, study.camera_elevation_rad),
            model: light.on(study.intruder.clone()),
            targets: [study.intruder.target.clone()],
            options,
            eye,
            tracker: Tracker::new(study.track).ok()?,
            noise: case(&format!("encounters {} noise", study.seed), index),
            start_s: -(f64::from(frames) + phase) / study.rate_hz,
            next: 0,
            alert: None,
        })
    }

    /// The encounter.
    #[must_use]
    pub const fn encounter(&self) -> &Encounter {
        &self.encounter
    }

    /// Frames up to the closest approach.
    #[must_use]
    pub fn frame_count(&self) -> u32 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited when it was made")]
        let frames = (-self.start_s * self.study.rate_hz).floor() as u32;
        frames + 1
    }

    fn look(&mut self, time_s: f64) -> Option<Look> {
        let camera = &self.study.camera;
        let truth = self.encounter.camera_from_target(time_s, &self.camera, self.study.mount);
        let middle = Point::<space::Camera>::from(truth.translation);
        let is_in_view = camera.project(&middle).is_some_and(|pixel| camera.contains(&pixel));
        let (frame, estimate) = match &self.eye {
            Eye::Simulated(sight) => {
                let detection = sight.detect(camera, &truth, &self.model, &mut self.noise);
                (None, estimate_of(detection, None, camera, &self.targets, &self.options, |_| ()))
            }
            Eye::Rendered { sky, optics } => {
                let frame = render(camera, &truth, &self.model, sky, optics, &mut self.noise);
                let estimate = estimate(&frame, camera, &self.targets, &self.options, |_| ()).ok()?;
                (Some(frame), estimate)
            }
        };
        let answers = estimate.targets.iter().filter_map(|target| target.answer.as_ref().ok());
        let stamp = Duration::try_from_secs_f64(time_s - self.start_s).ok()?;
        let report = self.tracker.step(stamp, answers).ok()?;
        if self.alert.is_none() {
            let (alarm, manoeuvre) = (&self.study.alarm, &self.study.manoeuvre);
            let own_speed_mps = self.encounter.own_speed_mps;
            let mount = &self.camera;
            self.alert = report.believed().find_map(|track| alarm.of(track, time_s, mount, own_speed_mps, manoeuvre));
        }
        Some(Look { time_s, truth, is_in_view, frame, estimate, report, alert: self.alert })
    }
}

impl Iterator for Lookout<'_> {
    type Item = Look;

    fn next(&mut self) -> Option<Look> {
        let time_s = self.start_s + f64::from(self.next) / self.study.rate_hz;
        if time_s > 0.0 {
            return None;
        }
        self.next += 1;
        self.look(time_s)
    }
}

/// From this range on nothing can be found yet, m.
fn first_range_m(study: &EncounterStudy) -> f64 {
    let [fx, fy] = study.camera.focal_lengths();
    let focal_px = fx.max(fy);
    let markers = study.intruder.target.markers();
    if matches!(study.detector, Detector::Beacon(_)) {
        let length_m = markers
            .iter()
            .flat_map(|a| markers.iter().map(move |b| (a.position.coords - b.position.coords).norm()))
            .fold(0.0, f64::max);
        return length_m * focal_px / FIRST_LENGTH_PX;
    }
    let radius_m =
        markers.iter().map(|marker| marker.radius_m.unwrap_or(study.intruder.default_radius_m)).fold(0.0, f64::max);
    // A lens that bends makes the border at most so much larger.
    1.2 * radius_m * focal_px / (FIRST_AREA_PX / std::f64::consts::PI).sqrt()
}

/// Whether one of the blobs is an image of a marker of the target.
pub(super) fn is_seen(study: &EncounterStudy, look: &Look) -> bool {
    let Detection { centroids, .. } = &look.estimate.detection;
    let markers = study.intruder.target.markers().iter();
    let images: Vec<Pixel> =
        markers.filter_map(|marker| study.camera.project(&(look.truth * marker.position))).collect();
    centroids.iter().any(|centroid| images.iter().any(|image| (image - centroid.pixel).norm() < NEAR_PX))
}

/// A blob this near to where a marker is is its image, or holds it, px.
const NEAR_PX: f64 = 3.0;
