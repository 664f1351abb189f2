//! When there is an alarm, and the turn that follows it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::standard;
use crate::encounter::{EncounterError, Manoeuvre};
use crate::evaluate::encounters::Alarm;
use crate::shell::wire::encounter::SideName;

/// When there is an alarm: a track is believed, and by it the two pass within the miss distance.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = Alert)]
pub struct AlertWire {
    /// From the frame that gives the alarm to the beginning of the turn: computing, link, decision; 0.25 if left out.
    pub delay_s: f64,
    /// They pass within the miss distance and so many of its own deviations: the more, the earlier, and the more often for nothing. 1 if left out.
    pub sigmas: f64,
    /// Alarms wait until so long before the last moment for the turn; null (and if left out) for not at all.
    pub lead_s: Option<f64>,
}

impl Default for AlertWire {
    fn default() -> Self {
        let Alarm { delay_s, sigmas, lead_s } = standard().alarm;
        Self { delay_s, sigmas, lead_s }
    }
}

/// A level turn.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = AvoidanceTurn)]
pub struct ManoeuvreWire {
    /// Bank; 45 degrees if left out.
    pub bank_rad: f64,
    /// Distance by which the intruder is to be cleared; 6 if left out.
    pub miss_distance_m: f64,
    /// How fast the bank grows, pi/2 if left out; null for at once.
    pub roll_rate_radps: Option<f64>,
    /// How far it turns; pi/2 if left out.
    pub max_turn_rad: f64,
    /// To which side; `either` is the one where the track shows more room, the right one where both are alike.
    pub side: SideName,
}

impl Default for ManoeuvreWire {
    fn default() -> Self {
        let manoeuvre = standard().manoeuvre;
        Self {
            bank_rad: manoeuvre.bank_rad(),
            miss_distance_m: manoeuvre.miss_distance_m(),
            roll_rate_radps: manoeuvre.roll_rate_radps(),
            max_turn_rad: manoeuvre.max_turn_rad(),
            side: SideName::Either,
        }
    }
}

impl TryFrom<&ManoeuvreWire> for Manoeuvre {
    type Error = EncounterError;

    fn try_from(wire: &ManoeuvreWire) -> Result<Self, EncounterError> {
        let turn = Self::checked(wire.bank_rad, wire.miss_distance_m)?.up_to(wire.max_turn_rad)?.to(wire.side.into());
        wire.roll_rate_radps.map_or(Ok(turn), |rate| turn.rolling(rate))
    }
}
