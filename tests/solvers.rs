//! Solvers where others are known to fail: planes whichever way their normal points, seen exactly face on, far from the
//! origin of their own space, in units of any size; points that fix nothing.

#![allow(clippy::expect_used, clippy::panic, reason = "a test says what it takes for granted")]

use nalgebra::{Rotation3, Vector2, Vector3};
use rand::{Rng, RngExt};
use skypose::geometry::{CameraFromTarget, Point, rotation};
use skypose::random;
use skypose::scene::cases;
use skypose::solve::{Pair, SolveError, Solver, squared_ray_error};

/// Those that take a plane.
const FOR_PLANES: [Solver; 5] = [Solver::Homography, Solver::Epnp, Solver::Ippe, Solver::P3p, Solver::Sqpnp];

fn seen(points: &[Vector3<f64>], truth: &CameraFromTarget) -> Vec<Pair> {
    let pair = |p: &Vector3<f64>| {
        let in_camera = (*truth * Point::from(*p)).coords;
        Pair { point: Point::from(*p), ray: Vector2::new(in_camera.x, in_camera.y) / in_camera.z }
    };
    points.iter().map(pair).collect()
}

/// Smallest distance of a solution from the truth, rotation in rad, translation as a share of the range.
fn nearest(solver: Solver, pairs: &[Pair], truth: &CameraFromTarget) -> f64 {
    let found = solver.solve(pairs).unwrap_or_else(|error| panic!("{}: {error}", solver.name()));
    let error = |pose: &CameraFromTarget| {
        assert!(pose.is_finite(), "{}: {pose:?}", solver.name());
        let turn = rotation::angle_between_rad(&pose.rotation, &truth.rotation);
        turn.max((pose.translation - truth.translation).norm() / truth.translation.norm())
    };
    found.iter().map(error).fold(f64::INFINITY, f64::min)
}

fn flat(rng: &mut impl Rng, count: usize) -> Vec<Vector3<f64>> {
    (0..count).map(|_| Vector3::new(rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5), 0.0)).collect()
}

/// Six places on a plane that no accident of the draw makes nearly a line.
fn six(rng: &mut impl Rng) -> Vec<Vector3<f64>> {
    let corners = [[-0.4, -0.3], [0.35, -0.4], [0.4, 0.3], [-0.3, 0.4], [0.1, 0.0], [-0.1, 0.2]];
    let mut near = || rng.random_range(-0.08..0.08);
    corners.map(|[x, y]| Vector3::new(x + near(), y + near(), 0.0)).to_vec()
}

#[test]
fn a_planes_normal_may_point_anywhere_and_its_origin_lie_elsewhere() {
    // Where the normal decided the sign: rosys pull request 479.
    for index in 0..2000 {
        let rng = &mut random::case("any plane", index);
        let board_from_flat = cases::any_rotation(rng);
        let shift = Vector3::from_fn(|_, _| rng.random_range(-3.0..3.0));
        let points: Vec<_> = six(rng).into_iter().map(|p| board_from_flat * p + shift).collect();
        let tilt = rotation::exp(&Vector3::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0), 0.3));
        let centre = Vector3::new(0.3, -0.2, rng.random_range(1.5..8.0));
        let turn: Rotation3<f64> = tilt * board_from_flat.inverse();
        let truth = CameraFromTarget::new(turn, centre - turn * shift);
        for solver in FOR_PLANES {
            let error = nearest(solver, &seen(&points, &truth), &truth);
            assert!(error < 1e-6, "{index} {}: {error:.1e}", solver.name());
        }
    }
}

#[test]
fn a_plane_seen_exactly_face_on_has_a_pose() {
    // OpenCV's IPPE answers NaN and success (issue 8813 and others).
    let square = [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]].map(|[x, y]| Vector3::new(x, y, 0.0));
    let turns = [Vector3::zeros(), Vector3::z() * 0.7, Vector3::x() * std::f64::consts::PI];
    for (turn, place) in turns.into_iter().flat_map(|turn| [[0.0, 0.0], [0.4, -0.3]].map(|place| (turn, place))) {
        // Face on to the ray through its middle, not only to the axis.
        let middle = Vector3::new(place[0], place[1], 1.0);
        let towards = Rotation3::rotation_between(&Vector3::z(), &middle).expect("below a right angle");
        let truth = CameraFromTarget::new(towards * rotation::exp(&turn), middle * 2.0);
        for solver in [Solver::Homography, Solver::Epnp, Solver::Ippe, Solver::Sqpnp] {
            let error = nearest(solver, &seen(&square, &truth), &truth);
            // Both solutions meet there, so the attitude is good to the root of the rounding.
            assert!(error < 1e-6, "{} at {place:?} turned {turn:?}: {error:.1e}", solver.name());
        }
    }
}

#[test]
fn the_size_of_the_target_does_not_matter() {
    // Micrometres to kilometres; thresholds that are lengths fail here (opencv issue 25094, kornia-rs issue 1087).
    for (index, scale) in (0_u64..).zip([1e-6, 1e-3, 1.0, 1e3]) {
        let rng = &mut random::case("scales", index);
        let points: Vec<_> = six(rng).into_iter().map(|p| p * scale).collect();
        let truth =
            CameraFromTarget::new(rotation::exp(&Vector3::new(0.5, -0.4, 0.2)), Vector3::new(0.2, 0.1, 2.0) * scale);
        for solver in FOR_PLANES {
            let error = nearest(solver, &seen(&points, &truth), &truth);
            assert!(error < 1e-6, "{} at {scale:.0e} m: {error:.1e}", solver.name());
        }
    }
}

#[test]
fn both_poses_of_ippe_explain_a_distant_plane_and_differ() {
    for index in 0..500 {
        let rng = &mut random::case("two poses", index);
        let points = six(rng);
        let tilt = rotation::exp(&(Vector3::new(0.6, 0.8, 0.0) * rng.random_range(0.4..1.1)));
        let truth = CameraFromTarget::new(tilt, Vector3::new(0.0, 0.0, 80.0));
        let pairs = seen(&points, &truth);
        let found = Solver::Ippe.solve(&pairs).expect("a plane");
        assert_eq!(found.len(), 2, "{index}");
        let apart = rotation::angle_between_rad(&found[0].rotation, &found[1].rotation);
        assert!(apart > 0.5, "{index}: {apart}");
        // At a hundred times its size perspective is a hundredth of the image of 0.01: 1e-4, and second order in the slope.
        for pose in &found {
            assert!((squared_ray_error(&pairs, pose) / 6.0).sqrt() < 1e-4, "{index}");
        }
    }
}

#[test]
fn sqpnp_finds_the_least_error_that_a_dense_search_finds() {
    for index in 0..40 {
        let case = cases::visible_box(&mut random::case("least error", index), 8, 1.0);
        let ray = |pixel| case.camera.unproject(pixel).expect("no lens");
        let pairs: Vec<Pair> = case
            .points
            .iter()
            .zip(&case.pixels)
            .map(|(point, pixel)| Pair { point: *point, ray: ray(pixel) })
            .collect();
        let found = Solver::Sqpnp.solve(&pairs).expect("points in view");
        let least = object_space_error(&pairs, &found[0].rotation);
        let rng = &mut random::case("dense attitudes", index);
        for _ in 0..20_000 {
            let turn = cases::any_rotation(rng);
            let error = object_space_error(&pairs, &turn);
            let is_in_front = pairs.iter().all(|pair| depth_of_best(&pairs, &turn, pair) > 0.0);
            assert!(error > least * (1.0 - 1e-9) || !is_in_front, "{index}: {error:.3e} below {least:.3e}");
        }
    }
}

/// The error that SQPnP minimises: distances of the points from their rays across the axis, weighed by depth, the best
/// translation put in by plain least squares.
fn object_space_error(pairs: &[Pair], turn: &Rotation3<f64>) -> f64 {
    let translation = skypose::solve::ippe::best_translation(pairs, turn).expect("rays that differ");
    let error = |pair: &Pair| {
        let p = turn * pair.point.coords + translation;
        (p.xy() - pair.ray * p.z).norm_squared()
    };
    pairs.iter().map(error).sum()
}

fn depth_of_best(pairs: &[Pair], turn: &Rotation3<f64>, pair: &Pair) -> f64 {
    let translation = skypose::solve::ippe::best_translation(pairs, turn).expect("rays that differ");
    (turn * pair.point.coords + translation).z
}

#[test]
fn what_fixes_no_pose_is_told_as_such() {
    let rng = &mut random::named("no pose");
    let truth = CameraFromTarget::new(rotation::exp(&Vector3::new(0.3, 0.2, 0.1)), Vector3::new(0.0, 0.0, 3.0));
    let line: Vec<_> = (0..6).map(|i| Vector3::new(0.1 * f64::from(i), 0.05 * f64::from(i), 0.0)).collect();
    let three = &flat(rng, 3)[..];
    let one_place = vec![Vector3::new(0.1, 0.2, 0.3); 5];
    for solver in Solver::ALL {
        let refused = |points: &[Vector3<f64>]| solver.solve(&seen(points, &truth)).expect_err("no pose");
        assert!(matches!(refused(&line), SolveError::Collinear { .. }), "{}", solver.name());
        assert!(matches!(refused(&one_place), SolveError::Collinear { .. }), "{}", solver.name());
        if solver.min_points() > 3 {
            assert!(matches!(refused(three), SolveError::TooFewPoints { given: 3, .. }), "{}", solver.name());
        }
        // All rays the same, although the points are not: nothing is finite there, and nothing may come out.
        let mut same = seen(&six(rng), &truth);
        let ray = same[0].ray;
        for pair in &mut same {
            pair.ray = ray;
        }
        if let Ok(found) = solver.solve(&same) {
            assert!(found.iter().all(CameraFromTarget::is_finite), "{}: {found:?}", solver.name());
        }
    }
}

#[test]
fn a_target_behind_the_camera_has_no_pose() {
    // Rays reach both ways; the points at negative depths have the same ones.
    let rng = &mut random::named("behind");
    let behind = CameraFromTarget::new(rotation::exp(&Vector3::new(0.4, -0.3, 0.2)), Vector3::new(0.3, 0.2, -3.0));
    let points: Vec<_> = (0..8).map(|_| Vector3::from_fn(|_, _| rng.random_range(-0.5..0.5))).collect();
    let pairs = seen(&points, &behind);
    for solver in Solver::ALL {
        let Ok(found) = solver.solve(&pairs) else { continue };
        for pose in &found {
            let rms = (squared_ray_error(&pairs, pose) / 8.0).sqrt();
            // Points in front can only mimic them badly.
            assert!(rms > 1e-3, "{}: {pose:?}", solver.name());
        }
    }
}
