//! When a turn has to begin.
//!
//! Seen from the intruder our aircraft comes along a straight line, and from the moment at which it turns along a curve that leaves this
//! line. To begin earlier by a second moves the intruder along the line, away from the curve's beginning; so the turn must begin so early
//! that the intruder lies beyond all places of the line that are nearer to the curve than the miss distance. A place `c` of the curve, at
//! `a` along the line and aside by `q` from the intruder's track, is too near to those up to `a + sqrt(m^2 - q^2)`: the largest of these over the
//! whole curve, over the closing speed, is the time. No search over times of beginning is needed, and the same holds in three dimensions
//! and where the two would pass each other at a distance.

use nalgebra::Vector3;
use thiserror::Error;

use super::approach::RelativeState;
use super::manoeuvre::{Manoeuvre, Side};
use super::path::Path;

/// The last moment for the turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatestTurn {
    /// Time before the closest approach without a turn at which it has to begin, s.
    pub time_s: f64,
    /// Distance of the two then, m.
    pub distance_m: f64,
    /// To which side: left or right.
    pub side: Side,
    /// Time from its beginning to the moment at which the two are nearest, s.
    pub nearest_s: f64,
    /// How far our aircraft has turned by then, rad.
    pub turned_rad: f64,
}

/// Why no last moment can be told. None of these is an error of the numbers.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum NoTurn {
    /// The two do not come nearer.
    #[error("they do not come nearer: the closing speed is {closing_speed_mps:.3} m/s")]
    NeverClosing {
        /// How fast the distance shrinks, m/s.
        closing_speed_mps: f64,
    },
    /// Too late for any turn.
    #[error("the intruder is {range_m:.1} m away, inside the miss distance of {miss_distance_m:.1} m")]
    InsideMissDistance {
        /// Its distance, m.
        range_m: f64,
        /// What was to be cleared, m.
        miss_distance_m: f64,
    },
    /// They pass each other far enough without a turn.
    #[error("they pass at {miss_m:.1} m without a turn, and {miss_distance_m:.1} m are enough")]
    NotNeeded {
        /// The distance at which they pass, m.
        miss_m: f64,
        /// What has to be cleared, m.
        miss_distance_m: f64,
    },
    /// However early it begins, the turn does not lead so far from the intruder's track.
    #[error(
        "a turn of {max_turn_rad:.3} rad leads {most_m:.1} m aside at most, and {miss_distance_m:.1} m are to be cleared"
    )]
    Unreachable {
        /// The distance that it leads to, m.
        most_m: f64,
        /// What was to be cleared, m.
        miss_distance_m: f64,
        /// How far it turns, rad.
        max_turn_rad: f64,
    },
}

impl NoTurn {
    /// Its name in the contract.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::NeverClosing { .. } => "never_closing",
            Self::InsideMissDistance { .. } => "inside_miss_distance",
            Self::NotNeeded { .. } => "not_needed",
            Self::Unreachable { .. } => "miss_distance_unreachable",
        }
    }
}

/// Moments of a turn that are looked at before the best is refined; denser at its beginning, where short turns are over.
const SAMPLES: u32 = 192;

/// Steps of the golden section: from two samples' distance to rounding.
const STEPS: u32 = 60;

/// The last moment at which the turn still clears an intruder that is there and moves so, our aircraft flying along x at
/// `own_speed_mps`, above zero. By the exact arc: the curve of the whole manoeuvre against the intruder's straight one.
///
/// # Errors
/// [`NoTurn`] says why there is no such moment.
pub fn latest_turn(state: &RelativeState, own_speed_mps: f64, manoeuvre: &Manoeuvre) -> Result<LatestTurn, NoTurn> {
    let track = Track::of(state, own_speed_mps, manoeuvre)?;
    let miss_distance_m = manoeuvre.miss_distance_m();
    let miss_m = track.aside.norm();
    let range_m = state.range_m();
    if range_m <= miss_distance_m {
        return Err(NoTurn::InsideMissDistance { range_m, miss_distance_m });
    }
    if miss_m >= miss_distance_m {
        return Err(NoTurn::NotNeeded { miss_m, miss_distance_m });
    }
    match manoeuvre.side() {
        Side::Left | Side::Right => track.turn(manoeuvre, manoeuvre.side()),
        Side::Either => match (track.turn(manoeuvre, Side::Left), track.turn(manoeuvre, Side::Right)) {
            // Of two that are as good, as head-on, the right: the rule of the air for that.
            (Ok(left), Ok(right)) if left.time_s < right.time_s * (1.0 - 1e-9) => Ok(left),
            (Ok(left), Err(_)) => Ok(left),
            (Err(NoTurn::Unreachable { most_m: left_m, .. }), Err(NoTurn::Unreachable { most_m: right_m, .. })) => {
                let most_m = left_m.max(right_m);
                Err(NoTurn::Unreachable { most_m, miss_distance_m, max_turn_rad: manoeuvre.max_turn_rad() })
            }
            (_, right) => right,
        },
    }
}

/// How near the two come if the turn begins now, m, to the side where that is farther if either will do.
#[must_use]
pub fn miss_if_turned_now_m(state: &RelativeState, own_speed_mps: f64, manoeuvre: &Manoeuvre) -> f64 {
    let intruder_velocity = state.velocity_mps() + Vector3::x() * own_speed_mps;
    let miss = |to_right: bool| {
        let path = Path::of(manoeuvre, own_speed_mps, to_right);
        let gap = |time_s: f64| path.place_m(time_s) - intruder_velocity * time_s - state.position_m();
        let (_, least) = largest(path.end_s, |time_s| -gap(time_s).norm());
        // Then straight on.
        let (left, leaving) = (gap(path.end_s), path.velocity_mps(path.end_s) - intruder_velocity);
        let still_mps = 1e-9 * (own_speed_mps + intruder_velocity.norm());
        let leaving = if leaving.norm() > still_mps { leaving } else { Vector3::zeros() };
        let later_s = (-left.dot(&leaving) / leaving.norm_squared().max(f64::MIN_POSITIVE)).max(0.0);
        (-least).min((left + leaving * later_s).norm())
    };
    match manoeuvre.side() {
        Side::Left => miss(false),
        Side::Right => miss(true),
        Side::Either => miss(false).max(miss(true)),
    }
}

/// The straight relative path before the turn.
struct Track {
    own_speed_mps: f64,
    intruder_velocity: Vector3<f64>,
    /// The direction in which our aircraft goes as seen from the intruder.
    along: Vector3<f64>,
    relative_speed_mps: f64,
    /// The intruder's place beside that line.
    aside: Vector3<f64>,
}

impl Track {
    fn of(state: &RelativeState, own_speed_mps: f64, manoeuvre: &Manoeuvre) -> Result<Self, NoTurn> {
        let closing_speed_mps = state.closing_speed_mps();
        if state.closest_approach().is_none() {
            let (range_m, miss_distance_m) = (state.range_m(), manoeuvre.miss_distance_m());
            return Err(if range_m <= miss_distance_m {
                NoTurn::InsideMissDistance { range_m, miss_distance_m }
            } else {
                NoTurn::NeverClosing { closing_speed_mps }
            });
        }
        let relative_speed_mps = state.velocity_mps().norm();
        let along = -state.velocity_mps() / relative_speed_mps;
        let aside = state.position_m() - along * along.dot(state.position_m());
        let intruder_velocity = state.velocity_mps() + Vector3::x() * own_speed_mps;
        Ok(Self { own_speed_mps, intruder_velocity, along, relative_speed_mps, aside })
    }

    fn turn(&self, manoeuvre: &Manoeuvre, side: Side) -> Result<LatestTurn, NoTurn> {
        let path = Path::of(manoeuvre, self.own_speed_mps, side == Side::Right);
        let miss_m = manoeuvre.miss_distance_m();
        let farthest = |time_s: f64| {
            let (along, off) = self.parts(&(path.place_m(time_s) - self.intruder_velocity * time_s));
            let room = miss_m * miss_m - (off - self.aside).norm_squared();
            if room > 0.0 { along + room.sqrt() } else { f64::NEG_INFINITY }
        };
        let turning = largest(path.end_s, farthest);
        let (nearest_s, reach_m) = match self.straight(&path, manoeuvre)? {
            Some(straight) if straight.1 > turning.1 => straight,
            _ => turning,
        };
        let time_s = reach_m / self.relative_speed_mps;
        let turned_rad = path.turned_rad(nearest_s);
        Ok(LatestTurn { time_s, distance_m: reach_m.hypot(self.aside.norm()), side, nearest_s, turned_rad })
    }

    /// The same on the straight way after the turn, in closed form: the time, and how far it reaches.
    fn straight(&self, path: &Path, manoeuvre: &Manoeuvre) -> Result<Option<(f64, f64)>, NoTurn> {
        let miss_m = manoeuvre.miss_distance_m();
        let (along, off) = self.parts(&(path.place_m(path.end_s) - self.intruder_velocity * path.end_s));
        let (along_mps, off_mps) = self.parts(&(path.velocity_mps(path.end_s) - self.intruder_velocity));
        let gap = off - self.aside;
        let speed_mps = off_mps.norm();
        let still_mps = 1e-9 * (self.own_speed_mps + self.intruder_velocity.norm());
        if speed_mps <= still_mps {
            if gap.norm() < miss_m && along_mps > still_mps {
                let (most_m, max_turn_rad) = (gap.norm(), manoeuvre.max_turn_rad());
                return Err(NoTurn::Unreachable { most_m, miss_distance_m: miss_m, max_turn_rad });
            }
            return Ok(None);
        }
        // The gap is least after `least_s`; around then it is inside the miss distance for a while.
        let least_s = -gap.dot(&off_mps) / (speed_mps * speed_mps);
        let room = miss_m * miss_m - (gap + off_mps * least_s).norm_squared();
        if room <= 0.0 || least_s + room.sqrt() / speed_mps <= 0.0 {
            return Ok(None);
        }
        let best_s = (least_s + along_mps * room.sqrt() / (speed_mps * along_mps.hypot(speed_mps))).max(0.0);
        let left = room - (speed_mps * (best_s - least_s)).powi(2);
        Ok((left >= 0.0).then(|| (path.end_s + best_s, along + along_mps * best_s + left.sqrt())))
    }

    /// A vector's part along the line, and what is left.
    fn parts(&self, vector: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let along = self.along.dot(vector);
        (along, vector - self.along * along)
    }
}

/// Where the function is largest from 0 to `end_s`, and how large.
fn largest(end_s: f64, function: impl Fn(f64) -> f64) -> (f64, f64) {
    let at = |index: u32| end_s * (f64::from(index) / f64::from(SAMPLES)).powi(3);
    let mut best = (0, f64::NEG_INFINITY);
    for index in 0..=SAMPLES {
        let value = function(at(index));
        if value > best.1 {
            best = (index, value);
        }
    }
    // Golden section between the neighbours.
    let shrink = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (at(best.0.saturating_sub(1)), at((best.0 + 1).min(SAMPLES)));
    for _ in 0..STEPS {
        let (left, right) = (high - shrink * (high - low), low + shrink * (high - low));
        if function(left) < function(right) {
            low = left;
        } else {
            high = right;
        }
    }
    let middle = 0.5 * (low + high);
    let value = function(middle);
    if value > best.1 { (middle, value) } else { (at(best.0), best.1) }
}
