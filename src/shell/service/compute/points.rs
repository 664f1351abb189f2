//! Points to pose.

use std::time::Instant;

use nalgebra::{Vector2, Vector3};
use serde_json::Value;

use super::Terms;
use crate::camera::{Camera, Pixel};
use crate::geometry::{Point, space};
use crate::identify::{Blob, IdentifyOptions, identify};
use crate::pose::{NoPose, PoseAnswer, PoseOptions, PosePrior, estimate_pose, estimate_pose_robustly};
use crate::refine;
use crate::shell::fault::Fault;
use crate::shell::service::lookup::Lookup;
use crate::shell::wire::PoseRequest;
use crate::shell::wire::pose::{Correspondence, FailedRequest, PoseReplies, PoseReply, PoseReplyOrError};
use crate::target::{Marker, Target};

/// A pose request that makes sense.
#[derive(Debug)]
pub struct PoseTask {
    id: Option<Value>,
    camera: Camera,
    points: Vec<Point<space::Target>>,
    pixels: Vec<Pixel>,
    /// For each image point.
    sigmas_px: Vec<f64>,
    options: PoseOptions,
    prior: Option<PosePrior>,
    mode: Mode,
}

/// What is known of the pairs.
#[derive(Debug)]
enum Mode {
    /// Image point i is object point i.
    Known,
    /// So, but some pairs are wrong.
    Outliers,
    /// No order; the object points as a target.
    Unknown(Target),
}

impl PoseTask {
    /// Checks everything that can be wrong with a request.
    ///
    /// # Errors
    /// Names the field and the numbers.
    pub async fn checked(request: PoseRequest, lookup: &Lookup<'_>, terms: &Terms) -> Result<Self, Fault> {
        let camera = lookup.camera(&request.camera).await.map_err(|fault| fault.within("/camera"))?;
        let (objects, images) = (request.object_points_m.len(), request.image_points_px.len());
        let least = request.solver.min_points();
        let unknown = request.correspondence == Correspondence::Unknown;
        let most_seen = if unknown { terms.identify.max_blobs } else { terms.max_points };
        check_count("/object_points_m", objects, least, terms.max_points)?;
        // With unknown correspondence too few image points are an answer: the target is not in view.
        check_count("/image_points_px", images, if unknown { 0 } else { least }, most_seen)?;
        if !unknown && objects != images {
            let detail =
                format!("{images} image points for {objects} object points: with known correspondence they pair up");
            return Err(Fault::senseless("/image_points_px", detail));
        }
        check_values("/object_points_m", &request.object_points_m, 1e6)?;
        check_values("/image_points_px", &request.image_points_px, 1e9)?;
        let sigmas_px = match request.pixel_sigmas {
            Some(sigmas) if sigmas.len() != images => {
                let detail = format!("{} standard deviations for {images} image points", sigmas.len());
                return Err(Fault::senseless("/pixel_sigmas", detail));
            }
            Some(sigmas) => {
                for (index, sigma) in sigmas.iter().enumerate() {
                    check_sigma(format!("/pixel_sigmas/{index}"), *sigma)?;
                }
                sigmas
            }
            None => {
                check_sigma("/pixel_sigma", request.pixel_sigma)?;
                vec![request.pixel_sigma; images]
            }
        };
        let prior = request.prior.as_ref().map(PosePrior::try_from).transpose();
        let prior = prior.map_err(|fault| fault.within("/prior"))?;
        let mode = match (request.correspondence, request.outliers) {
            (Correspondence::Known, false) => Mode::Known,
            (Correspondence::Known, true) => Mode::Outliers,
            // Identification drops what does not fit, so outliers need no second word.
            (Correspondence::Unknown, _) => Mode::Unknown(target_of(&request.object_points_m)?),
        };
        Ok(Self {
            id: request.id,
            camera,
            points: request.object_points_m.into_iter().map(Point::from).collect(),
            pixels: request.image_points_px.into_iter().map(Vector2::from).collect(),
            sigmas_px,
            options: PoseOptions { noise: request.noise.into(), ..request.solver.options(request.refine) },
            prior,
            mode,
        })
    }

    /// The reply.
    #[must_use]
    pub fn reply(self, terms: &Terms) -> PoseReply {
        let start = Instant::now();
        let (answer, inliers, assignment) = match &self.mode {
            Mode::Known => (estimate_pose(&self.camera, &self.correspondences(), &self.options), None, None),
            Mode::Outliers => match estimate_pose_robustly(&self.camera, &self.correspondences(), &self.options) {
                Ok((answer, inliers)) => (Ok(answer), Some(inliers), None),
                Err(reason) => (Err(reason), Some(vec![false; self.points.len()]), None),
            },
            Mode::Unknown(target) => {
                let (answer, assignment) = self.identified(target, terms);
                (answer, None, Some(assignment))
            }
        };
        let middle = self.points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / self.points.len() as f64;
        let answer = match &self.prior {
            Some(prior) => answer.and_then(|answer| answer.given(prior, &Point::from(middle))),
            None => answer,
        };
        PoseReply {
            id: self.id,
            noise_scale: answer.as_ref().ok().map(|answer| answer.noise_scale),
            answer: (&answer).into(),
            inliers,
            assignment_probability: assignment.as_ref().and_then(|(_, probability)| *probability),
            assignment: assignment.map(|(assignment, _)| assignment),
            elapsed_us: start.elapsed().as_secs_f64() * 1e6,
        }
    }

    fn correspondences(&self) -> Vec<refine::Correspondence> {
        let pair = |((point, pixel), sigma_px): ((&Point<space::Target>, &Pixel), &f64)| refine::Correspondence {
            point: *point,
            pixel: *pixel,
            sigma_px: *sigma_px,
        };
        self.points.iter().zip(&self.pixels).zip(&self.sigmas_px).map(pair).collect()
    }

    /// The answer of the best assignment with the poses of its rivals among the alternatives, and for each image point its
    /// object point, with the assignment's probability.
    fn identified(&self, target: &Target, terms: &Terms) -> (Result<PoseAnswer, NoPose>, Assignment) {
        let blob = |(pixel, sigma_px): (&Pixel, &f64)| Blob { pixel: *pixel, sigma_px: *sigma_px, area_px: None };
        let blobs: Vec<Blob> = self.pixels.iter().zip(&self.sigmas_px).map(blob).collect();
        // The caller states the whole uncertainty of the points.
        let options = IdentifyOptions { model_sigma_px: 0.0, ..terms.identify };
        let identified = match identify(&self.camera, target, &blobs, &options) {
            Ok(identified) => identified,
            Err(reason) => return (Err(reason), (vec![None; blobs.len()], None)),
        };
        let best = &identified.hypotheses[0];
        let mut assignment = vec![None; blobs.len()];
        for (marker, blob) in best.blob_of_marker.iter().enumerate() {
            if let Some(blob) = blob {
                assignment[*blob] = Some(marker);
            }
        }
        let answer = crate::pipeline::answer_of_all(&self.camera, target, &blobs, &identified, &self.options, 0.0);
        (answer, (assignment, Some(best.probability)))
    }
}

/// For each image point its object point, and the probability of that.
type Assignment = (Vec<Option<usize>>, Option<f64>);

fn check_count(pointer: &str, given: usize, least: usize, most: usize) -> Result<(), Fault> {
    if (least..=most).contains(&given) {
        return Ok(());
    }
    Err(Fault::senseless(pointer, format!("{given} points: from {least} to {most} are accepted here")))
}

fn check_sigma(pointer: impl Into<String>, sigma: f64) -> Result<(), Fault> {
    if (1e-6..=1e6).contains(&sigma) {
        return Ok(());
    }
    let detail = format!("{sigma}: a standard deviation from 0.000001 to 1000000 px is accepted");
    Err(Fault::senseless(pointer, detail))
}

fn check_values<const N: usize>(pointer: &str, points: &[[f64; N]], most: f64) -> Result<(), Fault> {
    for (index, point) in points.iter().enumerate() {
        for (axis, value) in point.iter().enumerate() {
            if !(value.abs() <= most) {
                let detail = format!("{value} is not a finite number within {most}");
                return Err(Fault::senseless(format!("{pointer}/{index}/{axis}"), detail));
            }
        }
    }
    Ok(())
}

/// The object points as a constellation of markers named by their index.
fn target_of(points: &[[f64; 3]]) -> Result<Target, Fault> {
    let marker = |(index, position): (usize, &[f64; 3])| Marker {
        id: index.to_string(),
        position: (*position).into(),
        radius_m: None,
        normal: None,
    };
    Target::checked("points", points.iter().enumerate().map(marker).collect()).map_err(|error| {
        let pointer =
            error.place().map_or_else(|| "/object_points_m".into(), |(index, _)| format!("/object_points_m/{index}"));
        Fault::senseless(pointer, error.to_string())
    })
}

/// One of many requests: to be computed, or already failed.
#[derive(Debug)]
pub enum BatchItem {
    /// To be computed.
    Task(Box<PoseTask>),
    /// What is wrong with it, and its id.
    Failed(Option<Value>, Fault),
}

impl BatchItem {
    /// Reads and checks one request.
    pub async fn read(request: Value, lookup: &Lookup<'_>, terms: &Terms) -> Self {
        let id = request.get("id").cloned();
        let parsed = crate::shell::wire::from_value::<PoseRequest>(request);
        let checked = match parsed {
            Ok(request) => PoseTask::checked(request, lookup, terms).await,
            Err(fault) => Err(fault),
        };
        match checked {
            Ok(task) => Self::Task(Box::new(task)),
            Err(fault) => Self::Failed(id, fault),
        }
    }

    /// The reply, or what is wrong.
    #[must_use]
    pub fn reply(self, terms: &Terms) -> PoseReplyOrError {
        match self {
            Self::Task(task) => PoseReplyOrError::Reply(Box::new(task.reply(terms))),
            Self::Failed(id, fault) => PoseReplyOrError::Failed(FailedRequest { id, error: (&fault).into() }),
        }
    }
}

/// The replies in the order of the requests.
#[must_use]
pub fn batch(items: Vec<BatchItem>, terms: &Terms) -> PoseReplies {
    PoseReplies { replies: items.into_iter().map(|item| item.reply(terms)).collect() }
}
