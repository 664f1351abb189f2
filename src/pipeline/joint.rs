//! Which blobs are whose, when several targets, or several of a kind, are in one view.

use crate::camera::Camera;
use crate::identify::{Blob, Identified, IdentifyOptions, identify};
use crate::pose::NoPose;
use crate::target::Target;

/// One target in view, or why it is not.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Claim {
    /// Position of the target among those asked for.
    pub target: usize,
    /// Its blobs.
    pub identified: Result<Identified, NoPose>,
}

/// Every target among the blobs that no more probable one has claimed, up to `max_instances` of each: one claim for each
/// target, in the order asked for, with further ones of its kind after it, the most probable first.
pub(super) fn claims(
    camera: &Camera,
    targets: &[Target],
    blobs: &[Blob],
    max_instances: usize,
    options: &IdentifyOptions,
) -> Vec<Claim> {
    let mut taken = vec![false; blobs.len()];
    let mut made: Vec<Claim> = Vec::new();
    let mut open: Vec<Claim> = (0..targets.len())
        .map(|target| Claim { target, identified: identify(camera, &targets[target], blobs, options) })
        .collect();
    while let Some(next) = most_probable(&open) {
        let claim = open.remove(next);
        for blob in claim.blobs() {
            taken[blob] = true;
        }
        let again = |target: usize| Claim {
            target,
            identified: identify_free(camera, &targets[target], blobs, &taken, options),
        };
        for other in &mut open {
            if other.blobs().any(|blob| taken[blob]) {
                *other = again(other.target);
            }
        }
        let so_far = 1 + made.iter().filter(|known| known.target == claim.target).count();
        if claim.identified.is_ok() && so_far < max_instances {
            open.push(again(claim.target));
        }
        // That there is no second one is not worth a word.
        if claim.identified.is_ok() || so_far == 1 {
            made.push(claim);
        }
    }
    for index in 0..made.len() {
        let others: Vec<usize> =
            (0..made.len()).filter(|other| *other != index).flat_map(|o| made[o].blobs()).collect();
        if let Ok(identified) = &mut made[index].identified {
            identified.without_claimed(|blob| others.contains(&blob));
        }
    }
    // Stable: those of a kind stay in the order in which they were found.
    made.sort_by_key(|claim| claim.target);
    made
}

/// The one with the largest odds against chance; of equal ones the first asked for. Those that were not found come last.
fn most_probable(open: &[Claim]) -> Option<usize> {
    let odds = |claim: &Claim| claim.identified.as_ref().map_or(f64::NEG_INFINITY, |found| found.ln_odds);
    (0..open.len())
        .rev()
        .max_by(|&a, &b| odds(&open[a]).total_cmp(&odds(&open[b])).then(open[b].target.cmp(&open[a].target)))
}

impl Claim {
    /// The blobs of its best assignment.
    fn blobs(&self) -> impl Iterator<Item = usize> {
        let best = self.identified.as_ref().ok().map(|found| &found.hypotheses[0]);
        best.into_iter().flat_map(|best| best.blob_of_marker.iter().copied().flatten())
    }
}

/// The target among the blobs that are not taken.
fn identify_free(
    camera: &Camera,
    target: &Target,
    blobs: &[Blob],
    taken: &[bool],
    options: &IdentifyOptions,
) -> Result<Identified, NoPose> {
    let free: Vec<usize> = (0..blobs.len()).filter(|blob| !taken[*blob]).collect();
    let remaining: Vec<Blob> = free.iter().map(|&blob| blobs[blob]).collect();
    let mut identified = identify(camera, target, &remaining, options)?;
    for hypothesis in &mut identified.hypotheses {
        for blob in hypothesis.blob_of_marker.iter_mut().flatten() {
            *blob = free[*blob];
        }
    }
    Ok(identified)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::camera::Distortion;
    use crate::geometry::{CameraFromTarget, rotation};
    use crate::scene::models::wing_six;

    fn camera() -> Camera {
        Camera::checked([640, 480], [600.0; 2], [320.0, 240.0], Distortion::None).expect("a camera")
    }

    /// The wing's markers at several places from left to right, all nearer than the one before.
    fn wings(count: usize) -> Vec<Blob> {
        let (camera, target) = (camera(), wing_six());
        (0..count)
            .flat_map(|index| {
                let i = index as f64;
                let turn = rotation::exp(&Vector3::new(0.5, -0.3 + 0.3 * i, 0.8 * i));
                let pose = CameraFromTarget::new(turn, Vector3::new(-1.6 + 1.6 * i, 0.3 - 0.3 * i, 5.0 - 0.5 * i));
                let image = |m: &crate::target::Marker| camera.project(&(pose * m.position)).expect("in view");
                target.markers().iter().map(image).collect::<Vec<_>>()
            })
            .map(|pixel| Blob { pixel, sigma_px: 0.1, area_px: None })
            .collect()
    }

    fn found(targets: usize, wings_in_view: usize, max_instances: usize) -> Vec<(usize, Vec<usize>, usize)> {
        let options = IdentifyOptions { model_sigma_px: 0.0, ..IdentifyOptions::default() };
        let targets = vec![wing_six(); targets];
        let rivals = |claim: &Claim| claim.identified.as_ref().map_or(0, |found| found.hypotheses.len() - 1);
        claims(&camera(), &targets, &wings(wings_in_view), max_instances, &options)
            .iter()
            .map(|claim| (claim.target, claim.blobs().collect(), rivals(claim)))
            .collect()
    }

    /// The blobs of one wing, in the order of its markers.
    fn wing(index: usize) -> Vec<usize> {
        (6 * index..6 * index + 6).collect()
    }

    #[test]
    fn all_of_a_kind_are_found_up_to_the_number_asked_for_and_are_no_rivals() {
        for max_instances in 1..=4 {
            let found = found(1, 3, max_instances);
            assert_eq!(found.len(), max_instances.min(3), "{found:?}");
            let mut blobs: Vec<Vec<usize>> = found.iter().map(|(_, blobs, _)| blobs.clone()).collect();
            blobs.sort();
            assert!(blobs.iter().all(|b| (0..3).any(|i| *b == wing(i))), "{blobs:?}");
            blobs.dedup();
            assert_eq!(blobs.len(), found.len());
            if max_instances >= 3 {
                assert!(found.iter().all(|(_, _, rivals)| *rivals == 0), "{found:?}");
            }
        }
    }

    #[test]
    fn equal_targets_share_what_is_there() {
        let found = found(3, 2, 1);
        assert_eq!(found.iter().map(|(target, ..)| *target).collect::<Vec<_>>(), [0, 1, 2]);
        let mut blobs: Vec<Vec<usize>> = found.into_iter().map(|(_, blobs, _)| blobs).collect();
        assert!(!blobs[0].is_empty(), "the first asked for comes first");
        blobs.sort();
        assert_eq!(blobs, [vec![], wing(0), wing(1)]);
    }
}
