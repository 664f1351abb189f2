//! The spine: a frame in, an estimate out, on one screen.
//!
//! `Frame` → [`detect`] → centroids → [`identify`] → correspondences → [`estimate_pose`] → poses. Each stage reports to the
//! caller when it is done; there is no clock in here.

mod merge;

use crate::camera::Camera;
use crate::detect::{Detection, Detector, detect};
use crate::frame::{Frame, FrameError, Region};
use crate::identify::{Blob, Hypothesis, Identified, IdentifyOptions, identify};
use crate::pose::{NoPose, PoseAnswer, PoseOptions, estimate_pose};
use crate::target::Target;

/// The stages, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Frame to centroids.
    Detect,
    /// Centroids to correspondences.
    Identify,
    /// Correspondences to poses.
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
    /// Pose.
    pub pose: PoseOptions,
    /// Error of camera and target model, px, added to each centroid's own for the pose. The default is that of a careful
    /// calibration; where residuals show more, the covariance grows with them.
    pub model_sigma_px: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            detector: Detector::default(),
            region: None,
            identify: IdentifyOptions::default(),
            pose: PoseOptions::default(),
            model_sigma_px: 0.02,
        }
    }
}

/// What a frame shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// The blobs.
    pub detection: Detection,
    /// One for each target asked for, in that order.
    pub targets: Vec<TargetEstimate>,
}

/// What a frame tells of one target.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetEstimate {
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
    let detection = detect(frame, region, &options.detector);
    on_stage(Stage::Detect);
    let blobs: Vec<Blob> = detection
        .centroids
        .iter()
        .map(|c| Blob { pixel: c.pixel, sigma_px: c.sigma_px, area_px: Some(c.area_px) })
        .collect();
    let identified = identify_all(camera, targets, &blobs, &options.identify);
    on_stage(Stage::Identify);
    let targets = identified
        .into_iter()
        .zip(targets)
        .map(|(identified, target)| match identified {
            Ok(identified) => solved(camera, target, &blobs, &identified, options),
            Err(reason) => {
                TargetEstimate { centroid_of_marker: vec![None; target.markers().len()], answer: Err(reason) }
            }
        })
        .collect();
    on_stage(Stage::Solve);
    Ok(Estimate { detection, targets })
}

/// Each target among the blobs that no more probable target has claimed.
fn identify_all(
    camera: &Camera,
    targets: &[Target],
    blobs: &[Blob],
    options: &IdentifyOptions,
) -> Vec<Result<Identified, NoPose>> {
    let mut found: Vec<_> = targets.iter().map(|target| identify(camera, target, blobs, options)).collect();
    let claims = |result: &Result<Identified, NoPose>| -> Vec<usize> {
        result
            .as_ref()
            .map_or_else(|_| Vec::new(), |i| i.hypotheses[0].blob_of_marker.iter().copied().flatten().collect())
    };
    // By falling number of markers found, then in the order asked for.
    let mut order: Vec<usize> = (0..targets.len()).collect();
    order.sort_by_key(|&t| std::cmp::Reverse(claims(&found[t]).len()));
    let mut taken: Vec<usize> = Vec::new();
    for t in order {
        if claims(&found[t]).iter().any(|blob| taken.contains(blob)) {
            let free: Vec<usize> = (0..blobs.len()).filter(|blob| !taken.contains(blob)).collect();
            let remaining: Vec<Blob> = free.iter().map(|&blob| blobs[blob]).collect();
            found[t] = identify(camera, &targets[t], &remaining, options).map(|mut identified| {
                for hypothesis in &mut identified.hypotheses {
                    for blob in hypothesis.blob_of_marker.iter_mut().flatten() {
                        *blob = free[*blob];
                    }
                }
                identified
            });
        }
        taken.extend(claims(&found[t]));
    }
    found
}

fn solved(
    camera: &Camera,
    target: &Target,
    blobs: &[Blob],
    identified: &Identified,
    options: &Options,
) -> TargetEstimate {
    TargetEstimate {
        centroid_of_marker: identified.hypotheses[0].blob_of_marker.clone(),
        answer: answer_of_all(camera, target, blobs, identified, &options.pose, options.model_sigma_px),
    }
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
    let answer = |hypothesis: &Hypothesis| -> Result<(f64, PoseAnswer), NoPose> {
        Ok((hypothesis.probability, answer_of(camera, target, blobs, hypothesis, options, model_sigma_px)?))
    };
    let best = answer(&identified.hypotheses[0])?;
    let rivals = identified.hypotheses[1..].iter().filter_map(|hypothesis| answer(hypothesis).ok());
    Ok(merge::merged(best, rivals))
}

/// The answer for one assignment, by the method asked for.
fn answer_of(
    camera: &Camera,
    target: &Target,
    blobs: &[Blob],
    hypothesis: &Hypothesis,
    options: &PoseOptions,
    model_sigma_px: f64,
) -> Result<PoseAnswer, NoPose> {
    let correspondences = hypothesis.correspondences(camera, target, blobs, model_sigma_px);
    let answer = estimate_pose(camera, &correspondences, options)?;
    hypothesis.possible(target, answer)
}
