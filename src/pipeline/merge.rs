//! The poses of several assignments as one answer.

use crate::pose::{PoseAnswer, PoseEstimate};

/// Poses nearer than this, in squared standard deviations, say the same: assignments that differ by one blob.
const SAME_WITHIN_SQUARED: f64 = 9.0;

/// Poses less probable than this are left out.
const NEGLIGIBLE: f64 = 1e-4;

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
