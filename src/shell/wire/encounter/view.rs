//! What our camera sees of an encounter, and what of the pipeline that allows.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::reply::plain;
use crate::encounter::{Covered, Expected, Feasibility, Measure, Regard, Task, View};
use crate::shell::wire::assessment::CellWire;

/// What a camera sees of the encounter.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncounterView)]
pub struct ViewWire {
    /// The distance at which it looks: that at which the intruder must be in sight, or without a turn that of now.
    pub distance_m: f64,
    /// Where the intruder is then, from our course: positive to the right.
    pub azimuth_rad: f64,
    /// Where it is then, from the level: positive up.
    pub elevation_rad: f64,
    /// Whether that is on the picture.
    pub in_picture: bool,
    /// Where it is in the picture, lens included; null where it is not on it.
    pub pixel: Option<[f64; 2]>,
    /// The intruder's width in the picture; in its middle where it is not on it.
    pub width_px: f64,
    /// The intruder's height in the picture, likewise.
    pub height_px: f64,
    /// The area of its silhouette, likewise.
    pub area_px: f64,
    /// What of the pipeline that allows.
    pub tasks: Vec<TaskWire>,
    /// What is to be expected of the markers there; null without a target.
    pub expected: Option<ExpectedWire>,
    /// What the camera covers of the directions in which guidance asks to look.
    pub field_of_regard: RegardWire,
}

/// Something that the pipeline does, and whether it can be done.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncounterTask)]
pub struct TaskWire {
    /// What.
    pub task: TaskName,
    /// On what it depends.
    pub measure: MeasureName,
    /// What there is of that; null where nothing is.
    pub found: Option<f64>,
    /// What it takes: at least so much, of `flip_rate` at most.
    pub needed: f64,
    /// Whether there is enough, and the intruder on the picture.
    pub feasible: bool,
    /// Up to this distance there is enough in the middle of the picture; null where there is at none.
    pub reach_m: Option<f64>,
}

/// Something that the pipeline does.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = EncounterTaskName)]
pub enum TaskName {
    /// The aircraft is found without markers.
    Detection,
    /// It is told from a bird.
    Classification,
    /// Its markers are found by their colour.
    MarkerDetection,
    /// Its markers are told apart.
    Identification,
    /// Its pose is known, and not the wrong one of two.
    Pose,
}

/// On what a task depends.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = EncounterMeasure)]
pub enum MeasureName {
    /// Area of the silhouette, px.
    AreaPx,
    /// Area of the smallest marker, px.
    MarkerAreaPx,
    /// Share of simulated pictures in which the markers are told apart rightly.
    IdentifiedRate,
    /// Share of simulated poses that are the wrong minimum, where the markers are told apart.
    FlipRate,
}

/// What is to be expected of the markers, in the middle of the picture.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncounterExpected)]
pub struct ExpectedWire {
    /// Rates and errors, counted on simulated noise; as in an assessment.
    pub cell: CellWire,
    /// A pose there, its translation; null, like the next, where the markers do not fix it.
    pub translation_m: Option<[f64; 3]>,
    /// The least covariance that this pose can have (Cramer-Rao), in the order of every pose's.
    pub covariance: Option<Vec<Vec<f64>>>,
}

/// What a camera covers.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = FieldOfRegard)]
pub struct RegardWire {
    /// Left and right end of the picture at the horizon; null where it does not see that in the direction of its axis.
    pub azimuth_rad: Option<[f64; 2]>,
    /// Lower and upper end of the picture in the azimuth of its axis.
    pub elevation_rad: Option<[f64; 2]>,
    /// The whole picture.
    pub solid_angle_sr: f64,
    /// Against each guidance.
    pub guidance: Vec<GuidanceWire>,
}

/// How much of a guidance's directions the camera covers. No standard is claimed to be met: none of these is about such a camera.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = GuidanceCovered)]
pub struct GuidanceWire {
    /// The document.
    pub source: String,
    /// What it is about.
    pub about: String,
    /// Its azimuths.
    pub azimuth_rad: [f64; 2],
    /// Its elevations; null where it has none, and the horizon stands for them.
    pub elevation_rad: Option<[f64; 2]>,
    /// Share of the solid angle covered; without elevations, of the horizon.
    pub covered_ratio: f64,
    /// Share of the azimuths at the horizon.
    pub azimuth_ratio: f64,
    /// Share of the elevations straight ahead; null where it has none.
    pub elevation_ratio: Option<f64>,
}

impl From<&View> for ViewWire {
    fn from(view: &View) -> Self {
        let sighting = &view.sighting;
        let [azimuth_rad, elevation_rad] = view.bearing_rad.map(plain);
        Self {
            distance_m: view.distance_m,
            azimuth_rad,
            elevation_rad,
            in_picture: sighting.is_in_picture,
            pixel: sighting.pixel.filter(|_| sighting.is_in_picture).map(Into::into),
            width_px: sighting.size_px[0],
            height_px: sighting.size_px[1],
            area_px: sighting.area_px,
            tasks: view.tasks.iter().map(Into::into).collect(),
            expected: view.expected.as_ref().map(Into::into),
            field_of_regard: (&view.regard).into(),
        }
    }
}

impl From<&Feasibility> for TaskWire {
    fn from(found: &Feasibility) -> Self {
        Self {
            task: match found.task {
                Task::Detection => TaskName::Detection,
                Task::Classification => TaskName::Classification,
                Task::Markers => TaskName::MarkerDetection,
                Task::Identification => TaskName::Identification,
                Task::Pose => TaskName::Pose,
            },
            measure: match found.measure {
                Measure::AreaPx => MeasureName::AreaPx,
                Measure::MarkerAreaPx => MeasureName::MarkerAreaPx,
                Measure::IdentifiedRate => MeasureName::IdentifiedRate,
                Measure::FlipRate => MeasureName::FlipRate,
            },
            found: found.found,
            needed: found.needed,
            feasible: found.feasible,
            reach_m: found.reach_m,
        }
    }
}

impl From<&Expected> for ExpectedWire {
    fn from(expected: &Expected) -> Self {
        let rows = |matrix: &nalgebra::Matrix6<f64>| {
            matrix.row_iter().map(|row| row.iter().copied().collect()).collect::<Vec<Vec<f64>>>()
        };
        Self {
            cell: (&expected.cell).into(),
            translation_m: expected.pose.map(|(pose, _)| pose.translation.into()),
            covariance: expected.pose.map(|(_, covariance)| rows(covariance.matrix())),
        }
    }
}

impl From<&Regard> for RegardWire {
    fn from(regard: &Regard) -> Self {
        Self {
            azimuth_rad: regard.azimuth_rad,
            elevation_rad: regard.elevation_rad,
            solid_angle_sr: regard.solid_angle_sr,
            guidance: regard.covered.iter().map(Into::into).collect(),
        }
    }
}

impl From<&Covered> for GuidanceWire {
    fn from(covered: &Covered) -> Self {
        let guidance = &covered.guidance;
        Self {
            source: guidance.source.to_owned(),
            about: guidance.about.to_owned(),
            azimuth_rad: [-guidance.azimuth_rad, guidance.azimuth_rad],
            elevation_rad: guidance.elevation_rad,
            covered_ratio: covered.ratio,
            azimuth_ratio: covered.azimuth_ratio,
            elevation_ratio: covered.elevation_ratio,
        }
    }
}
