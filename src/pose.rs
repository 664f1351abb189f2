//! Correspondences to an answer: the best pose with its covariance, its runners-up with probabilities, or the reason why
//! there is none.

mod evidence;
mod prior;
mod propagation;
mod robust;
mod starts;

use thiserror::Error;

use crate::camera::Camera;
use crate::geometry::{CameraFromTarget, PoseCovariance};
use crate::refine::{Correspondence, RefineOptions, Refined, Stop, distinct, refine};
use crate::solve::{Pair, SolveError, Solver, is_in_front};
use starts::Start;

pub use evidence::Consistency;
pub use prior::PosePrior;
pub use robust::estimate_pose_robustly;

/// How a pose is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseOptions {
    /// The method by name, or `None` for the best answer that we know.
    pub solver: Option<Solver>,
    /// Minimise the reprojection error from the method's pose. A named method without refinement is that method alone, as
    /// its paper has it.
    pub refine: bool,
    /// Residuals of up to this many times their stated standard deviation still count as explained (the covariance grows
    /// with them); larger ones mean that pairs, camera or target are wrong.
    pub max_residual_ratio: f64,
    /// How large the noise of the image points is.
    pub noise: Noise,
    /// When refinement stops.
    pub refinement: RefineOptions,
}

/// How large the noise of the image points is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Noise {
    /// As large as stated, unless the residuals say otherwise beyond doubt.
    #[default]
    Stated,
    /// Unknown: the stated deviations only say how the points compare, the residuals say the rest. Six numbers of the
    /// residuals go into the pose, so this takes five points and gets good from ten on. Robust estimation and identification still
    /// tell right pairs from wrong ones by the stated deviations, which must be right within a factor of about two there.
    Estimated,
}

impl Default for PoseOptions {
    fn default() -> Self {
        Self {
            solver: None,
            refine: true,
            max_residual_ratio: 5.0,
            noise: Noise::Stated,
            refinement: RefineOptions::default(),
        }
    }
}

/// A pose and how far to trust it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseEstimate {
    /// `p_camera = R p_target + t`.
    pub camera_from_target: CameraFromTarget,
    /// Of the error `(t_true - t, Log(R_true R^T))`, provided that this is the right one of the alternatives.
    pub covariance: PoseCovariance,
    /// Whether the error is a paraboloid out to two standard deviations, so that the covariance holds as such. Where it is
    /// not (far, small, nearly face on), the covariance still gives the size and the direction of the uncertainty.
    pub covariance_reliable: bool,
    /// Root mean square distance between the image points and the projected ones, px.
    pub reprojection_rms_px: f64,
    /// That this one and none of the alternatives is right.
    pub probability: f64,
}

/// The answer to a set of correspondences.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseAnswer {
    /// The most probable pose.
    pub best: PoseEstimate,
    /// The others that explain the points, by falling probability.
    pub alternatives: Vec<PoseEstimate>,
    /// The method that led to `best`.
    pub solver: Solver,
    /// The noise of the image points on which the covariances rest, as a factor on the stated deviations.
    pub noise_scale: f64,
    /// Logarithm of the evidence for these correspondences with their stated deviations, up to a constant for a given number
    /// of them: over all minima, likelihood times the volume in which it is high.
    pub ln_evidence: f64,
}

impl PoseAnswer {
    /// From this probability on, an alternative makes an answer ambiguous.
    pub const AMBIGUOUS_FROM: f64 = 0.05;

    /// The answer with only those poses that are possible, their probabilities brought to a sum of one and the evidence
    /// reduced accordingly.
    ///
    /// # Errors
    /// [`NoPose::DegenerateGeometry`] if none is.
    pub fn restricted(mut self, is_possible: impl Fn(&CameraFromTarget) -> bool) -> Result<Self, NoPose> {
        let mut possible: Vec<PoseEstimate> = std::iter::once(self.best)
            .chain(std::mem::take(&mut self.alternatives))
            .filter(|estimate| is_possible(&estimate.camera_from_target))
            .collect();
        let total: f64 = possible.iter().map(|estimate| estimate.probability).sum();
        for estimate in &mut possible {
            estimate.probability /= total;
        }
        let mut possible = possible.into_iter();
        let best = possible.next().ok_or_else(|| {
            NoPose::DegenerateGeometry(
                "every pose that explains the points shows the target from a side on which its markers are not".into(),
            )
        })?;
        let ln_evidence = self.ln_evidence + total.ln();
        Ok(Self { best, alternatives: possible.collect(), ln_evidence, ..self })
    }

    /// Whether a runner-up is probable enough to matter.
    #[must_use]
    pub fn is_ambiguous(&self) -> bool {
        self.alternatives.first().is_some_and(|runner_up| runner_up.probability >= Self::AMBIGUOUS_FROM)
    }
}

/// Why there is no pose. The display tells the numbers.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum NoPose {
    /// Fewer points than the method needs.
    #[error("{given} points, but at least {need} are needed")]
    TooFewPoints {
        /// How many there are.
        given: usize,
        /// How many it takes.
        need: usize,
    },
    /// The layout of the points, or their image, does not fix a pose.
    #[error("{0}")]
    DegenerateGeometry(String),
    /// Every solution has points behind the camera.
    #[error("every solution puts points behind the camera")]
    BehindCamera,
    /// The best pose does not explain its points.
    #[error("{detail}")]
    HighResidual {
        /// What was compared.
        detail: String,
    },
    /// Robust estimation found no set of pairs that agree.
    #[error("no {need} of {given} pairs agree on a pose")]
    NoConsensus {
        /// How many pairs there are.
        given: usize,
        /// How many must agree.
        need: usize,
    },
    /// The image points could not be assigned to the markers with confidence.
    #[error("{detail}")]
    NotIdentified {
        /// What was missing.
        detail: String,
    },
}

impl NoPose {
    /// The contract's word.
    #[must_use]
    pub const fn reason(&self) -> &'static str {
        match self {
            Self::TooFewPoints { .. } => "too_few_points",
            Self::DegenerateGeometry(_) => "degenerate_geometry",
            Self::BehindCamera => "behind_camera",
            Self::HighResidual { .. } => "high_residual",
            Self::NoConsensus { .. } => "no_consensus",
            Self::NotIdentified { .. } => "not_identified",
        }
    }
}

impl From<SolveError> for NoPose {
    fn from(error: SolveError) -> Self {
        match error {
            SolveError::TooFewPoints { given, need, .. } => Self::TooFewPoints { given, need },
            SolveError::BehindCamera { .. } => Self::BehindCamera,
            SolveError::NotConverged { .. } => Self::HighResidual { detail: error.to_string() },
            SolveError::Collinear { .. } | SolveError::NotCoplanar { .. } | SolveError::Degenerate { .. } => {
                Self::DegenerateGeometry(error.to_string())
            }
        }
    }
}

/// The pose of a target from points of known identity.
///
/// # Errors
/// The reason why there is none; see [`NoPose`].
pub fn estimate_pose(
    camera: &Camera,
    correspondences: &[Correspondence],
    options: &PoseOptions,
) -> Result<PoseAnswer, NoPose> {
    estimate_pose_near(camera, correspondences, None, options)
}

/// As [`estimate_pose`], with one more start for the refinement: a pose that is already known to be near.
fn estimate_pose_near(
    camera: &Camera,
    correspondences: &[Correspondence],
    known: Option<(Solver, CameraFromTarget)>,
    options: &PoseOptions,
) -> Result<PoseAnswer, NoPose> {
    let pairs = rays(camera, correspondences)?;
    let starts = starts::of(&pairs, options.solver, known)?;
    let minimum_from = |(solver, start): &Start| {
        let refined = refine(camera, correspondences, start, &options.refinement).ok()?;
        let is_minimum = !matches!(refined.stats.stop, Stop::MaxIterations { .. });
        (is_minimum && is_in_front(&pairs, &refined.camera_from_target)).then_some((*solver, refined))
    };
    let mut reached: Vec<(Solver, Refined)> = starts.iter().filter_map(minimum_from).collect();
    let mut minima = distinct(reached.iter().map(|(_, refined)| *refined).collect());
    if let [only] = minima[..] {
        // A plane has two as a rule, one nearly the mirror image of the other; the starts may have led to the same.
        let others = starts::others(&pairs, &only.camera_from_target, reached[0].0);
        reached.extend(others.iter().filter_map(minimum_from));
        minima = distinct(reached.iter().map(|(_, refined)| *refined).collect());
    }
    if minima.is_empty() {
        return Err(NoPose::DegenerateGeometry("the image of these points does not fix a pose".into()));
    }
    let consistency = Consistency::of(&minima, correspondences, options)?;
    let (estimates, ln_evidence) = evidence::weigh(camera, correspondences, &minima, &consistency);
    let mut estimates = estimates.into_iter();
    let (Some(best), alternatives) = (estimates.next(), estimates.collect()) else {
        return Err(NoPose::DegenerateGeometry("no minimum explains the points".into()));
    };
    let led_to_best = |refined: &Refined| {
        best.covariance.normalized_error_squared(&best.camera_from_target, &refined.camera_from_target) < 1.0
    };
    let solver = reached.iter().find(|(_, refined)| led_to_best(refined)).unwrap_or(&reached[0]).0;
    let refined = PoseAnswer { best, alternatives, solver, noise_scale: consistency.noise_scale, ln_evidence };
    match options.solver {
        Some(named) if !options.refine => {
            propagation::unrefined(camera, correspondences, consistency.sigma_factor(), named, &pairs, refined)
        }
        _ => Ok(refined),
    }
}

/// Each correspondence on its ray.
fn rays(camera: &Camera, correspondences: &[Correspondence]) -> Result<Vec<Pair>, NoPose> {
    correspondences
        .iter()
        .enumerate()
        .map(|(index, seen)| {
            let ray = camera.unproject(&seen.pixel).ok_or_else(|| {
                NoPose::DegenerateGeometry(format!(
                    "image point {index} at ({:.1}, {:.1}) px lies outside the lens model",
                    seen.pixel.x, seen.pixel.y
                ))
            })?;
            Ok(Pair { point: seen.point, ray })
        })
        .collect()
}
