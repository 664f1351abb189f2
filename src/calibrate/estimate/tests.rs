//! Simulated sets with known truth.

use rand::{Rng, RngExt};

use super::*;
use crate::random::{case, named, normal2};
use crate::scene::boards::{STUDY_LENSES, pose_in_view, study_camera};

pub const SIZE: [u32; 2] = [640, 480];

pub fn lenses() -> [Distortion; 4] {
    STUDY_LENSES
}

pub fn truth(lens: Distortion) -> Camera {
    study_camera(lens)
}

/// Points of so many views with noise of `sigma_px`.
pub fn views(camera: &Camera, board: &Board, count: usize, sigma_px: f64, rng: &mut impl Rng) -> Vec<Vec<SeenPoint>> {
    let bundle = Bundle {
        size: SIZE,
        board,
        views: &[],
        lens: *camera.distortion(),
        freedom: Freedom::none(),
        loss: Loss::Squares,
        prior: Parameters::zeros(),
        watch: Watch::nobody(),
    };
    (0..count)
        .map(|_| {
            let pose = pose_in_view(camera, board, rng);
            (0..board.points().len())
                .map(|point| {
                    let origin = SeenPoint { point, pixel: Vector2::zeros(), sigma_px };
                    let exact = -bundle.residual(camera, &pose, &origin).expect("in view");
                    SeenPoint { pixel: exact + normal2(rng) * sigma_px, ..origin }
                })
                .collect()
        })
        .collect()
}

/// The same of a board that is held anew for each view and bends then, by a millimetre or two at its rim, as a cylinder of any direction.
pub fn views_of_a_bent_board(
    camera: &Camera,
    board: &Board,
    count: usize,
    sigma_px: f64,
    rng: &mut impl Rng,
) -> Vec<Vec<SeenPoint>> {
    (0..count)
        .map(|_| {
            let pose = pose_in_view(camera, board, rng);
            let (turn, bend) = (rng.random_range(0.0..std::f64::consts::PI), rng.random_range(-0.1..0.1));
            let seen = board.points().iter().enumerate().map(|(point, place)| {
                let across = (place.coords.x - 0.1) * turn.cos() + (place.coords.y - 0.06) * turn.sin();
                let mut bent = *place;
                bent.coords.z += bend * across * across;
                let exact = camera.project(&(pose * bent)).expect("in view");
                SeenPoint { point, pixel: exact + normal2(rng) * sigma_px, sigma_px }
            });
            seen.collect()
        })
        .collect()
}

pub fn chessboard() -> Board {
    "chessboard:9x6:0.025".parse().expect("a board")
}

pub fn options(lens: Distortion) -> CalibrateOptions {
    CalibrateOptions { lens, ..CalibrateOptions::default() }
}

#[test]
fn without_noise_the_camera_is_exact() {
    for board in ["chessboard:9x6:0.025", "circles:7x5:0.03"] {
        let board: Board = board.parse().expect("a board");
        // Terms of a rational lens cancel each other up to rounding.
        for lens in lenses().into_iter().filter(|lens| !matches!(lens, Distortion::RationalPolynomial(_))) {
            let camera = truth(lens);
            let views = views(&camera, &board, 12, 1e-7, &mut named("exact calibration"));
            let found = calibrate(SIZE, &board, &views, &options(lens)).expect("a camera");
            for step in 0..20 {
                let pixel = Vector2::new(40.0 + 28.0 * f64::from(step), 30.0 + 20.0 * f64::from(step));
                let (a, b) = (camera.unproject(&pixel).expect("a ray"), found.camera.unproject(&pixel).expect("a ray"));
                assert!((a - b).norm() < 2e-6, "{}: {a} {b}", lens.name());
            }
            assert!(found.rms_px < 1e-5, "{}: {}", lens.name(), found.rms_px);
        }
    }
}

/// Sum of squared errors of the parameters in units of their covariance.
pub fn parameter_chi_square(found: &Camera, truth: &Camera) -> f64 {
    let error = super::super::freedom::parameters_of(found) - super::super::freedom::parameters_of(truth);
    let covariance = found.parameter_covariance().expect("measured").matrix();
    let size = 4 + truth.distortion().coefficients().len();
    let scale = covariance.diagonal().map(|v| if v > 0.0 { v.sqrt() } else { 1.0 });
    let unit = nalgebra::DMatrix::from_fn(size, size, |r, c| covariance[(r, c)] / (scale[r] * scale[c]));
    let error = nalgebra::DVector::from_fn(size, |i, _| error[i] / scale[i]);
    error.dot(&unit.cholesky().expect("a covariance").solve(&error))
}

/// Mean of the squared errors of the pixels of rays all over the picture, in units of their covariance, per coordinate.
fn ray_chi_square(found: &Camera, truth: &Camera) -> f64 {
    let covariance = found.parameter_covariance().expect("measured").matrix();
    let (mut sum, mut count) = (0.0, 0.0);
    for x in 0..7 {
        for y in 0..5 {
            let pixel = Vector2::new(90.0 + 75.0 * f64::from(x), 70.0 + 80.0 * f64::from(y));
            let ray = truth.unproject(&pixel).expect("a ray");
            let point = crate::geometry::Point::new(ray.x, ray.y, 1.0);
            let by = found.pixel_by_parameters(&point).expect("in view");
            let error = found.project(&point).expect("in view") - pixel;
            let variance = (by * covariance * by.transpose()).diagonal();
            sum += error.component_mul(&error).component_div(&variance).sum();
            count += 2.0;
        }
    }
    sum / count
}

#[test]
fn parameters_lie_within_their_covariance() {
    let board = chessboard();
    for lens in lenses() {
        let camera = truth(lens);
        let size = (4 + lens.coefficients().len()) as f64;
        let (mut parameters, mut rays, mut noise) = (Vec::new(), 0.0, 0.0);
        let sets = 50;
        for set in 0..sets {
            let mut rng = case("calibration covariance", set);
            let views = views(&camera, &board, 10, 0.2, &mut rng);
            // The pictures say half of what their noise is: it is measured.
            let views: Vec<Vec<SeenPoint>> =
                views.into_iter().map(|v| v.into_iter().map(|s| SeenPoint { sigma_px: 0.1, ..s }).collect()).collect();
            let found = calibrate(SIZE, &board, &views, &options(lens)).expect("a camera");
            parameters.push(parameter_chi_square(&found.camera, &camera) / size);
            rays += ray_chi_square(&found.camera, &camera) / sets as f64;
            noise += found.noise_ratio / sets as f64;
        }
        // One set in fifty of a rational lens leads to where what is below the fraction bar nearly vanishes.
        parameters.sort_by(f64::total_cmp);
        if matches!(lens, Distortion::RationalPolynomial(_)) {
            parameters.pop();
        }
        let parameters = parameters.iter().sum::<f64>() / parameters.len() as f64;
        // Sums of `size` squares: their mean is known to sqrt(2 / (sets size)); four deviations.
        let allowed = 4.0 * (2.0 / (sets as f64 * size)).sqrt();
        assert!((parameters - 1.0).abs() < allowed, "{}: {parameters}", lens.name());
        // Errors of neighbouring rays are alike: as if there were four.
        assert!((rays - 1.0).abs() < 4.0 * (2.0 / (sets as f64 * 4.0)).sqrt(), "{}: {rays}", lens.name());
        assert!((noise - 2.0).abs() < 0.02, "{}: {noise}", lens.name());
    }
}

#[test]
fn a_few_wrong_points_and_a_wrong_picture_do_not_count() {
    let board = chessboard();
    let lens = lenses()[1];
    let camera = truth(lens);
    let mut rng = named("wrong points");
    let mut seen = views(&camera, &board, 10, 0.1, &mut rng);
    // A picture of a camera with another zoom.
    let other = Camera::checked(SIZE, [900.0; 2], [320.0, 240.0], Distortion::None).expect("a camera");
    seen[3] = views(&other, &board, 1, 0.1, &mut rng).remove(0);
    for view in [0, 5] {
        for point in [3, 17, 40] {
            seen[view][point].pixel += Vector2::new(rng.random_range(-9.0..9.0), 4.0);
        }
    }
    let found = calibrate(SIZE, &board, &seen, &options(lens)).expect("a camera");
    assert!(matches!(found.views[3].left_out, Some(LeftOut::DoesNotFit { median_px }) if median_px > 1.0));
    assert!(found.views.iter().filter(|view| view.counts()).count() == 9);
    for view in [0, 5] {
        assert!([3, 17, 40].iter().all(|point| !found.views[view].inliers[*point]));
    }
    let wrong = found.views.iter().filter(|v| v.counts()).flat_map(|v| &v.inliers).filter(|inlier| !**inlier).count();
    assert!(wrong <= 7, "{wrong} points left out");
    assert!((found.camera.focal_lengths()[0] - 530.0).abs() < 4.0 * found.standard_deviations[0]);
}

#[test]
fn a_view_whose_points_leave_its_pose_open_sinks_no_others() {
    let board = chessboard();
    let lens = lenses()[2];
    let camera = truth(lens);
    let mut seen = views(&camera, &board, 8, 0.1, &mut named("eight points on a line"));
    let bundle = Bundle {
        size: SIZE,
        board: &board,
        views: &[],
        lens,
        freedom: Freedom::of(&lens, &Fixed::default(), 1.0),
        loss: Loss::Squares,
        prior: Parameters::zeros(),
        watch: Watch::nobody(),
    };
    let poses = seen.iter().map(|view| minima::best_pose(&bundle, &camera, view).expect("a pose")).collect();
    // Of one view a row is left, as where its other points do not fit.
    seen[4].truncate(8);
    let slices: Vec<&[SeenPoint]> = seen.iter().map(Vec::as_slice).collect();
    let places: Vec<usize> = (0..seen.len()).collect();
    let state = crate::calibrate::start::state_of(&camera, poses);
    let fit = robust::Fit { places: places.clone(), state, scale: 1.0, scale_px: 0.1 };
    let kept = kept::without_what_is_wrong(&Bundle { views: &slices, ..bundle }, fit).expect("views");
    let found = kept.calibration(&seen, &places).expect("a camera of the others");
    let left_out: Vec<Option<LeftOut>> = found.views.iter().map(|view| view.left_out).collect();
    let open = Some(LeftOut::PoseOpen { inliers: 8 });
    assert_eq!(left_out, [None, None, None, None, open, None, None, None]);
}

#[test]
fn views_that_never_had_a_chance_are_told_why() {
    let board = chessboard();
    let lens = lenses()[1];
    let mut seen = views(&truth(lens), &board, 8, 0.1, &mut named("a row and five points"));
    seen[6].truncate(9);
    seen[7].truncate(5);
    let found = calibrate(SIZE, &board, &seen, &options(lens)).expect("a camera of the others");
    let left_out: Vec<Option<LeftOut>> = found.views.iter().map(|view| view.left_out).collect();
    let few = Some(LeftOut::TooFewPoints { points: 5, need: MIN_POINTS });
    assert_eq!(left_out, [None, None, None, None, None, None, Some(LeftOut::NoPose), few]);
}

#[test]
fn points_on_a_line_leave_a_pose_open_and_one_beside_it_does_not() {
    let (board, camera) = (chessboard(), truth(lenses()[2]));
    let mut rng = named("points on a line");
    let pose = pose_in_view(&camera, &board, &mut rng);
    let bundle = Bundle {
        size: SIZE,
        board: &board,
        views: &[],
        lens: *camera.distortion(),
        freedom: Freedom::none(),
        loss: Loss::Squares,
        prior: Parameters::zeros(),
        watch: Watch::nobody(),
    };
    let seen = |points: &[usize]| -> Vec<SeenPoint> {
        let origin = |point| SeenPoint { point, pixel: Vector2::zeros(), sigma_px: 0.1 };
        points.iter().map(|point| origin(*point)).collect()
    };
    // A row, a column, a diagonal; the last with a corner beside it.
    for line in [[0, 1, 2, 3, 4, 5, 6, 7], [4, 13, 22, 31, 40, 49, 4, 13], [0, 10, 20, 30, 40, 50, 0, 10]] {
        assert!(bundle.leaves_pose_open(&camera, &pose, &seen(&line)), "{line:?}");
    }
    assert!(!bundle.leaves_pose_open(&camera, &pose, &seen(&[0, 1, 2, 3, 4, 5, 6, 7, 30])));
}

#[test]
fn what_is_held_stays() {
    let board = chessboard();
    let camera = Camera::checked(SIZE, [530.0; 2], [319.5, 239.5], Distortion::PlumbBob([-0.28, 0.09, 0.0, 0.0, 0.0]))
        .expect("a camera");
    let views = views(&camera, &board, 8, 0.1, &mut named("held"));
    let fixed = Fixed {
        aspect_ratio: true,
        principal_point: true,
        coefficients: [false, false, true, true, true, false, false, false],
    };
    let options = CalibrateOptions { fixed, ..options(*camera.distortion()) };
    let found = calibrate(SIZE, &board, &views, &options).expect("a camera");
    let ([fx, fy], [cx, cy]) = (found.camera.focal_lengths(), found.camera.principal_point());
    assert!((fx - fy).abs() < 1e-9 && (cx - 319.5).abs() < 1e-9 && (cy - 239.5).abs() < 1e-9);
    assert_eq!(found.camera.distortion().coefficients()[2..], [0.0; 3]);
    assert!(found.standard_deviations[2].abs() < 1e-12);
    assert!((found.camera.focal_lengths()[0] - 530.0).abs() < 4.0 * found.standard_deviations[0]);
    // Held to what a camera says that is known.
    let guess = CalibrateOptions { guess: Some(found.camera), ..options };
    let again = calibrate(SIZE, &board, &views, &guess).expect("a camera");
    assert!((again.camera.focal_lengths()[0] - found.camera.focal_lengths()[0]).abs() < 1e-3);
}

#[test]
fn a_coefficient_that_is_held_is_zero_though_the_views_say_otherwise() {
    let board = chessboard();
    let camera = Camera::checked(SIZE, [530.0; 2], [319.5, 239.5], Distortion::PlumbBob([-0.28, 0.09, 0.0, 0.0, 0.0]))
        .expect("a camera");
    let views = views(&camera, &board, 8, 0.1, &mut named("held at zero"));
    for coefficients in [[true; 8], [true, false, false, false, false, false, false, false]] {
        let fixed = Fixed { coefficients, ..Fixed::default() };
        let options = CalibrateOptions { fixed, ..options(*camera.distortion()) };
        let found = calibrate(SIZE, &board, &views, &options).expect("a camera");
        let held = found.camera.distortion().coefficients().iter().zip(coefficients).filter(|(_, held)| *held);
        assert!(held.into_iter().all(|(k, _)| *k == 0.0), "{:?}", found.camera);
        assert!(found.standard_deviations[4].abs() < 1e-12);
    }
}

#[test]
fn a_view_of_what_stands_still_does_not_count_twice() {
    let board = chessboard();
    let lens = Distortion::PlumbBob([-0.28, 0.09, 0.0, 0.0, 0.0]);
    let mut seen = views(&truth(lens), &board, 5, 0.1, &mut named("still"));
    let alone = calibrate(SIZE, &board, &seen, &options(lens)).expect("a camera");
    let shifted = |view: &[SeenPoint], by: f64| -> Vec<SeenPoint> {
        view.iter().map(|s| SeenPoint { pixel: s.pixel + Vector2::new(by, 0.0), ..*s }).collect()
    };
    seen.push(seen[1].clone());
    seen.push(shifted(&seen[2], 0.2));
    let found = calibrate(SIZE, &board, &seen, &options(lens)).expect("a camera");
    assert_eq!(found.camera, alone.camera);
    for view in &found.views[5..] {
        assert_eq!(view.left_out, Some(LeftOut::Repeated));
    }
    // Half of another view of the same board has moved.
    seen.truncate(5);
    seen.push(shifted(&seen[3], 3.0));
    let found = calibrate(SIZE, &board, &seen, &options(lens)).expect("a camera");
    assert!(found.views[5].counts());
}

#[test]
fn what_is_within_the_deviation_that_its_picture_told_is_not_wrong() {
    let board = chessboard();
    let lens = Distortion::None;
    let mut seen = views(&truth(lens), &board, 8, 0.01, &mut named("cautious deviations"));
    for point in seen.iter_mut().flatten() {
        point.sigma_px = 0.1;
    }
    // One view is worse than the others, but not than it says.
    for (index, point) in seen[3].iter_mut().enumerate() {
        point.pixel.x += if index % 2 == 0 { 0.1 } else { -0.1 };
    }
    let found = calibrate(SIZE, &board, &seen, &options(lens)).expect("a camera");
    assert!(found.views.iter().all(FittedView::counts));
    assert_eq!(found.views[3].inliers.iter().filter(|counts| **counts).count(), seen[3].len());
}

#[test]
fn a_view_of_which_much_does_not_fit_does_not_count() {
    let board = chessboard();
    let lens = Distortion::None;
    let mut seen = views(&truth(lens), &board, 8, 0.1, &mut named("half a view"));
    let wrong = seen[2].len() * 2 / 5;
    for point in &mut seen[2][..wrong] {
        point.pixel.y += 5.0;
    }
    let found = calibrate(SIZE, &board, &seen, &options(lens)).expect("a camera");
    assert!(!found.views[2].counts(), "{:?}", found.views[2]);
    assert_eq!(found.views.iter().filter(|view| view.counts()).count(), 7);
}

#[test]
fn too_little_is_refused() {
    let board = chessboard();
    let camera = truth(Distortion::None);
    let mut seen = views(&camera, &board, 2, 0.1, &mut named("little"));
    let refused = calibrate(SIZE, &board, &seen[..1], &options(Distortion::None)).expect_err("one view");
    assert_eq!(refused, CalibrateError::TooFewViews { found: 1, need: 2, min_points: MIN_POINTS });
    seen[1].truncate(5);
    let refused = calibrate(SIZE, &board, &seen, &options(Distortion::None)).expect_err("five points");
    assert!(matches!(refused, CalibrateError::TooFewViews { found: 1, .. }));
}
