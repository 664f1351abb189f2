//! Two vehicles that fly before each other, each with a camera and a target: rendered to pixels with noise, tracked, compared, fused.

use std::time::Duration;

use nalgebra::Vector3;
use rand::Rng;

use super::squared_errors;
use crate::camera::{Camera, Pixel};
use crate::geometry::space::{Body, Peer, Space, Target};
use crate::geometry::{EulerAngles, PoseCovariance, Transform, UncertainTransform, mount, rotation};
use crate::pose::{PoseAnswer, PoseOptions, estimate_pose};
use crate::random::{case, normal, normal2};
use crate::refine::Correspondence;
use crate::scene::cases::seed_camera;
use crate::scene::models::wing_six;
use crate::statistics::Rate;
use crate::swarm::{Candidate, Mounts, OwnView, Seen, Sighting, Sightings, SwarmOptions, View, Worn};
use crate::track::{TrackOptions, Tracker};

const RATE_HZ: f64 = 20.0;
const NOISE_PX: f64 = 0.8;

/// Frames after which tracks have settled; before, flat targets have two attitudes.
const SETTLED: u32 = 10;

/// How the vehicles move against each other: white accelerations of this size along and about the axes of the first.
const ACCELERATION: f64 = 0.4;
const TWIST: f64 = 0.06;

/// The same as a tracker has it that sees this much acceleration. To the second everything swings about it at its distance, so it sees
/// more of it: `0.4` and, at 7.5 m, `0.06 * 7.5`.
fn tracked_with(acceleration_mps2_per_rthz: f64) -> TrackOptions {
    TrackOptions { acceleration_mps2_per_rthz, angular_acceleration_radps2_per_rthz: TWIST, ..TrackOptions::default() }
}

/// A camera that looks forward, and a target that is worn so that it faces forward.
fn mounts(peer: &str) -> Mounts {
    let forward = EulerAngles { roll_rad: 0.0, pitch_rad: 0.0, yaw_rad: 0.0 };
    let camera = mount::body_from_camera(forward, [0.1, 0.0, 0.05]);
    let worn = Worn { target: "wing-six".into(), peer_from_target: UncertainTransform::exact(worn()) };
    Mounts {
        cameras: [("front".into(), UncertainTransform::exact(camera))].into(),
        peers: [(peer.into(), worn)].into(),
    }
}

/// Facing forward, a little turned.
fn worn<Wearer: Space>() -> Transform<Wearer, Target> {
    let turned = EulerAngles { roll_rad: 0.1, pitch_rad: -1.4, yaw_rad: 0.2 };
    Transform::new(turned.to_rotation(), Vector3::new(0.2, 0.05, 0.0))
}

/// A vehicle.
struct Vehicle {
    mounts: Mounts,
    peer: &'static str,
    options: TrackOptions,
    tracker: Tracker,
    sightings: Sightings,
}

impl Vehicle {
    fn new(peer: &'static str, options: TrackOptions) -> Self {
        let tracker = Tracker::new(options).expect("good options");
        Self { mounts: mounts(peer), peer, options, tracker, sightings: Sightings::default() }
    }

    /// It takes a picture while the other is there.
    fn look(&mut self, rng: &mut impl Rng, stamp: Duration, body_from_peer: &Transform<Body, Peer>) {
        let camera_from_body = self.mounts.cameras["front"].transform.inverse();
        let camera_from_target = camera_from_body * *body_from_peer * worn::<Peer>();
        let answer = answer(rng, &seed_camera(), &camera_from_target);
        let report = self.tracker.step(stamp, answer.as_ref()).expect("later");
        let sighting = Sighting { stamp, tracks: report.tracks, options: self.options };
        self.sightings.add("front", "wing-six", sighting, &SwarmOptions::default());
    }

    fn view(&self, stamp: Duration) -> Option<OwnView> {
        self.sightings.own_view(&self.mounts, self.peer, stamp, &SwarmOptions::default()).ok()
    }
}

fn answer(
    rng: &mut impl Rng,
    camera: &Camera,
    pose: &Transform<crate::geometry::space::Camera, Target>,
) -> Option<PoseAnswer> {
    let target = wing_six();
    let seen: Option<Vec<Correspondence>> = target
        .markers()
        .iter()
        .map(|marker| {
            let pixel: Pixel = camera.project(&(*pose * marker.position))? + normal2(rng) * NOISE_PX;
            Some(Correspondence { point: marker.position, pixel, sigma_px: NOISE_PX })
        })
        .collect();
    let faces = |pose: &_| (0..target.markers().len()).all(|index| target.faces_camera(index, pose));
    estimate_pose(camera, &seen?, &PoseOptions::default()).ok()?.restricted(faces).ok()
}

/// What one says, as the other hears it: the speaker's body is the hearer's peer.
pub(super) fn heard(view: &View<Body, Peer>) -> View<Body, Peer> {
    let candidates = view.candidates.iter().map(|candidate| {
        let UncertainTransform { transform, covariance } = candidate.seen.along();
        let transform = Transform::<Peer, Body>::new(transform.rotation, transform.translation);
        Candidate { seen: Seen::Back(UncertainTransform { transform, covariance }), ..*candidate }
    });
    View { cameras: view.cameras.clone(), candidates: candidates.collect() }
}

/// How the second moves against the first.
struct Flight {
    pose: Transform<Body, Peer>,
    velocity: Vector3<f64>,
    turning: Vector3<f64>,
}

impl Flight {
    /// Face to face, six to nine metres apart.
    fn begun(rng: &mut impl Rng) -> Self {
        let mut draw = |sigma: f64| Vector3::from_fn(|_, _| sigma * normal(rng));
        let facing = rotation::exp(&draw(0.12)) * rotation::exp(&(Vector3::z() * std::f64::consts::PI));
        let place = Vector3::new(7.5, 0.0, 0.0) + draw(0.5);
        Self { pose: Transform::new(facing, place), velocity: draw(0.3), turning: draw(0.03) }
    }

    fn fly(&mut self, rng: &mut impl Rng, span_s: f64) {
        let steps = 10;
        let dt_s = span_s / f64::from(steps);
        for _ in 0..steps {
            let mut kick = |density: f64| Vector3::from_fn(|_, _| density * dt_s.sqrt() * normal(rng));
            let (push, twist) = (kick(ACCELERATION), kick(TWIST));
            let (velocity, turning) = (self.velocity + push * 0.5, self.turning + twist * 0.5);
            let turn = rotation::exp(&(turning * dt_s));
            self.pose = Transform::new(turn * self.pose.rotation, self.pose.translation + velocity * dt_s);
            (self.velocity, self.turning) = (self.velocity + push, self.turning + twist);
        }
    }
}

#[test]
fn two_that_see_each_other_know_more_than_each_of_them() {
    let options = SwarmOptions { clock_sigma: Duration::ZERO, ..SwarmOptions::default() };
    let (mut normalized, mut agreed, mut flips) = (Vec::new(), Rate::default(), [0_u64; 3]);
    let mut sums = [[0.0; 2]; 3];
    let mut count = 0.0;
    for index in 0..60 {
        let mut rng = case("face to face", index);
        let mut flight = Flight::begun(&mut rng);
        let (mut one, mut other) =
            (Vehicle::new("other", tracked_with(ACCELERATION)), Vehicle::new("one", tracked_with(0.6)));
        let mut of_flight = Vec::new();
        for frame in 0..50_u32 {
            // The second takes its pictures 20 ms after the first.
            let stamp = Duration::from_secs_f64(1000.0 + f64::from(frame) / RATE_HZ);
            one.look(&mut rng, stamp, &flight.pose);
            flight.fly(&mut rng, 0.02);
            let stamp = stamp + Duration::from_millis(20);
            let seen_back = flight.pose.inverse();
            let seen_back = Transform::<Body, Peer>::new(seen_back.rotation, seen_back.translation);
            other.look(&mut rng, stamp, &seen_back);
            let truth = flight.pose;
            flight.fly(&mut rng, 1.0 / RATE_HZ - 0.02);
            let (Some(ours), Some(theirs)) = (one.view(stamp), other.view(stamp)) else { continue };
            assert_eq!((ours.apart, theirs.apart), (Duration::from_millis(20), Duration::ZERO));
            let theirs = heard(&theirs.view);
            let found = ours.compare(&theirs, &options).expect("good numbers");
            agreed.of += 1;
            agreed.count += u64::from(found.agrees());
            let Some(fused) = found.fused.first() else { continue };
            let poses = [
                ours.view.candidates[0].seen.along().transform,
                theirs.candidates[0].seen.along().transform,
                fused.pose.transform,
            ];
            let errors = poses.map(|pose| squared_errors(&pose, &truth));
            let is_flip = errors.map(|[_, attitude]| attitude.sqrt() > 0.3);
            (0..3).for_each(|who| flips[who] += u64::from(is_flip[who]));
            if frame < SETTLED || is_flip.iter().any(|flip| *flip) {
                continue;
            }
            count += 1.0;
            for (sums, errors) in sums.iter_mut().zip(errors) {
                (0..2).for_each(|what| sums[what] += errors[what]);
            }
            let covariance = PoseCovariance::checked(fused.pose.covariance).expect("positive definite");
            of_flight.push(covariance.normalized_error_squared(&fused.pose.transform, &truth) / 6.0);
        }
        if !of_flight.is_empty() {
            normalized.push(of_flight.iter().sum::<f64>() / of_flight.len() as f64);
        }
    }
    let mean = normalized.iter().sum::<f64>() / normalized.len() as f64;
    let rms = sums.map(|sums| sums.map(|sum| (sum / count).sqrt()));
    println!(
        "{} flights, {agreed:?}; fused squared error {mean:.3} of what it says; flips, ours, theirs, fused: {flips:?}; place m and attitude \
         rad: {rms:.4?}",
        normalized.len()
    );
    assert!(normalized.len() > 40 && agreed.of > 1000, "{agreed:?}");
    assert!((0.7..1.15).contains(&mean), "{mean}");
    assert!(agreed.ratio().expect("many") > 0.995, "{agreed:?}");
    for what in 0..2 {
        assert!(rms[2][what] < 0.8 * rms[0][what].min(rms[1][what]), "{rms:?}");
    }
    assert!(flips[0] + flips[1] > 20 && flips[2] * 10 < flips[0] + flips[1], "{flips:?}");
}
