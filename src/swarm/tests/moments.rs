//! One moment out of many frames, and what several cameras of one vehicle say of it.

use std::time::Duration;

use nalgebra::Vector3;

use super::flights::heard;
use crate::geometry::space::{Body, Camera, Peer, Target};
use crate::geometry::{CameraFromTarget, EulerAngles, Transform, UncertainTransform, mount};
use crate::pose::{PoseAnswer, PoseOptions, estimate_pose};
use crate::random::{case, normal2};
use crate::refine::Correspondence;
use crate::scene::cases::seed_camera;
use crate::scene::models::wing_six;
use crate::swarm::{Mounts, NoView, Sighting, Sightings, SwarmOptions, Worn};
use crate::track::{TrackOptions, Tracker};

const SPEED_MPS: f64 = 2.0;

fn at(time_s: f64) -> Duration {
    Duration::from_secs_f64(1000.0 + time_s)
}

/// The other comes nearer, straight ahead, its target to us.
fn truth(time_s: f64) -> Transform<Body, Target> {
    let turned = EulerAngles { roll_rad: 0.2, pitch_rad: -1.2, yaw_rad: 3.3 };
    Transform::new(turned.to_rotation(), Vector3::new(9.0 - SPEED_MPS * time_s, 0.2, -0.1))
}

fn camera(yaw_rad: f64, position_m: [f64; 3]) -> Transform<Body, Camera> {
    mount::body_from_camera(EulerAngles { roll_rad: 0.0, pitch_rad: 0.0, yaw_rad }, position_m)
}

fn mounts() -> Mounts {
    let cameras = [("left", camera(0.05, [0.0, -0.3, 0.0])), ("right", camera(-0.05, [0.0, 0.3, 0.0]))];
    let peer_from_target = UncertainTransform::exact(Transform::new(nalgebra::Rotation3::identity(), Vector3::zeros()));
    Mounts {
        cameras: cameras.map(|(name, mount)| (name.to_owned(), UncertainTransform::exact(mount))).into(),
        peers: [("beta".to_owned(), Worn { target: "wing-six".into(), peer_from_target })].into(),
    }
}

fn answer(rng: &mut impl rand::Rng, pose: &CameraFromTarget, sigma_px: f64) -> PoseAnswer {
    let seen: Vec<Correspondence> = wing_six()
        .markers()
        .iter()
        .map(|marker| {
            let pixel = seed_camera().project(&(*pose * marker.position)).expect("in view") + normal2(rng) * sigma_px;
            Correspondence { point: marker.position, pixel, sigma_px }
        })
        .collect();
    estimate_pose(&seed_camera(), &seen, &PoseOptions::default()).expect("a pose")
}

/// Both cameras have looked at 20 Hz for a second, the right one 10 ms after the left.
fn looked(cameras: &Mounts, name: &str, index: u64) -> Sightings {
    let mut rng = case(name, index);
    let options = TrackOptions {
        acceleration_mps2_per_rthz: 0.3,
        angular_acceleration_radps2_per_rthz: 0.1,
        ..TrackOptions::default()
    };
    let mut sightings = Sightings::default();
    for (camera, late_s) in [("left", 0.0), ("right", 0.01)] {
        let mut tracker = Tracker::new(options).expect("good options");
        for frame in 0..20 {
            let time_s = f64::from(frame) * 0.05 + late_s;
            let pose = cameras.cameras[camera].transform.inverse() * truth(time_s);
            let answer = answer(&mut rng, &pose, 0.2);
            let report = tracker.step(at(time_s), Some(&answer)).expect("later");
            let sighting = Sighting { stamp: at(time_s), tracks: report.tracks, options };
            sightings.add(camera, "wing-six", sighting, &SwarmOptions::default());
        }
    }
    sightings
}

#[test]
fn the_last_frames_before_the_moment_are_taken_on_to_it() {
    let (mounts, options) = (mounts(), SwarmOptions::default());
    let sightings = looked(&mounts, "moment", 0);
    for (time_s, apart_ms) in [(0.95, 40), (0.97, 20), (0.72, 20), (1.05, 100)] {
        let found = sightings.own_view(&mounts, "beta", at(time_s), &options).expect("seen");
        let late = found.apart.as_secs_f64() * 1e3 - f64::from(apart_ms);
        assert!(late.abs() < 1e-3, "{time_s}: {:?}", found.apart);
        let place = found.view.candidates[0].seen.along().transform.translation;
        let off = place - truth(time_s).translation;
        // 2 m/s over the 20 ms between frames would be 4 cm.
        assert!(off.norm() < 0.03, "{time_s}: {off}");
        assert!((found.rate[0] + SPEED_MPS).abs() < 0.3, "{}", found.rate);
        assert_eq!(found.view.cameras, ["left", "right"]);
        assert!(found.cameras.is_some_and(|cameras| cameras.agrees()));
    }
    for (peer, time_s) in [("beta", 1.3), ("beta", -0.1), ("gamma", 0.97), ("beta", 0.01)] {
        let found = sightings.own_view(&mounts, peer, at(time_s), &options);
        assert_eq!(found.err(), Some(NoView::Unseen), "{peer} at {time_s}");
    }
}

#[test]
fn two_cameras_know_more_than_one_and_one_that_sits_elsewhere_is_told() {
    let (mounts, options) = (mounts(), SwarmOptions::default());
    let mut sums = [0.0; 2];
    for index in 0..40 {
        let sightings = looked(&mounts, "two cameras", index);
        let alone = Mounts { cameras: mounts.cameras.clone().into_iter().take(1).collect(), ..mounts.clone() };
        for (sum, mounts) in sums.iter_mut().zip([&alone, &mounts]) {
            let found = sightings.own_view(mounts, "beta", at(0.96), &options).expect("seen");
            let place = found.view.candidates[0].seen.along().transform.translation;
            *sum += (place - truth(0.96).translation).norm_squared();
        }
    }
    println!("one camera {:.4} m, two {:.4} m", (sums[0] / 40.0_f64).sqrt(), (sums[1] / 40.0_f64).sqrt());
    assert!(sums[1] < 0.75 * sums[0], "{sums:?}");
    let sightings = looked(&mounts, "moved camera", 0);
    let mut moved = mounts;
    moved.cameras.insert("right".into(), UncertainTransform::exact(camera(-0.10, [0.0, 0.3, 0.0])));
    match sightings.own_view(&moved, "beta", at(0.96), &options) {
        Err(NoView::Contradiction { comparison, views }) => {
            assert!(!comparison.agrees() && comparison.squared > comparison.limit);
            assert_eq!(views.iter().map(|view| view.cameras[0].as_str()).collect::<Vec<_>>(), ["left", "right"]);
        }
        other => panic!("{other:?}"),
    }
    // Whose place is known to three degrees only contradicts nobody.
    let loose = nalgebra::Matrix6::from_diagonal(&[1e-4, 1e-4, 1e-4, 3e-3, 3e-3, 3e-3].into());
    moved.cameras.get_mut("right").expect("there").covariance = loose;
    assert!(sightings.own_view(&moved, "beta", at(0.96), &options).is_ok());
}

#[test]
fn another_clock_is_allowed_for() {
    let mounts = mounts();
    let sightings = looked(&mounts, "clock", 0);
    let ours = sightings.own_view(&mounts, "beta", at(0.96), &SwarmOptions::default()).expect("seen");
    // The other says the very same, but for a moment that is 100 ms later by its clock.
    let mut other = ours.view.clone();
    let late = ours.rate * 0.1;
    for candidate in &mut other.candidates {
        let seen = candidate.seen.along();
        let back = UncertainTransform { transform: seen.transform.perturbed(&late), ..seen }.inverse();
        let transform = Transform::<Body, Peer>::new(back.transform.rotation, back.transform.translation);
        let covariance = back.covariance;
        candidate.seen = crate::swarm::Seen::Along(UncertainTransform { transform, covariance });
    }
    let other = heard(&other);
    let agrees = |clock_ms| {
        let options = SwarmOptions { clock_sigma: Duration::from_millis(clock_ms), ..SwarmOptions::default() };
        ours.compare(&other, &options).expect("good numbers").agrees()
    };
    assert_eq!([agrees(0), agrees(100)], [false, true]);
}

#[test]
fn after_the_clock_was_set_back_it_begins_anew() {
    let (mounts, options) = (mounts(), SwarmOptions::default());
    let mut sightings = looked(&mounts, "set back", 0);
    let early = Sighting { stamp: at(-50.0), tracks: Vec::new(), options: TrackOptions::default() };
    for camera in ["left", "right"] {
        sightings.add(camera, "wing-six", early.clone(), &options);
    }
    for time_s in [0.96, -50.0] {
        assert_eq!(sightings.own_view(&mounts, "beta", at(time_s), &options).err(), Some(NoView::Unseen));
    }
}
