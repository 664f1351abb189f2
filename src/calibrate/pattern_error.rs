//! Whether the same points of the board are off in all views: then it is not the views that are wrong, but what is said of the board.

use nalgebra::{Matrix2, Vector2};

use super::evidence::Evidence;

/// What the points of the board have in common in all views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatternError {
    /// Share of the squared errors, on the board, that is the same in all views.
    pub share: f64,
    /// Root mean square distance on the board of what is the same in all views, m.
    pub rms_m: f64,
}

/// Views in which a point must be seen: chance has their inverse in common.
const MIN_VIEWS: usize = 4;

impl PatternError {
    /// Of the points that enough views show; `None` where there are none.
    pub(super) fn of(evidence: &Evidence<'_>) -> Option<Self> {
        let mut sums = vec![(0_usize, Vector2::zeros(), 0.0); evidence.board.points().len()];
        for (view, pose) in evidence.views.iter().zip(&evidence.poses) {
            let axes = pose.rotation.matrix().fixed_columns::<2>(0).into_owned();
            for seen in view {
                let point = *pose * evidence.board.points()[seen.point];
                let Some((pixel, by_point)) = evidence.camera.project_with_jacobian(&point) else { continue };
                let by_place: Matrix2<f64> = by_point * axes;
                let Some(off_m) = by_place.try_inverse().map(|inverse| inverse * (seen.pixel - pixel)) else {
                    continue;
                };
                let (count, sum, squares) = &mut sums[seen.point];
                *count += 1;
                *sum += off_m;
                *squares += off_m.norm_squared();
            }
        }
        let (mut points, mut same, mut all) = (0.0, 0.0, 0.0);
        for (count, sum, squares) in sums.into_iter().filter(|(count, ..)| *count >= MIN_VIEWS) {
            points += 1.0;
            same += (sum / count as f64).norm_squared();
            all += squares / count as f64;
        }
        (all > 0.0).then(|| Self { share: same / all, rms_m: f64::sqrt(same / points) })
    }
}
