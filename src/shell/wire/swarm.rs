//! What stands beside the frames and estimates of a camera: notes, its status, what was not told of it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::Problem;
use super::frame::RawFormatName;
use super::sighting::Timing;

/// What a camera says of its frame, over Zenoh in the attachment, over HTTP in the query. All of it may be left out.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(default)]
pub struct FrameNote {
    /// Number of the frame; each is one more than the one before. By it lost frames are counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sequence: Option<u64>,
    /// When the frame was taken, microseconds since the Unix epoch; copied to the estimate. By it frames that are too old are dropped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub timestamp_us: Option<i64>,
    /// Width of a raw frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width: Option<u32>,
    /// Height of a raw frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height: Option<u32>,
    /// Pixel format of a raw frame; none for encoded pictures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<RawFormatName>,
}

/// What stands beside an estimate: the attachment, JSON.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
pub struct EstimateNote {
    /// The frame's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequence: Option<u64>,
    /// The frame's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timestamp_us: Option<i64>,
    /// When the frame arrived, microseconds since the Unix epoch by the service's clock.
    pub received_us: i64,
    /// Where the time went from the frame's arrival to handing the estimate to the network.
    pub latency_us: Ledger,
}

/// Where the time went, whole microseconds.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
pub struct Ledger {
    /// From the frame's arrival to its turn on a worker, waiting included.
    pub receive: u64,
    /// Bytes to pixels.
    pub decode: u64,
    /// Pixels to centroids.
    pub detect: u64,
    /// Centroids to markers.
    pub identify: u64,
    /// Markers to poses.
    pub solve: u64,
    /// From the poses to handing the reply to the network.
    pub publish: u64,
    /// All together.
    pub total: u64,
}

impl Ledger {
    /// Of the work's own times, in an estimate that was there `answered` and handed over `total` after the frame's arrival.
    #[must_use]
    pub fn of(timing: &Timing, answered: u64, total: u64) -> Self {
        Self {
            receive: answered.saturating_sub(timing.total),
            decode: timing.decode,
            detect: timing.detect,
            identify: timing.identify.unwrap_or(0),
            solve: timing.solve.unwrap_or(0),
            publish: total.saturating_sub(answered),
            total,
        }
    }
}

/// What a ground station has not been told: it read too slowly, came again too late, or the service was started anew.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[schema(as = EstimatesGap)]
pub struct GapWire {
    /// Estimates and tracks that are not kept any more; null where nobody knows, as the service was started since, or as the number is
    /// none of its own.
    #[schema(required = true)]
    pub missed_count: Option<u64>,
    /// Number of the event that comes next.
    pub next_id: u64,
}

/// What has become of a camera's frames since the service began to listen.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
pub struct CameraStatus {
    /// The node that tells it.
    pub node: String,
    /// The camera.
    pub camera: String,
    /// When it is told, microseconds since the Unix epoch.
    pub time_us: i64,
    /// Whether it is stored what is looked for in its frames (`PUT /v1/streams/{camera}`).
    pub has_stream: bool,
    /// Frames that arrived.
    pub received: u64,
    /// Those of them that came in shared memory, from this machine, and were not copied.
    #[serde(default)]
    #[schema(required = true)]
    pub shared: u64,
    /// Estimates that were published.
    pub published: u64,
    /// Frames that a newer one has replaced before their turn came.
    pub replaced: u64,
    /// Frames that were older than `max_age_ms` when their turn came.
    pub too_old: u64,
    /// Frames that were older than that when their estimate was there, which was not published.
    pub late: u64,
    /// Frames that were refused: no frames, not of this camera, too large, or nothing stored to be looked for in them.
    pub refused: u64,
    /// Frames that found the workers full, or failed by a fault of ours.
    pub failed: u64,
    /// Frames that never arrived, by gaps in their sequence.
    pub lost: u64,
    /// How often the sequence went back: the sender has begun anew.
    pub restarts: u64,
    /// Number of the last frame that arrived.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_sequence: Option<u64>,
    /// What was wrong with the last frame that was refused or failed; none after the next estimate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<Problem>,
}

impl CameraStatus {
    /// A frame of this number has arrived.
    pub const fn arrived(&mut self, sequence: Option<u64>) {
        self.received += 1;
        if let Some(sequence) = sequence {
            match self.last_sequence {
                Some(last) if sequence > last => self.lost = self.lost.saturating_add(sequence - last - 1),
                Some(_) => self.restarts += 1,
                None => {}
            }
            self.last_sequence = Some(sequence);
        }
    }

    /// Frames of which nothing came.
    #[must_use]
    pub const fn losses(&self) -> u64 {
        let ours = self.replaced + self.too_old + self.late + self.refused + self.failed;
        ours.saturating_add(self.lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_counted_and_a_new_beginning_is_none() {
        let mut status = CameraStatus::default();
        for sequence in [Some(7), Some(8), Some(11), None, Some(12), Some(0), Some(1)] {
            status.arrived(sequence);
        }
        assert_eq!((status.received, status.lost, status.restarts), (7, 2, 1));
        assert_eq!(status.last_sequence, Some(1));
        status.arrived(Some(u64::MAX));
        status.arrived(Some(0));
        status.arrived(Some(u64::MAX));
        assert_eq!(status.lost, u64::MAX);
    }
}
