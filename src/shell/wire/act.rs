//! What is left to do about a target that is tracked: the figures, and what they rest on.

use nalgebra::Rotation3;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;

use super::from_value;
use super::track::UncertainWire;
use crate::encounter::{Delays, EncounterError, Manoeuvre, Means, Side, ToAct, positive};
use crate::geometry::EulerAngles;
use crate::geometry::mount::body_from_forward_camera;
use crate::shell::fault::Fault;

/// What our aircraft can do about an encounter, and what passes before it does. What is left out in a stream is as the settings of the
/// service have it.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = EncounterOptions)]
pub struct ActOptionsWire {
    /// Our speed; 0 is not known, and then nothing is told.
    pub own_speed_mps: f64,
    /// Bank of the turn.
    pub bank_rad: f64,
    /// Time until the bank is there, at a steady roll rate; 0 is at once.
    pub roll_in_s: f64,
    /// How far it turns at most, and then flies straight.
    pub max_turn_rad: f64,
    /// By how much the turn has to clear.
    pub miss_distance_m: f64,
    /// Until it is decided.
    pub decision_s: f64,
    /// On the way to who decides and back.
    pub link_s: f64,
    /// Roll, pitch and yaw of the camera on our aircraft, which flies level: all zero looks forward.
    pub camera_turned_rad: [f64; 3],
}

impl Default for ActOptionsWire {
    fn default() -> Self {
        let turn = Manoeuvre::default();
        Self {
            own_speed_mps: 0.0,
            bank_rad: turn.bank_rad(),
            roll_in_s: 0.0,
            max_turn_rad: turn.max_turn_rad(),
            miss_distance_m: turn.miss_distance_m(),
            decision_s: 0.5,
            link_s: 0.5,
            camera_turned_rad: [0.0; 3],
        }
    }
}

impl ActOptionsWire {
    /// These, with what a stream says differently.
    ///
    /// # Errors
    /// [`FaultKind::Senseless`](crate::shell::fault::FaultKind::Senseless) for what there is not, or is of another kind.
    pub fn with(&self, changes: &Map<String, Value>) -> Result<Self, Fault> {
        let mut merged = serde_json::to_value(self).unwrap_or_default();
        if let Value::Object(merged) = &mut merged {
            merged.extend(changes.iter().map(|(name, value)| (name.clone(), value.clone())));
        }
        from_value(merged)
    }

    /// For the core; nothing where our speed is not known.
    ///
    /// # Errors
    /// Names the option that makes no sense.
    pub fn means(&self) -> Result<Option<Means>, Fault> {
        let refused = |error: EncounterError| {
            let pointer = match error {
                EncounterError::Positive { field: "roll_rate_radps", .. } => "/roll_in_s".into(),
                EncounterError::Positive { field, .. } | EncounterError::Time { field, .. } => format!("/{field}"),
                EncounterError::Bank { .. } => "/bank_rad".into(),
                EncounterError::Turn { .. } => "/max_turn_rad".into(),
                _ => String::new(),
            };
            Fault::senseless(pointer, error.to_string())
        };
        let turn =
            Manoeuvre::checked(self.bank_rad, self.miss_distance_m).and_then(|turn| turn.up_to(self.max_turn_rad));
        let mut manoeuvre = turn.map_err(refused)?;
        if !(0.0..=60.0).contains(&self.roll_in_s) {
            return Err(Fault::senseless("/roll_in_s", "a time from 0 to 60 s is expected"));
        }
        if self.roll_in_s > 0.0 {
            manoeuvre = manoeuvre.rolling(self.bank_rad / self.roll_in_s).map_err(refused)?;
        }
        let delays = Delays::checked(0.0, 0.0, self.link_s, self.decision_s).map_err(refused)?;
        if !self.camera_turned_rad.iter().all(|angle| angle.abs() <= 6.3) {
            return Err(Fault::senseless("/camera_turned_rad", "angles from -6.3 to 6.3 are expected"));
        }
        let [roll_rad, pitch_rad, yaw_rad] = self.camera_turned_rad;
        let turned: Rotation3<f64> = EulerAngles { roll_rad, pitch_rad, yaw_rad }.to_rotation();
        if self.own_speed_mps.abs() < f64::MIN_POSITIVE {
            return Ok(None);
        }
        let own_speed_mps = positive("own_speed_mps", self.own_speed_mps).map_err(refused)?;
        Ok(Some(Means { own_speed_mps, manoeuvre, delays, body_from_camera: turned * body_from_forward_camera() }))
    }
}

/// What is left to do about a target, if its velocity against ours stays as it is, our aircraft flies level and its camera does not turn.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = ToAct)]
pub struct ToActWire {
    /// How it stands.
    pub verdict: ToActName,
    /// From the moment of the track until somebody has to set about the turn: time to the closest approach, less the time that the turn,
    /// the link and the decision take. Negative where that is past. Null where there is no such moment.
    #[schema(required = true)]
    pub time_left_s: Option<UncertainWire>,
    /// Time before the closest approach at which the turn has to begin, by the exact arc.
    #[schema(required = true)]
    pub turn_s: Option<f64>,
    /// To which side.
    #[schema(required = true)]
    pub side: Option<TurnSideName>,
    /// What passes before the turn begins: decision and link.
    pub delay_s: f64,
}

/// How an encounter stands.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = ToActName)]
pub enum ToActName {
    /// There is time left.
    InTime,
    /// The last moment is past, the target is inside the miss distance, or no such turn leads so far.
    TooLate,
    /// The target goes away, or passes outside of the miss distance without a turn, by two deviations at least.
    NoConflict,
    /// Whether it comes nearer is not known yet, or not at what speed, or not whether it passes far enough.
    Undetermined,
}

/// A side.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = TurnSide)]
pub enum TurnSideName {
    /// To the left.
    Left,
    /// To the right.
    Right,
}

impl ToActWire {
    /// What the core says, with these means.
    #[must_use]
    pub fn of(to_act: &ToAct, means: &Means) -> Self {
        let without =
            |verdict| Self { verdict, time_left_s: None, turn_s: None, side: None, delay_s: means.delays.total_s() };
        match to_act {
            ToAct::Turn { time_s, turn } => Self {
                time_left_s: Some((*time_s).into()),
                turn_s: Some(turn.time_s),
                side: Some(if turn.side == Side::Left { TurnSideName::Left } else { TurnSideName::Right }),
                ..without(if time_s.value >= 0.0 { ToActName::InTime } else { ToActName::TooLate })
            },
            ToAct::NoConflict => without(ToActName::NoConflict),
            ToAct::TooLate => without(ToActName::TooLate),
            ToAct::Undetermined => without(ToActName::Undetermined),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn changed(changes: &Value) -> Result<Option<Means>, Fault> {
        ActOptionsWire::default().with(changes.as_object().expect("an object"))?.means()
    }

    #[test]
    fn without_our_speed_nothing_is_told_and_with_it_the_turn_is_that_of_the_options() {
        assert_eq!(changed(&json!({})), Ok(None));
        let means =
            changed(&json!({"own_speed_mps": 20, "bank_rad": 0.5, "roll_in_s": 2, "decision_s": 3})).expect("sense");
        let means = means.expect("a speed");
        assert!((means.manoeuvre.roll_in_s() - 2.0).abs() < 1e-12 && (means.delays.total_s() - 3.5).abs() < 1e-12);
        assert!((means.body_from_camera * nalgebra::Vector3::z() - nalgebra::Vector3::x()).norm() < 1e-12);
    }

    #[test]
    fn what_makes_no_sense_is_named() {
        for (changes, pointer) in [
            (json!({"own_speed_mps": -1}), "/own_speed_mps"),
            (json!({"bank_rad": 1.6}), "/bank_rad"),
            (json!({"miss_distance_m": 0}), "/miss_distance_m"),
            (json!({"roll_in_s": -1}), "/roll_in_s"),
            (json!({"max_turn_rad": 4}), "/max_turn_rad"),
            (json!({"decision_s": -1}), "/decision_s"),
            (json!({"link_s": "long"}), "/link_s"),
            (json!({"camera_turned_rad": [7, 0, 0]}), "/camera_turned_rad/0"),
            (json!({"speed": 1}), "/speed"),
        ] {
            let fault = changed(&changes).expect_err(pointer);
            let found = fault.pointer.as_deref().unwrap_or_default();
            assert!(pointer.starts_with(found) && !found.is_empty(), "{pointer}: {fault}");
        }
    }
}
