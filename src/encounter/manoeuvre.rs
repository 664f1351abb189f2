//! What our aircraft does to keep clear.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use super::GRAVITY_MPS2;
use super::error::{EncounterError, positive};

/// To which side it turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// To the left.
    Left,
    /// To the right.
    Right,
    /// To the side on which it may begin later.
    Either,
}

impl Side {
    /// Its name in the contract.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
            Self::Either => "either",
        }
    }
}

/// A level turn, and by how much it has to clear the intruder. Only [`Manoeuvre::checked`] makes one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manoeuvre {
    bank_rad: f64,
    miss_distance_m: f64,
    roll_rate_radps: Option<f64>,
    max_turn_rad: f64,
    side: Side,
}

impl Default for Manoeuvre {
    /// 45 degrees is the usual limit of small autopilots, 500 ft the thesis' miss distance.
    fn default() -> Self {
        Self {
            bank_rad: FRAC_PI_4,
            miss_distance_m: 152.4,
            roll_rate_radps: None,
            max_turn_rad: FRAC_PI_2,
            side: Side::Either,
        }
    }
}

impl Manoeuvre {
    /// A turn at this bank, the bank there at once, of a quarter turn, to the better side, that clears by `miss_distance_m`.
    ///
    /// # Errors
    /// Names the number that makes no turn.
    pub fn checked(bank_rad: f64, miss_distance_m: f64) -> Result<Self, EncounterError> {
        if !(bank_rad > 0.0 && bank_rad < FRAC_PI_2 && bank_rad.tan() <= 1e6) {
            return Err(EncounterError::Bank { bank_rad });
        }
        let miss_distance_m = positive("miss_distance_m", miss_distance_m)?;
        Ok(Self { bank_rad, miss_distance_m, ..Self::default() })
    }

    /// The same at this bank.
    ///
    /// # Errors
    /// [`EncounterError::Bank`] for a bank that turns nothing or carries nothing.
    pub fn banked(self, bank_rad: f64) -> Result<Self, EncounterError> {
        Ok(Self { bank_rad: Self::checked(bank_rad, self.miss_distance_m)?.bank_rad, ..self })
    }

    /// The same with a bank that grows at this rate, rad/s.
    ///
    /// # Errors
    /// [`EncounterError::Positive`] for a rate that is none.
    pub fn rolling(self, roll_rate_radps: f64) -> Result<Self, EncounterError> {
        Ok(Self { roll_rate_radps: Some(positive("roll_rate_radps", roll_rate_radps)?), ..self })
    }

    /// The same that ends after a turn of `max_turn_rad`, at most a half.
    ///
    /// # Errors
    /// [`EncounterError::Turn`] for a turn that is none.
    pub fn up_to(self, max_turn_rad: f64) -> Result<Self, EncounterError> {
        if !(max_turn_rad > 0.0 && max_turn_rad <= PI) {
            return Err(EncounterError::Turn { max_turn_rad });
        }
        Ok(Self { max_turn_rad, ..self })
    }

    /// The same to this side.
    #[must_use]
    pub const fn to(self, side: Side) -> Self {
        Self { side, ..self }
    }

    /// Bank, rad.
    #[must_use]
    pub const fn bank_rad(&self) -> f64 {
        self.bank_rad
    }

    /// Distance by which the intruder has to be cleared, m.
    #[must_use]
    pub const fn miss_distance_m(&self) -> f64 {
        self.miss_distance_m
    }

    /// How fast the bank grows, rad/s; `None` for at once.
    #[must_use]
    pub const fn roll_rate_radps(&self) -> Option<f64> {
        self.roll_rate_radps
    }

    /// How far it turns, rad.
    #[must_use]
    pub const fn max_turn_rad(&self) -> f64 {
        self.max_turn_rad
    }

    /// To which side.
    #[must_use]
    pub const fn side(&self) -> Side {
        self.side
    }

    /// Time until the bank is there, s.
    #[must_use]
    pub fn roll_in_s(&self) -> f64 {
        self.roll_rate_radps.map_or(0.0, |rate| self.bank_rad / rate)
    }

    /// Acceleration to the side in the turn, m/s^2.
    #[must_use]
    pub fn lateral_mps2(&self) -> f64 {
        GRAVITY_MPS2 * self.bank_rad.tan()
    }

    /// Radius of the turn at this speed, m.
    #[must_use]
    pub fn radius_m(&self, speed_mps: f64) -> f64 {
        speed_mps * speed_mps / self.lateral_mps2()
    }

    /// Rate of the turn at this speed, rad/s.
    #[must_use]
    pub fn turn_rate_radps(&self, speed_mps: f64) -> f64 {
        self.lateral_mps2() / speed_mps
    }

    /// Lift over weight in the turn.
    #[must_use]
    pub fn load_factor(&self) -> f64 {
        self.bank_rad.cos().recip()
    }
}
