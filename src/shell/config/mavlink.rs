//! To whom is sent by MAVLink, and where the camera sits on the vehicle.

use std::net::SocketAddr;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::NAME;
use crate::shell::store::check_name;

/// Ground stations and autopilots, by MAVLink 2 over UDP.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct MavlinkSettings {
    /// Address and port to which is sent; empty is nobody.
    pub address: String,
    /// The vehicle that carries us.
    pub system_id: u8,
    /// Our number on it.
    pub component_id: u8,
    /// What tells where a target is.
    pub message: MavlinkMessage,
    /// Name of the stream whose targets are told.
    pub camera: String,
    /// Roll, pitch and yaw of the camera on the vehicle; all zero looks forward.
    pub camera_turned_rad: [f64; 3],
    /// Place of the camera on the vehicle: forward, right, down.
    pub camera_position_m: [f64; 3],
    /// Time between two heartbeats.
    pub heartbeat_ms: u64,
}

/// What tells where a target is.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MavlinkMessage {
    /// `LANDING_TARGET`: autopilots know it.
    #[default]
    LandingTarget,
    /// `ODOMETRY`: with the covariance. An autopilot would take it for its own pose.
    Odometry,
}

impl Default for MavlinkSettings {
    fn default() -> Self {
        Self {
            address: String::new(),
            system_id: 1,
            component_id: 191,
            message: MavlinkMessage::LandingTarget,
            camera: "front".into(),
            camera_turned_rad: [0.0; 3],
            camera_position_m: [0.0; 3],
            heartbeat_ms: 1000,
        }
    }
}

impl MavlinkSettings {
    /// Where is sent to; nothing where nobody is.
    #[must_use]
    pub fn receiver(&self) -> Option<SocketAddr> {
        self.address.parse().ok()
    }

    /// Time between two heartbeats.
    #[must_use]
    pub const fn heartbeat(&self) -> Duration {
        Duration::from_millis(self.heartbeat_ms)
    }

    pub(super) fn faults(&self, need: &mut impl FnMut(bool, &str, &str)) {
        let is_address = self.address.is_empty() || self.receiver().is_some_and(|address| address.port() > 0);
        need(is_address, "mavlink.address", "must be an address and a port as 192.168.1.20:14550, or empty");
        need(self.system_id > 0, "mavlink.system_id", "must be from 1 to 255");
        need(self.component_id > 0, "mavlink.component_id", "must be from 1 to 255");
        need(check_name(&self.camera).is_ok(), "mavlink.camera", NAME);
        let is_within = |most: f64, values: [f64; 3]| values.iter().all(|value| value.abs() <= most);
        need(is_within(6.3, self.camera_turned_rad), "mavlink.camera_turned_rad", "must be from -6.3 to 6.3 each");
        need(is_within(1000.0, self.camera_position_m), "mavlink.camera_position_m", "must be from -1000 to 1000 each");
        need((100..=60_000).contains(&self.heartbeat_ms), "mavlink.heartbeat_ms", "must be from 100 to 60000");
    }
}
