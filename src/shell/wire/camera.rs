//! The camera of the contract.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::camera::{Camera, Distortion, ParameterCovariance};
use crate::shell::fault::Fault;
use crate::shell::wire::{from_json, from_value};

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
    /// Standard deviation per axis of where a point is seen, as the calibration measured it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pixel_sigma_px: Option<f64>,
    /// Of which camera's picture this one's is a part or a rescale.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub derived_from: Option<OriginWire>,
}

impl CameraWire {
    /// The camera of what a sensor gives of which this is the camera, as ROS' `CameraInfo` states it: of all its pixels only the part
    /// `roi`, x, y, width, height, is read, all zero being the whole, and of that `binning` pixels across and down are one, 0 being 1.
    /// A pixel that is made of several has its centre in their middle.
    ///
    /// # Errors
    /// A part that does not lie on the sensor, or fewer pixels than are made one.
    pub fn of_sensor(&self, roi: [u32; 4], binning: [u32; 2]) -> Result<Self, Fault> {
        let [across, down] = binning.map(|binning| binning.max(1));
        if roi == [0; 4] && [across, down] == [1; 2] {
            return Ok(self.clone());
        }
        let mut camera = Camera::try_from(self)?;
        if roi != [0; 4] {
            camera = camera.cropped(roi).map_err(|error| Fault::of_camera(&error).at("/roi"))?;
        }
        let at_binning = |error| Fault::of_camera(&error).at("/binning_x");
        let size = [camera.width() / across, camera.height() / down];
        // Columns and rows that are left over make no pixel.
        let whole = [0, 0, size[0].saturating_mul(across), size[1].saturating_mul(down)];
        camera = camera.cropped(whole).and_then(|camera| camera.rescaled(size)).map_err(at_binning)?;
        Ok(Self::from(&camera))
    }
}

/// Where a derived camera comes from: first the part, then the size.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[schema(as = CameraOrigin)]
pub struct OriginWire {
    /// Name of the camera, as it was stored then.
    pub name: String,
    /// Its image width.
    pub width: u32,
    /// Its image height.
    pub height: u32,
    /// The part of its picture: x, y, width, height; all of it if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crop_px: Option<[u32; 4]>,
}

/// A camera whose picture is a stored camera's, cut out, scaled, or both in this order. Exact, covariance included.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = DerivedCamera)]
pub struct DerivedCameraWire {
    /// Name of the stored camera. What becomes of it later does not change this one.
    pub derived_from: String,
    /// The part of its picture: x, y, width, height.
    #[serde(default)]
    pub crop_px: Option<[u32; 4]>,
    /// Width to which its picture, or the part, is scaled; with `height`.
    #[serde(default)]
    pub width: Option<u32>,
    /// Height to which it is scaled; the two axes may be scaled differently.
    #[serde(default)]
    pub height: Option<u32>,
}

impl DerivedCameraWire {
    /// The camera derived from `origin`.
    ///
    /// # Errors
    /// What of it makes no camera.
    pub fn of(&self, origin: &CameraWire) -> Result<CameraWire, Fault> {
        let mut camera = Camera::try_from(origin)?;
        if let Some(crop_px) = self.crop_px {
            camera = camera.cropped(crop_px).map_err(|error| Fault::of_camera(&error).at("/crop_px"))?;
        }
        match (self.width, self.height) {
            (Some(width), Some(height)) => {
                camera = camera.rescaled([width, height]).map_err(|error| Fault::of_camera(&error).at("/width"))?;
            }
            (None, None) if self.crop_px.is_some() => {}
            (None, None) => return Err(Fault::senseless("/width", "width and height, crop_px, or both are needed")),
            (Some(_), None) => return Err(Fault::senseless("/height", "width needs height")),
            (None, Some(_)) => return Err(Fault::senseless("/width", "height needs width")),
        }
        let is_scaled = self.width.is_some();
        Ok(CameraWire {
            // How well points are seen at another size, nobody has measured.
            pixel_sigma_px: origin.pixel_sigma_px.filter(|_| !is_scaled),
            derived_from: Some(OriginWire {
                name: self.derived_from.clone(),
                width: origin.width,
                height: origin.height,
                crop_px: self.crop_px,
            }),
            ..CameraWire::from(&camera)
        })
    }
}

/// What a camera is stored from.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraPut {
    /// The camera itself.
    Camera(CameraWire),
    /// Another camera.
    Derived(DerivedCameraWire),
}

impl CameraPut {
    /// From JSON: `derived_from` with a name derives.
    ///
    /// # Errors
    /// What is no JSON, or of neither shape.
    pub fn read(bytes: &[u8]) -> Result<Self, Fault> {
        let value: serde_json::Value = from_json(bytes)?;
        if value.get("derived_from").is_some_and(serde_json::Value::is_string) {
            return from_value(value).map(Self::Derived);
        }
        from_value(value).map(Self::Camera)
    }
}

impl CameraWire {
    /// A camera without distortion.
    #[must_use]
    pub fn pinhole([width, height]: [u32; 2], [fx, fy]: [f64; 2], [cx, cy]: [f64; 2]) -> Self {
        Self {
            width,
            height,
            fx,
            fy,
            cx,
            cy,
            distortion: DistortionWire::default(),
            parameter_covariance: None,
            pixel_sigma_px: None,
            derived_from: None,
        }
    }

    /// As the core understood it, with what is not the core's.
    ///
    /// # Errors
    /// Numbers that are no camera.
    pub fn checked(&self) -> Result<Self, Fault> {
        let camera = Camera::try_from(self)?;
        Ok(Self { pixel_sigma_px: self.pixel_sigma_px, derived_from: self.derived_from.clone(), ..Self::from(&camera) })
    }
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
        if let Some(sigma_px) = wire.pixel_sigma_px.filter(|sigma_px| !(1e-6..=1e3).contains(sigma_px)) {
            let detail = format!("{sigma_px} px: a standard deviation from 1e-6 to 1000 px");
            return Err(Fault::senseless("/pixel_sigma_px", detail));
        }
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
            distortion: DistortionWire { model, coefficients: camera.distortion().coefficients().to_vec() },
            parameter_covariance: camera.parameter_covariance().map(ParameterCovariance::rows),
            ..Self::pinhole([camera.width(), camera.height()], [fx, fy], [cx, cy])
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
    #[expect(clippy::float_cmp, reason = "these products and sums are exact")]
    fn a_derived_camera_says_where_it_comes_from() {
        let covariance = r#", "parameter_covariance": [[4, 0, 0, 0], [0, 4, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], "pixel_sigma_px": 0.1"#;
        let origin = CameraWire::from(&camera(covariance).expect("a camera"));
        let origin = CameraWire { pixel_sigma_px: Some(0.1), ..origin };
        let derive = |json: &str| match CameraPut::read(json.as_bytes())? {
            CameraPut::Derived(wire) => wire.of(&origin),
            CameraPut::Camera(_) => panic!("{json} is no camera"),
        };
        let half = derive(r#"{"derived_from": "front", "width": 320, "height": 240}"#).expect("a camera");
        assert_eq!([half.fx, half.cx, half.cy], [304.35, 156.75, 159.75]);
        assert_eq!(half.parameter_covariance.as_ref().expect("kept")[0][0], 1.0);
        assert_eq!(half.pixel_sigma_px, None);
        let json = serde_json::to_value(&half).expect("JSON");
        assert_eq!(json["derived_from"], serde_json::json!({"name": "front", "width": 640, "height": 480}));
        assert_eq!(CameraPut::read(json.to_string().as_bytes()), Ok(CameraPut::Camera(half)), "it can be put as it is");
        let part = derive(r#"{"derived_from": "front", "crop_px": [100, 50, 320, 240]}"#).expect("a camera");
        assert_eq!([part.fx, part.cx, part.cy, part.pixel_sigma_px.expect("kept")], [608.7, 214.0, 270.0, 0.1]);
        let both = derive(r#"{"derived_from": "front", "crop_px": [100, 50, 320, 240], "width": 640, "height": 240}"#);
        let both = both.expect("a camera");
        assert_eq!([both.fx, both.fy, both.cx, both.cy], [1217.4, 608.7, 428.5, 270.0]);
        for (json, pointer) in [
            (r#"{"derived_from": "front"}"#, "/width"),
            (r#"{"derived_from": "front", "width": 320}"#, "/height"),
            (r#"{"derived_from": "front", "width": 0, "height": 240}"#, "/width"),
            (r#"{"derived_from": "front", "width": 1, "height": 9000}"#, "/width"),
            (r#"{"derived_from": "front", "crop_px": [400, 0, 320, 240]}"#, "/crop_px"),
            (r#"{"derived_from": "front", "crop_px": [0, 0, 320]}"#, "/crop_px"),
        ] {
            assert_eq!(derive(json).expect_err(json).pointer.as_deref(), Some(pointer), "{json}");
        }
    }

    #[test]
    fn a_wrong_number_of_coefficients_is_named() {
        let fault =
            camera(r#", "distortion": {"model": "equidistant", "coefficients": [1, 2, 3]}"#).expect_err("three");
        assert_eq!(fault.to_string(), "/distortion/coefficients: equidistant has 4 coefficients, not 3");
    }
}
