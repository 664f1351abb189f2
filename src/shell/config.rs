//! Settings: from a file, from `SKYPOSE_*` variables and from options, the later over the earlier. All faults are reported
//! at once.

mod frames;
mod http;
mod identify;
mod load;
mod log;
mod mavlink;
mod ros;
mod store;
mod swarm;
mod work;
mod zenoh;

use serde::{Deserialize, Serialize};

use crate::shell::store::address_problem;
use crate::shell::wire::{ActOptionsWire, TrackOptionsWire};

pub use frames::{FrameSettings, SequenceSettings, StreamSettings};
pub use http::HttpSettings;
pub use identify::IdentifySettings;
pub use load::{SettingFault, load};
pub use log::{LogFormat, LogSettings};
pub use mavlink::{MavlinkMessage, MavlinkSettings};
pub use ros::{RosCamera, RosForm, RosSettings};
pub use store::{Storage, StoreSettings};
pub use swarm::{SwarmBody, SwarmCamera, SwarmSettings};
pub use work::{JobSettings, WorkerSettings};
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
        self.http.faults(&mut need);
        self.workers.faults(&mut need);
        self.jobs.faults(&mut need);
        self.frames.faults(&mut need);
        self.identify.faults(&mut need);
        self.streams.faults(&mut need);
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
