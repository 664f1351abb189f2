//! What is put to a case: a solver alone, or an answer of the service.

use std::fmt;

use crate::camera::Camera;
use crate::geometry::CameraFromTarget;
use crate::pose::{NoPose, PoseAnswer, PoseOptions, estimate_pose, estimate_pose_robustly};
use crate::refine::Correspondence;
use crate::solve::{Pair, Solver};

/// A way to a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// A solver as its paper has it: the pose that it ranks first, without covariance or probability, and without any of the
    /// checks that an answer goes through.
    Solver(Solver),
    /// What the service answers.
    Service {
        /// By name, or `None` where the service is free to choose.
        solver: Option<Solver>,
        /// Minimise the reprojection error from the solver's pose. Without a named solver it is always done.
        refine: bool,
        /// Some pairs may be wrong.
        robust: bool,
    },
}

/// What a method says.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "one is made and looked at at a time")]
pub enum Said {
    /// A pose and nothing else.
    Pose(CameraFromTarget),
    /// A pose with its covariance, and alternatives with probabilities.
    Answer(PoseAnswer),
}

impl Method {
    /// The best that there is.
    pub const AUTO: Self = Self::Service { solver: None, refine: true, robust: false };

    /// What it says of a case, given as the camera sees it and on its rays.
    ///
    /// # Errors
    /// Why it has no pose.
    pub fn ask(self, camera: &Camera, seen: &[Correspondence], rays: &[Pair]) -> Result<Said, NoPose> {
        match self {
            Self::Solver(solver) => Ok(Said::Pose(solver.solve(rays)?[0])),
            Self::Service { solver, refine, robust } => {
                let options = PoseOptions { solver, refine, ..PoseOptions::default() };
                let answer = if robust {
                    estimate_pose_robustly(camera, seen, &options).map(|(answer, _)| answer)
                } else {
                    estimate_pose(camera, seen, &options)
                };
                Ok(Said::Answer(answer?))
            }
        }
    }

    /// The method of this name, as [`Display`](fmt::Display) writes it: `epnp` is the solver alone, `epnp+covariance` the service's
    /// answer with it, `epnp+refine` and `auto` refined answers, `auto+robust` one for pairs that may be wrong.
    ///
    /// # Errors
    /// What names there are.
    pub fn named(name: &str) -> Result<Self, String> {
        let unknown = || {
            let solvers: Vec<&str> = Solver::ALL.iter().map(|solver| solver.name()).collect();
            let solvers = solvers.join(", ");
            format!("no method {name:?}: {solvers}, each also with +covariance, +refine or +robust; auto, auto+robust")
        };
        let mut parts = name.split('+');
        let first = parts.next().unwrap_or_default();
        let solver = Solver::ALL.into_iter().find(|solver| solver.name() == first);
        if solver.is_none() && first != "auto" {
            return Err(unknown());
        }
        let extras: Vec<&str> = parts.collect();
        let service = |refine, robust| Self::Service { solver, refine, robust };
        match (solver, &extras[..]) {
            (Some(solver), []) => Ok(Self::Solver(solver)),
            (Some(_), ["covariance"]) => Ok(service(false, false)),
            (None, []) | (Some(_), ["refine"]) => Ok(service(true, false)),
            (Some(_), ["robust"]) => Ok(service(false, true)),
            (None, ["robust"]) | (Some(_), ["refine", "robust"]) => Ok(service(true, true)),
            _ => Err(unknown()),
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (solver, extras) = match self {
            Self::Solver(solver) => (Some(*solver), ""),
            Self::Service { solver, refine, robust } => {
                let extras = match (solver.is_some() && *refine, *robust) {
                    (false, false) if solver.is_some() => "+covariance",
                    (false, false) => "",
                    (true, false) => "+refine",
                    (false, true) => "+robust",
                    (true, true) => "+refine+robust",
                };
                (*solver, extras)
            }
        };
        write!(f, "{}{extras}", solver.map_or("auto", Solver::name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back_to_their_methods() {
        for solver in Solver::ALL {
            assert_eq!(Method::named(solver.name()), Ok(Method::Solver(solver)));
        }
        for solver in Solver::ALL.map(Some).into_iter().chain([None]) {
            for (refine, robust) in [(false, false), (true, false), (false, true), (true, true)] {
                let method = Method::Service { solver, refine: refine || solver.is_none(), robust };
                assert_eq!(Method::named(&method.to_string()), Ok(method));
            }
        }
        for wrong in ["", "epnq", "epnp+", "epnp+fast", "+refine", "auto+refine", "auto+covariance"] {
            assert!(Method::named(wrong).is_err(), "{wrong}");
        }
    }
}
