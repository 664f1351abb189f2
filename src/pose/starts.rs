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
    if starts.is_empty() || (!coplanar && first != Solver::P3p && pairs.len() <= FEW_POINTS) {
        let poses = p3p_of_widest(pairs).into_iter().filter(|pose| is_in_front(pairs, pose));
        starts.extend(poses.map(|pose| (Solver::P3p, pose)));
    }
    if starts.is_empty() {
        answer?;
    }
    Ok(starts)
}

/// The other attitudes that look nearly the same if the points lie in a plane: its normal mirrored about the line of sight.
pub(super) fn flips(pairs: &[Pair], poses: &[Start]) -> Starts {
    let spread = spread_of(pairs);
    if spread.plane_ratio() > NEARLY_COPLANAR_RATIO {
        return Starts::new();
    }
    poses
        .iter()
        .take(4)
        .filter_map(|(solver, pose)| {
            let centre = pose.rotation * spread.centre + pose.translation;
            let sight = Unit::try_new(centre, 0.0)?;
            let normal: Vector3<f64> = pose.rotation * spread.axes.column(2);
            // Turn that takes the normal to its mirror image: twice the angle between them, in their plane.
            let axis = normal.cross(&sight);
            let sine = axis.norm();
            let angle = 2.0 * sine.atan2(normal.dot(&sight));
            let turn = rotation::exp(&(axis.try_normalize(1e-6)? * angle));
            let flipped = turn * pose.rotation;
            let pose = CameraFromTarget::new(flipped, centre - flipped * spread.centre);
            is_in_front(pairs, &pose).then_some((*solver, pose))
        })
        .collect()
}
