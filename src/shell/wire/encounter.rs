//! How early must it be seen, and can this camera do it: request of `POST /v1/encounters`.

#![expect(
    clippy::approx_constant,
    reason = "limits in the document are literals; the core checks against the constants"
)]

mod reply;
mod view;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

pub use reply::{EncounterReply, NoTurnName};
pub use view::{MeasureName, TaskName, TaskWire};

use super::reference::{CameraOrName, TargetOrName};
use super::{CameraWire, Ref, TargetWire};
use crate::encounter::{Airspace, Manoeuvre, Scenario, Side, Turn};

/// Two aircraft, what ours does to keep clear, and with what camera it looks. Every field has a default: `{}` is the thesis' head-on case.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct EncounterRequest {
    /// Copied to the reply.
    #[serde(default)]
    pub id: Option<Value>,
    /// The thesis' case: the intruder comes straight ahead, or crosses at a right angle from the right to the left. Head-on, if no
    /// `intruder_course_rad` and no `relative` say otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<ScenarioName>,
    /// Instead of a scenario: the intruder's course turned from ours, positive to the right. Pi comes towards us, 0 flies along.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -6.283_185_307_179_586, maximum = 6.283_185_307_179_586)]
    pub intruder_course_rad: Option<f64>,
    /// Instead of both, of `intruder_speed_mps` and of `range_m`: where the intruder is now and how it moves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative: Option<RelativeWire>,
    /// Our speed; 50 knots.
    #[serde(default = "speed_mps")]
    #[schema(exclusive_minimum = 0, maximum = 1e6, default = 25.722_222_222_222_22)]
    pub own_speed_mps: f64,
    /// The intruder's speed; 50 knots.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, maximum = 1e6, default = 25.722_222_222_222_22)]
    pub intruder_speed_mps: Option<f64>,
    /// Distance of the two now; if left out, the largest that the airspace has room for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, maximum = 1e6)]
    pub range_m: Option<f64>,
    /// Bank of the turn.
    #[serde(default = "bank_rad")]
    #[schema(exclusive_minimum = 0, exclusive_maximum = 1.570_796_326_794_896_6, default = 0.785_398_163_397_448_3)]
    pub bank_rad: f64,
    /// How far the turn has to clear the intruder; 500 ft.
    #[serde(default = "miss_distance_m")]
    #[schema(exclusive_minimum = 0, maximum = 1e6, default = 152.4)]
    pub miss_distance_m: f64,
    /// By which reckoning `time_to_avoid_s` and what follows from it are told.
    #[serde(default)]
    pub turn: TurnName,
    /// To which side it turns.
    #[serde(default)]
    pub side: SideName,
    /// How far it turns before it flies straight on; a quarter turn.
    #[serde(default = "max_turn_rad")]
    #[schema(exclusive_minimum = 0, maximum = 3.141_592_653_589_793, default = 1.570_796_326_794_896_6)]
    pub max_turn_rad: f64,
    /// How fast the bank grows, rad/s; if neither this nor `roll_in_s` is given, it is there at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, maximum = 1e6)]
    pub roll_rate_radps: Option<f64>,
    /// Instead: the time until the bank is there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 86_400)]
    pub roll_in_s: Option<f64>,
    /// What passes between the first sight and the turn. What is left out counts as nothing.
    #[serde(default)]
    pub delays: DelaysWire,
    /// Width of the intruder, square to the line of sight; that of the demo's wing.
    #[serde(default = "target_width_m")]
    #[schema(exclusive_minimum = 0, maximum = 1e6, default = 1.4)]
    pub target_width_m: f64,
    /// Its height; if left out, a fifth of its width. Its silhouette is the ellipse in this box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, maximum = 1e6)]
    pub target_height_m: Option<f64>,
    /// The airspace in which they fly.
    #[serde(default)]
    pub airspace: AirspaceWire,
    /// Our camera, or the name of a stored one: `view` in the reply.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<CameraOrName>)]
    pub camera: Option<Ref<CameraWire>>,
    /// How far it is turned from our course, positive to the right.
    #[serde(default)]
    #[schema(minimum = -3.141_592_653_589_793, maximum = 3.141_592_653_589_793, default = 0)]
    pub camera_azimuth_rad: f64,
    /// How far it is turned up from the level.
    #[serde(default)]
    #[schema(minimum = -1.570_796_326_794_896_6, maximum = 1.570_796_326_794_896_6, default = 0)]
    pub camera_elevation_rad: f64,
    /// The markers on the intruder, or the name of a stored target: what of them can be used. Needs a `camera`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<TargetOrName>)]
    pub target: Option<Ref<TargetWire>>,
    /// Between the line of sight and the front of the target; 30 degrees.
    #[serde(default = "aspect_rad")]
    #[schema(minimum = 0, maximum = 3.141_592_653_589_793, default = 0.523_598_775_598_298_8)]
    pub aspect_rad: f64,
    /// Standard deviation of a marker's centroid per axis, px.
    #[serde(default = "pixel_sigma")]
    #[schema(minimum = 0.001, maximum = 100, default = 0.3)]
    pub pixel_sigma: f64,
    /// Draw the pictures: `figures` in the reply.
    #[serde(default)]
    pub figures: bool,
}

impl Default for EncounterRequest {
    fn default() -> Self {
        Self {
            id: None,
            scenario: None,
            intruder_course_rad: None,
            relative: None,
            own_speed_mps: speed_mps(),
            intruder_speed_mps: None,
            range_m: None,
            bank_rad: bank_rad(),
            miss_distance_m: miss_distance_m(),
            turn: TurnName::default(),
            side: SideName::default(),
            max_turn_rad: max_turn_rad(),
            roll_rate_radps: None,
            roll_in_s: None,
            delays: DelaysWire::default(),
            target_width_m: target_width_m(),
            target_height_m: None,
            airspace: AirspaceWire::default(),
            camera: None,
            camera_azimuth_rad: 0.0,
            camera_elevation_rad: 0.0,
            target: None,
            aspect_rad: aspect_rad(),
            pixel_sigma: pixel_sigma(),
            figures: false,
        }
    }
}

const fn speed_mps() -> f64 {
    Scenario::SPEED_MPS
}

fn bank_rad() -> f64 {
    Manoeuvre::default().bank_rad()
}

fn miss_distance_m() -> f64 {
    Manoeuvre::default().miss_distance_m()
}

fn max_turn_rad() -> f64 {
    Manoeuvre::default().max_turn_rad()
}

const fn target_width_m() -> f64 {
    1.4
}

const fn aspect_rad() -> f64 {
    std::f64::consts::FRAC_PI_6
}

fn pixel_sigma() -> f64 {
    crate::assess::AssessOptions::default().pixel_sigma
}

/// A case of the thesis.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
#[schema(as = EncounterScenario)]
pub enum ScenarioName {
    /// The intruder comes straight ahead.
    HeadOn,
    /// The intruder crosses our course at a right angle, from the right to the left.
    Crossing,
}

impl From<ScenarioName> for Scenario {
    fn from(name: ScenarioName) -> Self {
        match name {
            ScenarioName::HeadOn => Self::HeadOn,
            ScenarioName::Crossing => Self::Crossing,
        }
    }
}

/// How a turn is reckoned.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = EncounterTurn)]
pub enum TurnName {
    /// The exact arc, against the intruder's own motion, closest approach over the whole path.
    #[default]
    Arc,
    /// The thesis' parabola, sqrt(2 r cot(bank) / g): head-on and for short turns only, else too late.
    Parabolic,
}

impl From<TurnName> for Turn {
    fn from(name: TurnName) -> Self {
        match name {
            TurnName::Arc => Self::Arc,
            TurnName::Parabolic => Self::Parabolic,
        }
    }
}

/// To which side our aircraft turns.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = EncounterSide)]
pub enum SideName {
    /// To the left.
    Left,
    /// To the right.
    Right,
    /// To the side on which the turn may begin later.
    #[default]
    Either,
}

impl From<SideName> for Side {
    fn from(name: SideName) -> Self {
        match name {
            SideName::Left => Self::Left,
            SideName::Right => Self::Right,
            SideName::Either => Self::Either,
        }
    }
}

impl From<Side> for SideName {
    fn from(side: Side) -> Self {
        match side {
            Side::Left => Self::Left,
            Side::Right => Self::Right,
            Side::Either => Self::Either,
        }
    }
}

/// Where an intruder is and how it moves as seen from us, along our level axes before the turn: forward along our course, right, down.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RelativeState)]
pub struct RelativeWire {
    /// Its place less ours.
    pub position_m: [f64; 3],
    /// Its velocity less ours.
    pub velocity_mps: [f64; 3],
}

/// What passes between the first sight and the turn.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
#[schema(as = EncounterDelays)]
pub struct DelaysWire {
    /// Until the detector has found it.
    #[schema(minimum = 0, maximum = 86_400, default = 0)]
    pub detection_s: f64,
    /// Until a track is believed.
    #[schema(minimum = 0, maximum = 86_400, default = 0)]
    pub track_s: f64,
    /// On the way to who decides, and back.
    #[schema(minimum = 0, maximum = 86_400, default = 0)]
    pub link_s: f64,
    /// Until it is decided.
    #[schema(minimum = 0, maximum = 86_400, default = 0)]
    pub decision_s: f64,
}

/// A box of air; the thesis' "4 km by 500 m by 2 km", of which it does not say which is the height.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
#[schema(as = Airspace)]
pub struct AirspaceWire {
    /// Along our course.
    #[schema(exclusive_minimum = 0, maximum = 1e6, default = 4000)]
    pub length_m: f64,
    /// Across it.
    #[schema(exclusive_minimum = 0, maximum = 1e6, default = 2000)]
    pub width_m: f64,
    /// Up.
    #[schema(exclusive_minimum = 0, maximum = 1e6, default = 500)]
    pub height_m: f64,
}

impl Default for AirspaceWire {
    fn default() -> Self {
        let [length_m, width_m, height_m] = Airspace::default().size_m();
        Self { length_m, width_m, height_m }
    }
}
