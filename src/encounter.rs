//! Sense and avoid: how early must another aircraft be seen so that a turn still clears it, and how large is it then.
//!
//! The geometry of R. Hajri's thesis (2012, section 2.1, after Geyer, Singh and Chamberlain 2008), put right where it is printed wrong and
//! carried beyond its two cases. An aid to evaluate cameras and detectors with; no certified function of any aircraft.
//!
//! # What is assumed
//!
//! Both aircraft keep their speeds; the other keeps its course and does nothing about the encounter; the air is still. Ours flies level, banks
//! to one angle, at once or at a steady roll rate, turns in a coordinated turn as far as the [`Manoeuvre`] says (a quarter turn), and then
//! flies straight. Wings are level again at once. The miss distance is that of the two centres over the whole path.
//!
//! # Axes
//!
//! Vectors are in the level axes of our aircraft before it turns: x along its course, y to the right, z down.

mod act;
mod airspace;
mod approach;
mod avoid;
mod course;
mod delays;
mod error;
mod eye;
mod left;
mod manoeuvre;
mod parabola;
mod path;
mod pictures;
mod regard;
mod study;
mod tasks;

pub use act::{Means, ToAct, to_act};
pub use airspace::Airspace;
pub use approach::{Approach, RelativeState};
pub use avoid::{LatestTurn, NoTurn, latest_turn, miss_if_turned_now_m};
pub use course::{Course, Scenario};
pub use delays::Delays;
pub use error::{EncounterError, positive};
pub use eye::{Eye, Sighting, arc_width_rad};
pub use left::{TimeLeft, time_left};
pub use manoeuvre::{Manoeuvre, Side};
pub use parabola::parabolic_time_s;
pub use pictures::pictures;
pub use regard::{Covered, GUIDANCE, Guidance, Regard};
pub use study::{Answer, Marked, Needed, Question, Room, Situation, Turn, Turns, View};
pub use tasks::{Expected, Feasibility, Measure, Task};

/// Metres a second of one knot.
pub const KNOT_MPS: f64 = 1852.0 / 3600.0;

/// Standard gravity, m/s^2 (ISO 80000-3).
pub const GRAVITY_MPS2: f64 = 9.806_65;

#[cfg(test)]
mod tests;
