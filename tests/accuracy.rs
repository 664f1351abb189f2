//! Poses against truth: exact without noise, inside their own covariance with it, probabilities that hold.
//!
//! Every scene has a name for a seed, so a failure can be looked at again: `random::case(NAME, index)`.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test says what it takes for granted, and shows its figures"
)]

use std::f64::consts::FRAC_PI_2;

use rand::RngExt;
use skypose::camera::{Camera, Distortion};
use skypose::geometry::{CameraFromTarget, rotation::angle_between_rad};
use skypose::pose::{
    NoPose, Noise, PoseAnswer, PoseEstimate, PoseOptions, PosePrior, estimate_pose, estimate_pose_robustly,
};
use skypose::random;
use skypose::refine::{Correspondence, RefineOptions, Refined, Stop, refine};
use skypose::scene::cases::{self, Case};
use skypose::solve::{Pair, Solver, squared_ray_error};

/// 95 % of chi-square with six degrees of freedom.
const CHI_SQUARE_6_95: f64 = 12.592;

/// Attitudes further apart than this are different minima, not errors.
const FLIP_RAD: f64 = 20.0 * std::f64::consts::PI / 180.0;

fn pairs(case: &Case) -> Vec<Pair> {
    let ray = |pixel| case.camera.unproject(pixel).expect("no lens");
    case.points.iter().zip(&case.pixels).map(|(point, pixel)| Pair { point: *point, ray: ray(pixel) }).collect()
}

fn correspondences(case: &Case, sigma_px: f64) -> Vec<Correspondence> {
    let pair = |(point, pixel): (&_, &_)| Correspondence { point: *point, pixel: *pixel, sigma_px };
    case.points.iter().zip(&case.pixels).map(pair).collect()
}

/// Radians or metres, whichever is worse.
fn error(found: &CameraFromTarget, case: &Case) -> f64 {
    let truth = &case.camera_from_target;
    angle_between_rad(&found.rotation, &truth.rotation).max((found.translation - truth.translation).norm())
}

fn nees(estimate: &PoseEstimate, case: &Case) -> f64 {
    estimate.covariance.normalized_error_squared(&estimate.camera_from_target, &case.camera_from_target)
}

fn is_flip(estimate: &PoseEstimate, case: &Case) -> bool {
    angle_between_rad(&estimate.camera_from_target.rotation, &case.camera_from_target.rotation) > FLIP_RAD
}

fn all(answer: &PoseAnswer) -> impl Iterator<Item = &PoseEstimate> {
    std::iter::once(&answer.best).chain(&answer.alternatives)
}

/// The one of the answer's minima that is meant by the truth.
fn nearest<'a>(answer: &'a PoseAnswer, case: &Case) -> &'a PoseEstimate {
    let angle = |e: &PoseEstimate| angle_between_rad(&e.camera_from_target.rotation, &case.camera_from_target.rotation);
    all(answer).min_by(|a, b| angle(a).total_cmp(&angle(b))).expect("at least the best")
}

#[test]
fn without_noise_the_closed_forms_are_exact_in_every_case_of_the_seed() {
    for index in 0..10_000 {
        let case = cases::thesis_2012(&mut random::case("thesis exact", index), 0.0);
        for solver in [Solver::Homography, Solver::Epnp, Solver::Ippe, Solver::P3p, Solver::Sqpnp] {
            let found = solver.solve(&pairs(&case)).unwrap_or_else(|e| panic!("{index} {}: {e}", solver.name()));
            let best = found.iter().map(|pose| error(pose, &case)).fold(f64::INFINITY, f64::min);
            assert!(best < 1e-6, "{index} {}: {best:.1e}", solver.name());
        }
    }
}

#[test]
fn posit_is_exact_wherever_it_settles_on_its_image() {
    let (mut exact, mut elsewhere, mut restless) = (0, 0, 0);
    for index in 0..1000 {
        let case = cases::thesis_2012(&mut random::case("thesis exact", index), 0.0);
        let pairs = pairs(&case);
        match Solver::Posit.solve(&pairs) {
            Ok(found) if squared_ray_error(&pairs, &found[0]) < 1e-18 => {
                assert!(error(&found[0], &case) < 1e-6, "{index}: {:.1e}", error(&found[0], &case));
                exact += 1;
            }
            Ok(_) => elsewhere += 1,
            Err(_) => restless += 1,
        }
    }
    // The seed's poses, up to 10 m to the side and with the target across the camera's plane, are far outside the small
    // angles that the iteration is made for; in front of the camera it settles in nine of ten cases.
    println!(
        "POSIT on the seed's cases: exact {exact}, settled on the other branch {elsewhere}, not settled {restless}"
    );
    assert!((200..500).contains(&exact), "the share of {exact} in 1000 is stated in the README");

    let mut settled = 0;
    for index in 0..300 {
        let case = cases::visible_box(&mut random::case("posit in space", index), 8, 0.0);
        if let Ok(found) = Solver::Posit.solve(&pairs(&case))
            && squared_ray_error(&pairs(&case), &found[0]) < 1e-18
        {
            assert!(error(&found[0], &case) < 1e-6, "{index}");
            settled += 1;
        }
    }
    assert!(settled > 290, "{settled} of 300");
}

#[test]
fn epnp_and_p3p_are_exact_in_space_from_four_points_on() {
    for index in 0..400 {
        for count in [4, 5, 6, 20, 60] {
            let case = cases::visible_box(&mut random::case("space exact", index), count, 0.0);
            for solver in [Solver::Epnp, Solver::P3p, Solver::Sqpnp] {
                let found = solver.solve(&pairs(&case)).unwrap_or_else(|e| panic!("{index} {}: {e}", solver.name()));
                assert!(
                    error(&found[0], &case) < 1e-6,
                    "{index} {} with {count}: {:.1e}",
                    solver.name(),
                    error(&found[0], &case)
                );
            }
        }
    }
}

/// What happened over many scenes with noise.
#[derive(Debug, Default)]
struct Tally {
    answered: u32,
    flips: u32,
    truth_among_all: u32,
    /// The pose that the truth is meant by, whether it is the first or an alternative, lies within its 95 % ellipsoid.
    inside: u32,
    reliable: u32,
    reliable_inside: u32,
    reliable_nees: f64,
}

fn tally(name: &str, count: u32, noise_px: f64, draw: impl Fn(&mut rand_chacha::ChaCha8Rng) -> Case) -> Tally {
    let mut tally = Tally::default();
    for index in 0..u64::from(count) {
        let case = draw(&mut random::case(name, index));
        let Ok(answer) = estimate_pose(&case.camera, &correspondences(&case, noise_px), &PoseOptions::default()) else {
            continue;
        };
        tally.answered += 1;
        tally.truth_among_all += u32::from(all(&answer).any(|e| !is_flip(e, &case)));
        tally.flips += u32::from(is_flip(&answer.best, &case));
        let meant = nearest(&answer, &case);
        let nees = nees(meant, &case);
        tally.inside += u32::from(nees < CHI_SQUARE_6_95);
        if meant.covariance_reliable {
            tally.reliable += 1;
            tally.reliable_inside += u32::from(nees < CHI_SQUARE_6_95);
            tally.reliable_nees += nees;
        }
    }
    println!("{name}: {tally:?}");
    tally
}

/// The mean of `count` chi-square variables of six degrees of freedom has a standard deviation of sqrt(12 / count); the share
/// below the 95 % quantile one of sqrt(0.95 * 0.05 / count). Four of each.
fn assert_consistent(tally: &Tally) {
    let count = f64::from(tally.reliable);
    let mean = tally.reliable_nees / count;
    let share = f64::from(tally.reliable_inside) / count;
    assert!((mean - 6.0).abs() < 4.0 * (12.0 / count).sqrt(), "mean NEES {mean:.2} of {count}");
    assert!((share - 0.95).abs() < 4.0 * (0.95 * 0.05 / count).sqrt(), "{share:.3} of {count} inside 95 %");
}

#[test]
fn with_a_pixel_of_noise_auto_lies_within_its_own_covariance_on_the_seeds_cases() {
    let tally = tally("thesis with noise", 1000, 1.0, |rng| cases::thesis_2012(rng, 1.0));
    assert_consistent(&tally);
    assert_eq!(tally.answered, 1000);
    assert!(tally.reliable > 600, "the linear approximation holds in most cases");
    assert!(f64::from(tally.inside) > 0.93 * 1000.0, "and the moments of the valley in the others: {}", tally.inside);
    // What no method can tell from one frame: about 17 % of these attitudes are mirrored (issue of the geometry, not ours).
    assert!(tally.flips < 230, "{} flips", tally.flips);
    assert!(tally.truth_among_all >= 990, "{} with the truth among the answers", tally.truth_among_all);
}

#[test]
fn targets_in_view_lie_within_their_covariance_flat_or_not() {
    let flat = tally("flat in view", 1000, 0.2, |rng| cases::visible_plane(rng, 6, 0.2));
    assert_consistent(&flat);
    assert!(flat.truth_among_all >= 990);
    assert!(flat.inside > 925, "{} inside, reliable or not", flat.inside);
    let deep = tally("deep in view", 1000, 1.0, |rng| cases::visible_box(rng, 8, 1.0));
    assert_consistent(&deep);
    assert!(deep.flips <= 10, "{} flips", deep.flips);
}

#[test]
fn probabilities_hold_over_many_cases() {
    probabilities_hold("probabilities", |rng| (cases::thesis_2012(rng, 1.0), 1.0));
    probabilities_hold("probabilities in view", |rng| {
        let noise_px = 0.1 * 20.0_f64.powf(rng.random_range(0.0..1.0));
        (cases::visible_plane(rng, 6, noise_px), noise_px)
    });
}

/// Poses given a probability of p are right in a share p of 20,000 cases, bin by bin, within two hundredths, and within
/// one on average.
fn probabilities_hold(name: &str, draw: impl Fn(&mut rand_chacha::ChaCha8Rng) -> (Case, f64)) {
    let mut bins = [(0_u32, 0_u32, 0.0_f64); 10];
    let (mut answered, mut squared) = (0.0, 0.0);
    for index in 0..20_000 {
        let (case, noise_px) = draw(&mut random::case(name, index));
        let Ok(answer) = estimate_pose(&case.camera, &correspondences(&case, noise_px), &PoseOptions::default()) else {
            continue;
        };
        let nearest = nearest(&answer, &case);
        answered += 1.0;
        squared +=
            (answer.best.probability - f64::from(u8::from(std::ptr::eq(&raw const answer.best, nearest)))).powi(2);
        for estimate in all(&answer) {
            #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "a share of ten")]
            let bin = &mut bins[((estimate.probability * 10.0) as usize).min(9)];
            bin.0 += 1;
            bin.1 += u32::from(std::ptr::eq(estimate, nearest));
            bin.2 += estimate.probability;
        }
    }
    let (mut off, mut given) = (0.0, 0.0);
    for (count, right, sum) in bins.into_iter().filter(|bin| bin.0 >= 1000) {
        let (observed, stated) = (f64::from(right) / f64::from(count), sum / f64::from(count));
        println!("{name}: stated {stated:.3}, observed {observed:.3} of {count}");
        off += (f64::from(right) - sum).abs();
        given += f64::from(count);
        assert!((observed - stated).abs() < 0.02, "{name}: stated {stated:.3}, observed {observed:.3} of {count}");
    }
    println!("{name}: off by {:.4} on average, Brier score {:.4}", off / given, squared / answered);
    assert!(off / given < 0.01, "{name}: off by {:.4} on average", off / given);
}

#[test]
fn both_minima_of_a_plane_are_found_wherever_a_dense_search_finds_them() {
    let draw = |index: u64| {
        let rng = &mut random::case("dense", index);
        match index % 3 {
            0 => (cases::thesis_2012(rng, 1.0), 1.0),
            1 => (cases::visible_plane(rng, 6, 0.5), 0.5),
            _ => (cases::visible_plane(rng, 5, 1.0), 1.0),
        }
    };
    let mut two = 0;
    for index in 0..450 {
        let (case, noise_px) = draw(index);
        let seen = correspondences(&case, noise_px);
        let answer = estimate_pose(&case.camera, &seen, &PoseOptions::default()).expect("a pose");
        let found: Vec<&PoseEstimate> = all(&answer).collect();
        for minimum in dense_minima(&case.camera, &seen, &case) {
            let known = found
                .iter()
                .any(|e| e.camera_from_target.difference_to(&minimum).norm() < 1e-3 * minimum.translation.norm());
            assert!(known, "{index}: a minimum at {minimum:?} is missing");
        }
        two += u32::from(found.len() == 2);
    }
    assert!(two > 200, "{two} of 450 are ambiguous enough to matter");
}

/// Minima from starts all over the sphere of attitudes, as far as they are worth an answer.
fn dense_minima(camera: &Camera, seen: &[Correspondence], case: &Case) -> Vec<CameraFromTarget> {
    let mut found: Vec<Refined> = Vec::new();
    let mut rng = random::named("dense starts");
    for _ in 0..60 {
        let turn = cases::any_rotation(&mut rng);
        let start = CameraFromTarget::new(turn, case.camera_from_target.translation);
        let Ok(refined) = refine(camera, seen, &start, &RefineOptions::default()) else { continue };
        let pose = &refined.camera_from_target;
        let behind = case.points.iter().any(|p| (*pose * *p).coords.z <= 0.0);
        if behind || matches!(refined.stats.stop, Stop::MaxIterations { .. }) {
            continue;
        }
        let far =
            |known: &Refined| known.camera_from_target.difference_to(pose).norm() > 1e-4 * pose.translation.norm();
        if found.iter().all(far) {
            found.push(refined);
        }
    }
    // As probable as one in five hundred, by the curvature alone.
    let ln_weight = |m: &Refined| -0.5 * m.chi_square + 0.5 * m.covariance.ln_determinant();
    let most = found.iter().map(ln_weight).fold(f64::NEG_INFINITY, f64::max);
    found.into_iter().filter(|m| ln_weight(m) - most > 0.002_f64.ln()).map(|m| m.camera_from_target).collect()
}

#[test]
fn a_method_alone_lies_within_the_covariance_of_its_own_arithmetic() {
    for solver in [Solver::Epnp, Solver::P3p, Solver::Sqpnp] {
        let options = PoseOptions { solver: Some(solver), refine: false, ..PoseOptions::default() };
        let (mut inside, mut count) = (0, 0);
        for index in 0..300 {
            let case = cases::visible_box(&mut random::case("alone", index), 8, 0.5);
            let Ok(answer) = estimate_pose(&case.camera, &correspondences(&case, 0.5), &options) else { continue };
            if !is_flip(&answer.best, &case) {
                count += 1;
                inside += u32::from(nees(&answer.best, &case) < CHI_SQUARE_6_95);
            }
        }
        let share = f64::from(inside) / f64::from(count);
        println!("{}: {share:.3} of {count}", solver.name());
        // The covariance is that of 64 trials, so its ellipsoid is wider by chance than the exact one.
        assert!(count > 270 && share > 0.92, "{}: {share:.3} of {count}", solver.name());
    }
}

#[test]
fn half_of_thirty_pairs_may_be_wrong() {
    let (mut good, count) = (0, 200);
    for index in 0..count {
        let mut rng = random::case("outliers", index);
        let mut case = cases::visible_box(&mut rng, 30, 0.5);
        for pixel in &mut case.pixels[..15] {
            *pixel = nalgebra::Vector2::new(rng.random_range(0.0..640.0), rng.random_range(0.0..480.0));
        }
        let seen = correspondences(&case, 0.5);
        let (answer, inliers) =
            estimate_pose_robustly(&case.camera, &seen, &PoseOptions::default()).expect("a consensus");
        let missed = inliers[15..].iter().filter(|inlier| !**inlier).count();
        good += u32::from(nees(&answer.best, &case) < 22.46 && missed <= 2);
    }
    // 22.46 is the 99.9 % quantile; an outlier that lands on its place by chance is no error.
    assert!(good >= 194, "{good} of {count}");
}

#[test]
fn pairs_that_are_all_wrong_have_no_consensus() {
    for index in 0..100 {
        let mut rng = random::case("no consensus", index);
        let mut case = cases::visible_box(&mut rng, 20, 0.5);
        for pixel in &mut case.pixels {
            *pixel = nalgebra::Vector2::new(rng.random_range(0.0..640.0), rng.random_range(0.0..480.0));
        }
        let answer = estimate_pose_robustly(&case.camera, &correspondences(&case, 0.5), &PoseOptions::default());
        assert!(answer.is_err(), "{index}: {answer:?}");
    }
}

#[test]
fn a_prior_of_half_the_attitudes_halves_the_flips() {
    let prior = PosePrior { euler_limits_rad: [Some([-FRAC_PI_2, FRAC_PI_2]); 3], ..PosePrior::default() };
    let (mut before, mut after, mut answered, mut refused) = (0, 0, 0, 0);
    for index in 0..1000 {
        let case = cases::thesis_2012(&mut random::case("thesis with a prior", index), 1.0);
        let Ok(answer) = estimate_pose(&case.camera, &correspondences(&case, 1.0), &PoseOptions::default()) else {
            continue;
        };
        let middle = case.points.iter().map(|p| p.coords).sum::<nalgebra::Vector3<f64>>() / case.points.len() as f64;
        answered += 1;
        before += u32::from(is_flip(&answer.best, &case));
        match answer.given(&prior, &middle.into()) {
            Ok(given) => after += u32::from(is_flip(&given.best, &case)),
            Err(_) => refused += 1,
        }
    }
    println!("flips of {answered}: {before} without, {after} with the limits that the draw has, {refused} refused");
    // Refused where the truth is in none of the poses: once in two hundred.
    assert!(answered > 980 && refused <= 10 && 100 * after <= 60 * before, "{before} {after} {refused}");
}

#[test]
fn noise_that_nobody_stated_is_read_from_the_residuals() {
    let options = PoseOptions { noise: Noise::Estimated, ..PoseOptions::default() };
    let (mut inside, mut reliable, mut ratio_squared, count) = (0, 0, 0.0, 1000);
    for index in 0..count {
        let rng = &mut random::case("noise unknown", index);
        let noise_px = 0.1 * 10.0_f64.powf(rng.random_range(0.0..1.0));
        let case = cases::visible_box(rng, 16, noise_px);
        let answer = estimate_pose(&case.camera, &correspondences(&case, 1.0), &options).expect("a pose");
        ratio_squared += (answer.noise_scale / noise_px).powi(2);
        if answer.best.covariance_reliable {
            reliable += 1;
            inside += u32::from(nees(nearest(&answer, &case), &case) < CHI_SQUARE_6_95);
        }
    }
    let (ratio_squared, share) = (ratio_squared / count as f64, f64::from(inside) / f64::from(reliable));
    println!("variance estimated over true {ratio_squared:.3}, {share:.3} of {reliable} inside");
    // 26 degrees of freedom each: within four times sqrt(2 / 26 / 1000).
    assert!((ratio_squared - 1.0).abs() < 0.035, "{ratio_squared:.3}");
    // Student's t with so many: 93.5 % inside; four times sqrt(0.06 / 900).
    assert!(reliable > 700 && (0.90..0.965).contains(&share), "{share:.3} of {reliable}");

    let case = cases::visible_box(&mut random::case("noise unknown", 0), 4, 0.5);
    let four = estimate_pose(&case.camera, &correspondences(&case, 1.0), &options);
    assert_eq!(four, Err(NoPose::TooFewPoints { given: 4, need: 5 }));
    let mut scattered = cases::visible_box(&mut random::case("noise unknown", 1), 16, 0.5);
    scattered.pixels.rotate_left(5);
    let refused = estimate_pose(&scattered.camera, &correspondences(&scattered, 1.0), &options);
    assert!(matches!(refused, Err(NoPose::HighResidual { .. })), "{refused:?}");
}

#[test]
fn an_uncertain_camera_makes_uncertain_poses() {
    use skypose::random::normal;
    // A calibration that leaves three pixels of focal length and two of the principal point.
    let sigmas = [3.0, 3.0, 2.0, 2.0];
    let rows: Vec<Vec<f64>> =
        (0..4).map(|r| (0..4).map(|c| if r == c { sigmas[r] * sigmas[r] } else { 0.0 }).collect()).collect();
    let (mut inside, mut inside_if_exact, count) = (0, 0, 1000);
    for index in 0..count {
        let rng = &mut random::case("camera uncertain", index);
        let case = cases::visible_box(rng, 12, 0.2);
        let [fx, fy] = case.camera.focal_lengths();
        let [cx, cy] = case.camera.principal_point();
        let mut off = |value: f64, sigma: f64| value + sigma * normal(rng);
        let (focal, centre) = ([off(fx, 3.0), off(fy, 3.0)], [off(cx, 2.0), off(cy, 2.0)]);
        let thought = Camera::checked([640, 480], focal, centre, Distortion::None).expect("a camera");
        let uncertain = thought.with_parameter_covariance(&rows).expect("a covariance");
        let seen = correspondences(&case, 0.2);
        let nees_with = |camera: &Camera| {
            let answer = estimate_pose(camera, &seen, &PoseOptions::default()).expect("a pose");
            nees(nearest(&answer, &case), &case)
        };
        inside += u32::from(nees_with(&uncertain) < CHI_SQUARE_6_95);
        inside_if_exact += u32::from(nees_with(&thought) < CHI_SQUARE_6_95);
    }
    println!("{inside} inside, {inside_if_exact} if the camera counts as exact, of {count}");
    assert!((930..=970).contains(&inside) && inside_if_exact < 500, "{inside} {inside_if_exact}");
}
