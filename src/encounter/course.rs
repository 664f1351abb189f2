//! The speeds and courses of two aircraft, and the seed's scenarios by name.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::Vector3;

use super::KNOT_MPS;
use super::approach::RelativeState;
use super::error::{EncounterError, positive};

/// The scenarios of the thesis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scenario {
    /// The intruder comes straight ahead.
    HeadOn,
    /// The intruder crosses our course at a right angle, from the right to the left.
    Crossing,
}

impl Scenario {
    /// Speed of both aircraft in the thesis: 50 knots.
    pub const SPEED_MPS: f64 = 50.0 * KNOT_MPS;

    /// Its name in the contract.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::HeadOn => "head-on",
            Self::Crossing => "crossing",
        }
    }

    /// The intruder's course from ours, rad, positive to the right.
    #[must_use]
    pub const fn course_rad(self) -> f64 {
        match self {
            Self::HeadOn => PI,
            Self::Crossing => -FRAC_PI_2,
        }
    }
}

/// Two aircraft in level flight that would meet in one point. Only [`Course::checked`] makes one: speeds are positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    own_speed_mps: f64,
    intruder_speed_mps: f64,
    heading_rad: f64,
}

impl Course {
    /// Of these speeds, the intruder's course turned from ours by `course_rad`, positive to the right: 0 flies along with us, pi comes
    /// towards us, -pi/2 crosses from the right to the left.
    ///
    /// # Errors
    /// Names the number that makes no encounter.
    pub fn checked(own_speed_mps: f64, intruder_speed_mps: f64, course_rad: f64) -> Result<Self, EncounterError> {
        let own_speed_mps = positive("own_speed_mps", own_speed_mps)?;
        let intruder_speed_mps = positive("intruder_speed_mps", intruder_speed_mps)?;
        if !(course_rad.abs() <= TAU) {
            let field = "intruder_course_rad";
            return Err(EncounterError::Angle { field, value: course_rad, min: -TAU, max: TAU });
        }
        Ok(Self { own_speed_mps, intruder_speed_mps, heading_rad: course_rad })
    }

    /// The thesis' scenario of this name, both aircraft at 50 knots.
    #[must_use]
    pub const fn of(scenario: Scenario) -> Self {
        let speed_mps = Scenario::SPEED_MPS;
        Self { own_speed_mps: speed_mps, intruder_speed_mps: speed_mps, heading_rad: scenario.course_rad() }
    }

    /// Our speed, m/s.
    #[must_use]
    pub const fn own_speed_mps(&self) -> f64 {
        self.own_speed_mps
    }

    /// The intruder's speed, m/s.
    #[must_use]
    pub const fn intruder_speed_mps(&self) -> f64 {
        self.intruder_speed_mps
    }

    /// The intruder's course from ours, rad, positive to the right.
    #[must_use]
    pub const fn course_rad(&self) -> f64 {
        self.heading_rad
    }

    /// The intruder's velocity along our level axes, m/s.
    #[must_use]
    pub fn intruder_velocity_mps(&self) -> Vector3<f64> {
        // Half a turn has a sine of 1.2e-16 in floating point: straight ahead is to be straight ahead.
        let [along, across] = [self.heading_rad.cos(), self.heading_rad.sin()];
        let exact = |part: f64| if part.abs() < 1e-15 { 0.0 } else { part };
        Vector3::new(exact(along), exact(across), 0.0) * self.intruder_speed_mps
    }

    /// The same less ours.
    #[must_use]
    pub fn relative_velocity_mps(&self) -> Vector3<f64> {
        self.intruder_velocity_mps() - Vector3::x() * self.own_speed_mps
    }

    /// How fast the two close on their collision course, m/s: the whole of their relative speed.
    #[must_use]
    pub fn closing_speed_mps(&self) -> f64 {
        let speed_mps = self.relative_velocity_mps().norm();
        // Side by side at one speed: what is left is rounding.
        if speed_mps < 1e-9 * self.own_speed_mps.max(self.intruder_speed_mps) { 0.0 } else { speed_mps }
    }

    /// The two at this distance of each other on their way to the point where they meet. `None` where they never do, flying side by side
    /// at one speed.
    #[must_use]
    pub fn at_range(&self, range_m: f64) -> Option<RelativeState> {
        let velocity = self.relative_velocity_mps();
        let closing_speed_mps = self.closing_speed_mps();
        if closing_speed_mps <= 0.0 {
            return None;
        }
        RelativeState::checked(-velocity * (range_m / closing_speed_mps), velocity).ok()
    }
}
