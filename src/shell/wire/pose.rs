//! Points to pose: request and reply of `POST /v1/poses`.

use nalgebra::Rotation3;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use super::reference::CameraOrName;
use super::{CameraWire, PriorWire, Problem, Ref};
use crate::geometry::{Direction, EulerAngles, Point, rotation};
use crate::pose::{NoPose, Noise, PoseAnswer, PoseEstimate, PoseOptions};
use crate::solve::Solver;

/// Points of a target and where a camera sees them.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseRequest {
    /// Copied to the reply.
    #[serde(default)]
    pub id: Option<Value>,
    /// The camera, or the name of a stored one.
    #[schema(value_type = CameraOrName)]
    pub camera: Ref<CameraWire>,
    /// Points in the target frame, m.
    pub object_points_m: Vec<[f64; 3]>,
    /// Where each is seen, px, in the raw image. With `correspondence` unknown: in no order, some missing, some clutter.
    pub image_points_px: Vec<[f64; 2]>,
    /// Standard deviation of the image points per axis, px.
    #[serde(default = "one")]
    #[schema(exclusive_minimum = 0, default = 1.0)]
    pub pixel_sigma: f64,
    /// The same for each image point, instead of one for all.
    #[serde(default)]
    pub pixel_sigmas: Option<Vec<f64>>,
    /// Whether that is how large the noise is, or only how the points compare.
    #[serde(default)]
    pub noise: NoiseWire,
    /// The method.
    #[serde(default)]
    pub solver: SolverName,
    /// Minimise the reprojection error from the method's pose. A named method without refinement is that method alone.
    #[serde(default = "yes")]
    #[schema(default = true)]
    pub refine: bool,
    /// Some pairs may be wrong: estimate robustly and say which.
    #[serde(default)]
    pub outliers: bool,
    /// Whether the order of the image points tells which point is which.
    #[serde(default)]
    pub correspondence: Correspondence,
    /// What is known of the pose beforehand.
    #[serde(default)]
    pub prior: Option<PriorWire>,
}

const fn one() -> f64 {
    1.0
}

const fn yes() -> bool {
    true
}

/// How large the noise of the image points is.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[schema(as = Noise)]
#[serde(rename_all = "snake_case")]
pub enum NoiseWire {
    /// As large as stated.
    #[default]
    Stated,
    /// As large as the residuals say; takes five points, better ten. With `outliers` or an unknown correspondence the stated
    /// deviations still tell right pairs from wrong ones, so they must be right within a factor of about two.
    Estimated,
}

impl From<NoiseWire> for Noise {
    fn from(wire: NoiseWire) -> Self {
        match wire {
            NoiseWire::Stated => Self::Stated,
            NoiseWire::Estimated => Self::Estimated,
        }
    }
}

/// Whether the order of the image points tells which point is which.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Correspondence {
    /// Image point i is object point i.
    #[default]
    Known,
    /// The image points are in no order.
    Unknown,
}

/// The methods.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SolverName {
    /// The best answer that we know.
    #[default]
    Auto,
    /// Planar homography by direct linear transform; coplanar points only.
    Homography,
    /// EPnP (Lepetit, Moreno-Noguer and Fua 2009).
    Epnp,
    /// POSIT and coplanar POSIT (DeMenthon and Davis 1995; Oberkampf, DeMenthon and Davis 1996).
    Posit,
    /// Infinitesimal plane-based pose estimation (Collins and Bartoli 2014); coplanar points only.
    Ippe,
    /// Three points, the rest choosing among the solutions.
    P3p,
    /// SQPnP (Terzakis and Lourakis 2020): least squares over all rotations.
    Sqpnp,
}

impl SolverName {
    const fn solver(self) -> Option<Solver> {
        match self {
            Self::Auto => None,
            Self::Homography => Some(Solver::Homography),
            Self::Epnp => Some(Solver::Epnp),
            Self::Posit => Some(Solver::Posit),
            Self::Ippe => Some(Solver::Ippe),
            Self::P3p => Some(Solver::P3p),
            Self::Sqpnp => Some(Solver::Sqpnp),
        }
    }

    /// How the core is to answer.
    #[must_use]
    pub fn options(self, refine: bool) -> PoseOptions {
        PoseOptions { solver: self.solver(), refine, ..PoseOptions::default() }
    }

    /// Fewest points that it makes sense to ask for.
    #[must_use]
    pub const fn min_points(self) -> usize {
        match self.solver() {
            Some(solver) => solver.min_points(),
            None => 4,
        }
    }
}

impl From<Solver> for SolverName {
    fn from(solver: Solver) -> Self {
        match solver {
            Solver::Homography => Self::Homography,
            Solver::Epnp => Self::Epnp,
            Solver::Posit => Self::Posit,
            Solver::Ippe => Self::Ippe,
            Solver::P3p => Self::P3p,
            Solver::Sqpnp => Self::Sqpnp,
        }
    }
}

/// A pose: `p_camera = R p_target + t`.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Pose)]
pub struct PoseWire {
    /// Attitude.
    pub rotation: RotationWire,
    /// Origin of the target frame in the camera frame.
    pub translation_m: [f64; 3],
    /// Length of the translation.
    pub range_m: f64,
    /// atan2(x, z), positive to the right.
    pub azimuth_rad: f64,
    /// atan2(-y, hypot(x, z)), positive up.
    pub elevation_rad: f64,
    /// 6 x 6, order x, y, z, rotation about camera x, y, z, of the error `(t_true - t, Log(R_true R^T))`; m and rad. It holds
    /// provided that this pose and not one of the alternatives is the right one.
    pub covariance: [[f64; 6]; 6],
    /// Whether the covariance holds as such; false where the linear approximation behind it does not.
    pub covariance_reliable: bool,
    /// Root mean square distance between image points and projected points.
    pub reprojection_rms_px: f64,
    /// That this pose and none of the alternatives is the right one.
    pub probability: f64,
}

/// A rotation in three forms.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Rotation)]
pub struct RotationWire {
    /// x, y, z, w with w >= 0.
    pub quaternion_xyzw: [f64; 4],
    /// Rows.
    pub matrix: [[f64; 3]; 3],
    /// R = Rz(yaw) Ry(pitch) Rx(roll); 0 at gimbal lock.
    pub roll_rad: f64,
    /// In [-pi/2, pi/2].
    pub pitch_rad: f64,
    /// About z.
    pub yaw_rad: f64,
}

impl From<&Rotation3<f64>> for RotationWire {
    fn from(turn: &Rotation3<f64>) -> Self {
        let quaternion = rotation::to_quaternion(turn);
        let euler = EulerAngles::from_rotation(turn);
        let matrix = turn.matrix();
        Self {
            quaternion_xyzw: [quaternion.i, quaternion.j, quaternion.k, quaternion.w],
            matrix: std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)])),
            roll_rad: euler.roll_rad,
            pitch_rad: euler.pitch_rad,
            yaw_rad: euler.yaw_rad,
        }
    }
}

impl From<&PoseEstimate> for PoseWire {
    fn from(estimate: &PoseEstimate) -> Self {
        let pose = &estimate.camera_from_target;
        let direction = Direction::of(Point::from(pose.translation));
        let covariance = estimate.covariance.matrix();
        Self {
            rotation: RotationWire::from(&pose.rotation),
            translation_m: pose.translation.into(),
            range_m: direction.range_m,
            azimuth_rad: direction.azimuth_rad,
            elevation_rad: direction.elevation_rad,
            covariance: std::array::from_fn(|row| std::array::from_fn(|column| covariance[(row, column)])),
            covariance_reliable: estimate.covariance_reliable,
            reprojection_rms_px: estimate.reprojection_rms_px,
            probability: estimate.probability,
        }
    }
}

/// Why there is no pose.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// Fewer points, or markers found, than a pose needs.
    TooFewPoints,
    /// The layout of the points, or their image, does not fix a pose.
    DegenerateGeometry,
    /// Every solution has points behind the camera.
    BehindCamera,
    /// No set of pairs agrees on a pose.
    NoConsensus,
    /// The image points could not be assigned with confidence.
    NotIdentified,
    /// The best pose does not explain its points.
    HighResidual,
}

impl From<&NoPose> for Reason {
    fn from(no_pose: &NoPose) -> Self {
        match no_pose {
            NoPose::TooFewPoints { .. } => Self::TooFewPoints,
            NoPose::DegenerateGeometry(_) => Self::DegenerateGeometry,
            NoPose::BehindCamera => Self::BehindCamera,
            NoPose::HighResidual { .. } => Self::HighResidual,
            NoPose::NoConsensus { .. } => Self::NoConsensus,
            NoPose::NotIdentified { .. } => Self::NotIdentified,
        }
    }
}

/// The pose, or why there is none: common to all replies that carry poses.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct Answer {
    /// The most probable pose; null if there is none.
    #[schema(required = true)]
    pub pose: Option<PoseWire>,
    /// The other poses that explain the points, by falling probability.
    pub alternatives: Vec<PoseWire>,
    /// The method that led to the pose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solver: Option<SolverName>,
    /// Whether an alternative has a probability of 0.05 or more.
    pub ambiguous: bool,
    /// Why there is no pose.
    #[schema(required = true)]
    pub reason: Option<Reason>,
    /// The reason in words, with its numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detail: Option<String>,
}

impl From<&Result<PoseAnswer, NoPose>> for Answer {
    fn from(answer: &Result<PoseAnswer, NoPose>) -> Self {
        match answer {
            Ok(answer) => Self {
                pose: Some((&answer.best).into()),
                alternatives: answer.alternatives.iter().map(Into::into).collect(),
                solver: Some(answer.solver.into()),
                ambiguous: answer.is_ambiguous(),
                reason: None,
                detail: None,
            },
            Err(no_pose) => Self {
                pose: None,
                alternatives: Vec::new(),
                solver: None,
                ambiguous: false,
                reason: Some(no_pose.into()),
                detail: Some(no_pose.to_string()),
            },
        }
    }
}

/// Reply to one pose request.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct PoseReply {
    /// The request's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<Value>,
    /// The pose.
    #[serde(flatten)]
    pub answer: Answer,
    /// The noise on which the covariances rest, as a factor on the stated standard deviations: estimated from the residuals
    /// when asked, else 1 unless the residuals are significantly larger than stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_scale: Option<f64>,
    /// For each pair whether it agrees with the pose; with `outliers` only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inliers: Option<Vec<bool>>,
    /// For each image point the index of its object point, or null; with `correspondence` unknown only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assignment: Option<Vec<Option<usize>>>,
    /// Probability of that assignment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assignment_probability: Option<f64>,
    /// Time taken, microseconds.
    pub elapsed_us: f64,
}

/// Many requests at once.
#[derive(Clone, Debug, Deserialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseBatch {
    /// The requests.
    pub requests: Vec<Value>,
}

/// The reply to one request or to many.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum OneOrManyReplies {
    /// To one.
    One(Box<PoseReply>),
    /// To many.
    Many(PoseReplies),
}

/// Replies in the order of the requests.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct PoseReplies {
    /// One for each request.
    pub replies: Vec<PoseReplyOrError>,
}

/// A reply, or what is wrong with its request.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
pub enum PoseReplyOrError {
    /// The request failed; the others are unharmed.
    Failed(FailedRequest),
    /// The reply.
    Reply(Box<PoseReply>),
}

/// What is wrong with one of many requests.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct FailedRequest {
    /// The request's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<Value>,
    /// The problem.
    pub error: Problem,
}
