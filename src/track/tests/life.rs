//! From the first sight to the last: confirmation, coasting, loss, names, and where to look.

use std::time::Duration;

use nalgebra::{Matrix6, Vector3};

use super::flights::{seed_camera, wing_six};
use crate::geometry::{CameraFromTarget, PoseCovariance, rotation};
use crate::pose::{PoseAnswer, PoseEstimate};
use crate::solve::Solver;
use crate::track::{FullReason, Life, Loss, Report, Search, Track, TrackError, TrackId, TrackOptions, Tracker};

/// The same in every frame: about a centimetre and half a degree.
fn estimate(position: Vector3<f64>, turn: Vector3<f64>, probability: f64) -> PoseEstimate {
    PoseEstimate {
        camera_from_target: CameraFromTarget::new(rotation::exp(&turn), position),
        covariance: PoseCovariance::checked(Matrix6::identity() * 1e-4).expect("positive definite"),
        covariance_reliable: true,
        reprojection_rms_px: 0.1,
        probability,
    }
}

/// The first is the best.
fn answer(poses: &[PoseEstimate]) -> PoseAnswer {
    PoseAnswer {
        best: poses[0],
        alternatives: poses[1..].to_vec(),
        solver: Solver::Ippe,
        noise_scale: 1.0,
        ln_evidence: 0.0,
    }
}

fn at(x: f64, y: f64, z: f64) -> PoseAnswer {
    answer(&[estimate(Vector3::new(x, y, z), Vector3::x() * 0.5, 1.0)])
}

fn stamp(frame: u64) -> Duration {
    Duration::from_millis(5_000 + 50 * frame)
}

fn tracker() -> Tracker {
    Tracker::new(TrackOptions::default()).expect("good options")
}

fn step(tracker: &mut Tracker, frame: u64, answers: &[PoseAnswer]) -> Report {
    tracker.step(stamp(frame), answers).expect("later")
}

/// Along x at 1 m/s.
fn moving(frame: u64) -> PoseAnswer {
    at(-1.0 + 0.05 * frame as f64, 0.0, 6.0)
}

#[test]
fn a_target_is_confirmed_at_the_third_sight_and_clutter_never() {
    let mut tracker = tracker();
    for frame in 0..3 {
        let report = step(&mut tracker, frame, &[moving(frame)]);
        assert_eq!(report.tracks[0].life(), if frame < 2 { Life::Tentative } else { Life::Confirmed });
        assert_eq!(report.track_of_answer, [Some(TrackId(0))]);
    }
    let report = step(&mut tracker, 3, &[moving(3), at(0.0, 3.0, 9.0)]);
    assert_eq!(report.track_of_answer, [Some(TrackId(0)), Some(TrackId(1))]);
    let lives: Vec<Life> =
        (4..7).filter_map(|frame| step(&mut tracker, frame, &[moving(frame)]).tracks.get(1).map(Track::life)).collect();
    assert_eq!(lives, [Life::Tentative, Life::Tentative, Life::Lost(Loss::Unconfirmed { hits: 1, frames: 4 })]);
    assert_eq!(tracker.tracks().len(), 1);
}

#[test]
fn ten_missing_frames_are_coasted_over() {
    let mut tracker = tracker();
    for frame in 0..20 {
        step(&mut tracker, frame, &[moving(frame)]);
    }
    let mut last_sigma_m = 0.0;
    for frame in 20..30 {
        let report = tracker.step(stamp(frame), None).expect("later");
        let track = &report.tracks[0];
        assert_eq!((track.life(), track.answer()), (Life::Coasting, None));
        assert_eq!(u64::from(track.coasted_count()), frame - 19);
        let motion = &track.best().motion;
        assert!(motion.position_sigma_m() > last_sigma_m);
        last_sigma_m = motion.position_sigma_m();
        let truth = moving(frame).best.camera_from_target;
        let error = motion.pose_covariance().normalized_error_squared(motion.camera_from_target(), &truth);
        assert!(error < 22.5, "frame {frame}: {error}");
    }
    let report = step(&mut tracker, 30, &[moving(30)]);
    assert_eq!((report.tracks[0].id(), report.tracks[0].life()), (TrackId(0), Life::Confirmed));
    assert!(report.tracks[0].best().motion.position_sigma_m() < 0.02);
}

#[test]
fn a_target_that_stays_away_is_lost_once_and_its_name_not_given_again() {
    let mut tracker = tracker();
    (0..5).for_each(|frame| drop(step(&mut tracker, frame, &[moving(frame)])));
    let lost: Vec<Report> =
        (5..60).map(|frame| step(&mut tracker, frame, &[])).filter(|r| r.tracks.iter().any(Track::is_lost)).collect();
    assert_eq!(lost.len(), 1);
    assert!(matches!(lost[0].tracks[0].life(), Life::Lost(Loss::Unseen { .. } | Loss::Uncertain { .. })));
    let again = step(&mut tracker, 60, &[moving(60)]);
    assert_eq!(again.tracks[0].id(), TrackId(1));
}

#[test]
fn a_gap_ends_everything_and_a_stamp_that_is_not_later_changes_nothing() {
    let mut tracker = tracker();
    (0..5).for_each(|frame| drop(step(&mut tracker, frame, &[moving(frame)])));
    let before = tracker.clone();
    for frame in [4, 3] {
        let refused = tracker.step(stamp(frame), None);
        assert!(matches!(refused, Err(TrackError::StampNotAfter { last_s, .. }) if (last_s - 5.2).abs() < 1e-9));
        assert_eq!(tracker, before);
    }
    let report = step(&mut tracker, 100, &[moving(5)]);
    assert!(matches!(report.tracks[0].life(), Life::Lost(Loss::Gap { .. })));
    assert_eq!((report.tracks[1].id(), report.tracks[1].life()), (TrackId(1), Life::Tentative));
    assert_eq!(tracker.tracks().len(), 1);
}

#[test]
fn two_that_cross_keep_their_names_whatever_the_order_of_the_answers() {
    let mut tracker = tracker();
    for frame in 0..60 {
        // Both pass x = 0 at once, half a metre apart in depth and 2 cm in height.
        let x = -1.5 + 0.05 * frame as f64;
        let mut both = [at(x, 0.0, 6.0), at(-x, 0.02, 6.5)];
        let mut right = [TrackId(0), TrackId(1)];
        if frame % 3 == 1 {
            both.reverse();
            right.reverse();
        }
        let report = step(&mut tracker, frame, &both);
        assert_eq!(report.track_of_answer, right.map(Some), "frame {frame}");
        assert_eq!(report.tracks.len(), 2);
    }
}

#[test]
fn the_mirrored_attitude_is_kept_alive_until_the_frames_decide() {
    let mut tracker = tracker();
    let place = Vector3::new(0.0, 0.0, 6.0);
    let [right, wrong] = [Vector3::x() * 0.5, Vector3::x() * -0.5];
    // A single frame prefers the wrong one now and then; over time the right one has the larger share.
    let shares = [0.3, 0.6, 0.9, 0.45, 0.8, 0.9, 0.2, 0.9, 0.9, 0.95];
    let mut is_right = Vec::new();
    for (frame, share) in (0..).zip(shares) {
        let mut poses = [estimate(place, right, share), estimate(place, wrong, 1.0 - share)];
        poses.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        let report = step(&mut tracker, frame, &[answer(&poses)]);
        let track = &report.tracks[0];
        assert!(!track.alternatives().is_empty(), "frame {frame}: both live");
        let turned =
            rotation::angle_between_rad(&track.best().motion.camera_from_target().rotation, &rotation::exp(&right));
        is_right.push(turned < 0.1);
    }
    assert_eq!(is_right, [false, false, true, true, true, true, true, true, true, true]);
    assert!(tracker.tracks()[0].best().probability > 0.999);
}

#[test]
fn a_track_that_was_wrong_turns_round_and_keeps_its_name() {
    let mut tracker = tracker();
    let place = Vector3::new(0.0, 0.0, 6.0);
    let seen = |turn: f64| answer(&[estimate(place, Vector3::x() * turn, 1.0)]);
    (0..10).for_each(|frame| drop(step(&mut tracker, frame, &[seen(0.5)])));
    let turned: Vec<bool> = (10..16)
        .map(|frame| {
            let report = step(&mut tracker, frame, &[seen(-0.5)]);
            assert_eq!(report.track_of_answer, [Some(TrackId(0))]);
            rotation::log(&report.tracks[0].best().motion.camera_from_target().rotation).x < 0.0
        })
        .collect();
    // One frame alone is more likely to be a wrong answer.
    assert!(!turned[0] && turned[5], "{turned:?}");
}

#[test]
fn the_region_holds_the_target_and_the_whole_frame_has_its_turn() {
    let (camera, target) = (seed_camera(), wing_six());
    let mut tracker = tracker();
    assert_eq!(tracker.search(stamp(0), &camera, &target), Search::Full(FullReason::NoTrack));
    let mut parts = 0;
    for frame in 0..40 {
        let answer = moving(frame);
        let search = tracker.search(stamp(frame), &camera, &target);
        match search {
            Search::Part(region) => {
                parts += 1;
                for marker in target.markers() {
                    let pixel = camera.project(&(answer.best.camera_from_target * marker.position)).expect("in view");
                    let inside =
                        |at: f64, from: u32, size: u32| at >= f64::from(from) && at <= f64::from(from + size - 1);
                    assert!(inside(pixel.x, region.x, region.width) && inside(pixel.y, region.y, region.height));
                }
                assert!(region.area() < 640 * 480 / 4, "{region}");
                assert_eq!(search.region(), Some(region));
            }
            Search::Full(FullReason::Schedule { every: 10 }) => assert_eq!(frame % 10, 0),
            Search::Full(FullReason::NoTrack | FullReason::Unsettled) => assert!(frame < 3, "frame {frame}"),
            Search::Full(other) => panic!("frame {frame}: {other:?}"),
        }
        step(&mut tracker, frame, &[answer]);
    }
    assert_eq!(parts, 34);
    step(&mut tracker, 40, &[]);
    assert!(matches!(tracker.search(stamp(41), &camera, &target), Search::Full(_)));
}

#[test]
fn the_prior_is_the_prediction() {
    let mut tracker = tracker();
    (0..20).for_each(|frame| drop(step(&mut tracker, frame, &[moving(frame)])));
    let prior = tracker.prior(TrackId(0), stamp(20)).expect("it lives");
    let (pose, covariance) = prior.predicted.expect("that is what it is");
    let truth = moving(20).best.camera_from_target;
    assert!(covariance.normalized_error_squared(&pose, &truth) < 22.5);
    assert!(tracker.prior(TrackId(7), stamp(20)).is_none());
    // Nothing was counted.
    assert_eq!(tracker.tracks()[0].seen_count(), 20);
}
