//! Two aircraft on straight paths: how far, how fast they close, when they are nearest and how near.

use nalgebra::Vector3;

use super::error::EncounterError;

/// Where the intruder is and how it moves, as seen from our aircraft. Only [`RelativeState::checked`] makes one: all numbers are finite, and
/// the two are not at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeState {
    position_m: Vector3<f64>,
    velocity_mps: Vector3<f64>,
}

/// The closest approach if both velocities stay as they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Time until then, s, above zero.
    pub time_s: f64,
    /// Distance then, m.
    pub miss_m: f64,
}

/// Relative speeds below this share of a metre a second are none.
const LEAST_SPEED_MPS: f64 = 1e-9;

/// Farthest place that is taken, m, and fastest motion, m/s: that of two of the fastest aircraft against each other. What is reckoned
/// from numbers at the limit may round beyond it.
const MOST: [f64; 2] = [1e6 * (1.0 + 1e-9), 2e6 * (1.0 + 1e-9)];

impl RelativeState {
    /// The intruder's position less ours, m, and its velocity less ours, m/s.
    ///
    /// # Errors
    /// Names the number that is not finite or beyond all aircraft, or says that both are at one place.
    pub fn checked(position_m: Vector3<f64>, velocity_mps: Vector3<f64>) -> Result<Self, EncounterError> {
        for ((field, vector), max) in
            [("position_m", &position_m), ("velocity_mps", &velocity_mps)].into_iter().zip(MOST)
        {
            for (axis, &value) in vector.iter().enumerate() {
                if !(value.abs() <= max) {
                    return Err(EncounterError::Coordinate { field, axis, value, max });
                }
            }
        }
        let range_m = position_m.norm();
        if range_m < 1e-6 {
            return Err(EncounterError::SamePlace { range_m });
        }
        Ok(Self { position_m, velocity_mps })
    }

    /// The intruder's position less ours, m.
    #[must_use]
    pub const fn position_m(&self) -> &Vector3<f64> {
        &self.position_m
    }

    /// The intruder's velocity less ours, m/s.
    #[must_use]
    pub const fn velocity_mps(&self) -> &Vector3<f64> {
        &self.velocity_mps
    }

    /// Distance of the two, m.
    #[must_use]
    pub fn range_m(&self) -> f64 {
        self.position_m.norm()
    }

    /// How fast that shrinks, m/s: `-(p . v) / |p|`. Negative where it grows.
    #[must_use]
    pub fn closing_speed_mps(&self) -> f64 {
        // No minus before a zero.
        (0.0 - self.position_m.dot(&self.velocity_mps)) / self.range_m()
    }

    /// When they are nearest, and how near. `None` where they do not come nearer than they are.
    #[must_use]
    pub fn closest_approach(&self) -> Option<Approach> {
        let squared = self.velocity_mps.norm_squared();
        if squared < LEAST_SPEED_MPS * LEAST_SPEED_MPS {
            return None;
        }
        let time_s = -self.position_m.dot(&self.velocity_mps) / squared;
        let miss_m = (self.position_m + self.velocity_mps * time_s).norm();
        (time_s > 0.0).then_some(Approach { time_s, miss_m })
    }

    /// Where the intruder is seen: azimuth, positive to the right, and elevation, positive up, rad, from our course and the level.
    #[must_use]
    pub fn bearing_rad(&self) -> [f64; 2] {
        let p = &self.position_m;
        [p.y.atan2(p.x), (-p.z).atan2(p.x.hypot(p.y))]
    }
}
