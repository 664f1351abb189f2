//! What a constellation is good for: request and reply of `POST /v1/targets/assessment`.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use super::reference::{CameraOrName, TargetOrName};
use super::{CameraWire, Ref, TargetWire};
use crate::assess::{Advice, AssessOptions, Assessment, Cell, Figures, Reach, Warning};

/// A constellation, a camera, and what is asked about them.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AssessmentRequest {
    /// Copied to the reply.
    #[serde(default)]
    pub id: Option<Value>,
    /// The camera, or the name of a stored one.
    #[schema(value_type = CameraOrName)]
    pub camera: Ref<CameraWire>,
    /// The target, or the name of a stored one.
    #[schema(value_type = TargetOrName)]
    pub target: Ref<TargetWire>,
    /// Standard deviation of a centroid per axis, px, with all that camera and target model add.
    #[serde(default = "pixel_sigma")]
    #[schema(minimum = 0.001, maximum = 100, default = 0.3)]
    pub pixel_sigma: f64,
    /// Distances from the camera to the centre of the markers; if left out, twelve from where the target just fits into the
    /// picture to where it is 8 px wide.
    #[serde(default)]
    #[schema(min_items = 1, max_items = 24)]
    pub ranges_m: Option<Vec<f64>>,
    /// Angles between the line of sight and the front of the target, from 0 to pi; if left out, 0 to 75 degrees in steps of 15.
    #[serde(default)]
    #[schema(min_items = 1, max_items = 12)]
    pub aspects_rad: Option<Vec<f64>>,
    /// Advise only moves of markers within the front plane.
    #[serde(default)]
    pub flat: bool,
    /// Other targets that fly in the same sky, or the names of stored ones.
    #[serde(default)]
    #[schema(max_items = 16, value_type = Vec<TargetOrName>)]
    pub others: Vec<Ref<TargetWire>>,
    /// Draw the figures: `plot_svg` in the reply.
    #[serde(default)]
    pub plot: bool,
}

fn pixel_sigma() -> f64 {
    AssessOptions::default().pixel_sigma
}

/// What the constellation is good for. Standard deviations are the Cramer-Rao bound, rates are counted on simulated noise; the
/// same request has the same reply.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct AssessmentReply {
    /// The request's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<Value>,
    /// Unit vector in the target frame: the direction from which the target is seen face on, at an aspect of 0.
    pub front: [f64; 3],
    /// The ranges, rising.
    pub ranges_m: Vec<f64>,
    /// The aspects, rising.
    pub aspects_rad: Vec<f64>,
    /// One for each aspect and range, by aspect, then range.
    pub cells: Vec<CellWire>,
    /// Simulated noises for each cell.
    pub draws: usize,
    /// Of these, noises in which markers are told apart, in the cells that have such rates; 0 if there are too many markers.
    pub identified_draws: usize,
    /// How far the target serves at each aspect.
    pub reach: Vec<AspectReach>,
    /// How far it serves at the mean of the aspects.
    pub mean_reach: ReachWire,
    /// What is wrong with the constellation, the worst first.
    pub warnings: Vec<WarningWire>,
    /// The range at which moves of markers were compared.
    pub advice_range_m: f64,
    /// The figures there as the target is.
    pub figures: FiguresWire,
    /// Moves of one marker that better it, the best first.
    pub advice: Vec<AdviceWire>,
    /// The figures drawn over range and aspect (SVG), with `plot` only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plot_svg: Option<String>,
    /// Time taken, microseconds.
    pub elapsed_us: f64,
}

/// What is to be expected at one range and aspect, over all turns about the line of sight and all directions of tilt.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = AssessmentCell)]
pub struct CellWire {
    /// From the camera to the centre of the markers.
    pub range_m: f64,
    /// Between the line of sight and the front of the target.
    pub aspect_rad: f64,
    /// Markers in the picture that face the camera, mean.
    pub markers_seen: f64,
    /// Largest distance between two of them in the picture, mean.
    pub extent_px: f64,
    /// Smallest distance between two of them in the picture.
    pub closest_px: Option<f64>,
    /// Radius of the largest of them in the picture, where known.
    pub marker_radius_px: Option<f64>,
    /// Area of the smallest of them in the picture, where known.
    pub smallest_area_px: Option<f64>,
    /// Standard deviation of the range of the markers' centre.
    pub range_sigma_m: Option<f64>,
    /// Root mean square angle between its true and its estimated direction.
    pub bearing_sigma_rad: Option<f64>,
    /// Root mean square angle of the error of the attitude as the bound has it, at most 2.3, which is that of an attitude of
    /// which nothing is known. Far too large where `reliable_rate` is small.
    pub attitude_sigma_rad: Option<f64>,
    /// Root mean square angle of the error of simulated attitudes, of each answer the pose nearest to the truth.
    pub attitude_error_rad: Option<f64>,
    /// Share of simulated poses whose covariance is reliable.
    pub reliable_rate: Option<f64>,
    /// Share of simulated poses, markers being known, that are the wrong minimum: attitude more than 20 degrees off.
    pub flip_rate: Option<f64>,
    /// Share of draws without a pose even if the markers are known.
    pub no_pose_rate: f64,
    /// Share of draws in which the markers are told apart, with a probability of 0.95 or more. Null, like the next three, where
    /// that was not simulated, as the target has too many markers.
    pub identified_rate: Option<f64>,
    /// Share of draws in which the best assignment has a probability below 0.95.
    pub unsure_rate: Option<f64>,
    /// Share of draws in which no assignment is found that cannot be chance.
    pub refused_rate: Option<f64>,
    /// Share of draws in which a wrong assignment has a probability of 0.95 or more.
    pub mistaken_rate: Option<f64>,
    /// Share of draws in which blobs of two markers grow together.
    pub merged_rate: f64,
}

/// To what range a target serves for what; null where it does at none of the ranges.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Reach)]
pub struct ReachWire {
    /// Even the smallest marker is large enough for the colour detector; null also where no radius is known. Bright beacons
    /// are found farther away.
    pub detected_to_m: Option<f64>,
    /// Its markers are told apart in at least nine draws of ten.
    pub identified_to_m: Option<f64>,
    /// Its pose, markers being known, is the wrong one of two in at most one draw of twenty.
    pub unambiguous_to_m: Option<f64>,
    /// The error of its attitude is at most five degrees, root mean square, the right one of two poses being taken.
    pub attitude_to_m: Option<f64>,
}

/// How far a target serves at one aspect.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct AspectReach {
    /// Between the line of sight and the front of the target.
    pub aspect_rad: f64,
    /// How far.
    #[serde(flatten)]
    pub reach: ReachWire,
}

/// Something that moving or marking markers would better.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = AssessmentWarning)]
pub struct WarningWire {
    /// For programs.
    pub kind: WarningKind,
    /// For people, with the numbers.
    pub detail: String,
}

/// What a warning is about.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WarningKind {
    /// The constellation looks the same when it is turned.
    Symmetric,
    /// It is its own mirror image in depth.
    OwnMirrorImage,
    /// One of the others is the same constellation.
    SameAsOther,
    /// One of the others is its mirror image.
    MirrorImageOfOther,
    /// All markers lie nearly in a plane.
    Flat,
    /// All markers lie nearly in a line.
    NearlyCollinear,
    /// Blobs of two markers grow together early.
    TooClose,
    /// Markers without a radius.
    RadiusUnknown,
    /// Markers without a normal.
    NormalUnknown,
    /// As many markers as make a detection.
    NoneToSpare,
    /// Ranges at which identification expects no target.
    RangeNotExpected,
}

/// Means over the aspects at one range.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = AssessmentFigures)]
pub struct FiguresWire {
    /// Share of poses that are the wrong minimum.
    pub flip_rate: f64,
    /// Share of draws in which the markers are told apart; null where that was not simulated.
    pub identified_rate: Option<f64>,
    /// Root mean square angle of the error of simulated attitudes.
    pub attitude_error_rad: Option<f64>,
}

/// A move of one marker and what is gained, measured with the same noise before and after.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = AssessmentAdvice)]
pub struct AdviceWire {
    /// Id of the marker.
    pub marker: String,
    /// Where it is.
    pub from_m: [f64; 3],
    /// Where to put it.
    pub to_m: [f64; 3],
    /// Part of the move along the front, towards the viewer.
    pub outward_m: f64,
    /// Before.
    pub before: FiguresWire,
    /// After.
    pub after: FiguresWire,
    /// All of it in a sentence.
    pub detail: String,
}

impl From<&Cell> for CellWire {
    fn from(cell: &Cell) -> Self {
        Self {
            range_m: cell.range_m,
            aspect_rad: cell.aspect_rad,
            markers_seen: cell.markers_seen,
            extent_px: cell.extent_px,
            closest_px: cell.closest_px,
            marker_radius_px: cell.marker_radius_px,
            smallest_area_px: cell.smallest_area_px,
            range_sigma_m: cell.range_sigma_m,
            bearing_sigma_rad: cell.bearing_sigma_rad,
            attitude_sigma_rad: cell.attitude_sigma_rad,
            attitude_error_rad: cell.attitude_error_rad,
            reliable_rate: cell.reliable_rate,
            flip_rate: cell.flip_rate,
            no_pose_rate: cell.no_pose_rate,
            identified_rate: cell.identified_rate,
            unsure_rate: cell.unsure_rate,
            refused_rate: cell.refused_rate,
            mistaken_rate: cell.mistaken_rate,
            merged_rate: cell.merged_rate,
        }
    }
}

impl From<&Reach> for ReachWire {
    fn from(reach: &Reach) -> Self {
        Self {
            detected_to_m: reach.detected_m,
            identified_to_m: reach.identified_m,
            unambiguous_to_m: reach.unambiguous_m,
            attitude_to_m: reach.attitude_m,
        }
    }
}

impl From<&Figures> for FiguresWire {
    fn from(figures: &Figures) -> Self {
        Self {
            flip_rate: figures.flip_rate,
            identified_rate: figures.identified_rate,
            attitude_error_rad: figures.attitude_error_rad,
        }
    }
}

impl From<&Warning> for WarningWire {
    fn from(warning: &Warning) -> Self {
        let kind = match warning {
            Warning::Symmetric { .. } => WarningKind::Symmetric,
            Warning::OwnMirrorImage { .. } => WarningKind::OwnMirrorImage,
            Warning::SameAs { .. } => WarningKind::SameAsOther,
            Warning::MirrorImageOf { .. } => WarningKind::MirrorImageOfOther,
            Warning::Flat { .. } => WarningKind::Flat,
            Warning::NearlyCollinear { .. } => WarningKind::NearlyCollinear,
            Warning::TooClose { .. } => WarningKind::TooClose,
            Warning::RadiusUnknown { .. } => WarningKind::RadiusUnknown,
            Warning::NormalUnknown { .. } => WarningKind::NormalUnknown,
            Warning::NoneToSpare { .. } => WarningKind::NoneToSpare,
            Warning::RangeNotExpected { .. } => WarningKind::RangeNotExpected,
        };
        Self { kind, detail: warning.to_string() }
    }
}

impl From<&Advice> for AdviceWire {
    fn from(advice: &Advice) -> Self {
        Self {
            marker: advice.id.clone(),
            from_m: advice.from.coords.into(),
            to_m: advice.to.coords.into(),
            outward_m: advice.outward_m,
            before: (&advice.before).into(),
            after: (&advice.after).into(),
            detail: advice.to_string(),
        }
    }
}

impl From<&Assessment> for AssessmentReply {
    fn from(found: &Assessment) -> Self {
        let reach = |(aspect_rad, reach): (&f64, &Reach)| AspectReach { aspect_rad: *aspect_rad, reach: reach.into() };
        Self {
            id: None,
            // A negative zero would be written as -0.0.
            front: found.front.add_scalar(0.0).into(),
            ranges_m: found.ranges_m.clone(),
            aspects_rad: found.aspects_rad.clone(),
            cells: found.cells.iter().flatten().map(Into::into).collect(),
            draws: found.draws,
            identified_draws: found.identified_draws,
            reach: found.aspects_rad.iter().zip(&found.reach).map(reach).collect(),
            mean_reach: (&found.mean_reach).into(),
            warnings: found.warnings.iter().map(Into::into).collect(),
            advice_range_m: found.advice_range_m,
            figures: (&found.figures).into(),
            advice: found.advice.iter().map(Into::into).collect(),
            plot_svg: None,
            elapsed_us: 0.0,
        }
    }
}
