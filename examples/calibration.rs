//! Do calibrations lie within what they say of themselves? Sets of rendered pictures of every pattern through every lens model, with
//! known truth: `cargo run --release --example calibration [-- SETS [PATTERN [MODEL]]]`.
//!
//! For each: pictures in which the board was found, mean squared error of the camera's parameters in units of their covariance, the
//! same for the pixels of rays all over the picture (both are to be 1), the error of these rays, and the noise that the finder stated
//! over that measured. docs/accuracy.md has the table.

#![expect(
    clippy::print_stdout,
    clippy::expect_used,
    reason = "a study prints its figures and says what it takes for granted"
)]

use nalgebra::{DMatrix, DVector, Vector2};
use skypose::board::Board;
use skypose::calibrate::estimate::{CalibrateOptions, calibrate};
use skypose::calibrate::find::find;
use skypose::camera::{Camera, Distortion};
use skypose::geometry::Point;
use skypose::random::case;
use skypose::scene::boards::{STUDY_BOARDS, STUDY_LENSES, pose_in_view, study_camera};
use skypose::scene::render::{Optics, Rays, Sheet, render_sheet};

/// Pictures of a set.
const VIEWS: u64 = 10;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let sets: u64 = arguments.first().and_then(|sets| sets.parse().ok()).unwrap_or(20);
    let is_asked = |index: usize, name: &str| arguments.get(index).is_none_or(|asked| name.starts_with(asked.as_str()));
    println!("| pattern | lens | sets | found | parameters | rays | ray error, px | stated / measured noise |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for text in STUDY_BOARDS.into_iter().filter(|text| is_asked(1, text)) {
        let board: Board = text.parse().expect("a board");
        for lens in STUDY_LENSES.into_iter().filter(|lens| is_asked(2, lens.name())) {
            study(text, &board, lens, sets);
        }
    }
}

fn study(text: &str, board: &Board, lens: Distortion, sets: u64) {
    let truth = study_camera(lens);
    let rays = Rays::of(&truth);
    let (mut found, mut made) = (0, 0.0);
    let (mut parameters, mut of_rays, mut square, mut noise) = (0.0, 0.0, 0.0, 0.0);
    for set in 0..sets {
        let mut rng = case(text, set);
        let views: Vec<_> = (0..VIEWS)
            .filter_map(|_| {
                let pose = pose_in_view(&truth, board, &mut rng);
                let frame = render_sheet(&rays, &pose, &Sheet::of(board), &Optics::default(), &mut rng);
                find(&frame, board).ok()
            })
            .collect();
        found += views.len();
        let options = CalibrateOptions { lens, ..CalibrateOptions::default() };
        let size = [truth.width(), truth.height()];
        let Ok(camera) = calibrate(size, board, &views, &options) else { continue };
        made += 1.0;
        parameters += parameter_error(&camera.camera, &truth);
        let (ratio, error) = ray_error(&camera.camera, &truth);
        of_rays += ratio;
        square += error;
        noise += 1.0 / camera.noise_ratio;
    }
    println!(
        "| {text} | {} | {made} of {sets} | {found} of {} | {:.2} | {:.2} | {:.3} | {:.2} |",
        lens.name(),
        sets * VIEWS,
        parameters / made,
        of_rays / made,
        (square / made).sqrt(),
        noise / made
    );
}

/// Mean squared error of the parameters in units of their covariance.
fn parameter_error(found: &Camera, truth: &Camera) -> f64 {
    let numbers = |camera: &Camera| -> Vec<f64> {
        let [fx, fy] = camera.focal_lengths();
        let [cx, cy] = camera.principal_point();
        [fx, fy, cx, cy].into_iter().chain(camera.distortion().coefficients().iter().copied()).collect()
    };
    let covariance = found.parameter_covariance().expect("measured").matrix();
    let (found, truth) = (numbers(found), numbers(truth));
    let sigma = |i: usize| covariance[(i, i)].sqrt();
    let unit = DMatrix::from_fn(found.len(), found.len(), |r, c| covariance[(r, c)] / (sigma(r) * sigma(c)));
    let error = DVector::from_fn(found.len(), |i, _| (found[i] - truth[i]) / sigma(i));
    error.dot(&unit.cholesky().expect("a covariance").solve(&error)) / found.len() as f64
}

/// Mean squared error of the pixels of rays all over the picture: in units of their covariance, and px^2 per axis.
fn ray_error(found: &Camera, truth: &Camera) -> (f64, f64) {
    let covariance = found.parameter_covariance().expect("measured").matrix();
    let (mut ratio, mut square, mut count) = (0.0, 0.0, 0.0);
    for (x, y) in (0..7).flat_map(|x| (0..5).map(move |y| (x, y))) {
        let pixel = Vector2::new(90.0 + 75.0 * f64::from(x), 70.0 + 80.0 * f64::from(y));
        let ray = truth.unproject(&pixel).expect("a ray");
        let point = Point::new(ray.x, ray.y, 1.0);
        let (Some(by), Some(seen)) = (found.pixel_by_parameters(&point), found.project(&point)) else { continue };
        let error = seen - pixel;
        let variance = (by * covariance * by.transpose()).diagonal();
        ratio += error.component_mul(&error).component_div(&variance).sum();
        square += error.norm_squared();
        count += 2.0;
    }
    (ratio / count, square / count)
}
