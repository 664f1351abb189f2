//! The field of regard: what of the directions in which guidance asks to look a camera covers.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;

use super::eye::Eye;
use crate::camera::Pixel;

/// Directions in which one should look, as table 1.2 of the thesis has them. None of these standards is about cameras of small aircraft, and
/// nothing here claims that a camera meets one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guidance {
    /// The document.
    pub source: &'static str,
    /// What it is about.
    pub about: &'static str,
    /// From this azimuth to the left to the same to the right, rad.
    pub azimuth_rad: f64,
    /// Elevation from and to, rad; `None` where it says nothing of that, and the horizon stands for it.
    pub elevation_rad: Option<[f64; 2]>,
}

/// The guidance of the thesis' table 1.2.
pub const GUIDANCE: [Guidance; 3] = [
    Guidance {
        source: "FAA P-8740-51",
        about: "How to Avoid a Mid-Air Collision: where pilots should look",
        azimuth_rad: PI / 3.0,
        elevation_rad: Some([-PI / 18.0, PI / 18.0]),
    },
    Guidance {
        source: "ICAO Rules of the Air, 3.2",
        about: "Avoidance of collisions: right of way, of all but overtaking traffic",
        azimuth_rad: PI * 110.0 / 180.0,
        elevation_rad: None,
    },
    Guidance {
        source: "FAA AC 25.773-1",
        about: "View from the pilot compartment of transport aircraft; its elevations vary with azimuth, and the outermost stand here",
        azimuth_rad: PI * 120.0 / 180.0,
        elevation_rad: Some([-PI * 25.0 / 180.0, PI * 37.0 / 180.0]),
    },
];

/// How much of a guidance's directions a camera covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covered {
    /// The guidance.
    pub guidance: Guidance,
    /// Share of the solid angle, or without elevations of the horizon.
    pub ratio: f64,
    /// Share of the azimuths, at the horizon.
    pub azimuth_ratio: f64,
    /// Share of the elevations, straight ahead; `None` where the guidance has none.
    pub elevation_ratio: Option<f64>,
}

/// What a camera covers.
#[derive(Clone, Debug, PartialEq)]
pub struct Regard {
    /// Left and right end of the picture at the horizon, rad; `None` where it does not see the horizon in the direction of its axis.
    pub azimuth_rad: Option<[f64; 2]>,
    /// Lower and upper end of the picture in the azimuth of its axis, rad; `None` where the lens does not reach its own axis.
    pub elevation_rad: Option<[f64; 2]>,
    /// All of the picture.
    pub solid_angle_sr: f64,
    /// The rim of the picture: azimuth and elevation, rad.
    pub rim_rad: Vec<[f64; 2]>,
    /// Against each guidance.
    pub covered: Vec<Covered>,
}

/// Directions of a guidance that are tried, over azimuth and over elevation. A share is right to one in the first.
const GRID: [u32; 2] = [360, 120];

/// Parts of the picture over which the solid angle is summed.
const PATCHES: [u32; 2] = [96, 72];

/// Points along each side of the picture's rim.
const RIM: u32 = 12;

/// Coarse step in which an end of the picture is looked for, rad.
const STEP_RAD: f64 = PI / 360.0;

impl Regard {
    /// Of a camera.
    #[must_use]
    pub fn of(eye: &Eye) -> Self {
        let [azimuth, elevation] = eye.axis_rad();
        let level = |angle: f64| eye.pixel(&direction(azimuth + angle, 0.0)).is_some();
        // Over the zenith and on, so that a camera that looks straight up has two ends.
        let upright = |angle: f64| eye.pixel(&direction(azimuth, elevation + angle)).is_some();
        Self {
            azimuth_rad: ends(level, PI).map(|ends| ends.map(|end| azimuth + end)),
            elevation_rad: ends(upright, FRAC_PI_2).map(|ends| ends.map(|end| elevation + end)),
            solid_angle_sr: solid_angle_sr(eye),
            rim_rad: rim_rad(eye),
            covered: GUIDANCE.iter().map(|guidance| covered(eye, guidance)).collect(),
        }
    }
}

fn direction(azimuth_rad: f64, elevation_rad: f64) -> Vector3<f64> {
    let (sine, cosine) = azimuth_rad.sin_cos();
    Vector3::new(cosine * elevation_rad.cos(), sine * elevation_rad.cos(), -elevation_rad.sin())
}

/// How far it is seen from zero on to both sides, at most `most_rad`.
fn ends(is_seen: impl Fn(f64) -> bool, most_rad: f64) -> Option<[f64; 2]> {
    is_seen(0.0).then(|| {
        [-1.0, 1.0].map(|sign| {
            let mut near = 0.0;
            while near < most_rad && is_seen(sign * (near + STEP_RAD)) {
                near += STEP_RAD;
            }
            let mut far = near + STEP_RAD;
            for _ in 0..40 {
                let middle = 0.5 * (near + far);
                if is_seen(sign * middle) { near = middle } else { far = middle }
            }
            sign * near.min(most_rad)
        })
    })
}

fn covered(eye: &Eye, guidance: &Guidance) -> Covered {
    let [columns, rows] = GRID;
    // In the middle of each cell.
    let along =
        |low: f64, high: f64, index: u32, count: u32| low + (high - low) * (f64::from(index) + 0.5) / f64::from(count);
    let azimuth = |column: u32| along(-guidance.azimuth_rad, guidance.azimuth_rad, column, columns);
    let is_seen = |azimuth_rad: f64, elevation_rad: f64| eye.pixel(&direction(azimuth_rad, elevation_rad)).is_some();
    let at_level = (0..columns).filter(|column| is_seen(azimuth(*column), 0.0)).count() as f64 / f64::from(columns);
    let Some([low, high]) = guidance.elevation_rad else {
        return Covered { guidance: *guidance, ratio: at_level, azimuth_ratio: at_level, elevation_ratio: None };
    };
    // Even steps of the sine of the elevation are even shares of the sphere.
    let elevation = |row: u32| along(low.sin(), high.sin(), row, rows).asin();
    let seen = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    let seen = seen.filter(|(row, column)| is_seen(azimuth(*column), elevation(*row))).count();
    let ahead = (0..rows).filter(|row| is_seen(0.0, along(low, high, *row, rows))).count();
    Covered {
        guidance: *guidance,
        ratio: seen as f64 / f64::from(columns * rows),
        azimuth_ratio: at_level,
        elevation_ratio: Some(ahead as f64 / f64::from(rows)),
    }
}

/// The sum of the solid angles of small parts of the picture: a ray `(x, y, 1)` takes `dx dy / |ray|^3`.
fn solid_angle_sr(eye: &Eye) -> f64 {
    let camera = eye.camera();
    let [columns, rows] = PATCHES;
    let size = [f64::from(camera.width()) / f64::from(columns), f64::from(camera.height()) / f64::from(rows)];
    let patch = |row: u32, column: u32| {
        let pixel = Pixel::new((f64::from(column) + 0.5) * size[0] - 0.5, (f64::from(row) + 0.5) * size[1] - 0.5);
        let (ray, by_pixel) = camera.unproject_with_jacobian(&pixel)?;
        Some(by_pixel.determinant().abs() * size[0] * size[1] / (1.0 + ray.norm_squared()).powf(1.5))
    };
    (0..rows).flat_map(|row| (0..columns).filter_map(move |column| patch(row, column))).sum()
}

/// Around the picture; what the lens does not reach is left out.
fn rim_rad(eye: &Eye) -> Vec<[f64; 2]> {
    let [width, height] = [eye.camera().width(), eye.camera().height()].map(f64::from);
    let corners = [[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5], [-0.5, -0.5]];
    corners
        .windows(2)
        .flat_map(|side| {
            (0..=RIM).map(move |step| {
                let share = f64::from(step) / f64::from(RIM);
                [0, 1].map(|axis| side[0][axis] + share * (side[1][axis] - side[0][axis]))
            })
        })
        .filter_map(|pixel| eye.direction_rad(&pixel.into()))
        .collect()
}
