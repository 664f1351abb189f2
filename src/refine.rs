//! Candidate pose to best pose: least reprojection error in the raw image, with covariance.

pub mod calibration;
pub mod levenberg_marquardt;
pub mod loss;
pub mod minima;
pub mod posterior;

pub(crate) use levenberg_marquardt::project_with_pose_jacobian;
pub use levenberg_marquardt::{RefineError, RefineOptions, Refined, Stats, Stop, chi_square, information, refine};
pub use loss::Loss;
pub use minima::distinct;
pub use posterior::{Posterior, posterior};

use crate::camera::Pixel;
use crate::geometry::{Point, space};

/// A point of the target, where it was seen in the raw image, and how well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    /// Where it sits on the target.
    pub point: Point<space::Target>,
    /// Where the camera saw it, distortion included.
    pub pixel: Pixel,
    /// Standard deviation of the pixel per axis, px.
    pub sigma_px: f64,
}
