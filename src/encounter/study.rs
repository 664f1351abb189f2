//! One encounter from all sides: when to act, from how far it must be seen, and whether a camera can do it there.

use nalgebra::Vector3;

use super::airspace::Airspace;
use super::approach::{Approach, RelativeState};
use super::avoid::{LatestTurn, NoTurn, latest_turn};
use super::course::Course;
use super::delays::Delays;
use super::error::{EncounterError, positive};
use super::eye::{Eye, Sighting, arc_width_rad};
use super::manoeuvre::{Manoeuvre, Side};
use super::parabola::parabolic_time_s;
use super::regard::Regard;
use super::tasks::{Expected, Feasibility, marked, unmarked};
use crate::assess::AssessOptions;
use crate::target::Target;

/// Where the two are and how they move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Situation {
    /// On their way to where they meet, this far apart; if left out, as far as the airspace allows.
    Meeting {
        /// Speeds and courses.
        course: Course,
        /// Distance, m.
        range_m: Option<f64>,
    },
    /// As somebody says, our aircraft flying along x.
    Given {
        /// The intruder.
        state: RelativeState,
        /// Our speed, m/s.
        own_speed_mps: f64,
    },
}

/// How the turn is reckoned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Turn {
    /// The exact arc.
    #[default]
    Arc,
    /// The thesis' parabola.
    Parabolic,
}

/// A constellation on the intruder.
#[derive(Clone, Debug, PartialEq)]
pub struct Marked {
    /// The constellation.
    pub target: Target,
    /// Between the line of sight and its front, rad.
    pub aspect_rad: f64,
    /// The noise of its centroids, and how they are told apart.
    pub options: AssessOptions,
}

/// What is asked.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// The two aircraft.
    pub situation: Situation,
    /// What ours does.
    pub manoeuvre: Manoeuvre,
    /// How that is reckoned.
    pub turn: Turn,
    /// What passes before.
    pub delays: Delays,
    /// Width and height of the intruder, m.
    pub size_m: [f64; 2],
    /// Where they fly.
    pub airspace: Airspace,
    /// Our camera.
    pub eye: Option<Eye>,
    /// Markers on the intruder.
    pub marked: Option<Marked>,
}

/// What the turn needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Needed {
    /// Before the closest approach the turn begins, s.
    pub time_to_avoid_s: f64,
    /// Distance then, m.
    pub distance_to_avoid_m: f64,
    /// Before the closest approach the intruder must be in sight: with all delays, s.
    pub time_to_detect_s: f64,
    /// Distance then, m.
    pub distance_to_detect_m: f64,
    /// The angle that the intruder's width fills then, rad.
    pub arc_width_rad: f64,
    /// From now until the intruder must be in sight, s; negative where that has passed.
    pub time_left_s: f64,
}

/// The last moments by every way of reckoning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turns {
    /// By the arc, to the left.
    pub left: Result<LatestTurn, NoTurn>,
    /// By the arc, to the right.
    pub right: Result<LatestTurn, NoTurn>,
    /// By the arc, to the side that was asked for.
    pub arc: Result<LatestTurn, NoTurn>,
    /// By the parabola: time and distance.
    pub parabolic: (f64, f64),
}

/// How far the intruder can be and still meet us within the airspace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Time before they meet, s.
    pub longest_s: f64,
    /// Distance then, m.
    pub range_m: f64,
}

/// What our camera sees.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The distance, m: that at which the intruder must be in sight, or without a turn that of now.
    pub distance_m: f64,
    /// Azimuth and elevation of the intruder there, rad.
    pub bearing_rad: [f64; 2],
    /// The intruder in the picture.
    pub sighting: Sighting,
    /// What can be done with that.
    pub tasks: Vec<Feasibility>,
    /// Of its markers.
    pub expected: Option<Expected>,
    /// What the camera covers.
    pub regard: Regard,
}

/// What is known of an encounter.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The intruder as seen from us.
    pub state: RelativeState,
    /// Our speed, m/s.
    pub own_speed_mps: f64,
    /// The intruder's, m/s.
    pub intruder_speed_mps: f64,
    /// When they are nearest without a turn; `None` where they do not come nearer.
    pub approach: Option<Approach>,
    /// What the turn needs, or why there is none.
    pub needed: Result<Needed, NoTurn>,
    /// By every way of reckoning.
    pub turns: Turns,
    /// In the airspace; `None` for a given situation.
    pub room: Option<Room>,
    /// By our camera, if there is one.
    pub view: Option<View>,
}

/// Farthest that an encounter is begun at, m.
const FARTHEST_M: f64 = 5e5;

impl Question {
    /// What is known of the encounter.
    ///
    /// # Errors
    /// The distance makes no encounter.
    pub fn answer(&self) -> Result<Answer, EncounterError> {
        let (state, own_speed_mps, room) = self.start()?;
        let approach = state.closest_approach();
        let turns = self.turns(&state, own_speed_mps);
        let needed = self.needed(&state, approach, &turns);
        let intruder = state.velocity_mps() + Vector3::x() * own_speed_mps;
        let view = self.eye.as_ref().map(|eye| self.view(eye, &state, needed.as_ref().ok()));
        Ok(Answer { own_speed_mps, intruder_speed_mps: intruder.norm(), approach, needed, turns, room, view, state })
    }

    fn start(&self) -> Result<(RelativeState, f64, Option<Room>), EncounterError> {
        match self.situation {
            Situation::Given { state, own_speed_mps } => Ok((state, positive("own_speed_mps", own_speed_mps)?, None)),
            Situation::Meeting { course, range_m } => {
                let longest_s = self.airspace.longest_s(&course);
                let room = Room { longest_s, range_m: longest_s * course.closing_speed_mps() };
                let range_m = match range_m {
                    Some(range_m) => positive("range_m", range_m)?,
                    None if course.closing_speed_mps() > 0.0 => room.range_m.clamp(1.0, FARTHEST_M),
                    None => self.airspace.size_m()[0],
                };
                let state = match course.at_range(range_m) {
                    Some(state) => state,
                    // Side by side, they stay as they are: one behind the other.
                    None => RelativeState::checked(Vector3::x() * range_m, Vector3::zeros())?,
                };
                Ok((state, course.own_speed_mps(), Some(room)))
            }
        }
    }

    fn turns(&self, state: &RelativeState, own_speed_mps: f64) -> Turns {
        let arc = |side: Side| latest_turn(state, own_speed_mps, &self.manoeuvre.to(side));
        let time_s = parabolic_time_s(&self.manoeuvre);
        Turns {
            left: arc(Side::Left),
            right: arc(Side::Right),
            arc: arc(self.manoeuvre.side()),
            parabolic: (time_s, distance_m(state, time_s)),
        }
    }

    fn needed(&self, state: &RelativeState, approach: Option<Approach>, turns: &Turns) -> Result<Needed, NoTurn> {
        let (time_to_avoid_s, distance_to_avoid_m) = match (self.turn, turns.arc) {
            (Turn::Arc, Ok(arc)) => (arc.time_s, arc.distance_m),
            // It knows of no turn that leads nowhere.
            (Turn::Parabolic, Ok(_) | Err(NoTurn::Unreachable { .. })) => turns.parabolic,
            (_, Err(why)) => return Err(why),
        };
        let time_to_detect_s = time_to_avoid_s + self.delays.total_s();
        let distance_to_detect_m = distance_m(state, time_to_detect_s);
        Ok(Needed {
            time_to_avoid_s,
            distance_to_avoid_m,
            time_to_detect_s,
            distance_to_detect_m,
            arc_width_rad: arc_width_rad(self.size_m[0], distance_to_detect_m),
            time_left_s: approach.map_or(0.0, |approach| approach.time_s) - time_to_detect_s,
        })
    }

    fn view(&self, eye: &Eye, state: &RelativeState, needed: Option<&Needed>) -> View {
        let time_s = needed.map_or(0.0, |needed| needed.time_left_s);
        let position = state.position_m() + state.velocity_mps() * time_s;
        let distance_m = position.norm();
        let sighting = eye.sighting(&position, self.size_m);
        let mut tasks = unmarked(&sighting, distance_m);
        let mut expected = None;
        if let Some(marks) = &self.marked {
            let seen = sighting.is_in_picture;
            let (more, found) = marked(eye.camera(), &marks.target, distance_m, marks.aspect_rad, &marks.options, seen);
            tasks.extend(more);
            expected = found;
        }
        let bearing_rad = [position.y.atan2(position.x), (-position.z).atan2(position.x.hypot(position.y))];
        View { distance_m, bearing_rad, sighting, tasks, expected, regard: Regard::of(eye) }
    }
}

/// Distance of the two so long before they are nearest, m.
fn distance_m(state: &RelativeState, time_s: f64) -> f64 {
    let miss_m = state.closest_approach().map_or_else(|| state.range_m(), |approach| approach.miss_m);
    (state.velocity_mps().norm() * time_s).hypot(miss_m)
}
