//! What is studied: points, camera, poses, disturbances, and which methods are put to them.

use std::f64::consts::{FRAC_PI_2, PI};

use thiserror::Error;

use super::draw;
use super::method::Method;
use crate::camera::Camera;
use crate::scene::cases;
use crate::solve::Solver;
use crate::target::Target;

/// Most points of a drawn layout.
const MAX_POINTS: usize = 1_000;
/// Most values of a sweep.
pub const MAX_STEPS: usize = 64;
/// Most methods side by side.
pub const MAX_METHODS: usize = 16;
/// Most solves of a study: cases times steps times methods.
pub const MAX_SOLVES: u64 = 1_000_000_000;

/// A study: everything that decides its figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    /// What the points are seen with.
    pub camera: Camera,
    /// The points.
    pub points: Layout,
    /// How they are placed before the camera.
    pub poses: Poses,
    /// Draw again until every point lies within the picture; otherwise until every point has an image, be it beside the picture.
    pub in_view: bool,
    /// What keeps the images from being perfect.
    pub disturbance: Disturbance,
    /// What is put to the cases.
    pub methods: Vec<Method>,
    /// Cases at each step of the sweep.
    pub runs: u64,
    /// Names the cases: the same seed, the same cases.
    pub seed: u64,
    /// One parameter at several values, instead of the value above.
    pub sweep: Option<Sweep>,
}

/// Where the points sit on the target.
#[derive(Clone, Debug, PartialEq)]
pub enum Layout {
    /// Anew in each case, evenly in a box about the origin.
    Random {
        /// How many.
        count: usize,
        /// Edges of the box, m; a height of 0 makes a plane.
        size_m: [f64; 3],
    },
    /// The markers of a target; those that face away are not seen.
    Given(Target),
}

/// How the target is placed before the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Poses {
    /// As in the seed's study: angles and translations evenly, each on its own.
    Free {
        /// Roll, pitch and yaw within plus and minus this.
        max_angle_rad: f64,
        /// Least and largest x, y and z.
        translation_m: [[f64; 2]; 3],
    },
    /// The origin of the target on the ray of a pixel of the picture, all pixels alike.
    InPicture {
        /// Least and largest distance.
        range_m: [f64; 2],
        /// Least and largest angle between the target's z axis and the line of sight, evenly; the direction of the tilt and the
        /// turn about the axis are any.
        tilt_rad: [f64; 2],
    },
}

/// What keeps the images of the points from being perfect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Disturbance {
    /// Standard deviation of a pixel's Gaussian noise per axis, px.
    pub pixel_sigma_px: f64,
    /// Share of the pairs whose pixel is anywhere in the picture instead, rounded to whole pairs.
    pub outlier_ratio: f64,
    /// Probability of a point not to be seen.
    pub missing_ratio: f64,
    /// Pixels are rounded to multiples of this, px.
    pub quantisation_px: f64,
    /// Standard deviation of the focal lengths that the solver is told, as a share of the true ones; of fx and fy alike.
    pub focal_error_ratio: f64,
    /// Standard deviation of the principal point that the solver is told, px per axis.
    pub center_error_px: f64,
}

/// One parameter at several values.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Which.
    pub parameter: Parameter,
    /// Its values, one a step.
    pub values: Vec<f64>,
}

/// What can be swept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// Number of drawn points.
    Points,
    /// Distance of poses in the picture.
    RangeM,
    /// Tilt of poses in the picture.
    TiltRad,
    /// Limit of the angles of free poses.
    MaxAngleRad,
    /// See [`Disturbance::pixel_sigma_px`].
    PixelSigmaPx,
    /// See [`Disturbance::outlier_ratio`].
    OutlierRatio,
    /// See [`Disturbance::missing_ratio`].
    MissingRatio,
    /// See [`Disturbance::quantisation_px`].
    QuantisationPx,
    /// See [`Disturbance::focal_error_ratio`].
    FocalErrorRatio,
    /// See [`Disturbance::center_error_px`].
    CenterErrorPx,
}

impl Parameter {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Points,
        Self::RangeM,
        Self::TiltRad,
        Self::MaxAngleRad,
        Self::PixelSigmaPx,
        Self::OutlierRatio,
        Self::MissingRatio,
        Self::QuantisationPx,
        Self::FocalErrorRatio,
        Self::CenterErrorPx,
    ];

    /// As in requests.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Points => "points",
            Self::RangeM => "range_m",
            Self::TiltRad => "tilt_rad",
            Self::MaxAngleRad => "max_angle_rad",
            Self::PixelSigmaPx => "pixel_sigma_px",
            Self::OutlierRatio => "outlier_ratio",
            Self::MissingRatio => "missing_ratio",
            Self::QuantisationPx => "quantisation_px",
            Self::FocalErrorRatio => "focal_error_ratio",
            Self::CenterErrorPx => "center_error_px",
        }
    }

    /// For people.
    #[must_use]
    pub const fn label(self) -> &'static str {
        match self {
            Self::Points => "number of points",
            Self::RangeM => "range (m)",
            Self::TiltRad => "tilt (rad)",
            Self::MaxAngleRad => "limit of the angles (rad)",
            Self::PixelSigmaPx => "noise of a pixel (px)",
            Self::OutlierRatio => "share of wrong pairs",
            Self::MissingRatio => "share of missing points",
            Self::QuantisationPx => "rounding of a pixel (px)",
            Self::FocalErrorRatio => "error of the focal length (share)",
            Self::CenterErrorPx => "error of the principal point (px)",
        }
    }
}

/// What is wrong with a study. The field is named as in requests.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum StudyError {
    /// A number out of its range.
    #[error("{field} is {value}, but {need}")]
    Value {
        /// Which.
        field: &'static str,
        /// What was given.
        value: f64,
        /// What is needed.
        need: &'static str,
    },
    /// Nothing to compare.
    #[error("no method is asked for, or more than {MAX_METHODS}, or one of them twice")]
    Methods,
    /// More than can be done.
    #[error("{runs} runs of {steps} steps with {methods} methods are more than {MAX_SOLVES} solves")]
    TooLarge {
        /// Runs.
        runs: u64,
        /// Steps.
        steps: usize,
        /// Methods.
        methods: usize,
    },
    /// A sweep that has nothing to act on.
    #[error("{parameter} cannot be swept: {why}")]
    Sweep {
        /// Which.
        parameter: &'static str,
        /// What it would need.
        why: &'static str,
    },
    /// Such poses do not occur.
    #[error("no case could be drawn in {attempts} attempts{at}: no such pose has every point {place}")]
    NoCase {
        /// How often it was tried.
        attempts: u32,
        /// At which value of the sweep.
        at: String,
        /// Where points are wanted.
        place: &'static str,
    },
}

impl StudyError {
    /// The field that is to blame, as in requests.
    #[must_use]
    pub const fn field(&self) -> Option<&'static str> {
        match self {
            Self::Value { field, .. } => Some(field),
            Self::Methods => Some("solvers"),
            Self::TooLarge { .. } => Some("runs"),
            Self::Sweep { .. } => Some("sweep"),
            Self::NoCase { .. } => None,
        }
    }
}

impl Study {
    /// The seed's study: table 4.1 as its program draws it (the table has misprints), its three methods as their papers have
    /// them. R. Hajri, "UAV to UAV Target Detection and Pose Estimation", Naval Postgraduate School, 2012,
    /// sections 4.3 and 4.4.
    #[must_use]
    pub fn thesis_2012(runs: u64, seed: u64) -> Self {
        Self {
            camera: cases::seed_camera(),
            points: Layout::Random { count: 6, size_m: [0.8, 0.8, 0.0] },
            poses: Poses::Free { max_angle_rad: FRAC_PI_2, translation_m: [[0.0, 10.0]; 3] },
            in_view: false,
            disturbance: Disturbance { pixel_sigma_px: 1.0, ..Disturbance::default() },
            methods: [Solver::Epnp, Solver::Posit, Solver::Homography].map(Method::Solver).to_vec(),
            runs,
            seed,
            sweep: None,
        }
    }

    /// How many values the sweep has; 1 without one.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.sweep.as_ref().map_or(1, |sweep| sweep.values.len())
    }

    /// The study at one value of its sweep.
    #[must_use]
    pub fn at(&self, step: usize) -> Self {
        let mut study = Self { sweep: None, ..self.clone() };
        let Some((parameter, value)) =
            self.sweep.as_ref().and_then(|sweep| Some((sweep.parameter, *sweep.values.get(step)?)))
        else {
            return study;
        };
        let Disturbance {
            pixel_sigma_px,
            outlier_ratio,
            missing_ratio,
            quantisation_px,
            focal_error_ratio,
            center_error_px,
        } = &mut study.disturbance;
        match (parameter, &mut study.points, &mut study.poses) {
            (Parameter::Points, Layout::Random { count, .. }, _) => {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "checked to be a small whole number"
                )]
                let wanted = value as usize;
                *count = wanted;
            }
            (Parameter::RangeM, _, Poses::InPicture { range_m, .. }) => *range_m = [value; 2],
            (Parameter::TiltRad, _, Poses::InPicture { tilt_rad, .. }) => *tilt_rad = [value; 2],
            (Parameter::MaxAngleRad, _, Poses::Free { max_angle_rad, .. }) => *max_angle_rad = value,
            (Parameter::PixelSigmaPx, ..) => *pixel_sigma_px = value,
            (Parameter::OutlierRatio, ..) => *outlier_ratio = value,
            (Parameter::MissingRatio, ..) => *missing_ratio = value,
            (Parameter::QuantisationPx, ..) => *quantisation_px = value,
            (Parameter::FocalErrorRatio, ..) => *focal_error_ratio = value,
            (Parameter::CenterErrorPx, ..) => *center_error_px = value,
            // Refused by the check.
            (Parameter::Points | Parameter::RangeM | Parameter::TiltRad | Parameter::MaxAngleRad, ..) => {}
        }
        study
    }

    /// Whether it makes sense, and cases of it can be drawn.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn check(&self) -> Result<(), StudyError> {
        let has_twins = self.methods.iter().enumerate().any(|(index, method)| self.methods[..index].contains(method));
        if self.methods.is_empty() || self.methods.len() > MAX_METHODS || has_twins {
            return Err(StudyError::Methods);
        }
        let (runs, steps, methods) = (self.runs, self.steps(), self.methods.len());
        within("runs", runs as f64, 1.0, MAX_SOLVES as f64, "at least one is needed")?;
        let solves = runs.saturating_mul((steps * methods) as u64);
        if solves > MAX_SOLVES {
            return Err(StudyError::TooLarge { runs, steps, methods });
        }
        if let Some(sweep) = &self.sweep {
            self.check_sweep(sweep)?;
        }
        for step in 0..steps {
            self.at(step).check_one()?;
            draw::check(self, step)?;
        }
        Ok(())
    }

    fn check_sweep(&self, sweep: &Sweep) -> Result<(), StudyError> {
        let refuse = |why| Err(StudyError::Sweep { parameter: sweep.parameter.name(), why });
        if !(1..=MAX_STEPS).contains(&sweep.values.len()) {
            return refuse("1 to 64 values are needed");
        }
        match (sweep.parameter, &self.points, &self.poses) {
            (Parameter::Points, Layout::Given(_), _) => refuse("the points are those of a target"),
            (Parameter::Points, ..) if sweep.values.iter().any(|value| value.fract() != 0.0) => {
                refuse("numbers of points are whole")
            }
            (Parameter::RangeM | Parameter::TiltRad, _, Poses::Free { .. }) => {
                refuse("it is one of poses in the picture")
            }
            (Parameter::MaxAngleRad, _, Poses::InPicture { .. }) => refuse("it is one of free poses"),
            _ => Ok(()),
        }
    }

    fn check_one(&self) -> Result<(), StudyError> {
        if let Layout::Random { count, size_m } = &self.points {
            within("points.count", *count as f64, 3.0, MAX_POINTS as f64, "3 to 1000 points are needed")?;
            for size in size_m {
                within("points.size_m", *size, 0.0, 1e3, "0 to 1000 m are needed")?;
            }
        }
        match self.poses {
            Poses::Free { max_angle_rad, translation_m } => {
                within("poses.max_angle_rad", max_angle_rad, 0.0, PI, "0 to pi is needed")?;
                for span in translation_m {
                    check_span("poses.translation_m", span, -1e5, 1e5, "least and largest within 100 km are needed")?;
                }
            }
            Poses::InPicture { range_m, tilt_rad } => {
                check_span("poses.range_m", range_m, 1e-3, 1e5, "least and largest within 1 mm to 100 km are needed")?;
                check_span("poses.tilt_rad", tilt_rad, 0.0, PI, "least and largest within 0 to pi are needed")?;
            }
        }
        let Disturbance {
            pixel_sigma_px,
            outlier_ratio,
            missing_ratio,
            quantisation_px,
            focal_error_ratio,
            center_error_px,
        } = self.disturbance;
        within("noise.pixel_sigma_px", pixel_sigma_px, 0.0, 1e3, "0 to 1000 px is needed")?;
        within("noise.outlier_ratio", outlier_ratio, 0.0, 1.0, "a share of 0 to 1 is needed")?;
        within("noise.missing_ratio", missing_ratio, 0.0, 1.0, "a share of 0 to 1 is needed")?;
        within("noise.quantisation_px", quantisation_px, 0.0, 1e3, "0 to 1000 px is needed")?;
        within("noise.focal_error_ratio", focal_error_ratio, 0.0, 0.2, "a share of 0 to 0.2 is needed")?;
        within("noise.center_error_px", center_error_px, 0.0, 1e3, "0 to 1000 px is needed")
    }
}

fn within(field: &'static str, value: f64, least: f64, most: f64, need: &'static str) -> Result<(), StudyError> {
    if (least..=most).contains(&value) { Ok(()) } else { Err(StudyError::Value { field, value, need }) }
}

fn check_span(
    field: &'static str,
    [low, high]: [f64; 2],
    least: f64,
    most: f64,
    need: &'static str,
) -> Result<(), StudyError> {
    within(field, low, least, most, need)?;
    within(field, high, low, most, need)
}
