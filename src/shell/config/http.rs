//! The HTTP door: its address, what it takes and how long.

use std::net::SocketAddr;
use std::time::Duration;

use serde::{Deserialize, Serialize};

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

    /// What makes no sense in them.
    pub(super) fn faults(&self, need: &mut impl FnMut(bool, &str, &str)) {
        need(self.max_connections > 0, "http.max_connections", "must be at least 1");
        need(self.max_in_flight > 0, "http.max_in_flight", "must be at least 1");
        need((1..=3_600_000).contains(&self.deadline_ms), "http.deadline_ms", "must be from 1 to 3600000");
        need((1..=3_600_000).contains(&self.header_timeout_ms), "http.header_timeout_ms", "must be from 1 to 3600000");
        need(self.max_json_bytes >= 1024, "http.max_json_bytes", "must be at least 1024");
        need(self.max_frame_bytes >= 1024, "http.max_frame_bytes", "must be at least 1024");
        need(self.max_batch > 0, "http.max_batch", "must be at least 1");
        need(self.max_points >= 4, "http.max_points", "must be at least 4");
    }
}
