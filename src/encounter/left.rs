//! How much time is left to act in an encounter that is measured, with its uncertainty.

use nalgebra::{Matrix6, Vector6};

use super::approach::RelativeState;
use super::avoid::{LatestTurn, NoTurn, latest_turn};
use super::manoeuvre::Manoeuvre;
use crate::track::Uncertain;

/// The last moment for the turn, from now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeLeft {
    /// Until the turn has to begin, s; negative where it should have begun. Its deviation is infinite where there is no such moment for
    /// any state near by.
    pub time_s: Uncertain,
    /// The turn.
    pub turn: LatestTurn,
}

/// Time left until the turn has to begin, from a relative state with its covariance, positions (m) before velocities (m/s). The deviation
/// is by first order; it is that of what was measured, and not of what the two aircraft may do.
///
/// # Errors
/// [`NoTurn`] says why there is no such moment.
pub fn time_left(
    state: &RelativeState,
    covariance: &Matrix6<f64>,
    own_speed_mps: f64,
    manoeuvre: &Manoeuvre,
) -> Result<TimeLeft, NoTurn> {
    let turn = latest_turn(state, own_speed_mps, manoeuvre)?;
    // One side, lest the better one changes between the two ends of a difference.
    let one_side = manoeuvre.to(turn.side);
    let left_s = |by: Vector6<f64>| {
        let moved = RelativeState::checked(
            state.position_m() + by.fixed_rows::<3>(0),
            state.velocity_mps() + by.fixed_rows::<3>(3),
        );
        let moved = moved.ok()?;
        let approach = moved.closest_approach()?;
        Some(approach.time_s - latest_turn(&moved, own_speed_mps, &one_side).ok()?.time_s)
    };
    let value = left_s(Vector6::zeros()).unwrap_or_default();
    let steps = [1e-5 * state.range_m(), 1e-5 * (state.velocity_mps().norm() + own_speed_mps)];
    let mut slope = Vector6::zeros();
    for axis in 0..6 {
        let size = steps[axis / 3];
        let [ahead, behind] = [size, -size].map(|size| left_s(Vector6::ith(axis, size)));
        // At the rim of what a turn is needed for only one end may have an answer.
        slope[axis] = match (ahead, behind) {
            (Some(ahead), Some(behind)) => (ahead - behind) / (2.0 * size),
            (Some(ahead), None) => (ahead - value) / size,
            (None, Some(behind)) => (value - behind) / size,
            (None, None) => return Ok(TimeLeft { time_s: Uncertain { value, sigma: f64::INFINITY }, turn }),
        };
    }
    let sigma = slope.dot(&(covariance * slope)).max(0.0).sqrt();
    Ok(TimeLeft { time_s: Uncertain { value, sigma }, turn })
}
