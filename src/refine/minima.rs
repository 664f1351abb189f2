//! Which minima are really different.

use super::Refined;

/// Minima closer than this many standard deviations are one: two iterations that ended in the same valley.
const SAME_WITHIN: f64 = 1e-2;

/// The different ones among `found`, by rising chi-square.
#[must_use]
pub fn distinct(mut found: Vec<Refined>) -> Vec<Refined> {
    found.sort_by(|a, b| a.chi_square.total_cmp(&b.chi_square));
    let mut kept: Vec<Refined> = Vec::new();
    for candidate in found {
        let fresh = kept.iter().all(|known| {
            known.covariance.normalized_error_squared(&known.camera_from_target, &candidate.camera_from_target)
                > SAME_WITHIN * SAME_WITHIN
        });
        if fresh {
            kept.push(candidate);
        }
    }
    kept
}
