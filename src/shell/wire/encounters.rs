//! Encounters that are flown by the hundred: what is asked; what comes of it is in `figures`.

#![expect(
    clippy::approx_constant,
    reason = "limits in the document are literals; the core checks against the constants"
)]

mod avoidance;
pub mod figures;
mod sensing;
mod traffic;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::evaluation::EvaluationRequest;
use super::pose::SolverName;
use super::reference::{CameraOrName, TargetOrName};
use super::{CameraWire, DetectorWire, Ref, TargetWire, TrackOptionsWire, from_value};
use crate::camera::Camera;
use crate::detect::Detector;
use crate::encounter::Manoeuvre;
use crate::evaluate::encounters::{Alarm, EncounterStudy, EncounterStudyError, Sensing};
use crate::scene::encounters::intruder::{painted, plate};
use crate::scene::encounters::{Disturbance, Traffic};
use crate::shell::fault::{Fault, FaultKind};
use crate::target::Target;

pub use avoidance::{AlertWire, ManoeuvreWire};
pub use figures::EncountersWire;
pub use sensing::{CentroidsWire, SensingName};
pub use traffic::{MountName, TrafficWire};

/// The kind by name.
pub const ENCOUNTERS: &str = "encounters";

/// What an evaluation is asked to do, as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
pub enum AskedEvaluation {
    /// Solvers on simulated cases.
    Study(Box<EvaluationRequest>),
    /// Encounters, flown.
    Encounters(Box<EncountersRequest>),
}

impl AskedEvaluation {
    /// Reads it: `kind` tells which it is.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(value: serde_json::Value) -> Result<Self, Fault> {
        match value.get("kind") {
            None => from_value(value).map(Box::new).map(Self::Study),
            Some(kind) if kind == ENCOUNTERS => from_value(value).map(Box::new).map(Self::Encounters),
            Some(kind) => {
                let detail = format!("no kind {kind}: there is {ENCOUNTERS:?}, and studies of solvers without a kind");
                Err(Fault::senseless("/kind", detail))
            }
        }
    }
}

/// Random encounters to be flown through detector, identification, solver and tracker. What is left out is that of two small aircraft that
/// come towards each other at 8 to 15 m/s.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = EncountersRequest)]
pub struct EncountersRequest {
    /// `encounters`.
    pub kind: EncountersKind,
    /// Encounters: up to 200,000 with simulated centroids, 5,000 with rendered frames.
    #[serde(default = "runs")]
    #[schema(minimum = 1, maximum = 200_000, default = 1000)]
    pub runs: u64,
    /// Names the encounters: the same request with the same seed has the same figures to the last digit.
    #[serde(default = "seed")]
    #[schema(default = 2012)]
    pub seed: u64,
    /// From what centroids come.
    #[serde(default)]
    pub sensing: SensingName,
    /// What disturbs simulated centroids beyond what the detector was measured to do.
    #[serde(default)]
    pub centroids: CentroidsWire,
    /// The own camera, or the name of a stored one; if left out, 1280 x 720 with f = 1000 px.
    #[serde(default)]
    #[schema(value_type = Option<CameraOrName>)]
    pub camera: Option<Ref<CameraWire>>,
    /// By how much it is turned to the right of the own course.
    #[serde(default)]
    #[schema(minimum = -3.141_592_653_589_793, maximum = 3.141_592_653_589_793, default = 0)]
    pub camera_azimuth_rad: f64,
    /// By how much it is turned up.
    #[serde(default)]
    #[schema(minimum = -1.570_796_326_794_896_6, maximum = 1.570_796_326_794_896_6, default = 0)]
    pub camera_elevation_rad: f64,
    /// The constellation on the intruder, or the name of a stored one; if left out, six discs of 9 cm radius on a flying wing of 4.2 m span.
    #[serde(default)]
    #[schema(value_type = Option<TargetOrName>)]
    pub target: Option<Ref<TargetWire>>,
    /// How the constellation sits on the intruder.
    #[serde(default)]
    pub mount: MountName,
    /// What encounters are drawn from.
    #[serde(default)]
    pub traffic: TrafficWire,
    /// What the own aircraft does at an alarm.
    #[serde(default)]
    pub manoeuvre: ManoeuvreWire,
    /// When there is an alarm.
    #[serde(default)]
    pub alert: AlertWire,
    /// Nearer than this is a near mid-air collision; at most the miss distance.
    #[serde(default = "nmac_m")]
    #[schema(default = 3.0)]
    pub nmac_m: f64,
    /// The detector: `color` by day, or `beacon` by night.
    #[serde(default)]
    pub detector: DetectorWire,
    /// The solver.
    #[serde(default)]
    pub solver: SolverName,
    /// How tracks are kept.
    #[serde(default)]
    pub track: TrackOptionsWire,
    /// Frames a second.
    #[serde(default = "rate_hz")]
    #[schema(minimum = 1, maximum = 240, default = 20.0)]
    pub rate_hz: f64,
}

/// The word that tells these from studies of solvers.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum EncountersKind {
    /// It is.
    #[default]
    Encounters,
}

fn standard() -> EncounterStudy {
    EncounterStudy::standard(runs(), seed())
}

const fn runs() -> u64 {
    1_000
}

const fn seed() -> u64 {
    2012
}

fn nmac_m() -> f64 {
    standard().nmac_m
}

fn rate_hz() -> f64 {
    standard().rate_hz
}

impl Default for EncountersRequest {
    fn default() -> Self {
        Self {
            kind: EncountersKind::Encounters,
            runs: runs(),
            seed: seed(),
            sensing: SensingName::default(),
            centroids: CentroidsWire::default(),
            camera: None,
            camera_azimuth_rad: 0.0,
            camera_elevation_rad: 0.0,
            target: None,
            mount: MountName::default(),
            traffic: TrafficWire::default(),
            manoeuvre: ManoeuvreWire::default(),
            alert: AlertWire::default(),
            nmac_m: nmac_m(),
            detector: DetectorWire::default(),
            solver: SolverName::default(),
            track: TrackOptionsWire::default(),
            rate_hz: rate_hz(),
        }
    }
}

impl EncountersRequest {
    /// The study in the core's words, its camera and target having been looked up before. Only what the study itself checks
    /// ([`EncounterStudy::check`]) may still be wrong with it.
    ///
    /// # Errors
    /// What is wrong, with a pointer.
    pub fn study(&self) -> Result<EncounterStudy, Fault> {
        let standard = EncounterStudy::standard(self.runs, self.seed);
        let camera = match &self.camera {
            None => standard.camera,
            Some(Ref::Object(wire)) => Camera::try_from(wire).map_err(|fault| fault.within("/camera"))?,
            Some(Ref::Name(name)) => return Err(unresolved("/camera", name)),
        };
        let mut intruder = match &self.target {
            None => standard.intruder,
            Some(Ref::Object(wire)) => plate(Target::try_from(wire).map_err(|fault| fault.within("/target"))?),
            Some(Ref::Name(name)) => return Err(unresolved("/target", name)),
        };
        if self.detector.sample_px.is_some() {
            let detail = "there is no frame to take a sample of: give a colour or a hue range";
            return Err(Fault::senseless("/detector/sample_px", detail));
        }
        let detector = Detector::try_from(&self.detector).map_err(|fault| fault.within("/detector"))?;
        intruder.marker_rgb = match &detector {
            Detector::Color(options) => painted(options.hue.centre_deg, intruder.marker_rgb),
            Detector::Beacon(options) => {
                options.hue.map_or(intruder.marker_rgb, |hue| painted(hue.centre_deg, intruder.marker_rgb))
            }
            _ => intruder.marker_rgb,
        };
        let manoeuvre = Manoeuvre::try_from(&self.manoeuvre)
            .map_err(|error| Fault::senseless(format!("/manoeuvre/{}", error.field()), error.to_string()))?;
        let CentroidsWire { missing_ratio, clutter, error_ratio } = self.centroids;
        let TrafficWire { own_speed_mps, intruder_speed_mps, course_rad, miss_m, attitude_sigma_rad } = self.traffic;
        let AlertWire { delay_s, sigmas, lead_s } = self.alert;
        Ok(EncounterStudy {
            camera,
            camera_azimuth_rad: self.camera_azimuth_rad,
            camera_elevation_rad: self.camera_elevation_rad,
            intruder,
            mount: self.mount.into(),
            traffic: Traffic { own_speed_mps, intruder_speed_mps, course_rad, miss_m, attitude_sigma_rad },
            manoeuvre,
            alarm: Alarm { delay_s, sigmas, lead_s },
            nmac_m: self.nmac_m,
            sensing: match self.sensing {
                SensingName::Centroids => Sensing::Centroids(Disturbance { missing_ratio, clutter, error_ratio }),
                SensingName::Frames => Sensing::Frames,
            },
            detector,
            pose: self.solver.options(true),
            track: self.track.options().map_err(|fault| fault.within("/track"))?,
            rate_hz: self.rate_hz,
            ..standard
        })
    }
}

/// Names are looked up before a job is made, so that what is stored is all that decides its figures.
fn unresolved(pointer: &str, name: &str) -> Fault {
    let detail = format!("no stored one {name:?}: there is no store here, so give the object itself");
    Fault { kind: FaultKind::NotFound, detail, pointer: Some(pointer.into()) }
}

/// The fault of a study that cannot be flown.
#[must_use]
pub fn fault_of_study(error: &EncounterStudyError) -> Fault {
    Fault::senseless(format!("/{}", error.field().replace('.', "/")), error.to_string())
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use crate::detect::HueRange;
    use crate::detect::color::NAMED_HUES;

    fn study(request: Value) -> Result<EncounterStudy, Fault> {
        let AskedEvaluation::Encounters(request) = AskedEvaluation::read(request)? else { panic!("another kind") };
        let study = request.study()?;
        study.check().map_err(|error| fault_of_study(&error))?;
        Ok(study)
    }

    #[test]
    fn what_is_not_said_is_the_standard() {
        assert_eq!(study(json!({"kind": "encounters"})), Ok(EncounterStudy::standard(1_000, 2012)));
        let said = json!({"kind": "encounters", "runs": 7, "seed": 1, "traffic": {"miss_m": [0, 4]}});
        let standard = EncounterStudy::standard(7, 1);
        let traffic = Traffic { miss_m: [0.0, 4.0], ..standard.traffic };
        assert_eq!(study(said), Ok(EncounterStudy { traffic, ..standard }));
        let written = serde_json::to_value(EncountersRequest::default()).expect("JSON");
        let AskedEvaluation::Encounters(read) = AskedEvaluation::read(written).expect("itself") else {
            panic!("another")
        };
        assert_eq!(*read, EncountersRequest::default());
    }

    #[test]
    fn markers_are_painted_as_the_detector_wants_them() {
        for (name, centre_deg) in NAMED_HUES {
            let found = study(json!({"kind": "encounters", "detector": {"color": name}})).expect("a study");
            let [r, g, b] = found.intruder.marker_rgb.map(f64::from);
            // The hue by its definition.
            let hue_deg = (3.0_f64.sqrt() * (g - b)).atan2(2.0 * r - g - b).to_degrees();
            let off = (hue_deg - centre_deg).rem_euclid(360.0);
            assert!(off.min(360.0 - off) < 8.0, "{name}: {hue_deg}");
            assert!(HueRange::named(name).is_some());
        }
    }

    #[test]
    fn what_is_wrong_is_pointed_at() {
        let with = |key: &str, value: Value| json!({"kind": "encounters", key: value});
        let cases = [
            (json!({"kind": "meetings"}), "/kind"),
            (with("runs", json!(0)), "/runs"),
            (with("sensing", json!("radar")), "/sensing"),
            (with("camera", json!("front")), "/camera"),
            (with("target", json!({"markers": []})), "/target/markers"),
            (with("traffic", json!({"own_speed_mps": [-1, 2]})), "/traffic/own_speed_mps"),
            (with("traffic", json!({"miss_m": [0, 4], "colour": 1})), "/traffic/colour"),
            (with("manoeuvre", json!({"bank_rad": 1.6})), "/manoeuvre/bank_rad"),
            (with("manoeuvre", json!({"miss_distance_m": 0})), "/manoeuvre/miss_distance_m"),
            (with("manoeuvre", json!({"roll_rate_radps": -1})), "/manoeuvre/roll_rate_radps"),
            (with("alert", json!({"delay_s": -0.1})), "/alert/delay_s"),
            (with("nmac_m", json!(60)), "/nmac_m"),
            (with("centroids", json!({"missing_ratio": 2})), "/centroids/missing_ratio"),
            (with("detector", json!({"method": "edge"})), "/detector"),
            (with("detector", json!({"sample_px": [1, 1, 2, 2]})), "/detector/sample_px"),
            (with("solver", json!("pnp")), "/solver"),
            (with("track", json!({"gate_z": -1})), "/track/gate_z"),
            (with("rate_hz", json!(0)), "/rate_hz"),
        ];
        for (request, pointer) in cases {
            let fault = study(request.clone()).expect_err("senseless");
            assert_eq!(fault.pointer.as_deref(), Some(pointer), "{request}: {fault}");
        }
    }
}
