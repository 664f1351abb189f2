//! The reply of `POST /v1/encounters`.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use utoipa::ToSchema;

use super::view::ViewWire;
use super::{SideName, TurnName};
use crate::encounter::{Answer, LatestTurn, Needed, NoTurn, Question, Room, Turns};
use crate::plot::Picture;

/// When to act, from how far the intruder must be seen, and whether the camera can do it. Times count back from the closest approach that
/// comes without a turn.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct EncounterReply {
    /// The request's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<Value>,
    /// How fast the distance shrinks: -(p . v) / |p|.
    pub closing_speed_mps: f64,
    /// Distance now.
    pub range_m: f64,
    /// Our speed.
    pub own_speed_mps: f64,
    /// The intruder's.
    pub intruder_speed_mps: f64,
    /// Where the intruder is now, from our course: positive to the right.
    pub azimuth_rad: f64,
    /// Where it is now, from the level: positive up.
    pub elevation_rad: f64,
    /// When the two are nearest without a turn, and how near; null where they do not come nearer.
    pub closest_approach: Option<ApproachWire>,
    /// By which reckoning what follows is told.
    pub turn: TurnName,
    /// Time before the closest approach at which the turn must begin, roll-in included; null, with a `reason`, where there is none.
    pub time_to_avoid_s: Option<f64>,
    /// Distance of the two then.
    pub distance_to_avoid_m: Option<f64>,
    /// Time before the closest approach at which the intruder must be in sight: with all delays.
    pub time_to_detect_s: Option<f64>,
    /// Distance of the two then.
    pub distance_to_detect_m: Option<f64>,
    /// The angle that the intruder's width fills then: 2 atan(w / 2d).
    pub arc_width_rad: Option<f64>,
    /// From now until the intruder must be in sight; negative where that has passed.
    pub time_left_s: Option<f64>,
    /// Whether some time is left; null where nothing has to be done or nothing can be.
    pub in_time: Option<bool>,
    /// Why no turn is told.
    pub reason: Option<NoTurnName>,
    /// The same in a sentence with the numbers.
    pub detail: Option<String>,
    /// The turn by itself.
    pub manoeuvre: ManoeuvreWire,
    /// The last moment by each reckoning.
    pub turns: TurnsWire,
    /// The delays together.
    pub delays_s: f64,
    /// What the airspace has room for; null for a `relative` state.
    pub airspace: Option<RoomWire>,
    /// What our camera sees; null without one.
    pub view: Option<ViewWire>,
    /// The pictures by name (SVG), with `figures` only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub figures: Option<BTreeMap<String, String>>,
    /// Time taken, microseconds.
    pub elapsed_us: f64,
}

/// Two straight paths at their nearest.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncounterApproach)]
pub struct ApproachWire {
    /// From now until then.
    pub time_s: f64,
    /// Distance then.
    pub miss_m: f64,
}

/// Why no turn is told.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoTurnName {
    /// The two do not come nearer.
    NeverClosing,
    /// The intruder is within the miss distance already.
    InsideMissDistance,
    /// They pass far enough from each other without a turn.
    NotNeeded,
    /// However early it begins, the turn does not lead so far from the intruder's track.
    MissDistanceUnreachable,
}

/// The turn by itself.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncounterManoeuvre)]
pub struct ManoeuvreWire {
    /// Radius at the full bank.
    pub radius_m: f64,
    /// Rate at the full bank, rad/s.
    pub turn_rate_radps: f64,
    /// Lift over weight at the full bank.
    pub load_factor: f64,
    /// Time until the full bank.
    pub roll_in_s: f64,
    /// The rate at which it comes, rad/s; null for at once.
    pub roll_rate_radps: Option<f64>,
}

/// The last moment by each reckoning; null where there is none.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncounterTurns)]
pub struct TurnsWire {
    /// The exact arc to the side that was asked for.
    pub arc: Option<LatestTurnWire>,
    /// The exact arc to the left.
    pub left: Option<LatestTurnWire>,
    /// The exact arc to the right.
    pub right: Option<LatestTurnWire>,
    /// The thesis' parabola: too late but for short turns head-on.
    pub parabolic: ParabolaWire,
}

/// The last moment of a turn.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncounterLatestTurn)]
pub struct LatestTurnWire {
    /// Before the closest approach.
    pub time_s: f64,
    /// Distance of the two then.
    pub distance_m: f64,
    /// To which side.
    pub side: SideName,
    /// From its beginning until the two are nearest.
    pub nearest_s: f64,
    /// How far our aircraft has turned by then.
    pub turned_rad: f64,
}

/// The last moment by the parabola.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncounterParabola)]
pub struct ParabolaWire {
    /// Before the closest approach.
    pub time_s: f64,
    /// Distance of the two then.
    pub distance_m: f64,
}

/// What the airspace has room for.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncounterRoom)]
pub struct RoomWire {
    /// The longest time before the collision at which both are inside.
    pub longest_s: f64,
    /// Distance of the two then.
    pub range_m: f64,
    /// Whether the intruder can be in sight within it as early as it must be; null without a turn.
    pub enough: Option<bool>,
}

impl EncounterReply {
    /// Of an answer, without pictures.
    #[must_use]
    pub fn of(question: &Question, turn: TurnName, answer: &Answer) -> Self {
        let needed = answer.needed.as_ref().ok();
        let why = answer.needed.as_ref().err();
        let told = |value: fn(&Needed) -> f64| needed.map(value);
        let manoeuvre = &question.manoeuvre;
        let [azimuth_rad, elevation_rad] = answer.state.bearing_rad();
        Self {
            id: None,
            closing_speed_mps: answer.state.closing_speed_mps(),
            range_m: answer.state.range_m(),
            own_speed_mps: answer.own_speed_mps,
            intruder_speed_mps: answer.intruder_speed_mps,
            azimuth_rad: plain(azimuth_rad),
            elevation_rad: plain(elevation_rad),
            closest_approach: answer
                .approach
                .map(|approach| ApproachWire { time_s: approach.time_s, miss_m: approach.miss_m }),
            turn,
            time_to_avoid_s: told(|n| n.time_to_avoid_s),
            distance_to_avoid_m: told(|n| n.distance_to_avoid_m),
            time_to_detect_s: told(|n| n.time_to_detect_s),
            distance_to_detect_m: told(|n| n.distance_to_detect_m),
            arc_width_rad: told(|n| n.arc_width_rad),
            time_left_s: told(|n| n.time_left_s),
            in_time: needed.map(|n| n.time_left_s >= 0.0),
            reason: why.map(Into::into),
            detail: why.map(ToString::to_string),
            manoeuvre: ManoeuvreWire {
                radius_m: manoeuvre.radius_m(answer.own_speed_mps),
                turn_rate_radps: manoeuvre.turn_rate_radps(answer.own_speed_mps),
                load_factor: manoeuvre.load_factor(),
                roll_in_s: manoeuvre.roll_in_s(),
                roll_rate_radps: manoeuvre.roll_rate_radps(),
            },
            turns: (&answer.turns).into(),
            delays_s: question.delays.total_s(),
            airspace: answer.room.map(|Room { longest_s, range_m }| RoomWire {
                longest_s,
                range_m,
                enough: needed.map(|n| n.time_to_detect_s <= longest_s),
            }),
            view: answer.view.as_ref().map(Into::into),
            figures: None,
            elapsed_us: 0.0,
        }
    }

    /// With pictures.
    #[must_use]
    pub fn with_figures(self, pictures: &[Picture]) -> Self {
        let drawn = pictures.iter().map(|picture| (picture.name.clone(), picture.figure.svg()));
        Self { figures: Some(drawn.collect()), ..self }
    }
}

/// A negative zero would be written as -0.0.
pub(super) fn plain(value: f64) -> f64 {
    value + 0.0
}

impl From<&NoTurn> for NoTurnName {
    fn from(why: &NoTurn) -> Self {
        match why {
            NoTurn::NeverClosing { .. } => Self::NeverClosing,
            NoTurn::InsideMissDistance { .. } => Self::InsideMissDistance,
            NoTurn::NotNeeded { .. } => Self::NotNeeded,
            NoTurn::Unreachable { .. } => Self::MissDistanceUnreachable,
        }
    }
}

impl From<&Turns> for TurnsWire {
    fn from(turns: &Turns) -> Self {
        let wire = |turn: &Result<LatestTurn, NoTurn>| turn.as_ref().ok().map(Into::into);
        let (time_s, distance_m) = turns.parabolic;
        Self {
            arc: wire(&turns.arc),
            left: wire(&turns.left),
            right: wire(&turns.right),
            parabolic: ParabolaWire { time_s, distance_m },
        }
    }
}

impl From<&LatestTurn> for LatestTurnWire {
    fn from(turn: &LatestTurn) -> Self {
        Self {
            time_s: turn.time_s,
            distance_m: turn.distance_m,
            side: turn.side.into(),
            nearest_s: turn.nearest_s,
            turned_rad: turn.turned_rad,
        }
    }
}
