//! The camera of the contract.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::camera::{Camera, Distortion, ParameterCovariance};
use crate::shell::fault::Fault;

/// A calibrated camera. Pixels throughout; the centre of the top-left pixel is (0, 0).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Camera)]
pub struct CameraWire {
    /// Image width.
    pub width: u32,
    /// Image height.
    pub height: u32,
    /// Focal length along u.
    pub fx: f64,
    /// Focal length along v.
    pub fy: f64,
    /// Principal point, u.
    pub cx: f64,
    /// Principal point, v.
    pub cy: f64,
    /// The lens; none if left out.
    #[serde(default)]
    pub distortion: DistortionWire,
    /// Covariance of the parameters, rows in the order fx, fy, cx, cy and the distortion coefficients (or the first four
    /// alone), as a calibration gives it. It enters the covariance of every pose; without it the camera counts as exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parameter_covariance: Option<Vec<Vec<f64>>>,
}

/// Lens distortion, models and order of the coefficients as in ROS `CameraInfo` and OpenCV.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Distortion)]
pub struct DistortionWire {
    /// The model.
    pub model: DistortionModel,
    /// `none`: empty; `plumb_bob`: k1 k2 p1 p2 k3 (k3 may be left out); `rational_polynomial`: k1 k2 p1 p2 k3 k4 k5 k6;
    /// `equidistant`: k1 k2 k3 k4.
    #[serde(default)]
    pub coefficients: Vec<f64>,
}

/// The distortion models.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum DistortionModel {
    /// An ideal pinhole.
    None,
    /// Brown-Conrady.
    PlumbBob,
    /// Brown-Conrady with a rational radial part.
    RationalPolynomial,
    /// Fisheye.
    Equidistant,
}

impl Default for DistortionWire {
    fn default() -> Self {
        Self { model: DistortionModel::None, coefficients: Vec::new() }
    }
}

impl DistortionWire {
    fn checked(&self) -> Result<Distortion, Fault> {
        let given = self.coefficients.len();
        let exactly = |need: &str| {
            let model = Distortion::from(self.model);
            Err(Fault::senseless(
                "/distortion/coefficients",
                format!("{} has {need} coefficients, not {given}", model.name()),
            ))
        };
        match (self.model, self.coefficients.as_slice()) {
            // Many tools write zeros where there is no distortion.
            (DistortionModel::None, k) if k.iter().all(|k| *k == 0.0) => Ok(Distortion::None),
            (DistortionModel::None, _) => exactly("no"),
            (DistortionModel::PlumbBob, &[k1, k2, p1, p2]) => Ok(Distortion::PlumbBob([k1, k2, p1, p2, 0.0])),
            (DistortionModel::PlumbBob, &[k1, k2, p1, p2, k3]) => Ok(Distortion::PlumbBob([k1, k2, p1, p2, k3])),
            (DistortionModel::PlumbBob, _) => exactly("4 or 5"),
            (DistortionModel::RationalPolynomial, k) => {
                k.try_into().map_or_else(|_| exactly("8"), |k| Ok(Distortion::RationalPolynomial(k)))
            }
            (DistortionModel::Equidistant, k) => {
                k.try_into().map_or_else(|_| exactly("4"), |k| Ok(Distortion::Equidistant(k)))
            }
        }
    }
}

impl From<DistortionModel> for Distortion {
    /// The model without any effect.
    fn from(model: DistortionModel) -> Self {
        match model {
            DistortionModel::None => Self::None,
            DistortionModel::PlumbBob => Self::PlumbBob([0.0; 5]),
            DistortionModel::RationalPolynomial => Self::RationalPolynomial([0.0; 8]),
            DistortionModel::Equidistant => Self::Equidistant([0.0; 4]),
        }
    }
}

impl TryFrom<&CameraWire> for Camera {
    type Error = Fault;

    fn try_from(wire: &CameraWire) -> Result<Self, Fault> {
        let lens = wire.distortion.checked()?;
        let camera = Self::checked([wire.width, wire.height], [wire.fx, wire.fy], [wire.cx, wire.cy], lens);
        match &wire.parameter_covariance {
            Some(rows) => camera.and_then(|camera| camera.with_parameter_covariance(rows)),
            None => camera,
        }
        .map_err(|error| Fault::of_camera(&error))
    }
}

impl From<&Camera> for CameraWire {
    fn from(camera: &Camera) -> Self {
        let ([fx, fy], [cx, cy]) = (camera.focal_lengths(), camera.principal_point());
        let model = match camera.distortion() {
            Distortion::None => DistortionModel::None,
            Distortion::PlumbBob(_) => DistortionModel::PlumbBob,
            Distortion::RationalPolynomial(_) => DistortionModel::RationalPolynomial,
            Distortion::Equidistant(_) => DistortionModel::Equidistant,
        };
        Self {
            width: camera.width(),
            height: camera.height(),
            fx,
            fy,
            cx,
            cy,
            distortion: DistortionWire { model, coefficients: camera.distortion().coefficients().to_vec() },
            parameter_covariance: camera.parameter_covariance().map(ParameterCovariance::rows),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::wire::from_json;

    fn camera(distortion: &str) -> Result<Camera, Fault> {
        let json = format!(
            r#"{{"width": 640, "height": 480, "fx": 608.7, "fy": 608.7, "cx": 314.0, "cy": 320.0{distortion}}}"#
        );
        Camera::try_from(&from_json::<CameraWire>(json.as_bytes()).expect("JSON"))
    }

    #[test]
    fn the_contracts_camera_goes_in_and_out() {
        let there = camera(r#", "distortion": {"model": "plumb_bob", "coefficients": [0.1, 0, 0, 0, 0]}"#);
        let there = there.expect("a good camera");
        assert_eq!(Camera::try_from(&CameraWire::from(&there)), Ok(there));
        assert!(camera("").is_ok());
        let uncertain = camera(r#", "parameter_covariance": [[4, 3, 0, 0], [3, 4, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"#);
        let uncertain = uncertain.expect("a covariance of the first four");
        assert_eq!(Camera::try_from(&CameraWire::from(&uncertain)), Ok(uncertain));
        let fault = camera(r#", "parameter_covariance": [[1, 0], [0, 1]]"#).expect_err("of two");
        assert_eq!(fault.pointer.as_deref(), Some("/parameter_covariance"));
    }

    #[test]
    fn a_wrong_number_of_coefficients_is_named() {
        let fault =
            camera(r#", "distortion": {"model": "equidistant", "coefficients": [1, 2, 3]}"#).expect_err("three");
        assert_eq!(fault.to_string(), "/distortion/coefficients: equidistant has 4 coefficients, not 3");
    }
}
