//! Whether an encounter has room in the airspace of the thesis.

use super::course::Course;
use super::error::{EncounterError, positive};

/// A box of air, its length along our course.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Airspace {
    /// Along our course, across it, and up.
    size_m: [f64; 3],
}

impl Default for Airspace {
    /// "4 km by 500 m by 2 km", of which the thesis does not say which is the height. Of small aircraft it is the least.
    fn default() -> Self {
        Self { size_m: [4000.0, 2000.0, 500.0] }
    }
}

impl Airspace {
    /// Along our course, across it, and up, m.
    ///
    /// # Errors
    /// Names the one that is not above zero.
    pub fn checked(length_m: f64, width_m: f64, height_m: f64) -> Result<Self, EncounterError> {
        let size_m = [positive("length_m", length_m)?, positive("width_m", width_m)?, positive("height_m", height_m)?];
        Ok(Self { size_m })
    }

    /// Length, width and height, m.
    #[must_use]
    pub const fn size_m(&self) -> [f64; 3] {
        self.size_m
    }

    /// The longest time before the collision at which both can be inside, flying straight to where they meet, s.
    #[must_use]
    pub fn longest_s(&self, course: &Course) -> f64 {
        let velocity = course.intruder_velocity_mps();
        // A second before, each was so far behind the point where they meet.
        let along = [0.0, course.own_speed_mps(), velocity.x];
        let spread = |places: &[f64]| {
            places.iter().copied().fold(f64::NEG_INFINITY, f64::max)
                - places.iter().copied().fold(f64::INFINITY, f64::min)
        };
        let time = |room_m: f64, speed_mps: f64| if speed_mps > 1e-12 { room_m / speed_mps } else { f64::INFINITY };
        time(self.size_m[0], spread(&along)).min(time(self.size_m[1], velocity.y.abs()))
    }
}
