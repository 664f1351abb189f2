//! What of the pipeline so many pixels allow.

use crate::assess::{AMBIGUOUS_FROM, AssessOptions, Cell, IDENTIFIED_FROM, cells_at, pose_at, range_limits_m};
use crate::camera::Camera;
use crate::detect::ColorOptions;
use crate::detect::edge::EdgeOptions;
use crate::detect::sky::kind;
use crate::geometry::{CameraFromTarget, PoseCovariance};
use crate::target::Target;

use super::eye::Sighting;

/// Something that the pipeline does with an aircraft in the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// It is found, without markers (`edge`).
    Detection,
    /// It is told from a bird.
    Classification,
    /// Its markers are found by their colour.
    Markers,
    /// Its markers are told apart.
    Identification,
    /// Its pose is known, and not the wrong one of two.
    Pose,
}

impl Task {
    /// Its name in the contract.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Detection => "detection",
            Self::Classification => "classification",
            Self::Markers => "marker_detection",
            Self::Identification => "identification",
            Self::Pose => "pose",
        }
    }
}

/// Whether a task can be done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feasibility {
    /// Which.
    pub task: Task,
    /// What decides, and in which unit.
    pub measure: Measure,
    /// What there is; `None` where nothing of it is seen.
    pub found: Option<f64>,
    /// What it takes.
    pub needed: f64,
    /// Whether there is enough, and the aircraft on the picture.
    pub feasible: bool,
    /// The distance up to which there would be enough in the middle of the picture, m; `None` where there is at none.
    pub reach_m: Option<f64>,
}

/// What a task depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Area of the silhouette, px; at least the one needed.
    AreaPx,
    /// Area of the smallest marker, px; at least the one needed.
    MarkerAreaPx,
    /// Share of simulated pictures in which all is told apart rightly; at least the one needed.
    IdentifiedRate,
    /// Share of simulated poses that are the wrong minimum; at most the one needed.
    FlipRate,
}

impl Measure {
    /// Its name in the contract.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::AreaPx => "area_px",
            Self::MarkerAreaPx => "marker_area_px",
            Self::IdentifiedRate => "identified_rate",
            Self::FlipRate => "flip_rate",
        }
    }
}

/// What is to be expected of a constellation at the distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// Rates and errors, counted on simulated noise.
    pub cell: Cell,
    /// A pose there and its least covariance; `None` where the markers do not fix it.
    pub pose: Option<(CameraFromTarget, PoseCovariance)>,
}

/// Ranges at which a constellation is tried, to see how far it reaches.
const RANGES: u32 = 8;

/// What can be done without markers, from the aircraft in the picture at this distance.
#[must_use]
pub fn unmarked(sighting: &Sighting, distance_m: f64) -> Vec<Feasibility> {
    // What is smaller drowns in the noise of most skies: birds of two pixels are at it.
    let needs = [(Task::Detection, EdgeOptions::default().min_area_px), (Task::Classification, kind::LEAST_AREA_PX)];
    needs
        .into_iter()
        .map(|(task, needed)| Feasibility {
            task,
            measure: Measure::AreaPx,
            found: Some(sighting.area_px),
            needed,
            feasible: sighting.is_in_picture && sighting.area_px >= needed,
            // The area falls with the square of the distance.
            reach_m: Some(distance_m * (sighting.area_px / needed).sqrt()),
        })
        .collect()
}

/// What can be done with markers at this distance, the target's front turned away by `aspect_rad`.
#[must_use]
pub fn marked(
    camera: &Camera,
    target: &Target,
    distance_m: f64,
    aspect_rad: f64,
    options: &AssessOptions,
    is_in_picture: bool,
) -> (Vec<Feasibility>, Option<Expected>) {
    let [near_m, far_m] = range_limits_m(camera, target);
    let at = |index: u32| near_m * (far_m / near_m).powf(f64::from(index) / f64::from(RANGES - 1));
    let mut ranges_m: Vec<f64> = (0..RANGES).map(at).collect();
    ranges_m.push(distance_m);
    let mut cells = cells_at(camera, target, &ranges_m, aspect_rad, options);
    let here = cells.pop();
    let needed_px = ColorOptions::default().blobs.min_area_px;
    let told = |task: Task, measure: Measure, needed: f64, value: &dyn Fn(&Cell) -> Option<f64>| {
        let enough = |value: f64| if measure == Measure::FlipRate { value <= needed } else { value >= needed };
        let found = here.as_ref().and_then(value);
        let feasible = is_in_picture && found.is_some_and(enough);
        let reach_m = cells.iter().filter(|cell| value(cell).is_some_and(enough)).map(|cell| cell.range_m);
        // Between ranges of the grid what is there tells as well.
        let here_m = found.is_some_and(enough).then_some(distance_m);
        Feasibility { task, measure, found, needed, feasible, reach_m: reach_m.chain(here_m).reduce(f64::max) }
    };
    let area = |cell: &Cell| cell.smallest_area_px;
    let mut markers = told(Task::Markers, Measure::MarkerAreaPx, needed_px, &area);
    // The area falls with the square of the distance: no grid is needed.
    let exact = cells.iter().find_map(|cell| Some(cell.range_m * (area(cell)? / needed_px).sqrt()));
    markers.reach_m = exact.or(markers.reach_m);
    let identified = |cell: &Cell| cell.identified_rate;
    let flips = |cell: &Cell| {
        // Without markers told apart there is no pose to be wrong.
        cell.identified_rate.filter(|rate| *rate >= IDENTIFIED_FROM).and(cell.flip_rate)
    };
    let all = vec![
        markers,
        told(Task::Identification, Measure::IdentifiedRate, IDENTIFIED_FROM, &identified),
        told(Task::Pose, Measure::FlipRate, AMBIGUOUS_FROM, &flips),
    ];
    let expected = here.map(|cell| Expected { cell, pose: pose_at(camera, target, distance_m, aspect_rad, options) });
    (all, expected)
}
