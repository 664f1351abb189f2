//! Settings: from a file, from `SKYPOSE_*` variables and from options, the later over the earlier. All faults are reported
//! at once.

mod load;
mod mavlink;
mod ros;
mod swarm;
mod zenoh;

use std::fmt;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::frame::Limits;
use crate::identify::IdentifyOptions;
use crate::pipeline;
use crate::shell::store::address_problem;
use crate::shell::wire::{ActOptionsWire, TrackOptionsWire};

pub use load::{SettingFault, load};
pub use mavlink::{MavlinkMessage, MavlinkSettings};
pub use ros::{RosCamera, RosForm, RosSettings};
pub use swarm::{SwarmBody, SwarmCamera, SwarmSettings};
pub use zenoh::ZenohSettings;

/// All settings. `deploy/skypose.toml` lists them with their defaults and reasons.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// The HTTP door.
    pub http: HttpSettings,
    /// What is kept.
    pub store: StoreSettings,
    /// Who computes.
    pub workers: WorkerSettings,
    /// Calibrations and other long work.
    pub jobs: JobSettings,
    /// What a frame may cost.
    pub frames: FrameSettings,
    /// Sequences of frames posted one by one.
    pub sequences: SequenceSettings,
    /// How markers are told apart.
    pub identify: IdentifySettings,
    /// Cameras that send frame after frame.
    pub streams: StreamSettings,
    /// How tracks are kept.
    pub track: TrackOptionsWire,
    /// What our aircraft can do about an encounter.
    pub encounter: ActOptionsWire,
    /// The swarm side.
    pub zenoh: ZenohSettings,
    /// Nodes that see each other.
    pub swarm: SwarmSettings,
    /// Robots that speak ROS 2.
    pub ros: RosSettings,
    /// Ground stations and autopilots.
    pub mavlink: MavlinkSettings,
    /// What is logged.
    pub log: LogSettings,
}

/// The HTTP door.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct HttpSettings {
    /// Address and port; port 0 takes a free one.
    pub listen: SocketAddr,
    /// Connections open at a time; further ones wait to be accepted.
    pub max_connections: usize,
    /// Requests being read or answered at a time; further ones are refused with 503.
    pub max_in_flight: usize,
    /// Longest time from the head of a request to its reply.
    pub deadline_ms: u64,
    /// Longest time for the head of a request.
    pub header_timeout_ms: u64,
    /// Largest JSON body.
    pub max_json_bytes: usize,
    /// Largest body with a frame.
    pub max_frame_bytes: usize,
    /// Most pose requests in one body.
    pub max_batch: usize,
    /// Most points in one pose request.
    pub max_points: usize,
    /// Longest time that requests under way are given when the service is told to stop.
    pub drain_ms: u64,
}

impl Default for HttpSettings {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 8080)),
            max_connections: 512,
            max_in_flight: 64,
            deadline_ms: 10_000,
            header_timeout_ms: 10_000,
            max_json_bytes: 4 << 20,
            max_frame_bytes: 32 << 20,
            max_batch: 10_000,
            max_points: 10_000,
            drain_ms: 20_000,
        }
    }
}

impl HttpSettings {
    /// Longest time from the head of a request to its reply.
    #[must_use]
    pub const fn deadline(&self) -> Duration {
        Duration::from_millis(self.deadline_ms)
    }
}

/// What is kept.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct StoreSettings {
    /// The folder under which everything is stored; with a database only what is being received.
    pub data: PathBuf,
    /// The database that several processes share; none is a file under `data`.
    pub storage: Storage,
}

impl Default for StoreSettings {
    fn default() -> Self {
        Self { data: PathBuf::from("skypose-data"), storage: Storage::default() }
    }
}

/// Address of a database: `postgres://user@host/database`, or nothing. It may hold a password, so it is not shown.
#[derive(Clone, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Storage(String);

impl From<String> for Storage {
    fn from(address: String) -> Self {
        Self(address)
    }
}

impl Storage {
    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The address, for who connects to it.
    #[must_use]
    pub fn expose(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Storage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.is_empty() { "Storage(none)" } else { "Storage(..)" })
    }
}

/// Who computes.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct WorkerSettings {
    /// Threads that compute; 0 takes one for each core.
    pub threads: usize,
    /// Requests that wait for a worker; further ones are refused with 503.
    pub queue: usize,
}

impl Default for WorkerSettings {
    fn default() -> Self {
        Self { threads: 0, queue: 32 }
    }
}

impl WorkerSettings {
    /// The number of threads, cores counted.
    #[must_use]
    pub fn thread_count(&self) -> usize {
        match self.threads {
            0 => std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            threads => threads,
        }
    }
}

/// Calibrations and other long work.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct JobSettings {
    /// Threads that compute, at low priority; 0 takes half the cores.
    pub threads: usize,
    /// Jobs that are not finished; further ones are refused with 503.
    pub queue: usize,
    /// Uploads being received at a time; further ones are refused with 503.
    pub max_uploads: usize,
    /// Longest time for an upload.
    pub upload_s: u64,
    /// Most bytes of all pictures of a job.
    pub max_upload_bytes: u64,
    /// Most bytes of one picture of a job.
    pub max_picture_bytes: u64,
    /// Most pictures of a job.
    pub max_pictures: usize,
    /// Time after its end at which a job is removed.
    pub keep_finished_s: u64,
    /// Most jobs that are stored; those that ended first make room.
    pub max_jobs: usize,
}

impl Default for JobSettings {
    fn default() -> Self {
        Self {
            threads: 0,
            queue: 16,
            max_uploads: 4,
            upload_s: 600,
            max_upload_bytes: 1 << 30,
            max_picture_bytes: 64 << 20,
            max_pictures: 500,
            keep_finished_s: 30 * 24 * 3600,
            max_jobs: 1000,
        }
    }
}

impl JobSettings {
    /// The number of threads, cores counted.
    #[must_use]
    pub fn thread_count(&self) -> usize {
        match self.threads {
            0 => std::thread::available_parallelism().map_or(1, |cores| cores.get().div_ceil(2)),
            threads => threads,
        }
    }

    /// Longest time for an upload.
    #[must_use]
    pub const fn upload(&self) -> Duration {
        Duration::from_secs(self.upload_s)
    }
}

/// What a frame may cost.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct FrameSettings {
    /// Most pixels, checked before decoding.
    pub max_pixels: u64,
}

impl Default for FrameSettings {
    fn default() -> Self {
        Self { max_pixels: Limits::default().max_pixels }
    }
}

impl FrameSettings {
    /// For the core.
    #[must_use]
    pub const fn limits(&self) -> Limits {
        Limits { max_pixels: self.max_pixels }
    }
}

/// Sequences of frames posted one by one.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct SequenceSettings {
    /// Most that are remembered; the one not used for longest makes room.
    pub most: usize,
    /// Time after its last frame at which one is forgotten.
    pub idle_ms: u64,
}

impl Default for SequenceSettings {
    fn default() -> Self {
        Self { most: 16, idle_ms: 60_000 }
    }
}

impl SequenceSettings {
    /// Time after its last frame at which one is forgotten.
    #[must_use]
    pub const fn idle(&self) -> Duration {
        Duration::from_millis(self.idle_ms)
    }
}

/// How markers are told apart, and what is assumed of camera and target.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct IdentifySettings {
    /// Error of camera and target model when markers are told apart, px.
    pub model_sigma_px: f64,
    /// The same when the pose is computed from markers already told apart, px.
    pub pose_model_sigma_px: f64,
    /// How often a marker that faces the camera is not seen.
    pub miss_probability: f64,
    /// Assignments less probable than this together are refused.
    pub min_probability: f64,
    /// Blobs considered in one frame; the work grows with their third power.
    pub max_blobs: usize,
    /// Nearest range expected, m.
    pub min_range_m: f64,
    /// Farthest range expected, m.
    pub max_range_m: f64,
}

impl Default for IdentifySettings {
    fn default() -> Self {
        let core = IdentifyOptions::default();
        Self {
            model_sigma_px: core.model_sigma_px,
            pose_model_sigma_px: pipeline::Options::default().model_sigma_px,
            miss_probability: core.miss_probability,
            min_probability: core.min_probability,
            max_blobs: core.max_blobs,
            min_range_m: core.range_m[0],
            max_range_m: core.range_m[1],
        }
    }
}

impl IdentifySettings {
    /// For the core.
    #[must_use]
    pub fn options(&self) -> IdentifyOptions {
        IdentifyOptions {
            model_sigma_px: self.model_sigma_px,
            miss_probability: self.miss_probability,
            min_probability: self.min_probability,
            max_blobs: self.max_blobs,
            range_m: [self.min_range_m, self.max_range_m],
            ..IdentifyOptions::default()
        }
    }
}

/// Cameras that send frame after frame, over Zenoh or HTTP.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct StreamSettings {
    /// Age at which a frame is of no use any more.
    pub max_age_ms: u64,
    /// Most cameras whose frames are taken.
    pub max_cameras: usize,
    /// Time between two messages about a camera's state.
    pub status_ms: u64,
    /// Bytes of estimates and tracks of one camera that are kept for who comes again or reads slowly.
    pub kept_bytes: usize,
    /// Ground stations that are told at a time; further ones are refused.
    pub max_readers: usize,
}

impl Default for StreamSettings {
    fn default() -> Self {
        Self { max_age_ms: 500, max_cameras: 32, status_ms: 1000, kept_bytes: 4 << 20, max_readers: 64 }
    }
}

impl StreamSettings {
    /// Age at which a frame is of no use any more.
    #[must_use]
    pub const fn max_age(&self) -> Duration {
        Duration::from_millis(self.max_age_ms)
    }

    /// Time between two messages about a camera's state.
    #[must_use]
    pub const fn status(&self) -> Duration {
        Duration::from_millis(self.status_ms)
    }
}

/// What is logged, to standard error.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct LogSettings {
    /// `error`, `warn`, `info`, `debug`, `trace`, or directives as in `skypose=debug,tower_http=info`.
    pub level: String,
    /// `text` or `json`.
    pub format: LogFormat,
}

/// Form of the log's lines.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LogFormat {
    /// For people.
    #[default]
    Text,
    /// For machines.
    Json,
}

impl Default for LogSettings {
    fn default() -> Self {
        Self { level: "info".into(), format: LogFormat::Text }
    }
}

/// What a name must be.
const NAME: &str = "must be 1 to 64 letters, digits, '.', '_' or '-', the first a letter or a digit";

impl Settings {
    /// Everything in them that makes no sense.
    #[must_use]
    pub fn faults(&self) -> Vec<SettingFault> {
        let mut faults = Vec::new();
        let mut need = |holds: bool, setting: &str, needed: &str| {
            if !holds {
                faults.push(SettingFault { setting: setting.into(), problem: needed.into() });
            }
        };
        let http = &self.http;
        need(http.max_connections > 0, "http.max_connections", "must be at least 1");
        need(http.max_in_flight > 0, "http.max_in_flight", "must be at least 1");
        need((1..=3_600_000).contains(&http.deadline_ms), "http.deadline_ms", "must be from 1 to 3600000");
        need((1..=3_600_000).contains(&http.header_timeout_ms), "http.header_timeout_ms", "must be from 1 to 3600000");
        need(http.max_json_bytes >= 1024, "http.max_json_bytes", "must be at least 1024");
        need(http.max_frame_bytes >= 1024, "http.max_frame_bytes", "must be at least 1024");
        need(http.max_batch > 0, "http.max_batch", "must be at least 1");
        need(http.max_points >= 4, "http.max_points", "must be at least 4");
        need(self.workers.threads <= 1024, "workers.threads", "must be at most 1024");
        let jobs = &self.jobs;
        need(jobs.threads <= 1024, "jobs.threads", "must be at most 1024");
        need(jobs.queue > 0, "jobs.queue", "must be at least 1");
        need(jobs.max_uploads > 0, "jobs.max_uploads", "must be at least 1");
        need((1..=86_400).contains(&jobs.upload_s), "jobs.upload_s", "must be from 1 to 86400");
        need(jobs.max_upload_bytes >= 1024, "jobs.max_upload_bytes", "must be at least 1024");
        need(jobs.max_picture_bytes >= 1024, "jobs.max_picture_bytes", "must be at least 1024");
        need((1..=100_000).contains(&jobs.max_pictures), "jobs.max_pictures", "must be from 1 to 100000");
        need(jobs.max_jobs > jobs.queue, "jobs.max_jobs", "must be more than jobs.queue");
        need(self.frames.max_pixels > 0, "frames.max_pixels", "must be at least 1");
        let identify = &self.identify;
        for (setting, value) in [
            ("identify.model_sigma_px", identify.model_sigma_px),
            ("identify.pose_model_sigma_px", identify.pose_model_sigma_px),
        ] {
            need((0.0..=100.0).contains(&value), setting, "must be from 0 to 100");
        }
        for (setting, value) in [
            ("identify.miss_probability", identify.miss_probability),
            ("identify.min_probability", identify.min_probability),
        ] {
            need(value > 0.0 && value < 1.0, setting, "must be between 0 and 1");
        }
        need((4..=128).contains(&identify.max_blobs), "identify.max_blobs", "must be from 4 to 128");
        need(
            identify.min_range_m > 0.0 && identify.min_range_m < identify.max_range_m && identify.max_range_m <= 1e6,
            "identify.min_range_m",
            "must be positive and below identify.max_range_m, which is at most 1000000",
        );
        let streams = &self.streams;
        need((1..=3_600_000).contains(&streams.max_age_ms), "streams.max_age_ms", "must be from 1 to 3600000");
        need((1..=1024).contains(&streams.max_cameras), "streams.max_cameras", "must be from 1 to 1024");
        need((100..=3_600_000).contains(&streams.status_ms), "streams.status_ms", "must be from 100 to 3600000");
        need(streams.kept_bytes <= 1 << 30, "streams.kept_bytes", "must be at most 1073741824");
        need((1..=65_536).contains(&streams.max_readers), "streams.max_readers", "must be from 1 to 65536");
        self.zenoh.faults(&mut need);
        self.ros.faults(&self.zenoh.network, &mut need);
        self.mavlink.faults(&mut need);
        self.swarm.faults(&mut need);
        if let Err(fault) = self.track.options() {
            let option = fault.pointer.as_deref().unwrap_or_default().trim_start_matches('/');
            faults.push(SettingFault { setting: format!("track.{option}"), problem: fault.detail });
        }
        if let Err(fault) = self.encounter.means() {
            let option = fault.pointer.as_deref().unwrap_or_default().trim_start_matches('/');
            faults.push(SettingFault { setting: format!("encounter.{option}"), problem: fault.detail });
        }
        if !self.store.storage.is_empty()
            && let Some(problem) = address_problem(self.store.storage.expose())
        {
            faults.push(SettingFault { setting: "store.storage".into(), problem });
        }
        if let Err(error) = self.log.level.parse::<tracing_subscriber::filter::Targets>() {
            faults.push(SettingFault { setting: "log.level".into(), problem: error.to_string() });
        }
        faults
    }
}
