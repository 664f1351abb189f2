//! One case of a study: points, their disturbed images, what the solver is told, and the truth.
//!
//! Geometry, noise and disturbances of a run have a generator each, and numbers are drawn in units that the parameters
//! scale, so that along a sweep the same cases get, say, more noise: curves differ by the parameter, not by luck.

use std::f64::consts::TAU;

use nalgebra::{Rotation3, Vector2, Vector3};
use rand::{Rng, RngExt};

use super::study::{Disturbance, Layout, Poses, Study, StudyError};
use crate::camera::{Camera, Pixel};
use crate::geometry::{CameraFromTarget, EulerAngles, Point, rotation, space};
use crate::random::{self, normal, normal2};
use crate::scene::cases::Case;
use crate::scene::protocols::Trial;

/// How often a pose is drawn for a case until one has its points where they are wanted.
const ATTEMPTS: u32 = 100_000;
/// The same for the first cases, by which it is told whether there are such poses.
const CHECK_ATTEMPTS: u32 = 3_000;
/// How many cases are looked at for that.
const CHECK_RUNS: u64 = 3;
/// A solver is told that pixels are no better than this, px.
const MIN_SIGMA_PX: f64 = 1e-3;

/// A case as it is and as a solver sees it.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// The truth, with the pairs that are seen.
    pub trial: Trial,
    /// The camera as the solver is told, with the covariance of what it is told.
    pub told: Camera,
}

/// Case number `run` of a study without a sweep, or of one step of it ([`Study::at`]). `None` if no pose has its points where they are wanted, which
/// [`Study::check`] makes all but impossible.
#[must_use]
pub fn case(study: &Study, run: u64) -> Option<Drawn> {
    drawn(study, run, ATTEMPTS)
}

/// Whether cases can be drawn.
pub(super) fn check(study: &Study, step: usize) -> Result<(), StudyError> {
    let at = study.at(step);
    for run in 0..CHECK_RUNS {
        if drawn(&at, run, CHECK_ATTEMPTS).is_none() {
            let at = study.sweep.as_ref().map_or_else(String::new, |sweep| {
                format!(" at {} = {}", sweep.parameter.name(), sweep.values.get(step).copied().unwrap_or_default())
            });
            let place = if study.in_view { "in the picture" } else { "in front of the camera" };
            return Err(StudyError::NoCase { attempts: CHECK_ATTEMPTS, at, place });
        }
    }
    Ok(())
}

fn drawn(study: &Study, run: u64, attempts: u32) -> Option<Drawn> {
    let rng = |part: &str| random::case(&format!("evaluation {} {part}", study.seed), run);
    let (points, pose, exact) = geometry(study, &mut rng("geometry"), attempts)?;
    let disturbance = &study.disturbance;
    let noise = &mut rng("noise");
    let mut pixels: Vec<Pixel> =
        exact.iter().map(|pixel| rounded(pixel + normal2(noise) * disturbance.pixel_sigma_px, disturbance)).collect();
    let (seen, right) = disturbed(study, &mut rng("disturbance"), &mut pixels);
    let kept = |index: &usize| seen[*index];
    let points = (0..points.len()).filter(kept).map(|index| points[index]).collect();
    let right = (0..right.len()).filter(kept).map(|index| right[index]).collect();
    let pixels = (0..pixels.len()).filter(kept).map(|index| pixels[index]).collect();
    let trial = Trial {
        case: Case { camera: study.camera, points, pixels, camera_from_target: pose },
        sigma_px: sigma_px(disturbance),
        right,
    };
    Some(Drawn { trial, told: told(&study.camera, disturbance, &mut rng("calibration")) })
}

/// Noise and rounding together, px.
fn sigma_px(disturbance: &Disturbance) -> f64 {
    // The variance of an even distribution over one step is a twelfth of its square.
    disturbance.pixel_sigma_px.hypot(disturbance.quantisation_px / 12.0_f64.sqrt()).max(MIN_SIGMA_PX)
}

fn rounded(pixel: Pixel, disturbance: &Disturbance) -> Pixel {
    let step = disturbance.quantisation_px;
    if step > 0.0 { pixel.map(|place| (place / step).round() * step) } else { pixel }
}

type Geometry = (Vec<Point<space::Target>>, CameraFromTarget, Vec<Pixel>);

/// Points, pose and exact images.
fn geometry(study: &Study, rng: &mut impl Rng, attempts: u32) -> Option<Geometry> {
    for _ in 0..attempts {
        let points = points(&study.points, rng);
        let pose = pose(study, rng);
        let faces = |index: usize| match &study.points {
            Layout::Given(target) => target.faces_camera(index, &pose),
            Layout::Random { .. } => true,
        };
        let facing: Vec<_> = (0..points.len()).filter(|index| faces(*index)).map(|index| points[index]).collect();
        let image = |point: &Point<space::Target>| {
            let pixel = study.camera.project(&(pose * *point))?;
            (!study.in_view || study.camera.contains(&pixel)).then_some(pixel)
        };
        if let Some(exact) = facing.iter().map(image).collect::<Option<Vec<Pixel>>>()
            && !exact.is_empty()
        {
            return Some((facing, pose, exact));
        }
    }
    None
}

fn points(layout: &Layout, rng: &mut impl Rng) -> Vec<Point<space::Target>> {
    match layout {
        Layout::Given(target) => target.markers().iter().map(|marker| marker.position).collect(),
        Layout::Random { count, size_m: [x, y, z] } => {
            let mut within = |size: f64| size * (rng.random::<f64>() - 0.5);
            (0..*count).map(|_| Point::new(within(*x), within(*y), within(*z))).collect()
        }
    }
}

fn pose(study: &Study, rng: &mut impl Rng) -> CameraFromTarget {
    let mut between = |[low, high]: [f64; 2]| low + (high - low) * rng.random::<f64>();
    match study.poses {
        Poses::Free { max_angle_rad, translation_m } => {
            let angles = [-max_angle_rad, max_angle_rad];
            let euler = EulerAngles { roll_rad: between(angles), pitch_rad: between(angles), yaw_rad: between(angles) };
            CameraFromTarget::new(euler.to_rotation(), Vector3::from(translation_m.map(between)))
        }
        Poses::InPicture { range_m, tilt_rad } => {
            let [width, height] = [study.camera.width(), study.camera.height()].map(f64::from);
            let pixel = Vector2::new(between([0.0, width]) - 0.5, between([0.0, height]) - 0.5);
            let ray = study.camera.unproject(&pixel).unwrap_or_default();
            let sight = Vector3::new(ray.x, ray.y, 1.0).normalize();
            let (range_m, tilt_rad) = (between(range_m), between(tilt_rad));
            let (direction, spin) = (between([0.0, TAU]), between([0.0, TAU]));
            let axis = Vector3::new(direction.cos(), direction.sin(), 0.0);
            // The marked face looks along -z, so untilted its z axis is the line of sight.
            let along_sight = Rotation3::rotation_between(&Vector3::z(), &sight).unwrap_or_default();
            let turn = along_sight * rotation::exp(&(axis * tilt_rad)) * rotation::exp(&(Vector3::z() * spin));
            CameraFromTarget::new(turn, sight * range_m)
        }
    }
}

/// Which points are seen, and which pairs are right; puts the pixels of the others anywhere.
fn disturbed(study: &Study, rng: &mut impl Rng, pixels: &mut [Pixel]) -> (Vec<bool>, Vec<bool>) {
    let [width, height] = [study.camera.width(), study.camera.height()].map(f64::from);
    // One draw a point, whatever the shares: that of whether it is missed, of its turn among the wrong, of its wrong place.
    let draws: Vec<[f64; 4]> = pixels.iter().map(|_| std::array::from_fn(|_| rng.random::<f64>())).collect();
    let seen: Vec<bool> = draws.iter().map(|draw| draw[0] >= study.disturbance.missing_ratio).collect();
    let mut right = vec![true; pixels.len()];
    let mut turn: Vec<usize> = (0..pixels.len()).filter(|index| seen[*index]).collect();
    turn.sort_by(|a, b| draws[*a][1].total_cmp(&draws[*b][1]));
    #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "a share of a few points")]
    let wrong = (study.disturbance.outlier_ratio * turn.len() as f64).round() as usize;
    for index in turn.into_iter().take(wrong) {
        let place = Pixel::new(draws[index][2] * width - 0.5, draws[index][3] * height - 0.5);
        pixels[index] = rounded(place, &study.disturbance);
        right[index] = false;
    }
    (seen, right)
}

/// The camera with errors of its calibration, and their covariance.
fn told(camera: &Camera, disturbance: &Disturbance, rng: &mut impl Rng) -> Camera {
    let (focal, center) = (disturbance.focal_error_ratio, disturbance.center_error_px);
    if focal <= 0.0 && center <= 0.0 {
        return *camera;
    }
    let factor = 1.0 + focal * normal(rng).clamp(-4.0, 4.0);
    let offset = normal2(rng) * center;
    let [fx, fy] = camera.focal_lengths();
    let [cx, cy] = camera.principal_point();
    let size = [camera.width(), camera.height()];
    let moved = Camera::checked(size, [fx * factor, fy * factor], [cx + offset.x, cy + offset.y], *camera.distortion());
    let mut covariance = vec![vec![0.0; 4]; 4];
    let deviation = [fx * focal, fy * focal];
    for (row, across) in deviation.iter().enumerate() {
        for (column, down) in deviation.iter().enumerate() {
            covariance[row][column] = across * down;
        }
    }
    covariance[2][2] = center * center;
    covariance[3][3] = center * center;
    // A camera that is wrong enough to be none is told as it is.
    moved.and_then(|moved| moved.with_parameter_covariance(&covariance)).unwrap_or(*camera)
}
