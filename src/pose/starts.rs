//! Where refinement starts from, so that no minimum is missed.

use arrayvec::ArrayVec;
use nalgebra::{Unit, Vector3};

use super::NoPose;
use crate::geometry::{CameraFromTarget, rotation};
use crate::solve::p3p::p3p_of_widest;
use crate::solve::{NEARLY_COPLANAR_RATIO, Pair, SolveError, Solver, is_in_front, spread_of};

/// A start and the method that gave it.
pub(super) type Start = (Solver, CameraFromTarget);

/// At most: four of a method, one known, two of IPPE, four of P3P.
pub(super) type Starts = ArrayVec<Start, 16>;

/// With this many points or fewer, a target in space can have several minima too, and closed forms lose their way among
/// them; the minimal solver finds them all.
const FEW_POINTS: usize = 12;

/// With this many or fewer, a plane can have a third minimum.
const FEW_IN_A_PLANE: usize = 5;

/// The method's poses first, then a pose already known, then those of the other minima that the layout can have.
pub(super) fn of(pairs: &[Pair], named: Option<Solver>, known: Option<Start>) -> Result<Starts, NoPose> {
    let coplanar = spread_of(pairs).plane_ratio() <= NEARLY_COPLANAR_RATIO;
    let first = match named {
        Some(solver) => solver,
        None if pairs.len() < 4 => {
            return Err(SolveError::TooFewPoints { solver: "auto", given: pairs.len(), need: 4 }.into());
        }
        None if coplanar => Solver::Ippe,
        None => Solver::Sqpnp,
    };
    let mut starts = Starts::new();
    let answer = first.solve(pairs).map(|poses| starts.extend(poses.into_iter().map(|pose| (first, pose))));
    if named.is_some() {
        // A method asked for by name is not silently replaced.
        answer.clone()?;
    }
    starts.extend(known);
    if coplanar
        && first != Solver::Ippe
        && let Ok(poses) = Solver::Ippe.solve(pairs)
    {
        starts.extend(poses.into_iter().map(|pose| (Solver::Ippe, pose)));
    }
    let few = if coplanar { FEW_IN_A_PLANE } else { FEW_POINTS };
    if starts.is_empty() || (first != Solver::P3p && pairs.len() <= few) {
        let poses = p3p_of_widest(pairs).into_iter().filter(|pose| is_in_front(pairs, pose));
        starts.extend(poses.map(|pose| (Solver::P3p, pose)));
    }
    if starts.is_empty() {
        answer?;
    }
    Ok(starts)
}

/// A plane's normal nearer to the line of sight than this is its own mirror image, to the eye of an iteration.
const FACE_ON_RAD: f64 = 0.2;

/// Where a plane's other minimum may be, once one is known: at the attitude that looks nearly the same, the normal mirrored
/// about the line of sight; for a plane seen face on, tilted to any side.
pub(super) fn others(pairs: &[Pair], known: &CameraFromTarget, solver: Solver) -> Starts {
    let spread = spread_of(pairs);
    let centre = known.rotation * spread.centre + known.translation;
    let Some(sight) = Unit::try_new(centre, 0.0) else { return Starts::new() };
    if spread.plane_ratio() > NEARLY_COPLANAR_RATIO {
        return Starts::new();
    }
    let normal: Vector3<f64> = known.rotation * spread.axes.column(2);
    // Turns the normal to the line of sight, either way along it.
    let upright = if normal.dot(&sight) < 0.0 { -normal } else { normal };
    let axis = upright.cross(&sight);
    let tilt = axis.norm().atan2(upright.dot(&sight));
    let mut turns: ArrayVec<Vector3<f64>, 4> = ArrayVec::new();
    if tilt > FACE_ON_RAD {
        turns.push(axis.normalize() * (2.0 * tilt));
    } else {
        let side: Vector3<f64> = known.rotation * spread.axes.column(0);
        let other = normal.cross(&side);
        turns.extend([side, -side, other, -other].map(|axis| axis * (2.0 * FACE_ON_RAD)));
    }
    turns
        .iter()
        .map(|turn| {
            let rotation = rotation::exp(turn) * known.rotation;
            CameraFromTarget::new(rotation, centre - rotation * spread.centre)
        })
        .filter(|pose| is_in_front(pairs, pose))
        .map(|pose| (solver, pose))
        .collect()
}
