//! Views whose errors are drawn from their covariances.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use rand::{Rng, RngExt};

use super::squared_errors;
use crate::geometry::space::{Body, Peer, Space};
use crate::geometry::{PoseCovariance, Transform, UncertainTransform, rotation};
use crate::random::{case, normal};
use crate::statistics::{Rate, chi_square_limit};
use crate::swarm::{Candidate, Comparison, Seen, SwarmOptions, View, compare};

/// The place of another vehicle 4 to 40 m away, turned anyhow.
fn truth(rng: &mut impl Rng) -> Transform<Body, Peer> {
    let mut direction = || Vector3::from_fn(|_, _| normal(rng)).normalize();
    let (bearing, axis) = (direction(), direction());
    Transform::new(rotation::exp(&(axis * rng.random_range(0.0..3.0))), bearing * rng.random_range(4.0..40.0))
}

/// What a camera knows of what it sees: across the line of sight to a pixel's angle, along it some hundred times worse, the attitude to a
/// degree or three.
fn covariance(rng: &mut impl Rng, place: &Vector3<f64>) -> Matrix6<f64> {
    let (range_m, sight) = (place.norm(), place.normalize());
    let (across_m, along_m) = (3e-4 * range_m, rng.random_range(0.005..0.03) * range_m);
    let along = sight * sight.transpose();
    let mut covariance = Matrix6::zeros();
    covariance
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(along * along_m.powi(2) + (Matrix3::identity() - along) * across_m.powi(2)));
    covariance.fixed_view_mut::<3, 3>(3, 3).fill_diagonal(rng.random_range(0.01..0.05_f64).powi(2));
    covariance
}

/// What somebody measures of the truth.
fn measured<To: Space, From: Space>(rng: &mut impl Rng, truth: &Transform<To, From>) -> UncertainTransform<To, From> {
    let covariance = covariance(rng, &truth.translation);
    let root = covariance.cholesky().expect("positive definite").l();
    let error = root * Vector6::from_fn(|_, _| normal(rng));
    UncertainTransform { transform: truth.perturbed(&-error), covariance }
}

fn view(candidates: &[(Seen<Body, Peer>, f64)]) -> View<Body, Peer> {
    let candidates =
        candidates.iter().map(|(seen, probability)| Candidate { seen: *seen, probability: *probability }).collect();
    View { cameras: Vec::new(), candidates }
}

/// The attitude of the other image of a flat target seen along this line: turned about the line by half a turn and back about the target's
/// normal, which leaves the projection nearly the same.
fn mirrored<To: Space, From: Space>(of: &UncertainTransform<To, From>) -> UncertainTransform<To, From> {
    let sight = of.transform.translation.normalize();
    let normal = of.transform.rotation * Vector3::z();
    let half = |axis: Vector3<f64>| rotation::exp(&(axis * std::f64::consts::PI));
    let rotation = half(sight) * half(normal) * of.transform.rotation;
    UncertainTransform { transform: Transform::new(rotation, of.transform.translation), covariance: of.covariance }
}

const CASES: u64 = 4000;

fn nees(comparison: &Comparison<Body, Peer>, truth: &Transform<Body, Peer>) -> f64 {
    let best = &comparison.fused[0].pose;
    let covariance = PoseCovariance::checked(best.covariance).expect("positive definite");
    covariance.normalized_error_squared(&best.transform, truth)
}

#[test]
fn the_fused_error_is_what_it_says_and_disagreements_are_as_many_as_asked() {
    let asked = 0.02;
    let options = SwarmOptions { significance: asked, ..SwarmOptions::default() };
    let (mut squared, mut distances, mut outside) = (0.0, 0.0, 0_u64);
    let (mut sums, mut agreed) = ([[0.0; 2]; 3], 0_u64);
    let inside_95 = chi_square_limit(3, 0.05);
    for index in 0..CASES {
        let mut rng = case("drawn views", index);
        let truth = truth(&mut rng);
        let (ours, theirs) = (measured(&mut rng, &truth), measured(&mut rng, &truth.inverse()));
        let views = [view(&[(Seen::Along(ours), 1.0)]), view(&[(Seen::Back(theirs), 1.0)])];
        let found = compare(&[&views[0], &views[1]], &options).expect("good numbers");
        distances += found.squared;
        if !found.agrees() {
            continue;
        }
        agreed += 1;
        let error = nees(&found, &truth);
        squared += error;
        outside += u64::from(error > inside_95);
        for (sums, pose) in
            sums.iter_mut().zip([ours.transform, theirs.transform.inverse(), found.fused[0].pose.transform])
        {
            for (sum, squared) in sums.iter_mut().zip(squared_errors(&pose, &truth)) {
                *sum += squared;
            }
        }
    }
    let disagreed = Rate { count: CASES - agreed, of: CASES };
    let rms = sums.map(|sums| sums.map(|sum| (sum / agreed as f64).sqrt()));
    println!(
        "mean distance {:.3} of 6, fused error {:.3} of 6, outside of 95 %: {:.4}, disagreed {:.4} of {asked}; \
         place and attitude, ours, theirs, fused: {rms:.4?}",
        distances / CASES as f64,
        squared / agreed as f64,
        outside as f64 / agreed as f64,
        disagreed.ratio().expect("many"),
    );
    // Three deviations of a mean of chi-square with six degrees of freedom over so many cases.
    let three = 3.0 * (12.0 / CASES as f64).sqrt();
    assert!((distances / CASES as f64 - 6.0).abs() < three, "{distances}");
    // Fused error and distance are independent, so that leaving out the distant ones takes nothing away.
    assert!((squared / agreed as f64 - 6.0).abs() < three, "{squared}");
    let [low, high] = Rate { count: outside, of: agreed }.interval();
    assert!(low < 0.05 && 0.05 < high, "{outside} of {agreed}");
    let [low, high] = disagreed.interval();
    assert!(low < asked && asked < high, "{disagreed:?}");
    for what in 0..2 {
        // Each learns from the other what it does not see itself.
        assert!(rms[2][what] < 0.75 * rms[0][what].min(rms[1][what]), "{rms:?}");
    }
}

#[test]
fn of_mirrored_attitudes_on_both_sides_the_true_pair_is_found() {
    let options = SwarmOptions::default();
    let (mut right, mut claimed, mut told, mut clear) = (0_u64, 0.0, 0_u64, 0_u64);
    for index in 0..CASES {
        let mut rng = case("mirrored views", index);
        let truth = truth(&mut rng);
        let (ours, theirs) = (measured(&mut rng, &truth), measured(&mut rng, &truth.inverse()));
        // Probabilities that hold: the right one has its own so often.
        let mut both = |seen: Seen<Body, Peer>, other: Seen<Body, Peer>| {
            let first: f64 = rng.random_range(0.5..0.9);
            let (best, runner_up) = if rng.random_bool(first) { (seen, other) } else { (other, seen) };
            view(&[(best, first), (runner_up, 1.0 - first)])
        };
        let own = both(Seen::Along(ours), Seen::Along(mirrored(&ours)));
        let heard = both(Seen::Back(theirs), Seen::Back(mirrored(&theirs)));
        let Some(found) = compare(&[&own, &heard], &options).filter(Comparison::agrees) else { continue };
        told += 1;
        let is_right = rotation::angle_between_rad(&found.fused[0].pose.transform.rotation, &truth.rotation) < 0.2;
        right += u64::from(is_right);
        claimed += found.fused[0].probability;
        clear += u64::from(found.fused[0].probability > 0.99);
    }
    println!("{right} of {told} right, {claimed:.1} claimed, {clear} clear");
    assert!(told as f64 > 0.998 * CASES as f64, "{told}");
    // As often as it says, within three deviations of so rare a thing; and one look nearly always tells.
    let wrong = told as f64 - claimed;
    assert!(((told - right) as f64 - wrong).abs() < 3.0 * wrong.sqrt() + 3.0, "{right} {claimed}");
    assert!(clear as f64 > 0.9 * told as f64, "{clear}");
}

#[test]
fn who_lies_is_told_and_not_believed() {
    let options = SwarmOptions::default();
    // A vehicle that says that it is elsewhere, one whose camera sits otherwise than it says, one that tells what was a second ago.
    let lies: [(&str, Vector6<f64>); 3] = [
        ("place", Vector6::new(0.0, 1.5, 0.0, 0.0, 0.0, 0.0)),
        ("mount", Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.3)),
        ("time", Vector6::new(-8.0, 2.0, 1.0, 0.05, 0.0, 0.1)),
    ];
    for (name, lie) in lies {
        let mut caught = Rate::default();
        for index in 0..500 {
            let mut rng = case("lies", index);
            let mut truth = truth(&mut rng);
            truth.translation = truth.translation.normalize() * rng.random_range(4.0..12.0);
            let ours = measured(&mut rng, &truth);
            let mut theirs = measured(&mut rng, &truth.inverse());
            theirs.transform = theirs.transform.perturbed(&lie);
            let views = [view(&[(Seen::Along(ours), 1.0)]), view(&[(Seen::Back(theirs), 1.0)])];
            let found = compare(&[&views[0], &views[1]], &options).expect("good numbers");
            caught.of += 1;
            caught.count += u64::from(!found.agrees());
            assert_eq!(found.agrees(), found.squared <= found.limit);
        }
        println!("{name}: {caught:?}");
        assert!(caught.ratio().expect("many") > 0.9, "{name} {caught:?}");
    }
}
