//! Against truth, and against a search along the first depth.

use nalgebra::Vector3;
use rand::{Rng, RngExt};

use super::p3p;
use crate::geometry::{CameraFromTarget, Point, rotation, space};
use crate::random;

struct Scene {
    bearings: [Vector3<f64>; 3],
    points: [Point<space::Target>; 3],
    truth: CameraFromTarget,
}

fn within(rng: &mut impl Rng, reach: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-reach..reach))
}

fn scene(rng: &mut impl Rng) -> Scene {
    loop {
        let points: [Point<space::Target>; 3] = std::array::from_fn(|_| Point::from(within(rng, 0.5)));
        let turn = rotation::exp(&within(rng, 3.0));
        let range = rng.random_range(0.6..15.0);
        let truth = CameraFromTarget::new(turn, Vector3::new(0.4 * range, -0.2 * range, range));
        let seen = points.map(|p| (truth * p).coords);
        let [a, b, c] = points.map(|p| p.coords);
        let sine = (b - a).normalize().cross(&(c - a).normalize()).norm();
        if seen.iter().all(|p| p.z > 0.05) && sine > 0.1 {
            return Scene { bearings: seen.map(|p| p.normalize()), points, truth };
        }
    }
}

#[test]
fn the_truth_is_among_the_solutions_and_every_solution_explains_the_bearings() {
    let mut missed = 0;
    for index in 0..20_000 {
        let scene = scene(&mut random::case("three points", index));
        let solutions = p3p(&scene.bearings, &scene.points);
        let off = |pose: &CameraFromTarget| pose.difference_to(&scene.truth).norm();
        if solutions.iter().map(off).fold(f64::INFINITY, f64::min) > 1e-6 {
            missed += 1;
        }
        for pose in &solutions {
            for (bearing, point) in scene.bearings.iter().zip(scene.points) {
                let error = (*pose * point).coords.normalize() - bearing;
                assert!(error.norm() < 1e-9, "{index}: {:.1e}", error.norm());
            }
        }
    }
    // Two solutions that meet are found to the root of the rounding only: some 1e-8, and rarely worse than the tolerance.
    assert!(missed <= 4, "{missed} of 20000");
}

/// The number of solutions by brute force: for each first depth the second and third follow up to a sign each, and the
/// third side changes sides where they are right.
fn counted(scene: &Scene) -> Option<usize> {
    const STEPS: u32 = 40_000;
    let [y1, y2, y3] = scene.bearings;
    let [x1, x2, x3] = scene.points.map(|p| p.coords);
    let (s12, s13, s23) = ((x1 - x2).norm_squared(), (x1 - x3).norm_squared(), (x2 - x3).norm_squared());
    let (c12, c13, c23) = (y1.dot(&y2), y1.dot(&y3), y2.dot(&y3));
    let farthest = (s12 / (1.0 - c12 * c12)).sqrt().min((s13 / (1.0 - c13 * c13)).sqrt());
    let other = |first: f64, cosine: f64, square: f64, sign: f64| {
        let inside = square - first * first * (1.0 - cosine * cosine);
        (inside >= 0.0).then(|| cosine * first + sign * inside.sqrt()).filter(|d| *d > 0.0)
    };
    let mut count = 0;
    for (second, third) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        let lack = |step: u32| {
            // Finer towards the far end, where the square roots are steep.
            let part = f64::from(step) / f64::from(STEPS);
            let first = farthest * (1.0 - (1.0 - part) * (1.0 - part));
            let (d2, d3) = (other(first, c12, s12, second)?, other(first, c13, s13, third)?);
            Some(d2 * d2 + d3 * d3 - 2.0 * c23 * d2 * d3 - s23)
        };
        let mut before = lack(1);
        for step in 2..STEPS {
            let now = lack(step);
            if let (Some(a), Some(b)) = (before, now) {
                if a * b < 0.0 {
                    count += 1;
                }
                // Too near to zero without crossing it to be counted by this.
                let flat = (a.abs() + b.abs()) < 1e-4 * s23 && a * b > 0.0 && (a - b).abs() < 1e-9 * s23;
                if flat {
                    return None;
                }
            }
            before = now;
        }
    }
    Some(count)
}

#[test]
fn all_solutions_are_found_and_no_others() {
    let mut compared = 0;
    let mut different = 0;
    for index in 0..400 {
        let scene = scene(&mut random::case("three points counted", index));
        let Some(expected) = counted(&scene) else { continue };
        compared += 1;
        different += usize::from(p3p(&scene.bearings, &scene.points).len() != expected);
    }
    assert!(compared > 300, "{compared}");
    // The search itself misses pairs of roots between its steps, and roots at the ends of its branches.
    assert!(different <= compared / 50, "{different} of {compared}");
}

#[test]
fn points_that_fix_no_pose_give_none() {
    let scene = scene(&mut random::named("degenerate"));
    let [a, b, _] = scene.points;
    let between = Point::from(a.coords.lerp(&b.coords, 0.3));
    assert!(p3p(&scene.bearings, &[a, b, between]).is_empty(), "collinear");
    assert!(p3p(&scene.bearings, &[a, b, b]).is_empty(), "two in one place");
    assert!(p3p(&scene.bearings, &[a, a, a]).is_empty(), "all in one place");
    let [y1, y2, _] = scene.bearings;
    for pose in p3p(&[y1, y2, y2], &scene.points) {
        assert!(pose.is_finite());
    }
    let lost = Vector3::repeat(f64::NAN);
    assert!(p3p(&[y1, y2, lost], &scene.points).is_empty());
}

#[test]
fn a_triangle_seen_face_on_is_found() {
    // All three depths equal: the symmetric case in which conics of the pencil touch.
    let corner = |angle: f64| Point::new(0.3 * angle.cos(), 0.3 * angle.sin(), 0.0);
    let third = std::f64::consts::TAU / 3.0;
    let points = [corner(0.1), corner(0.1 + third), corner(0.1 + 2.0 * third)];
    let truth = CameraFromTarget::new(rotation::exp(&Vector3::zeros()), Vector3::new(0.0, 0.0, 2.0));
    let bearings = points.map(|p| (truth * p).coords.normalize());
    let solutions = p3p(&bearings, &points);
    let nearest = solutions.iter().map(|pose| pose.difference_to(&truth).norm()).fold(f64::INFINITY, f64::min);
    assert!(nearest < 1e-6, "{nearest:.1e} in {}", solutions.len());
}
