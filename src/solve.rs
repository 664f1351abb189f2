//! Correspondences to candidate poses: one solver, one file, one paper.
//!
//! A solver takes exactly what it needs, returns every solution with all points in front of the camera, and neither
//! ranks nor refines. Rays are normalized image coordinates, free of distortion.

pub mod epnp;
pub mod homography;
pub mod ippe;
mod nearest;
pub mod p3p;
pub mod posit;
pub mod sqpnp;

use arrayvec::ArrayVec;
use thiserror::Error;

use crate::camera::Normalized;
use crate::geometry::{CameraFromTarget, Point, space};
use crate::target::Spread;

/// A point of the target and the ray on which the camera sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Where it sits on the target.
    pub point: Point<space::Target>,
    /// Where the camera sees it, `(x / z, y / z)`.
    pub ray: Normalized,
}

/// All solutions of a solver; the minimal problem has up to four.
pub type Solutions = ArrayVec<CameraFromTarget, 4>;

/// The solvers by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Solver {
    /// Direct linear transform of a plane.
    Homography,
    /// Virtual control points, any layout.
    Epnp,
    /// Pose from orthography and scaling with iterations.
    Posit,
    /// Infinitesimal plane-based pose: both solutions of a plane.
    Ippe,
    /// Three points, up to four solutions; further points choose.
    P3p,
    /// Least squares over all rotations, any layout.
    Sqpnp,
}

/// Why a solver has no solution.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SolveError {
    /// Fewer points than the method needs.
    #[error("{given} points: {solver} needs at least {need}")]
    TooFewPoints {
        /// Name of the method.
        solver: &'static str,
        /// How many there are.
        given: usize,
        /// How many it takes.
        need: usize,
    },
    /// Points on a line (or in one place).
    #[error("the points are collinear: spread ratio {spread_ratio:.1e}, need {min_spread_ratio:.1e}")]
    Collinear {
        /// Second largest spread over the largest.
        spread_ratio: f64,
        /// The smallest that is accepted.
        min_spread_ratio: f64,
    },
    /// Points that leave their plane, given to a method for planes.
    #[error("the points leave their plane by {plane_ratio:.1e} of their extent: {solver} needs coplanar points")]
    NotCoplanar {
        /// Name of the method.
        solver: &'static str,
        /// Third largest spread over the largest.
        plane_ratio: f64,
    },
    /// The equations do not determine the pose, or have no real solution.
    #[error("{solver}: the image of these points does not determine a pose")]
    Degenerate {
        /// Name of the method.
        solver: &'static str,
    },
    /// Every solution has a point at or behind the camera.
    #[error("{solver}: every solution has points behind the camera")]
    BehindCamera {
        /// Name of the method.
        solver: &'static str,
    },
    /// An iteration that ran out of steps.
    #[error("{solver} did not converge in {iterations} iterations")]
    NotConverged {
        /// Name of the method.
        solver: &'static str,
        /// Steps made.
        iterations: usize,
    },
}

impl Solver {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Homography, Self::Epnp, Self::Posit, Self::Ippe, Self::P3p, Self::Sqpnp];

    /// The name in the contract.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Homography => "homography",
            Self::Epnp => "epnp",
            Self::Posit => "posit",
            Self::Ippe => "ippe",
            Self::P3p => "p3p",
            Self::Sqpnp => "sqpnp",
        }
    }

    /// Fewest points it takes.
    #[must_use]
    pub const fn min_points(self) -> usize {
        match self {
            Self::P3p | Self::Sqpnp => 3,
            _ => 4,
        }
    }

    /// All poses that this method finds for `pairs`, its best first where it ranks them itself.
    ///
    /// # Errors
    /// Says why there is none; see [`SolveError`].
    pub fn solve(self, pairs: &[Pair]) -> Result<Solutions, SolveError> {
        let solver = self.name();
        let (given, need) = (pairs.len(), self.min_points());
        if given < need {
            return Err(SolveError::TooFewPoints { solver, given, need });
        }
        let spread = spread_of(pairs);
        let spread_ratio = spread.line_ratio();
        if spread_ratio < MIN_SPREAD_RATIO {
            return Err(SolveError::Collinear { spread_ratio, min_spread_ratio: MIN_SPREAD_RATIO });
        }
        let plane_only = matches!(self, Self::Homography | Self::Ippe);
        let plane_ratio = spread.plane_ratio();
        if plane_only && plane_ratio > NEARLY_COPLANAR_RATIO {
            return Err(SolveError::NotCoplanar { solver, plane_ratio });
        }
        let solutions = match self {
            Self::Homography => homography::homography(pairs, &spread),
            Self::Epnp => epnp::epnp(pairs, &spread),
            Self::Posit => posit::posit(pairs, &spread),
            Self::Ippe => ippe::ippe(pairs, &spread),
            Self::P3p => p3p::p3p_of_many(pairs),
            Self::Sqpnp => sqpnp::sqpnp(pairs, &spread),
        }?;
        let visible: Solutions = solutions.into_iter().filter(|pose| is_in_front(pairs, pose)).collect();
        if visible.is_empty() { Err(SolveError::BehindCamera { solver }) } else { Ok(visible) }
    }
}

/// Points flatter towards a line than this leave the turn about the line open.
pub const MIN_SPREAD_RATIO: f64 = 1e-6;

/// Methods for planes accept points that leave their plane by up to this share of their extent.
pub const NEARLY_COPLANAR_RATIO: f64 = 2e-2;

/// The spread of the target's points.
#[must_use]
pub fn spread_of(pairs: &[Pair]) -> Spread {
    Spread::of_all(pairs.iter().map(|pair| pair.point.coords))
}

/// Whether the pose is finite and puts every point in front of the camera.
#[must_use]
pub fn is_in_front(pairs: &[Pair], pose: &CameraFromTarget) -> bool {
    pose.is_finite() && pairs.iter().all(|pair| (*pose * pair.point).coords.z > 0.0)
}

/// Sum of squared distances between rays and projected points on the plane `z = 1`.
#[must_use]
pub fn squared_ray_error(pairs: &[Pair], pose: &CameraFromTarget) -> f64 {
    pairs
        .iter()
        .map(|pair| {
            let p = (*pose * pair.point).coords;
            (p.xy() / p.z - pair.ray).norm_squared()
        })
        .sum()
}
