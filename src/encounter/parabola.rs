//! The thesis' approximation: the turn as a parabola.

use super::manoeuvre::Manoeuvre;

/// Time before the encounter at which a turn has to begin, s: `sqrt(2 r cot(bank) / g)`, and the whole of the roll-in before it.
///
/// Equation 2.2 of the thesis with the g that is missing there; the thesis goes on to `cot(x) ~ pi/2 - x`, which is too small by a third
/// at 20 degrees. It asks only when the turn has led as far aside as is to be cleared. That holds head-on, and while the turn is short against
/// its radius; else it errs on the dangerous side, and [`latest_turn`](super::latest_turn) is right.
#[must_use]
pub fn parabolic_time_s(manoeuvre: &Manoeuvre) -> f64 {
    (2.0 * manoeuvre.miss_distance_m() / manoeuvre.lateral_mps2()).sqrt() + manoeuvre.roll_in_s()
}
