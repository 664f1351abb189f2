//! Evaluations: what is asked; what comes of it is in `figures`.

pub mod figures;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::reference::{CameraOrName, TargetOrName};
use super::{CameraWire, Ref, TargetWire};
use crate::camera::Camera;
use crate::evaluate::Method;
use crate::evaluate::study::{Disturbance, Layout, MAX_METHODS, MAX_STEPS, Parameter, Poses, Study, StudyError, Sweep};
use crate::scene::cases::seed_camera;
use crate::shell::fault::{Fault, FaultKind};
use crate::target::Target;

pub use figures::EvaluationWire;

/// The seed's study by name.
pub const THESIS: &str = "thesis-2012";
/// Runs where none are given: the seed's.
const RUNS: u64 = 100;
/// The seed where none is given.
const SEED: u64 = 2012;

/// A simulated study.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct EvaluationRequest {
    /// `thesis-2012`, or what is to be studied.
    #[schema(value_type = StudyOrName)]
    pub study: Ref<StudyWire>,
    /// Cases, at each value of the sweep.
    #[serde(default = "runs")]
    #[schema(minimum = 1, maximum = 1_000_000_000, default = 100)]
    pub runs: u64,
    /// Names the cases: the same request with the same seed has the same figures to the last digit.
    #[serde(default = "seed")]
    #[schema(default = 2012)]
    pub seed: u64,
    /// What is compared. A solver's name alone (`epnp`) is that solver as its paper has it; `epnp+covariance` is the service's answer
    /// with it, `epnp+refine` and `auto` are refined answers, `auto+robust` one for pairs that may be wrong. If left out, the study's
    /// own: those of the thesis, or `auto`.
    #[serde(default)]
    #[schema(max_items = 16)]
    pub solvers: Option<Vec<String>>,
    /// One parameter at several values. The same cases are disturbed, placed or seen accordingly.
    #[serde(default)]
    pub sweep: Option<SweepWire>,
}

const fn runs() -> u64 {
    RUNS
}

const fn seed() -> u64 {
    SEED
}

/// A study, or the name of one: what the API document calls it.
#[derive(ToSchema)]
#[serde(untagged)]
#[expect(clippy::large_enum_variant, reason = "read by the document only")]
pub enum StudyOrName {
    /// `thesis-2012`.
    Name(String),
    /// The study itself.
    Object(StudyWire),
}

/// What is studied.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = Study)]
pub struct StudyWire {
    /// The camera, or the name of a stored one; if left out, the thesis' (f = 608.7 px, 640 x 480).
    #[serde(default)]
    #[schema(value_type = Option<CameraOrName>)]
    pub camera: Option<Ref<CameraWire>>,
    /// Points drawn anew for each case; if neither these nor a target are given, six on a square of 0.8 m.
    #[serde(default)]
    pub points: Option<PointsWire>,
    /// The markers of a target instead, or the name of a stored one. Those that face away are not seen.
    #[serde(default)]
    #[schema(value_type = Option<TargetOrName>)]
    pub target: Option<Ref<TargetWire>>,
    /// How the points are placed before the camera.
    #[serde(default)]
    pub poses: PosesWire,
    /// Draw again until every point lies within the picture. Otherwise each only has to have an image, be it beside the picture.
    #[serde(default = "yes")]
    #[schema(default = true)]
    pub in_view: bool,
    /// What keeps the images from being perfect.
    #[serde(default)]
    pub noise: DisturbanceWire,
}

const fn yes() -> bool {
    true
}

/// Points in a box about the origin, evenly.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RandomPoints)]
pub struct PointsWire {
    /// How many.
    #[schema(minimum = 3, maximum = 1000)]
    pub count: usize,
    /// Edges of the box; a height of 0 makes a plane.
    pub size_m: [f64; 3],
}

/// How the points are placed before the camera.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
#[schema(as = Poses)]
pub enum PosesWire {
    /// Angles and translations evenly, each on its own: the thesis' way.
    Free {
        /// Roll, pitch and yaw within plus and minus this.
        max_angle_rad: f64,
        /// Least and largest x, y and z.
        translation_m: [[f64; 2]; 3],
    },
    /// The origin on the ray of any pixel.
    InPicture {
        /// Least and largest distance.
        range_m: [f64; 2],
        /// Least and largest angle between the target's z axis and the line of sight: 0 is face on.
        tilt_rad: [f64; 2],
    },
}

impl Default for PosesWire {
    fn default() -> Self {
        Self::InPicture { range_m: [1.0, 15.0], tilt_rad: [0.0, 1.3] }
    }
}

/// What keeps the images of the points from being perfect.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
#[schema(as = Disturbance)]
pub struct DisturbanceWire {
    /// Standard deviation of a pixel's Gaussian noise per axis; 1 if left out.
    pub pixel_sigma_px: f64,
    /// Share of the pairs whose pixel is anywhere in the picture.
    pub outlier_ratio: f64,
    /// Probability of a point not to be seen.
    pub missing_ratio: f64,
    /// Pixels are rounded to multiples of this; 0 for none.
    pub quantisation_px: f64,
    /// Standard deviation of the focal length that a solver is told, as a share of the true one.
    pub focal_error_ratio: f64,
    /// Standard deviation of the principal point that a solver is told, per axis.
    pub center_error_px: f64,
}

impl Default for DisturbanceWire {
    fn default() -> Self {
        Self {
            pixel_sigma_px: 1.0,
            outlier_ratio: 0.0,
            missing_ratio: 0.0,
            quantisation_px: 0.0,
            focal_error_ratio: 0.0,
            center_error_px: 0.0,
        }
    }
}

/// One parameter at several values.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = Sweep)]
pub struct SweepWire {
    /// Which.
    pub parameter: ParameterName,
    /// Its values.
    #[schema(min_items = 1, max_items = 64)]
    pub values: Vec<f64>,
}

/// What can be swept.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = SweepParameter)]
pub enum ParameterName {
    /// Number of drawn points.
    Points,
    /// Distance of poses in the picture.
    RangeM,
    /// Tilt of poses in the picture.
    TiltRad,
    /// Limit of the angles of free poses.
    MaxAngleRad,
    /// Noise of a pixel.
    PixelSigmaPx,
    /// Share of wrong pairs.
    OutlierRatio,
    /// Share of points that are not seen.
    MissingRatio,
    /// Rounding of pixels.
    QuantisationPx,
    /// Error of the focal length.
    FocalErrorRatio,
    /// Error of the principal point.
    CenterErrorPx,
}

impl From<ParameterName> for Parameter {
    fn from(name: ParameterName) -> Self {
        match name {
            ParameterName::Points => Self::Points,
            ParameterName::RangeM => Self::RangeM,
            ParameterName::TiltRad => Self::TiltRad,
            ParameterName::MaxAngleRad => Self::MaxAngleRad,
            ParameterName::PixelSigmaPx => Self::PixelSigmaPx,
            ParameterName::OutlierRatio => Self::OutlierRatio,
            ParameterName::MissingRatio => Self::MissingRatio,
            ParameterName::QuantisationPx => Self::QuantisationPx,
            ParameterName::FocalErrorRatio => Self::FocalErrorRatio,
            ParameterName::CenterErrorPx => Self::CenterErrorPx,
        }
    }
}

impl EvaluationRequest {
    /// The study by name with what the thesis has.
    #[must_use]
    pub fn named(name: &str) -> Self {
        Self { study: Ref::Name(name.into()), runs: RUNS, seed: SEED, solvers: None, sweep: None }
    }

    /// The study in the core's words, its camera and target having been looked up before. Only what the study itself checks
    /// ([`Study::check`]) may still be wrong with it.
    ///
    /// # Errors
    /// What is wrong, with a pointer.
    pub fn study(&self) -> Result<Study, Fault> {
        let mut study = match &self.study {
            Ref::Name(name) if name == THESIS => Study::thesis_2012(self.runs, self.seed),
            Ref::Name(name) => {
                let detail = format!("no study {name:?}: there is {THESIS:?}, or give the study itself as an object");
                return Err(Fault::senseless("/study", detail));
            }
            Ref::Object(wire) => wire.study(self.runs, self.seed).map_err(|fault| fault.within("/study"))?,
        };
        if let Some(names) = &self.solvers {
            if !(1..=MAX_METHODS).contains(&names.len()) {
                let detail = format!("{} solvers: 1 to {MAX_METHODS} are compared", names.len());
                return Err(Fault::senseless("/solvers", detail));
            }
            let read = |(index, name): (usize, &String)| {
                Method::named(name).map_err(|detail| Fault::senseless(format!("/solvers/{index}"), detail))
            };
            study.methods = names.iter().enumerate().map(read).collect::<Result<_, _>>()?;
        }
        if let Some(SweepWire { parameter, values }) = &self.sweep {
            if !(1..=MAX_STEPS).contains(&values.len()) {
                let detail = format!("{} values: 1 to {MAX_STEPS} are swept", values.len());
                return Err(Fault::senseless("/sweep/values", detail));
            }
            study.sweep = Some(Sweep { parameter: (*parameter).into(), values: values.clone() });
        }
        Ok(study)
    }
}

impl StudyWire {
    fn study(&self, runs: u64, seed: u64) -> Result<Study, Fault> {
        let camera = match &self.camera {
            None => seed_camera(),
            Some(Ref::Object(wire)) => Camera::try_from(wire).map_err(|fault| fault.within("/camera"))?,
            Some(Ref::Name(name)) => return Err(unresolved("/camera", name)),
        };
        let points = match (&self.points, &self.target) {
            (Some(_), Some(_)) => {
                return Err(Fault::senseless("/target", "points and a target: one of the two is studied"));
            }
            (Some(PointsWire { count, size_m }), None) => Layout::Random { count: *count, size_m: *size_m },
            (None, None) => Layout::Random { count: 6, size_m: [0.8, 0.8, 0.0] },
            (None, Some(Ref::Object(wire))) => {
                Layout::Given(Target::try_from(wire).map_err(|fault| fault.within("/target"))?)
            }
            (None, Some(Ref::Name(name))) => return Err(unresolved("/target", name)),
        };
        let poses = match self.poses {
            PosesWire::Free { max_angle_rad, translation_m } => Poses::Free { max_angle_rad, translation_m },
            PosesWire::InPicture { range_m, tilt_rad } => Poses::InPicture { range_m, tilt_rad },
        };
        let DisturbanceWire {
            pixel_sigma_px,
            outlier_ratio,
            missing_ratio,
            quantisation_px,
            focal_error_ratio,
            center_error_px,
        } = self.noise;
        let disturbance = Disturbance {
            pixel_sigma_px,
            outlier_ratio,
            missing_ratio,
            quantisation_px,
            focal_error_ratio,
            center_error_px,
        };
        let methods = vec![Method::AUTO];
        Ok(Study { camera, points, poses, in_view: self.in_view, disturbance, methods, runs, seed, sweep: None })
    }
}

/// Names are looked up before a job is made, so that what is stored is all that decides its figures.
fn unresolved(pointer: &str, name: &str) -> Fault {
    let detail = format!("no stored one {name:?}: there is no store here, so give the object itself");
    Fault { kind: FaultKind::NotFound, detail, pointer: Some(pointer.into()) }
}

/// The fault of a study that makes no sense.
#[must_use]
pub fn fault_of_study(error: &StudyError) -> Fault {
    let pointer = match error.field() {
        Some(field @ ("runs" | "solvers" | "sweep")) => format!("/{field}"),
        Some(field) => format!("/study/{}", field.replace('.', "/")),
        None => "/study".into(),
    };
    Fault::senseless(pointer, error.to_string())
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use crate::shell::wire::from_value;

    fn study(request: Value) -> Result<Study, Fault> {
        let study = from_value::<EvaluationRequest>(request)?.study()?;
        study.check().map_err(|error| fault_of_study(&error))?;
        Ok(study)
    }

    #[test]
    fn the_thesis_is_known_by_name() {
        assert_eq!(study(json!({"study": "thesis-2012"})), Ok(Study::thesis_2012(100, 2012)));
        assert_eq!(study(json!({"study": "thesis-2012", "runs": 7, "seed": 1})), Ok(Study::thesis_2012(7, 1)));
    }

    #[test]
    fn every_parameter_is_known_by_its_name() {
        for parameter in Parameter::ALL {
            let name: ParameterName = serde_json::from_value(json!(parameter.name())).expect("a name");
            assert_eq!(Parameter::from(name), parameter);
        }
    }

    #[test]
    fn what_is_wrong_is_pointed_at() {
        let free = |key: &str, value: Value| json!({"study": {key: value}});
        let cases = [
            (json!({"study": "thesis-2013"}), "/study"),
            (json!({"study": "thesis-2012", "runs": 0}), "/runs"),
            (json!({"study": "thesis-2012", "runs": 1_000_000_000}), "/runs"),
            (json!({"study": "thesis-2012", "solvers": []}), "/solvers"),
            (json!({"study": "thesis-2012", "solvers": ["epnp", "epnp"]}), "/solvers"),
            (json!({"study": "thesis-2012", "solvers": ["epnp", "pnp"]}), "/solvers/1"),
            (json!({"study": "thesis-2012", "sweep": {"parameter": "range_m", "values": [1.0]}}), "/sweep"),
            (json!({"study": "thesis-2012", "sweep": {"parameter": "points", "values": [4.5]}}), "/sweep"),
            (json!({"study": "thesis-2012", "sweep": {"parameter": "points", "values": []}}), "/sweep/values"),
            (json!({"study": "thesis-2012", "sweep": {"parameter": "pixels", "values": [1.0]}}), "/sweep/parameter"),
            (free("noise", json!({"pixel_sigma_px": -1.0})), "/study/noise/pixel_sigma_px"),
            (free("noise", json!({"outlier_ratio": 1.5})), "/study/noise/outlier_ratio"),
            (free("noise", json!({"colour": 1.0})), "/study/noise/colour"),
            (free("points", json!({"count": 2, "size_m": [1, 1, 0]})), "/study/points/count"),
            (
                free("poses", json!({"kind": "in_picture", "range_m": [2, 1], "tilt_rad": [0, 1]})),
                "/study/poses/range_m",
            ),
            (free("poses", json!({"kind": "in_picture", "range_m": [0.01, 0.02], "tilt_rad": [0, 1]})), "/study"),
            (free("camera", json!("front")), "/study/camera"),
        ];
        for (request, pointer) in cases {
            let fault = study(request.clone()).expect_err(&request.to_string());
            assert_eq!(fault.pointer.as_deref(), Some(pointer), "{request}: {fault}");
        }
    }
}
