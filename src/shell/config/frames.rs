//! What a frame may cost, and sequences and streams of them.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::frame::Limits;

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

    /// What makes no sense in them.
    pub(super) fn faults(&self, need: &mut impl FnMut(bool, &str, &str)) {
        need(self.max_pixels > 0, "frames.max_pixels", "must be at least 1");
    }
}

/// Sequences of frames posted one by one.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct SequenceSettings {
    /// Most that are remembered. Of those that are not in use the one not used for longest makes room; a further one is refused where
    /// all are.
    pub most: usize,
    /// Time after its last frame in which one is in use.
    pub in_use_ms: u64,
    /// Time after its last frame at which one is forgotten.
    pub idle_ms: u64,
}

impl Default for SequenceSettings {
    fn default() -> Self {
        Self { most: 16, in_use_ms: 10_000, idle_ms: 60_000 }
    }
}

impl SequenceSettings {
    /// Time after its last frame in which one is in use.
    #[must_use]
    pub const fn in_use(&self) -> Duration {
        Duration::from_millis(self.in_use_ms)
    }

    /// Time after its last frame at which one is forgotten.
    #[must_use]
    pub const fn idle(&self) -> Duration {
        Duration::from_millis(self.idle_ms)
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

    /// What makes no sense in them.
    pub(super) fn faults(&self, need: &mut impl FnMut(bool, &str, &str)) {
        need((1..=3_600_000).contains(&self.max_age_ms), "streams.max_age_ms", "must be from 1 to 3600000");
        need((1..=1024).contains(&self.max_cameras), "streams.max_cameras", "must be from 1 to 1024");
        need((100..=3_600_000).contains(&self.status_ms), "streams.status_ms", "must be from 100 to 3600000");
        need(self.kept_bytes <= 1 << 30, "streams.kept_bytes", "must be at most 1073741824");
        need((1..=65_536).contains(&self.max_readers), "streams.max_readers", "must be from 1 to 65536");
    }
}
