//! What is asked of a calibration.

use std::collections::BTreeMap;

use nalgebra::UnitQuaternion;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::camera::DistortionModel;
use super::{CameraWire, PatternOrText};
use crate::board::Board;
use crate::calibrate::estimate::CalibrateOptions;
use crate::calibrate::freedom::Fixed;
use crate::camera::Distortion;
use crate::geometry::CameraFromBoard;
use crate::shell::fault::Fault;
use crate::shell::store::check_name;

/// A calibration.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrationRequest {
    /// The board.
    pub pattern: PatternOrText,
    /// The distortion model.
    #[serde(default = "plumb_bob")]
    pub model: DistortionModel,
    /// Parameters that are not estimated.
    #[serde(default)]
    pub fixed: Vec<FixedWire>,
    /// Estimate also from pictures that say too little.
    #[serde(default)]
    pub force: bool,
    /// Store the camera under this name when it has been found.
    #[serde(default)]
    pub name: Option<String>,
}

const fn plumb_bob() -> DistortionModel {
    DistortionModel::PlumbBob
}

/// A parameter that is not estimated: coefficients stay at zero.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FixedWire {
    /// fx = fy.
    AspectRatio,
    /// The middle of the picture.
    PrincipalPoint,
    /// A radial coefficient.
    K1,
    /// A radial coefficient.
    K2,
    /// A radial coefficient.
    K3,
    /// A radial coefficient.
    K4,
    /// A radial coefficient.
    K5,
    /// A radial coefficient.
    K6,
    /// A tangential coefficient.
    P1,
    /// A tangential coefficient.
    P2,
}

impl FixedWire {
    /// The name in the contract.
    const fn name(self) -> &'static str {
        match self {
            Self::AspectRatio => "aspect_ratio",
            Self::PrincipalPoint => "principal_point",
            Self::K1 => "k1",
            Self::K2 => "k2",
            Self::K3 => "k3",
            Self::K4 => "k4",
            Self::K5 => "k5",
            Self::K6 => "k6",
            Self::P1 => "p1",
            Self::P2 => "p2",
        }
    }

    /// Whether the model has it.
    #[must_use]
    pub fn is_of(self, model: DistortionModel) -> bool {
        matches!(self, Self::AspectRatio | Self::PrincipalPoint)
            || Distortion::from(model).coefficient_names().contains(&self.name())
    }
}

impl CalibrationRequest {
    /// The board. The only place that reads `pattern`.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn board(&self) -> Result<Board, Fault> {
        Board::try_from(&self.pattern).map_err(|fault| match fault.pointer {
            Some(_) => fault.within("/pattern"),
            None => fault.at("/pattern"),
        })
    }

    /// What is sought and how.
    #[must_use]
    pub fn options(&self) -> CalibrateOptions {
        let lens = Distortion::from(self.model);
        let mut coefficients = [false; 8];
        for (held, name) in coefficients.iter_mut().zip(lens.coefficient_names()) {
            *held = self.fixed.iter().any(|fixed| fixed.name() == *name);
        }
        let fixed = Fixed {
            aspect_ratio: self.fixed.contains(&FixedWire::AspectRatio),
            principal_point: self.fixed.contains(&FixedWire::PrincipalPoint),
            coefficients,
        };
        CalibrateOptions { lens, fixed, guess: None }
    }

    /// Everything that can be checked before there are pictures.
    ///
    /// # Errors
    /// What makes no sense, with its place.
    pub fn check(&self) -> Result<(), Fault> {
        self.board()?;
        for (place, fixed) in self.fixed.iter().enumerate() {
            if !fixed.is_of(self.model) {
                let detail = format!("{} has no {}", Distortion::from(self.model).name(), fixed.name());
                return Err(Fault::senseless(format!("/fixed/{place}"), detail));
            }
        }
        match &self.name {
            Some(name) => check_name(name).map_err(|fault| fault.at("/name")),
            None => Ok(()),
        }
    }
}

/// A calibrated camera and how far to trust it.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[schema(as = Calibration)]
pub struct CalibrationWire {
    /// The camera, with the covariance of its parameters.
    pub camera: CameraWire,
    /// Root mean square distance of the points that count from where the camera predicts them.
    pub reprojection_rms_px: f64,
    /// Standard deviation of a point's place per axis, measured: what is left over, for so many unknowns.
    pub pixel_sigma_px: f64,
    /// What is left over in units of what the pictures told of their noise: 1 where that is all there is.
    pub noise_ratio: f64,
    /// Standard deviation per axis of what there is besides: a board that is not flat, a lens that the model does not have.
    pub model_error_px: f64,
    /// How many times the variances of the parameters are those that as many points with independent errors would leave, on average:
    /// 1 where the errors within a picture do not go together. The covariance has it already.
    pub design_effect: f64,
    /// Standard deviations by name: fx, fy, cx, cy and the coefficients; zero for what is held.
    pub standard_deviations: BTreeMap<String, f64>,
    /// The pictures in their order.
    pub views: Vec<CalibrationView>,
    /// Where in the picture points were seen.
    pub coverage: CoverageWire,
    /// The largest angle between the board's normals in two views.
    pub widest_turn_rad: f64,
    /// How lens models predict views that they do not rest on; the first is the chosen one.
    pub models: Vec<ModelTrialWire>,
    /// What these say of the chosen model: `right`, `too_small`, `too_large`, `other_kind`, `unknown`.
    pub model_fit: &'static str,
    /// Pictures that are better left out.
    pub drop: Vec<String>,
    /// The view that would help most.
    pub next_view: Option<NextViewWire>,
    /// What the pictures lack for a camera to trust; empty where they are good.
    pub weaknesses: Vec<String>,
    /// What to do about all that, in words.
    pub advice: Vec<String>,
}

/// A picture in a calibration.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct CalibrationView {
    /// Name of its file.
    pub name: String,
    /// Points of the board that were found.
    pub points: usize,
    /// Those of them that count.
    pub inliers: usize,
    /// Whether the camera rests on it.
    pub counts: bool,
    /// Why not.
    pub reason: Option<String>,
    /// Root mean square distance of its points from where the camera predicts them.
    pub rms_px: Option<f64>,
    /// Distance of the board's middle.
    pub range_m: Option<f64>,
    /// Angle between the board's normal and the ray to its middle.
    pub tilt_rad: Option<f64>,
    /// Where the board was: x right, y down, z into the sheet.
    pub camera_from_board: Option<BoardPoseWire>,
}

/// Where a board was in the camera's space.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct BoardPoseWire {
    /// x, y, z, w.
    pub quaternion_xyzw: [f64; 4],
    /// Of the board's origin.
    pub translation_m: [f64; 3],
}

/// Where in the picture points were seen.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct CoverageWire {
    /// Cells along the picture's width.
    pub columns: usize,
    /// Cells along its height.
    pub rows: usize,
    /// Points in each cell, row by row.
    pub points: Vec<usize>,
    /// Share of the cells with a point.
    pub share: f64,
    /// How well the pixel of a ray through the middle of each cell is known, standard deviation per axis; null where the lens has
    /// no ray.
    pub ray_sigma_px: Vec<Option<f64>>,
}

/// A lens model that was tried.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ModelTrialWire {
    /// The model and its free terms.
    pub name: String,
    /// Root mean square error of points of views that the camera does not rest on; null where there was none.
    pub held_out_rms_px: Option<f64>,
}

/// A view to take next.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct NextViewWire {
    /// Where to hold the board.
    pub camera_from_board: BoardPoseWire,
    /// Corners of the sheet in the picture.
    pub outline_px: Vec<[f64; 2]>,
    /// Distance of its middle.
    pub range_m: f64,
    /// Its tilt.
    pub tilt_rad: f64,
    /// How well rays all over the picture are known, px, now and after it.
    pub ray_sigma_px: [f64; 2],
}

impl From<&CameraFromBoard> for BoardPoseWire {
    fn from(pose: &CameraFromBoard) -> Self {
        let q = UnitQuaternion::from_rotation_matrix(&pose.rotation);
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        Self { quaternion_xyzw: [q.i, q.j, q.k, q.w].map(|part| sign * part), translation_m: pose.translation.into() }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::shell::wire::from_value;

    fn pointer(request: serde_json::Value) -> Option<String> {
        let read = from_value::<CalibrationRequest>(request).and_then(|request| request.check());
        read.err().map(|fault| fault.pointer.unwrap_or_default())
    }

    #[test]
    fn what_makes_no_sense_is_told_where() {
        let board = "chessboard:9x6:0.025";
        assert_eq!(pointer(json!({"pattern": board})), None);
        assert_eq!(pointer(json!({"pattern": board, "fixed": ["k3", "aspect_ratio"], "name": "front"})), None);
        assert_eq!(pointer(json!({"pattern": "chess"})).as_deref(), Some("/pattern"));
        assert_eq!(pointer(json!({"pattern": board, "model": "none", "fixed": ["k1"]})).as_deref(), Some("/fixed/0"));
        assert_eq!(pointer(json!({"pattern": board, "fixed": ["p1", "k6"]})).as_deref(), Some("/fixed/1"));
        let fisheye = json!({"pattern": board, "model": "equidistant", "fixed": ["k4", "p2"]});
        assert_eq!(pointer(fisheye).as_deref(), Some("/fixed/1"));
        assert_eq!(pointer(json!({"pattern": board, "fixed": ["k9"]})).as_deref(), Some("/fixed/0"));
        assert_eq!(pointer(json!({"pattern": board, "name": "a/b"})).as_deref(), Some("/name"));
        assert_eq!(pointer(json!({"pattern": board, "nmae": "a"})).as_deref(), Some("/nmae"));
    }
}
