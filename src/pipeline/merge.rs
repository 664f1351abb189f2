//! The poses of several assignments as one answer.

use crate::pose::{PoseAnswer, PoseEstimate};

/// Poses nearer than this, in squared standard deviations, say the same: assignments that differ by one blob.
const SAME_WITHIN_SQUARED: f64 = 9.0;

/// Poses less probable than this are left out.
pub(super) const NEGLIGIBLE: f64 = 1e-4;

/// One answer from that of the best assignment and those of its rivals, each with the assignment's probability. Every pose's
/// probability is that of its assignment and of its minimum together; poses that say the same are one.
pub(super) fn merged(best: (f64, PoseAnswer), rivals: impl Iterator<Item = (f64, PoseAnswer)>) -> PoseAnswer {
    let weighted = |share: f64, answer: &PoseAnswer| -> Vec<PoseEstimate> {
        std::iter::once(&answer.best)
            .chain(&answer.alternatives)
            .map(|e| PoseEstimate { probability: e.probability * share, ..*e })
            .collect()
    };
    let (probability, mut answer) = best;
    let mut all = weighted(probability, &answer);
    for (probability, rival) in rivals {
        all.extend(weighted(probability, &rival));
    }
    let total: f64 = all.iter().map(|e| e.probability).sum();
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let mut kept: Vec<PoseEstimate> = Vec::new();
    for mut estimate in all {
        estimate.probability /= total;
        let same = kept.iter_mut().find(|known| {
            known.covariance.normalized_error_squared(&known.camera_from_target, &estimate.camera_from_target)
                < SAME_WITHIN_SQUARED
        });
        match same {
            Some(known) => known.probability += estimate.probability,
            None => kept.push(estimate),
        }
    }
    kept.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let mut kept = kept.into_iter();
    if let Some(best) = kept.next() {
        answer.best = best;
        answer.alternatives = kept.filter(|e| e.probability >= NEGLIGIBLE).collect();
    }
    answer
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Rotation3, Vector3};

    use super::*;
    use crate::geometry::{CameraFromTarget, PoseCovariance};
    use crate::solve::Solver;

    /// A pose this far away, known to a centimetre and to 10 mrad.
    fn estimate(range_m: f64, probability: f64) -> PoseEstimate {
        PoseEstimate {
            camera_from_target: CameraFromTarget::new(Rotation3::identity(), Vector3::z() * range_m),
            covariance: PoseCovariance::checked(Matrix6::identity() * 1e-4).expect("positive definite"),
            covariance_reliable: true,
            reprojection_rms_px: 0.1,
            probability,
        }
    }

    /// The first is the best.
    fn answer(poses: &[PoseEstimate]) -> PoseAnswer {
        PoseAnswer {
            best: poses[0],
            alternatives: poses[1..].to_vec(),
            solver: Solver::Ippe,
            noise_scale: 1.0,
            ln_evidence: 0.0,
        }
    }

    /// Range and probability of each pose.
    fn poses(answer: &PoseAnswer) -> Vec<[f64; 2]> {
        let all = std::iter::once(&answer.best).chain(&answer.alternatives);
        all.map(|e| [e.camera_from_target.translation.z, e.probability]).collect()
    }

    fn assert_poses(answer: &PoseAnswer, expected: &[[f64; 2]]) {
        let found = poses(answer);
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() < 1e-12, "{found} is not {expected}");
        }
    }

    #[test]
    fn an_answer_without_rivals_stays_as_it_is() {
        let alone = answer(&[estimate(5.0, 0.7), estimate(6.0, 0.3)]);
        assert_poses(&merged((1.0, alone), std::iter::empty()), &[[5.0, 0.7], [6.0, 0.3]]);
    }

    #[test]
    fn each_pose_has_the_probability_of_its_assignment_times_its_own() {
        let best = answer(&[estimate(5.0, 0.6), estimate(6.0, 0.4)]);
        let rival = answer(&[estimate(7.0, 1.0)]);
        // 0.75 * 0.6, 0.75 * 0.4, 0.25: in the order of probability.
        assert_poses(&merged((0.75, best), [(0.25, rival)].into_iter()), &[[5.0, 0.45], [6.0, 0.3], [7.0, 0.25]]);
    }

    #[test]
    fn a_rivals_pose_may_be_the_most_probable() {
        let best = answer(&[estimate(5.0, 0.5), estimate(6.0, 0.5)]);
        let rival = answer(&[estimate(7.0, 1.0)]);
        assert_poses(&merged((0.6, best), [(0.4, rival)].into_iter()), &[[7.0, 0.4], [5.0, 0.3], [6.0, 0.3]]);
    }

    #[test]
    fn poses_that_say_the_same_are_one() {
        // 2 cm apart: two standard deviations.
        let rival = answer(&[estimate(5.02, 1.0)]);
        assert_poses(&merged((0.8, answer(&[estimate(5.0, 1.0)])), [(0.2, rival)].into_iter()), &[[5.0, 1.0]]);
    }

    #[test]
    fn what_is_negligible_is_left_out() {
        let rival = answer(&[estimate(7.0, 1.0)]);
        let one = merged((1.0 - 5e-5, answer(&[estimate(5.0, 1.0)])), [(5e-5, rival)].into_iter());
        assert_eq!(one.alternatives, []);
    }
}
