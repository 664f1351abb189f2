//! Skypose.

use skypose::geometry::CameraFromTarget;
use skypose::pose::{PoseOptions, estimate_pose, estimate_pose_robustly};
use skypose::refine::{RefineOptions, refine};
use skypose::solve::Solver;
use skypose::solve::p3p::p3p;

use crate::method::{Method, takes};
use crate::study::Task;

/// Each solver alone, the minimal solver bare, the refinement alone, and the whole answers with both minima, covariances and
/// probabilities.
pub const METHODS: [Method; 10] = [
    Method { name: "Skypose ippe", takes: takes::planar, solve: |task| alone(Solver::Ippe, task) },
    Method { name: "Skypose homography", takes: takes::planar, solve: |task| alone(Solver::Homography, task) },
    Method { name: "Skypose p3p, others choose", takes: takes::clean, solve: |task| alone(Solver::P3p, task) },
    Method { name: "Skypose epnp", takes: takes::clean, solve: |task| alone(Solver::Epnp, task) },
    Method { name: "Skypose sqpnp", takes: takes::clean, solve: |task| alone(Solver::Sqpnp, task) },
    Method { name: "Skypose posit", takes: takes::clean, solve: |task| alone(Solver::Posit, task) },
    Method { name: "Skypose p3p", takes: takes::smallest, solve: three },
    Method { name: "Skypose refine", takes: takes::clean, solve: refined },
    Method { name: "Skypose estimate_pose", takes: takes::clean, solve: whole },
    Method { name: "Skypose estimate_pose_robustly", takes: takes::any, solve: robust },
];

fn alone(solver: Solver, task: &Task) -> Option<CameraFromTarget> {
    solver.solve(&task.pairs).ok().map(|poses| poses[0])
}

fn three(task: &Task) -> Option<CameraFromTarget> {
    p3p(&task.bearings, &task.corners).first().copied()
}

fn refined(task: &Task) -> Option<CameraFromTarget> {
    let refined = refine(&task.trial.case.camera, &task.seen, &task.start, &RefineOptions::default());
    refined.ok().map(|refined| refined.camera_from_target)
}

fn whole(task: &Task) -> Option<CameraFromTarget> {
    let answer = estimate_pose(&task.trial.case.camera, &task.seen, &PoseOptions::default());
    answer.ok().map(|answer| answer.best.camera_from_target)
}

fn robust(task: &Task) -> Option<CameraFromTarget> {
    let answer = estimate_pose_robustly(&task.trial.case.camera, &task.seen, &PoseOptions::default());
    answer.ok().map(|(answer, _)| answer.best.camera_from_target)
}
