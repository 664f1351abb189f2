//! What is told to all doors of the frames that cameras send.

use crate::shell::wire::sighting::TargetEstimateWire;

/// What a listener may leave unheard; then he misses the oldest.
pub(super) const MOST_WAITING: usize = 64;

/// What a frame of a camera shows.
#[derive(Clone, Debug)]
pub struct Told {
    /// The camera, by the name of its stream.
    pub camera: String,
    /// When the frame was taken, as the camera says; microseconds since the Unix epoch.
    pub timestamp_us: Option<i64>,
    /// When it arrived, by our clock.
    pub received_us: i64,
    /// What it shows of the targets.
    pub targets: Vec<TargetEstimateWire>,
}
