//! What is flown, with what, and when an alarm is given.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};
use std::ops::Range;

use thiserror::Error;

use super::alarm::Alarm;
use super::lookout::Lookout;
use crate::camera::Camera;
use crate::detect::Detector;
use crate::encounter::Manoeuvre;
use crate::pose::PoseOptions;
use crate::scene::encounters::intruder::wing;
use crate::scene::encounters::{Disturbance, Light, Mount, Sight, Traffic};
use crate::scene::models;
use crate::scene::render::Model;
use crate::track::{TrackError, TrackOptions};

/// Most encounters of a study by how it senses: an hour or so.
const MAX_SIMULATED: u64 = 200_000;
const MAX_RENDERED: u64 = 5_000;

/// Most frames of one encounter: it begins later rather than have more.
pub const MAX_FRAMES: u32 = 2_400;

/// Encounters of a part of the work, by how they sense; more where there would be more parts than these.
const SIMULATED_PER_SHARD: u64 = 25;
const RENDERED_PER_SHARD: u64 = 1;
const MAX_SHARDS: u64 = 2_000;

/// Encounters that are tried before a study is believed to have some.
const TRIES: u64 = 20;

/// Longest waits and leads that make sense, s.
const MOST_SECONDS: f64 = 600.0;

/// Everything that decides the figures.
#[derive(Clone, Debug, PartialEq)]
pub struct EncounterStudy {
    /// The camera.
    pub camera: Camera,
    /// By how much it is turned to the right of the own course, rad.
    pub camera_azimuth_rad: f64,
    /// By how much it is turned up, rad.
    pub camera_elevation_rad: f64,
    /// The intruder, and the constellation on it.
    pub intruder: Model,
    /// How the constellation sits on it.
    pub mount: Mount,
    /// What is drawn from.
    pub traffic: Traffic,
    /// What the own aircraft does, and by how much it wants to clear.
    pub manoeuvre: Manoeuvre,
    /// When it does so.
    pub alarm: Alarm,
    /// Nearer than this is a near mid-air collision, m.
    pub nmac_m: f64,
    /// From what blobs come.
    pub sensing: Sensing,
    /// The detector.
    pub detector: Detector,
    /// The solver.
    pub pose: PoseOptions,
    /// The tracker.
    pub track: TrackOptions,
    /// Frames a second.
    pub rate_hz: f64,
    /// Encounters.
    pub runs: u64,
    /// Names them: the same seed, the same encounters.
    pub seed: u64,
}

/// From what blobs come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sensing {
    /// Simulated, with the errors that the detector was measured to have, and these.
    Centroids(Disturbance),
    /// Found in rendered frames.
    Frames,
}

/// What is wrong with a study. The field is named as in requests.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum EncounterStudyError {
    /// A number out of its range.
    #[error("{field} is {value}, but {need}")]
    Value {
        /// Which.
        field: &'static str,
        /// What was given.
        value: f64,
        /// What is needed.
        need: &'static str,
    },
    /// Two numbers that are no range.
    #[error("{field} is [{low}, {high}], but {need}")]
    Range {
        /// Which.
        field: &'static str,
        /// The first.
        low: f64,
        /// The second.
        high: f64,
        /// What is needed.
        need: &'static str,
    },
    /// An option of the tracker.
    #[error(transparent)]
    Track(TrackError),
    /// A detector that finds no markers, or that cannot be simulated.
    #[error("the detector {why}")]
    Detector {
        /// What it lacks.
        why: &'static str,
    },
    /// Two that hardly ever close.
    #[error("no encounter could be drawn: with these speeds and courses the two do not close")]
    NoEncounter,
}

impl EncounterStudyError {
    /// The field that is to blame, as in requests, with dots between its parts.
    #[must_use]
    pub const fn field(&self) -> &'static str {
        match self {
            Self::Value { field, .. } | Self::Range { field, .. } => field,
            Self::Track(_) => "track",
            Self::Detector { .. } => "detector",
            Self::NoEncounter => "traffic",
        }
    }
}

impl EncounterStudy {
    /// What is flown where nothing is said: two small aircraft that come towards each other at 8 to 15 m/s each, the intruder a flying wing of
    /// 4.2 m span with discs of 9 cm radius at its nose, the camera that of the demo. A quarter of a second for computing and link, half a
    /// second to roll to 45 degrees, and twice the 3 m that make a near miss to be cleared.
    ///
    /// # Panics
    /// Never: the numbers are good.
    #[must_use]
    pub fn standard(runs: u64, seed: u64) -> Self {
        #[expect(clippy::expect_used, reason = "constants that a test holds up")]
        let (intruder, manoeuvre) = (
            wing(3.0).expect("a good size"),
            Manoeuvre::checked(FRAC_PI_4, 6.0).and_then(|turn| turn.rolling(FRAC_PI_2)).expect("a good turn"),
        );
        Self {
            camera: models::demo_camera(),
            camera_azimuth_rad: 0.0,
            camera_elevation_rad: 0.0,
            intruder,
            mount: Mount::Nose,
            traffic: Traffic {
                own_speed_mps: [8.0, 12.0],
                intruder_speed_mps: [8.0, 15.0],
                course_rad: [2.0 * PI / 3.0, 4.0 * PI / 3.0],
                miss_m: [0.0, 9.0],
                attitude_sigma_rad: 0.05,
            },
            manoeuvre,
            alarm: Alarm { delay_s: 0.25, sigmas: 1.0, lead_s: None },
            nmac_m: 3.0,
            sensing: Sensing::Centroids(Disturbance::default()),
            detector: Detector::default(),
            pose: PoseOptions::default(),
            track: TrackOptions::default(),
            rate_hz: 20.0,
            runs,
            seed,
        }
    }

    /// Whether it can be flown.
    ///
    /// # Errors
    /// The first that is wrong with it.
    pub fn check(&self) -> Result<(), EncounterStudyError> {
        let speeds = "a least and a largest speed of 0.5 to 500 m/s are needed";
        range("traffic.own_speed_mps", self.traffic.own_speed_mps, [0.5, 500.0], speeds)?;
        range("traffic.intruder_speed_mps", self.traffic.intruder_speed_mps, [0.5, 500.0], speeds)?;
        let courses = "a least and a largest angle within a full turn are needed";
        range("traffic.course_rad", self.traffic.course_rad, [-TAU, TAU], courses)?;
        range(
            "traffic.miss_m",
            self.traffic.miss_m,
            [0.0, 1e5],
            "a least and a largest distance from 0 on are needed",
        )?;
        let miss_distance_m = self.manoeuvre.miss_distance_m();
        let disturbance = match self.sensing {
            Sensing::Centroids(disturbance) => disturbance,
            Sensing::Frames => Disturbance::default(),
        };
        let most = self.most_runs();
        let runs = self.runs as f64;
        let values = [
            ("traffic.attitude_sigma_rad", self.traffic.attitude_sigma_rad, [0.0, 1.0], "0 to 1 is needed"),
            ("camera_azimuth_rad", self.camera_azimuth_rad, [-PI, PI], "-pi to pi is needed"),
            ("camera_elevation_rad", self.camera_elevation_rad, [-FRAC_PI_2, FRAC_PI_2], "-pi/2 to pi/2 is needed"),
            ("nmac_m", self.nmac_m, [1e-3, miss_distance_m], "above 0 and at most the miss distance is needed"),
            ("rate_hz", self.rate_hz, [1.0, 240.0], "1 to 240 frames a second are needed"),
            ("alert.delay_s", self.alarm.delay_s, [0.0, MOST_SECONDS], "0 to 600 s are needed"),
            ("alert.sigmas", self.alarm.sigmas, [0.0, 10.0], "0 to 10 is needed"),
            ("alert.lead_s", self.alarm.lead_s.unwrap_or(0.0), [0.0, MOST_SECONDS], "0 to 600 s are needed"),
            ("centroids.missing_ratio", disturbance.missing_ratio, [0.0, 1.0], "0 to 1 is needed"),
            ("centroids.clutter", disturbance.clutter, [0.0, 50.0], "0 to 50 blobs a frame are needed"),
            ("centroids.error_ratio", disturbance.error_ratio, [0.0, 100.0], "0 to 100 is needed"),
            ("runs", runs, [1.0, most as f64], "1 to 200,000 with centroids and 1 to 5,000 with frames are flown"),
        ];
        for (field, value, [low, high], need) in values {
            if !(value >= low && value <= high) {
                return Err(EncounterStudyError::Value { field, value, need });
            }
        }
        self.track.checked().map_err(EncounterStudyError::Track)?;
        if Sight::of(&self.detector, disturbance).is_none() {
            let why = "finds no markers: color and beacon do, without the preset thesis";
            return Err(EncounterStudyError::Detector { why });
        }
        if (0..TRIES).all(|index| Lookout::of(self, index).is_none()) {
            return Err(EncounterStudyError::NoEncounter);
        }
        Ok(())
    }

    /// Light and background that go with the detector.
    #[must_use]
    pub const fn light(&self) -> Light {
        match self.detector {
            Detector::Beacon(_) => Light::Night,
            _ => Light::Day,
        }
    }

    /// In how many parts it is computed: a property of the study alone.
    #[must_use]
    pub fn shards(&self) -> u64 {
        self.runs.div_ceil(self.shard_size())
    }

    /// The encounters of a part.
    #[must_use]
    pub fn runs_of(&self, shard: u64) -> Range<u64> {
        let size = self.shard_size();
        let start = shard.saturating_mul(size).min(self.runs);
        start..start.saturating_add(size).min(self.runs)
    }

    fn shard_size(&self) -> u64 {
        let least = match self.sensing {
            Sensing::Centroids(_) => SIMULATED_PER_SHARD,
            Sensing::Frames => RENDERED_PER_SHARD,
        };
        least.max(self.runs.div_ceil(MAX_SHARDS))
    }

    const fn most_runs(&self) -> u64 {
        match self.sensing {
            Sensing::Centroids(_) => MAX_SIMULATED,
            Sensing::Frames => MAX_RENDERED,
        }
    }
}

fn range(
    field: &'static str,
    [low, high]: [f64; 2],
    [least, most]: [f64; 2],
    need: &'static str,
) -> Result<(), EncounterStudyError> {
    if low >= least && high <= most && low <= high {
        return Ok(());
    }
    Err(EncounterStudyError::Range { field, low, high, need })
}
