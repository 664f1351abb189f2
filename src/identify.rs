//! Which blob is which marker.
//!
//! The blobs look alike, come in no order, lack some markers and hold clutter. Three markers tried on three blobs give a
//! few poses (P3P); each pose predicts where the other markers must be; those found there make an assignment. What is left
//! is weighed: every assignment against every other and against "all of it is clutter", by the probability of the picture
//! under each. A mirrored or turned match loses on its residuals, or ties, and then it is reported as tied.
//!
//! Nothing is accepted because it is the best: it must be far more probable than chance.

mod bases;
mod cloud;
mod search;
mod weigh;
mod worth;

use crate::camera::{Camera, Pixel};
use crate::geometry::CameraFromTarget;
use crate::pose::{NoPose, PoseAnswer};
use crate::refine::Correspondence;
use crate::target::Target;
use search::{Scope, Sky};

/// A blob that may be a marker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blob {
    /// Where it is, px.
    pub pixel: Pixel,
    /// Standard deviation per axis, px.
    pub sigma_px: f64,
    /// Its area, px, where it was measured.
    pub area_px: Option<f64>,
}

/// What is assumed, and what is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IdentifyOptions {
    /// Error of camera and target model, px, added to each blob's own when markers are told apart: what an ordinary
    /// calibration and a ruler leave.
    pub model_sigma_px: f64,
    /// A marker turned away from the camera by more than this is too thin to be seen.
    pub max_tilt_rad: f64,
    /// Fewest markers that make a detection; the seed's rule.
    pub min_markers: usize,
    /// How often a marker that faces the camera is not among the blobs.
    pub miss_probability: f64,
    /// How often the target is in view at all, before looking.
    pub presence_probability: f64,
    /// An answer whose assignments together are less probable than this is refused.
    pub min_probability: f64,
    /// Blobs considered, the first ones given. The work grows with their third power.
    pub max_blobs: usize,
    /// Triples of blobs tried before the search is given up.
    pub max_trials: usize,
    /// Nearest and farthest range expected, m, evenly likely on a logarithmic scale.
    pub range_m: [f64; 2],
}

impl Default for IdentifyOptions {
    fn default() -> Self {
        Self {
            model_sigma_px: 0.3,
            max_tilt_rad: 80.0_f64.to_radians(),
            min_markers: 4,
            miss_probability: 0.1,
            presence_probability: 0.5,
            min_probability: 0.9999,
            max_blobs: 48,
            max_trials: 1_000_000,
            range_m: [0.2, 200.0],
        }
    }
}

impl IdentifyOptions {
    /// What the logarithm of a Bayes factor must be for an answer.
    fn ln_odds_needed(&self) -> f64 {
        let odds = |p: f64| (p / (1.0 - p)).ln();
        odds(self.min_probability) - odds(self.presence_probability)
    }

    /// Whether a marker can be seen at this pose.
    fn shows(&self, target: &Target, marker: usize, pose: &CameraFromTarget) -> bool {
        target.facing_cosine(marker, pose).is_none_or(|cosine| cosine > self.max_tilt_rad.cos())
    }
}

/// One way to assign the blobs.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// For each marker the position of its blob, if it has one.
    pub blob_of_marker: Vec<Option<usize>>,
    /// The pose of the target under this assignment, with its own alternatives.
    pub answer: PoseAnswer,
    /// Of this assignment, against all others and against clutter alone.
    pub probability: f64,
}

impl Hypothesis {
    /// Number of markers found.
    #[must_use]
    pub fn found(&self) -> usize {
        self.blob_of_marker.iter().flatten().count()
    }

    /// Its pairs of marker and blob with the blobs' own uncertainty, `model_sigma_px` added. Blobs are moved by what lies
    /// between the centroid of a disc's image and the image of its centre at the hypothesis' pose.
    #[must_use]
    pub fn correspondences(
        &self,
        camera: &Camera,
        target: &Target,
        blobs: &[Blob],
        model_sigma_px: f64,
    ) -> Vec<Correspondence> {
        let pose = &self.answer.best.camera_from_target;
        pairs(target, &self.blob_of_marker)
            .map(|(marker, blob)| Correspondence {
                point: target.markers()[marker].position,
                pixel: blobs[blob].pixel - target.centroid_offset(marker, camera, pose),
                sigma_px: blobs[blob].sigma_px.hypot(model_sigma_px),
            })
            .collect()
    }

    /// `answer` without the poses in which a marker that was seen faces away.
    ///
    /// # Errors
    /// [`NoPose::DegenerateGeometry`] if no pose is left.
    pub fn possible(&self, target: &Target, answer: PoseAnswer) -> Result<PoseAnswer, NoPose> {
        answer
            .restricted(|pose| pairs(target, &self.blob_of_marker).all(|(marker, _)| target.faces_camera(marker, pose)))
    }
}

/// The pairs of an assignment.
fn pairs<'a>(target: &'a Target, blob_of_marker: &'a [Option<usize>]) -> impl Iterator<Item = (usize, usize)> + 'a {
    (0..target.markers().len()).filter_map(|marker| Some((marker, blob_of_marker[marker]?)))
}

/// The assignments that explain the blobs, by falling probability; never empty. Assignments that cannot be told apart share
/// the probability.
#[derive(Clone, Debug, PartialEq)]
pub struct Identified {
    /// The assignments.
    pub hypotheses: Vec<Hypothesis>,
    /// Logarithm of the odds that the target is there, and not chance alone.
    pub ln_odds: f64,
    /// How much was looked at.
    pub stats: Stats,
}

impl Identified {
    /// Drops the rivals of the best assignment that need a blob which another target has.
    pub fn without_claimed(&mut self, is_claimed: impl Fn(usize) -> bool) {
        let total = |hypotheses: &[Hypothesis]| hypotheses.iter().map(|h| h.probability).sum::<f64>();
        let before = total(&self.hypotheses);
        let mut is_best = true;
        self.hypotheses.retain(|hypothesis| {
            std::mem::take(&mut is_best) || !hypothesis.blob_of_marker.iter().flatten().any(|blob| is_claimed(*blob))
        });
        let share = before / total(&self.hypotheses);
        for hypothesis in &mut self.hypotheses {
            hypothesis.probability *= share;
        }
    }
}

/// The work done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// Triples of blobs tried on triples of markers.
    pub triples: usize,
    /// Of these, triples for which poses were computed.
    pub solved: usize,
    /// Assignments refined and weighed.
    pub weighed: usize,
}

/// So many markers are found together by chance only where everything is near everything; then it is looked at more closely.
const ENOUGH_MARKERS: usize = 9;

/// Finds the target among the blobs.
///
/// # Errors
/// [`NoPose::TooFewPoints`] for fewer blobs than make a detection, [`NoPose::NotIdentified`] if no assignment is probable
/// enough, or none was before the trials ran out.
pub fn identify(
    camera: &Camera,
    target: &Target,
    blobs: &[Blob],
    options: &IdentifyOptions,
) -> Result<Identified, NoPose> {
    let blobs = &blobs[..blobs.len().min(options.max_blobs)];
    let need = options.min_markers.max(Target::MIN_MARKERS);
    if blobs.len() < need {
        return Err(NoPose::TooFewPoints { given: blobs.len(), need });
    }
    let mut stats = Stats::default();
    let sky = Sky::of(camera, target, blobs, options);
    let mut weighed = weigh::Scale::new(camera, target, blobs, options);
    let enough = need.max(ENOUGH_MARKERS).max(target.markers().len() * 6 / 10);
    let everything = |_: usize| true;
    let everyone = 0..=usize::MAX;
    let mut gave_up = false;
    for (markers, bases) in bases::of(target, need) {
        let mut look = |weighed: &mut weigh::Scale<'_>, scope: &Scope<'_>| {
            let found: Vec<_> =
                bases.iter().flat_map(|base| search::candidates(&sky, target, base, scope, &mut stats)).collect();
            let most = found.iter().map(search::Candidate::found).max();
            weighed.add_all(found, &mut stats);
            weighed.add_exchanges(&mut stats);
            most.unwrap_or(0)
        };
        // A match that takes more markers than this to be more than chance was found before, if it is there. It is looked
        // for again only to see whether what was found has rivals.
        let was_likely = weighed.is_likely();
        let needs = if was_likely { everyone.clone() } else { 0..=markers };
        let most = look(&mut weighed, &Scope { takes: &everything, enough, needs: needs.clone() });
        if let Some(best) = weighed.beyond_doubt(enough) {
            // What resembles it, and another target like it.
            let taken: Vec<usize> = best.blob_of_marker.iter().copied().flatten().collect();
            for its_own in [true, false] {
                let takes = |blob| taken.contains(&blob) == its_own;
                look(&mut weighed, &Scope { takes: &takes, enough: usize::MAX, needs: everyone.clone() });
            }
            break;
        }
        if most >= enough {
            look(&mut weighed, &Scope { takes: &everything, enough: usize::MAX, needs });
        }
        if weighed.is_likely() && !was_likely && markers < target.markers().len() {
            look(&mut weighed, &Scope { takes: &everything, enough: usize::MAX, needs: markers + 1..=usize::MAX });
        }
        // What other bases could still find has fewer markers, and no weight beside this.
        if weighed.is_decided(markers - 1) {
            break;
        }
        gave_up = stats.triples >= options.max_trials;
        if gave_up {
            break;
        }
    }
    if gave_up {
        return Err(NoPose::NotIdentified {
            detail: format!(
                "gave up looking for {:?} among the {} blobs after {} trials of three markers on three blobs",
                target.name(),
                blobs.len(),
                stats.triples
            ),
        });
    }
    let (hypotheses, ln_odds) = weighed.ranked()?;
    Ok(Identified { hypotheses, ln_odds, stats })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::camera::Distortion;
    use crate::geometry::rotation;
    use crate::scene::models::wing_six;
    use crate::target::Marker;

    fn camera() -> Camera {
        Camera::checked([640, 480], [600.0; 2], [320.0, 240.0], Distortion::None).expect("a camera")
    }

    fn pose() -> CameraFromTarget {
        CameraFromTarget::new(rotation::exp(&Vector3::new(0.5, -0.3, 0.8)), Vector3::new(0.1, -0.2, 3.0))
    }

    /// The markers' images, in the order of the markers.
    fn blobs(target: &Target) -> Vec<Blob> {
        let pixel = |marker: &Marker| camera().project(&(pose() * marker.position)).expect("in view");
        target.markers().iter().map(|m| Blob { pixel: pixel(m), sigma_px: 0.1, area_px: None }).collect()
    }

    fn exact() -> IdentifyOptions {
        IdentifyOptions { model_sigma_px: 0.0, ..IdentifyOptions::default() }
    }

    /// A square that faces the camera.
    fn square() -> Target {
        let corners = [("a", [0.3, 0.3]), ("b", [-0.3, 0.3]), ("c", [-0.3, -0.3]), ("d", [0.3, -0.3])];
        let marker = |(id, [x, y]): (&str, [f64; 2])| Marker {
            id: id.into(),
            position: [x, y, 0.0].into(),
            radius_m: None,
            normal: Some(-Vector3::z()),
        };
        Target::checked("square", corners.into_iter().map(marker).collect()).expect("a good target")
    }

    #[test]
    fn blobs_are_told_apart_in_any_order() {
        let (target, mut blobs) = (wing_six(), blobs(&wing_six()));
        for turn in 0..6 {
            let found = identify(&camera(), &target, &blobs, &exact()).expect("all six are there");
            let expected: Vec<_> = (0..6).map(|marker| Some((marker + 6 - turn) % 6)).collect();
            assert_eq!(found.hypotheses[0].blob_of_marker, expected);
            assert!(found.hypotheses[0].probability > 0.9999);
            blobs.rotate_left(1);
        }
    }

    #[test]
    fn fewer_blobs_than_a_detection_takes_are_too_few() {
        let blobs = blobs(&wing_six());
        let too_few = |given, need| Err(NoPose::TooFewPoints { given, need });
        assert_eq!(identify(&camera(), &wing_six(), &blobs[..3], &exact()), too_few(3, 4));
        let five = IdentifyOptions { min_markers: 5, ..exact() };
        assert_eq!(identify(&camera(), &wing_six(), &blobs[..4], &five), too_few(4, 5));
        assert!(identify(&camera(), &wing_six(), &blobs[..5], &five).is_ok());
        let first_three = IdentifyOptions { max_blobs: 3, ..exact() };
        assert_eq!(identify(&camera(), &wing_six(), &blobs, &first_three), too_few(3, 4));
    }

    #[test]
    fn assignments_that_cannot_be_told_apart_share_the_probability() {
        let target = square();
        let found = identify(&camera(), &target, &blobs(&target), &exact()).expect("a square");
        // Four turns of a square; mirrored it would face away.
        assert_eq!(found.hypotheses.len(), 4, "{:?}", found.hypotheses);
        for (index, hypothesis) in found.hypotheses.iter().enumerate() {
            assert_eq!(hypothesis.found(), 4);
            // Perspective prefers none, as every corner is a corner: equal but for the curvature about each minimum.
            assert!((hypothesis.probability - 0.25).abs() < 0.01, "{index}: {}", hypothesis.probability);
        }
    }

    #[test]
    fn a_target_that_faces_away_is_not_the_one_that_was_seen() {
        let away = |marker: &Marker| Marker { normal: Some(Vector3::z()), ..marker.clone() };
        let target = Target::checked("away", wing_six().markers().iter().map(away).collect()).expect("a good target");
        let found = identify(&camera(), &target, &blobs(&wing_six()), &exact());
        assert!(matches!(found, Err(NoPose::NotIdentified { .. })), "{found:?}");
    }

    #[test]
    fn a_range_that_was_not_expected_is_refused() {
        let far = IdentifyOptions { range_m: [5.0, 200.0], ..exact() };
        let found = identify(&camera(), &wing_six(), &blobs(&wing_six()), &far);
        assert!(matches!(found, Err(NoPose::NotIdentified { .. })), "{found:?}");
    }

    #[test]
    fn blobs_of_the_wrong_size_are_not_the_target() {
        // The discs of 30 mm have an area of 110 px at 3 m.
        let sized = |area_px| -> Vec<Blob> {
            blobs(&wing_six()).into_iter().map(|blob| Blob { area_px: Some(area_px), ..blob }).collect()
        };
        assert!(identify(&camera(), &wing_six(), &sized(100.0), &exact()).is_ok());
        assert!(identify(&camera(), &wing_six(), &sized(3000.0), &exact()).is_err());
    }
}
