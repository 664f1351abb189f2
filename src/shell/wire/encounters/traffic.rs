//! From what encounters are drawn.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::standard;
use crate::scene::encounters::{Mount, Traffic};

/// Ranges from which encounters are drawn, each number evenly on its own. Both aircraft fly level and straight.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = Traffic)]
pub struct TrafficWire {
    /// Least and largest own speed; [8, 12] if left out.
    pub own_speed_mps: [f64; 2],
    /// Of the intruder; [8, 15] if left out.
    pub intruder_speed_mps: [f64; 2],
    /// The intruder's course from ours, positive to the right: pi comes towards us, -pi/2 crosses from the right to the left. Within 60 degrees of
    /// pi if left out.
    pub course_rad: [f64; 2],
    /// Distance at which the two pass if nobody turns, on any side, above and below; [0, 9] if left out.
    pub miss_m: [f64; 2],
    /// Standard deviation of the intruder's roll, pitch and yaw from level flight along its course; 0.05 if left out.
    pub attitude_sigma_rad: f64,
}

impl Default for TrafficWire {
    fn default() -> Self {
        let Traffic { own_speed_mps, intruder_speed_mps, course_rad, miss_m, attitude_sigma_rad } = standard().traffic;
        Self { own_speed_mps, intruder_speed_mps, course_rad, miss_m, attitude_sigma_rad }
    }
}

/// How the constellation sits on the intruder. Target frames are taken as x to the nose, y to the left, z up.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = Mount)]
pub enum MountName {
    /// -z, where the markers of a flat target look, along the intruder's course: seen by whom it comes towards.
    #[default]
    Nose,
    /// -z down, x along the course: under a wing, or a constellation that is seen from all sides.
    Belly,
    /// -z always to our camera: as if the intruder's attitude were no matter.
    Facing,
}

impl From<MountName> for Mount {
    fn from(name: MountName) -> Self {
        match name {
            MountName::Nose => Self::Nose,
            MountName::Belly => Self::Belly,
            MountName::Facing => Self::Facing,
        }
    }
}
