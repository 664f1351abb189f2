//! The reply of `POST /v1/encounters`.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use utoipa::ToSchema;

use super::{SideName, TurnName};
use crate::encounter::{
    Answer, Covered, Expected, Feasibility, LatestTurn, Measure, Needed, NoTurn, Picture, Question, Regard, Room, Task,
    Turns, View,
};
use crate::shell::wire::assessment::CellWire;

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

/// What a camera sees of the encounter.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncounterView)]
pub struct ViewWire {
    /// The distance at which it looks: that at which the intruder must be in sight, or without a turn that of now.
    pub distance_m: f64,
    /// Where the intruder is then, from our course: positive to the right.
    pub azimuth_rad: f64,
    /// Where it is then, from the level: positive up.
    pub elevation_rad: f64,
    /// Whether that is on the picture.
    pub in_picture: bool,
    /// Where it is in the picture, lens included; null where it is not on it.
    pub pixel: Option<[f64; 2]>,
    /// The intruder's width in the picture; in its middle where it is not on it.
    pub width_px: f64,
    /// The intruder's height in the picture, likewise.
    pub height_px: f64,
    /// The area of its silhouette, likewise.
    pub area_px: f64,
    /// What of the pipeline that allows.
    pub tasks: Vec<TaskWire>,
    /// What is to be expected of the markers there; null without a target.
    pub expected: Option<ExpectedWire>,
    /// What the camera covers of the directions in which guidance asks to look.
    pub field_of_regard: RegardWire,
}

/// Something that the pipeline does, and whether it can be done.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncounterTask)]
pub struct TaskWire {
    /// What.
    pub task: TaskName,
    /// On what it depends.
    pub measure: MeasureName,
    /// What there is of that; null where nothing is.
    pub found: Option<f64>,
    /// What it takes: at least so much, of `flip_rate` at most.
    pub needed: f64,
    /// Whether there is enough, and the intruder on the picture.
    pub feasible: bool,
    /// Up to this distance there is enough in the middle of the picture; null where there is at none.
    pub reach_m: Option<f64>,
}

/// Something that the pipeline does.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = EncounterTaskName)]
pub enum TaskName {
    /// The aircraft is found without markers.
    Detection,
    /// It is told from a bird.
    Classification,
    /// Its markers are found by their colour.
    MarkerDetection,
    /// Its markers are told apart.
    Identification,
    /// Its pose is known, and not the wrong one of two.
    Pose,
}

/// On what a task depends.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = EncounterMeasure)]
pub enum MeasureName {
    /// Area of the silhouette, px.
    AreaPx,
    /// Area of the smallest marker, px.
    MarkerAreaPx,
    /// Share of simulated pictures in which the markers are told apart rightly.
    IdentifiedRate,
    /// Share of simulated poses that are the wrong minimum, where the markers are told apart.
    FlipRate,
}

/// What is to be expected of the markers, in the middle of the picture.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncounterExpected)]
pub struct ExpectedWire {
    /// Rates and errors, counted on simulated noise; as in an assessment.
    pub cell: CellWire,
    /// A pose there, its translation; null, like the next, where the markers do not fix it.
    pub translation_m: Option<[f64; 3]>,
    /// The least covariance that this pose can have (Cramer-Rao), in the order of every pose's.
    pub covariance: Option<Vec<Vec<f64>>>,
}

/// What a camera covers.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = FieldOfRegard)]
pub struct RegardWire {
    /// Left and right end of the picture at the horizon; null where it does not see that in the direction of its axis.
    pub azimuth_rad: Option<[f64; 2]>,
    /// Lower and upper end of the picture in the azimuth of its axis.
    pub elevation_rad: Option<[f64; 2]>,
    /// The whole picture.
    pub solid_angle_sr: f64,
    /// Against each guidance.
    pub guidance: Vec<GuidanceWire>,
}

/// How much of a guidance's directions the camera covers. No standard is claimed to be met: none of these is about such a camera.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = GuidanceCovered)]
pub struct GuidanceWire {
    /// The document.
    pub source: String,
    /// What it is about.
    pub about: String,
    /// Its azimuths.
    pub azimuth_rad: [f64; 2],
    /// Its elevations; null where it has none, and the horizon stands for them.
    pub elevation_rad: Option<[f64; 2]>,
    /// Share of the solid angle covered; without elevations, of the horizon.
    pub covered_ratio: f64,
    /// Share of the azimuths at the horizon.
    pub azimuth_ratio: f64,
    /// Share of the elevations straight ahead; null where it has none.
    pub elevation_ratio: Option<f64>,
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
        let drawn = pictures.iter().map(|picture| (picture.name.to_owned(), picture.figure.svg()));
        Self { figures: Some(drawn.collect()), ..self }
    }
}

/// A negative zero would be written as -0.0.
fn plain(value: f64) -> f64 {
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

impl From<&View> for ViewWire {
    fn from(view: &View) -> Self {
        let sighting = &view.sighting;
        let [azimuth_rad, elevation_rad] = view.bearing_rad.map(plain);
        Self {
            distance_m: view.distance_m,
            azimuth_rad,
            elevation_rad,
            in_picture: sighting.is_in_picture,
            pixel: sighting.pixel.filter(|_| sighting.is_in_picture).map(Into::into),
            width_px: sighting.size_px[0],
            height_px: sighting.size_px[1],
            area_px: sighting.area_px,
            tasks: view.tasks.iter().map(Into::into).collect(),
            expected: view.expected.as_ref().map(Into::into),
            field_of_regard: (&view.regard).into(),
        }
    }
}

impl From<&Feasibility> for TaskWire {
    fn from(found: &Feasibility) -> Self {
        Self {
            task: match found.task {
                Task::Detection => TaskName::Detection,
                Task::Classification => TaskName::Classification,
                Task::Markers => TaskName::MarkerDetection,
                Task::Identification => TaskName::Identification,
                Task::Pose => TaskName::Pose,
            },
            measure: match found.measure {
                Measure::AreaPx => MeasureName::AreaPx,
                Measure::MarkerAreaPx => MeasureName::MarkerAreaPx,
                Measure::IdentifiedRate => MeasureName::IdentifiedRate,
                Measure::FlipRate => MeasureName::FlipRate,
            },
            found: found.found,
            needed: found.needed,
            feasible: found.feasible,
            reach_m: found.reach_m,
        }
    }
}

impl From<&Expected> for ExpectedWire {
    fn from(expected: &Expected) -> Self {
        let rows = |matrix: &nalgebra::Matrix6<f64>| {
            matrix.row_iter().map(|row| row.iter().copied().collect()).collect::<Vec<Vec<f64>>>()
        };
        Self {
            cell: (&expected.cell).into(),
            translation_m: expected.pose.map(|(pose, _)| pose.translation.into()),
            covariance: expected.pose.map(|(_, covariance)| rows(covariance.matrix())),
        }
    }
}

impl From<&Regard> for RegardWire {
    fn from(regard: &Regard) -> Self {
        Self {
            azimuth_rad: regard.azimuth_rad,
            elevation_rad: regard.elevation_rad,
            solid_angle_sr: regard.solid_angle_sr,
            guidance: regard.covered.iter().map(Into::into).collect(),
        }
    }
}

impl From<&Covered> for GuidanceWire {
    fn from(covered: &Covered) -> Self {
        let guidance = &covered.guidance;
        Self {
            source: guidance.source.to_owned(),
            about: guidance.about.to_owned(),
            azimuth_rad: [-guidance.azimuth_rad, guidance.azimuth_rad],
            elevation_rad: guidance.elevation_rad,
            covered_ratio: covered.ratio,
            azimuth_ratio: covered.azimuth_ratio,
            elevation_ratio: covered.elevation_ratio,
        }
    }
}
