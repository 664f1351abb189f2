//! The spine: a frame in, an estimate out, on one screen.
//!
//! `Frame` → [`detect`](crate::detect::detect_with) → centroids → [`identify`](crate::identify::identify) → correspondences → [`estimate_pose`](crate::pose::estimate_pose) → poses.
//! Each stage reports to the caller when it is done; there is no clock in here.

mod again;
mod displaced;
mod joint;
mod merge;

use crate::camera::Camera;
use crate::detect::{Centroid, Detection, Detector, Workspace, detect_with};
use crate::frame::{Frame, FrameError, Region};
use crate::identify::{Blob, Hypothesis, Identified, IdentifyOptions};
use crate::pose::{NoPose, PoseAnswer, PoseOptions};
use crate::target::Target;
use displaced::Weighed;
use joint::Claim;

/// The stages, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Frame to centroids.
    Detect,
    /// Centroids to correspondences.
    Identify,
    /// Correspondences to poses, with a second look at markers whose shapes are known by then.
    Solve,
}

/// How a frame is to be looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The detector.
    pub detector: Detector,
    /// Where to look; the whole frame if `None`.
    pub region: Option<Region>,
    /// Identification.
    pub identify: IdentifyOptions,
    /// Most of each target that are looked for.
    pub max_instances: usize,
    /// Pose.
    pub pose: PoseOptions,
    /// Error of camera and target model, px, added to each centroid's own for the pose. The default is that of a model that is as good as what
    /// is stated of it: a camera's own covariance comes on top of it, and where residuals show more, the covariance grows with them.
    pub model_sigma_px: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            detector: Detector::default(),
            region: None,
            identify: IdentifyOptions::default(),
            max_instances: 1,
            pose: PoseOptions::default(),
            model_sigma_px: 0.01,
        }
    }
}

/// What a frame shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// The blobs.
    pub detection: Detection,
    /// One for each target asked for, in that order; where several of a target are in view, one for each of them.
    pub targets: Vec<TargetEstimate>,
}

/// What a frame tells of one target.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetEstimate {
    /// Position of the target among those asked for.
    pub target: usize,
    /// For each marker the centroid that it was identified with; all `None` if the target was not.
    pub centroid_of_marker: Vec<Option<usize>>,
    /// The poses, or why there is none.
    pub answer: Result<PoseAnswer, NoPose>,
}

impl TargetEstimate {
    /// The seed's word: at least four markers of the target found.
    #[must_use]
    pub fn is_detected(&self) -> bool {
        self.centroid_of_marker.iter().flatten().count() >= Target::MIN_MARKERS
    }
}

/// Looks for `targets` in `frame`; `on_stage` hears of every stage as it ends.
///
/// # Errors
/// [`FrameError::NotOfCamera`] if the frame is not of the camera's size, and the errors of a region that does not fit.
pub fn estimate(
    frame: &Frame,
    camera: &Camera,
    targets: &[Target],
    options: &Options,
    mut on_stage: impl FnMut(Stage),
) -> Result<Estimate, FrameError> {
    frame.check_camera(camera)?;
    let region = options.region.unwrap_or_else(|| frame.full()).checked(frame.width(), frame.height())?;
    let mut workspace = Workspace::default();
    let detection = detect_with(&mut workspace, frame, region, &options.detector);
    on_stage(Stage::Detect);
    Ok(estimate_of(detection, Some((frame, &mut workspace)), camera, targets, options, on_stage))
}

/// As [`estimate`] in a frame of the camera whose blobs were found already, as those of a sequence are. Where the frame is there
/// to be looked at, in memory for that, markers are located once more when their shapes are known.
pub fn estimate_of(
    mut detection: Detection,
    frame: Option<(&Frame, &mut Workspace)>,
    camera: &Camera,
    targets: &[Target],
    options: &Options,
    mut on_stage: impl FnMut(Stage),
) -> Estimate {
    let blobs = blobs_of(&detection, &options.detector);
    let claims = joint::claims(camera, targets, &blobs, options.max_instances, &options.identify);
    on_stage(Stage::Identify);
    if let Some((frame, workspace)) = frame {
        let mut looking = again::Looking { frame, workspace, detector: &options.detector };
        for claim in &claims {
            if let Ok(identified) = &claim.identified {
                looking.look_again(camera, &targets[claim.target], identified, &mut detection.centroids);
            }
        }
    }
    let blobs = blobs_of(&detection, &options.detector);
    let centroids = &mut detection.centroids;
    let targets = claims
        .into_iter()
        .map(|claim| solved(camera, &targets[claim.target], &blobs, claim, options, centroids))
        .collect();
    on_stage(Stage::Solve);
    Estimate { detection, targets }
}

fn blobs_of(detection: &Detection, detector: &Detector) -> Vec<Blob> {
    let area_px = |centroid: &Centroid| detector.measures_area().then_some(centroid.area_px);
    let blob = |c: &Centroid| Blob { pixel: c.pixel, sigma_px: c.sigma_px, area_px: area_px(c) };
    detection.centroids.iter().map(blob).collect()
}

/// What is told of a target; of its `centroids` those are less certain of which the others tell that their light lies aside.
fn solved(
    camera: &Camera,
    target: &Target,
    blobs: &[Blob],
    claim: Claim,
    options: &Options,
    centroids: &mut [Centroid],
) -> TargetEstimate {
    let (centroid_of_marker, answer) = match claim.identified {
        Ok(identified) => {
            let centroid_of_marker = identified.hypotheses[0].blob_of_marker.clone();
            let weighed = weighed_of_all(camera, target, blobs, &identified, &options.pose, options.model_sigma_px);
            let answer = weighed.map(|weighed| {
                for (blob, displacement_px) in centroid_of_marker.iter().flatten().zip(weighed.displacement_px) {
                    centroids[*blob].sigma_px = centroids[*blob].sigma_px.hypot(displacement_px);
                }
                weighed.answer
            });
            (centroid_of_marker, answer)
        }
        Err(reason) => (vec![None; target.markers().len()], Err(reason)),
    };
    TargetEstimate { target: claim.target, centroid_of_marker, answer }
}

/// The poses of every assignment, together: the best first, those of rival assignments among the alternatives.
///
/// # Errors
/// Why the method asked for has none for the best assignment.
pub fn answer_of_all(
    camera: &Camera,
    target: &Target,
    blobs: &[Blob],
    identified: &Identified,
    options: &PoseOptions,
    model_sigma_px: f64,
) -> Result<PoseAnswer, NoPose> {
    weighed_of_all(camera, target, blobs, identified, options, model_sigma_px).map(|weighed| weighed.answer)
}

/// As [`answer_of_all`], with what the best assignment says of its pairs.
fn weighed_of_all(
    camera: &Camera,
    target: &Target,
    blobs: &[Blob],
    identified: &Identified,
    options: &PoseOptions,
    model_sigma_px: f64,
) -> Result<Weighed, NoPose> {
    let weighed = |hypothesis: &Hypothesis| weighed_of(camera, target, blobs, hypothesis, options, model_sigma_px);
    let Weighed { answer, displacement_px } = weighed(&identified.hypotheses[0])?;
    let rivals = identified.hypotheses[1..]
        .iter()
        .filter_map(|hypothesis| Some((hypothesis.probability, weighed(hypothesis).ok()?.answer)));
    let answer = merge::merged((identified.hypotheses[0].probability, answer), rivals);
    Ok(Weighed { answer, displacement_px })
}

/// The answer for one assignment, by the method asked for.
fn weighed_of(
    camera: &Camera,
    target: &Target,
    blobs: &[Blob],
    hypothesis: &Hypothesis,
    options: &PoseOptions,
    model_sigma_px: f64,
) -> Result<Weighed, NoPose> {
    let correspondences = hypothesis.correspondences(camera, target, blobs, model_sigma_px);
    let radius_px = |blob: &usize| Some((blobs[*blob].area_px? / std::f64::consts::PI).sqrt());
    let radii_px: Vec<Option<f64>> = hypothesis.blob_of_marker.iter().flatten().map(radius_px).collect();
    let Weighed { answer, displacement_px } = displaced::weighed(camera, &correspondences, &radii_px, options)?;
    Ok(Weighed { answer: hypothesis.possible(target, answer)?, displacement_px })
}
