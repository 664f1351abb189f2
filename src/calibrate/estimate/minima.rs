//! A small board, or a distant one, looks much the same tilted to either side: its pose has two minima. A start that knows no lens may
//! pick the wrong one, and no step downhill leads out of it.

use crate::calibrate::SeenPoint;
use crate::calibrate::bundle::{Bundle, State};
use crate::calibrate::freedom::Freedom;
use crate::calibrate::start::{poses, state_of};
use crate::camera::Camera;
use crate::geometry::CameraFromBoard;

/// Poses that are turned by less than this are in the same minimum.
const SAME_RAD: f64 = 0.02;

/// The best pose of a view under a camera that is held: of the two minima the deeper one.
pub(super) fn best_pose(bundle: &Bundle<'_>, camera: &Camera, view: &[SeenPoint]) -> Option<CameraFromBoard> {
    let poses = poses(bundle, camera, view);
    // Points outside the lens' range leave no cost to lower; the start is what there is.
    let start = *poses.first()?;
    let refined = poses.into_iter().filter_map(|pose| refined(bundle, camera, view, pose));
    Some(refined.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(start, |(_, pose)| pose))
}

/// The state with those poses moved to their other minimum that explain their view better there; `None` where there are none.
pub(super) fn in_deeper_minima(bundle: &Bundle<'_>, state: &State) -> Option<State> {
    let mut better = state.clone();
    let mut is_moved = false;
    for (view, pose) in bundle.views.iter().zip(&mut better.poses) {
        let others = poses(bundle, &state.camera, view);
        let others = others.into_iter().filter(|other| (other.rotation.inverse() * pose.rotation).angle() > SAME_RAD);
        let Some((own, _)) = refined(bundle, &state.camera, view, *pose) else { continue };
        let deeper = others
            .filter_map(|other| refined(bundle, &state.camera, view, other))
            .filter(|(cost, _)| *cost < own)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, deeper)) =
            deeper.filter(|(_, deeper)| (deeper.rotation.inverse() * pose.rotation).angle() > SAME_RAD)
        {
            *pose = deeper;
            is_moved = true;
        }
    }
    is_moved.then_some(better)
}

/// The pose at the bottom of where it stands, and its cost.
fn refined(
    bundle: &Bundle<'_>,
    camera: &Camera,
    view: &[SeenPoint],
    pose: CameraFromBoard,
) -> Option<(f64, CameraFromBoard)> {
    let views = [view];
    let alone = Bundle { views: &views, freedom: Freedom::none(), ..*bundle };
    let state = alone.refined(state_of(camera, vec![pose]))?;
    Some((alone.cost(&state), state.poses[0]))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::*;
    use crate::calibrate::bundle::Loss;
    use crate::calibrate::estimate::tests::{SIZE, chessboard, lenses, truth};
    use crate::calibrate::freedom::Parameters;
    use crate::calibrate::watch::Watch;
    use crate::camera::Pixel;

    #[test]
    fn a_distant_board_leaves_the_wrong_minimum_of_its_pose() {
        let (board, camera) = (chessboard(), truth(lenses()[1]));
        let bundle = Bundle {
            size: SIZE,
            board: &board,
            views: &[],
            lens: *camera.distortion(),
            freedom: Freedom::none(),
            loss: Loss::Squares,
            prior: Parameters::zeros(),
            watch: Watch::nobody(),
        };
        let mut two = 0;
        for step in 0..8 {
            let turn = Vector3::new(0.3, 0.05 * f64::from(step), 0.1);
            let pose = CameraFromBoard::new(Rotation3::new(turn), Vector3::new(-0.3, 0.2, 1.8));
            let origin = |point| SeenPoint { point, pixel: Pixel::zeros(), sigma_px: 0.05 };
            let exact =
                |seen: SeenPoint| SeenPoint { pixel: -bundle.residual(&camera, &pose, &seen).expect("seen"), ..seen };
            let view: Vec<SeenPoint> = (0..board.points().len()).map(|point| exact(origin(point))).collect();
            let off = |other: &CameraFromBoard| (other.rotation.inverse() * pose.rotation).angle();
            let refined =
                poses(&bundle, &camera, &view).into_iter().filter_map(|start| refined(&bundle, &camera, &view, start));
            let Some((_, wrong)) =
                refined.max_by(|a, b| off(&a.1).total_cmp(&off(&b.1))).filter(|(_, wrong)| off(wrong) > 0.1)
            else {
                continue;
            };
            two += 1;
            let views = [view.as_slice()];
            let bundle = Bundle { views: &views, ..bundle };
            let mended = in_deeper_minima(&bundle, &state_of(&camera, vec![wrong])).expect("another minimum");
            assert!(off(&mended.poses[0]) < 1e-4, "{step}: {}", off(&mended.poses[0]));
            assert_eq!(in_deeper_minima(&bundle, &mended).map(|state| state.poses), None, "{step}");
            let best = best_pose(&bundle, &camera, &view).expect("a pose");
            assert!(off(&best) < 1e-4, "{step}: {}", off(&best));
        }
        assert!(two > 4, "{two}");
    }
}
