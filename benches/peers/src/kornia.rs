//! kornia-3d, in this process.

use kornia_3d::pnp::ap3p::solve_ap3p_multi;
use kornia_3d::pnp::{
    EPnPParams, LMRefineParams, PnPMethod, PnPResult, RansacParams, refine_pose_lm, solve_pnp, solve_pnp_ransac,
};
use nalgebra::{Matrix3, Rotation3, Vector3};
use skypose::geometry::CameraFromTarget;

use crate::method::{Method, takes};
use crate::study::Task;

/// The gate of consensus in deviations; with the 5 of `peers.py` it does worse.
const GATE: f64 = 3.7;

/// Each solver, its refinement, and consensus with the minimal solver, refined on its inliers.
pub const METHODS: [Method; 5] = [
    Method { name: "kornia EPnP", takes: takes::clean, solve: |task| epnp(task, None) },
    Method { name: "kornia EPnP + LM", takes: takes::clean, solve: |task| epnp(task, Some(LMRefineParams::default())) },
    Method { name: "kornia AP3P", takes: takes::smallest, solve: three },
    Method { name: "kornia LM", takes: takes::clean, solve: refined },
    Method { name: "kornia RANSAC + LM", takes: takes::any, solve: robust },
];

fn epnp(task: &Task, refine_lm: Option<LMRefineParams>) -> Option<CameraFromTarget> {
    let method = PnPMethod::EPnP(EPnPParams { refine_lm, ..EPnPParams::default() });
    let input = &task.kornia;
    solve_pnp(&input.world, &input.image, &input.k, None, method).ok().as_ref().and_then(pose)
}

fn three(task: &Task) -> Option<CameraFromTarget> {
    let input = &task.kornia;
    solve_ap3p_multi(&input.world[..3], &input.image[..3], &input.k).ok()?.first().and_then(pose)
}

fn refined(task: &Task) -> Option<CameraFromTarget> {
    let input = &task.kornia;
    refine_pose_lm(
        &input.world,
        &input.image,
        &input.k,
        &input.start_rotation,
        &input.start_translation,
        None,
        &LMRefineParams::default(),
    )
    .ok()
    .as_ref()
    .and_then(pose)
}

fn robust(task: &Task) -> Option<CameraFromTarget> {
    #[expect(clippy::cast_possible_truncation, reason = "kornia computes in single precision")]
    let reproj_threshold_px = (GATE * task.trial.sigma_px) as f32;
    let params = RansacParams {
        max_iterations: 3000,
        confidence: 0.9999,
        reproj_threshold_px,
        random_seed: Some(0),
        refine: false,
        ..RansacParams::default()
    };
    let input = &task.kornia;
    let found = solve_pnp_ransac(&input.world, &input.image, &input.k, None, PnPMethod::AP3PDefault, &params).ok()?;
    let (world, image): (Vec<_>, Vec<_>) = found.inliers.iter().map(|i| (input.world[*i], input.image[*i])).unzip();
    // Its own last step fits EPnP to the inliers, which loses to least squares from the winning sample.
    let (rotation, translation) = (&found.pose.rotation, &found.pose.translation);
    let refined =
        refine_pose_lm(&world, &image, &input.k, rotation, translation, None, &LMRefineParams::default()).ok();
    pose(refined.as_ref().unwrap_or(&found.pose))
}

fn pose(result: &PnPResult) -> Option<CameraFromTarget> {
    let rotation = Matrix3::from_iterator(result.rotation.to_cols_array().map(f64::from));
    let translation = Vector3::from(result.translation.to_array().map(f64::from));
    let pose = CameraFromTarget::new(Rotation3::from_matrix_unchecked(rotation), translation);
    pose.is_finite().then_some(pose)
}
