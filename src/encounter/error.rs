//! Numbers of which no encounter can be made.

use thiserror::Error;

/// Why a set of numbers is not an encounter.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum EncounterError {
    /// A speed, a size or a rate that is zero, negative, not a number, or beyond all aircraft.
    #[error("{field} = {value}: a number above zero is needed, {max:e} at most")]
    Positive {
        /// The contract's name of the field.
        field: &'static str,
        /// What was given.
        value: f64,
        /// Largest accepted.
        max: f64,
    },
    /// A time that is negative, not a number, or beyond a day.
    #[error("{field} = {value} s: a time from 0 to {max} s is needed")]
    Time {
        /// The contract's name of the field.
        field: &'static str,
        /// What was given.
        value: f64,
        /// Largest accepted.
        max: f64,
    },
    /// At a quarter turn nothing carries the aircraft, at none nothing turns it.
    #[error("bank_rad = {bank_rad}: a level turn needs a bank above 0 and below pi/2")]
    Bank {
        /// What was given.
        bank_rad: f64,
    },
    /// Less than no turn, or more than a half.
    #[error("max_turn_rad = {max_turn_rad}: a turn above 0 and up to pi is needed")]
    Turn {
        /// What was given.
        max_turn_rad: f64,
    },
    /// An angle that is not finite or beyond a full turn.
    #[error("{field} = {value} rad: an angle from {min:.4} to {max:.4} is needed")]
    Angle {
        /// The contract's name of the field.
        field: &'static str,
        /// What was given.
        value: f64,
        /// Smallest accepted.
        min: f64,
        /// Largest accepted.
        max: f64,
    },
    /// A place or a velocity that is not finite or beyond all aircraft.
    #[error("{field}[{axis}] = {value}: a finite number within {max:e} is needed")]
    Coordinate {
        /// The contract's name of the field.
        field: &'static str,
        /// Which of the three.
        axis: usize,
        /// What was given.
        value: f64,
        /// Largest magnitude accepted.
        max: f64,
    },
    /// Two aircraft at one place.
    #[error("the intruder is {range_m:e} m away: it cannot be where we are")]
    SamePlace {
        /// Its distance, m.
        range_m: f64,
    },
}

impl EncounterError {
    /// The contract's name of the field at fault, for a pointer into the request.
    #[must_use]
    pub const fn field(&self) -> &'static str {
        match self {
            Self::Positive { field, .. }
            | Self::Time { field, .. }
            | Self::Angle { field, .. }
            | Self::Coordinate { field, .. } => field,
            Self::Bank { .. } => "bank_rad",
            Self::Turn { .. } => "max_turn_rad",
            Self::SamePlace { .. } => "position_m",
        }
    }
}

/// Largest speed, distance, size or rate that is taken: far beyond every aircraft, and far from where squares overflow.
const MOST: f64 = 1e6;

/// A number that is above zero and no larger than anything that flies.
///
/// # Errors
/// [`EncounterError::Positive`].
pub fn positive(field: &'static str, value: f64) -> Result<f64, EncounterError> {
    // A thousandth of a millimetre or of a millimetre a second is nothing that flies, and its reciprocal is still a number.
    if (1e-6..=MOST).contains(&value) { Ok(value) } else { Err(EncounterError::Positive { field, value, max: MOST }) }
}
