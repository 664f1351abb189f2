//! Is the error of a track as large as it says, and smaller than that of single frames? Do flips end?

#![allow(clippy::print_stdout, reason = "a test shows its figures")]

use std::time::Duration;

use super::flights::{RATE_HZ, Start, Truth, answer, seed_camera, wandering, wandering_options};
use crate::camera::{Camera, Pixel};
use crate::geometry::{CameraFromTarget, rotation};
use crate::random::{case, normal2};
use crate::scene::flight::Flight;
use crate::scene::models::demo_camera;
use crate::scene::verdict::MAX_GOOD_ROTATION_DEG;
use crate::statistics::Rate;
use crate::track::{Motion, TrackOptions, Tracker};

/// Frames after which a track has settled: velocities are known.
const SETTLED: usize = 10;

/// Sums over the frames of many flights.
#[derive(Default)]
struct Sums {
    /// Per flight the mean squared error in units of the covariance: of the pose, of all twelve numbers.
    pose: Vec<f64>,
    all: Vec<f64>,
    closing: Vec<f64>,
    time: Vec<f64>,
    /// Squared errors of track and single frame, where neither is a flip: of the position, of the range, of the attitude.
    squared: [[f64; 3]; 2],
    count: f64,
    flips: [u64; 2],
    frames: u64,
    /// Frames on which the best hypothesis has this probability in tenths, and those on which it is right.
    claimed: f64,
    /// Times to closest approach that were told.
    times: u64,
    times_inside: u64,
    /// Frames whose best hypothesis is called 95 % probable at least, and flips among them.
    sure: [u64; 2],
    /// Poses inside and outside of the ellipsoid that holds 95 of a hundred.
    inside: u64,
}

fn is_flip(found: &CameraFromTarget, truth: &CameraFromTarget) -> bool {
    rotation::angle_between_rad(&found.rotation, &truth.rotation).to_degrees() > MAX_GOOD_ROTATION_DEG
}

fn squared_errors(found: &CameraFromTarget, truth: &CameraFromTarget) -> [f64; 3] {
    [
        (found.translation - truth.translation).norm_squared(),
        (found.translation.norm() - truth.translation.norm()).powi(2),
        rotation::angle_between_rad(&found.rotation, &truth.rotation).powi(2),
    ]
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Standard error of the mean, flights being independent and frames not.
fn mean_sigma(values: &[f64]) -> f64 {
    let middle = mean(values);
    let spread = values.iter().map(|value| (value - middle).powi(2)).sum::<f64>() / values.len() as f64;
    (spread / values.len() as f64).sqrt()
}

impl Sums {
    fn fly(&mut self, camera: &Camera, flight: &[Truth], noise_px: f64, options: TrackOptions, seed: (&str, u64)) {
        self.fly_beside(camera, flight, (noise_px, &[Pixel::zeros(); 6]), options, seed);
    }

    /// As `fly`, with a bias in all frames beside the noise.
    fn fly_beside(
        &mut self,
        camera: &Camera,
        flight: &[Truth],
        (noise_px, bias_px): (f64, &[Pixel; 6]),
        options: TrackOptions,
        seed: (&str, u64),
    ) {
        let mut rng = case(seed.0, seed.1);
        let mut tracker = Tracker::new(options).expect("good options");
        let (mut pose, mut all, mut closing, mut time) = (vec![], vec![], vec![], vec![]);
        for (index, truth) in flight.iter().enumerate() {
            let stamp = Duration::from_secs_f64(1000.0 + index as f64 / RATE_HZ);
            let single = answer(&mut rng, camera, &truth.camera_from_target, noise_px, bias_px);
            let report = tracker.step(stamp, single.as_ref()).expect("later");
            let (Some(single), Some(track), true) = (single, report.believed().next(), index >= SETTLED) else {
                continue;
            };
            let best = track.best();
            let found = [*best.motion.camera_from_target(), single.best.camera_from_target];
            let flips = found.map(|found| is_flip(&found, &truth.camera_from_target));
            self.frames += 1;
            self.claimed += best.probability;
            (0..2).for_each(|which| self.flips[which] += u64::from(flips[which]));
            if best.probability >= 0.95 {
                self.sure[0] += 1;
                self.sure[1] += u64::from(flips[0]);
            }
            if flips[0] {
                continue;
            }
            let squared = best.motion.pose_covariance().normalized_error_squared(&found[0], &truth.camera_from_target);
            self.inside += u64::from(squared < 12.59);
            self.normalized(&best.motion, truth, [&mut pose, &mut all, &mut closing, &mut time]);
            if !flips[1] {
                self.count += 1.0;
                for (sums, found) in self.squared.iter_mut().zip(&found) {
                    for (sum, error) in sums.iter_mut().zip(squared_errors(found, &truth.camera_from_target)) {
                        *sum += error;
                    }
                }
            }
        }
        for (sums, of_flight) in
            [(&mut self.pose, pose), (&mut self.all, all), (&mut self.closing, closing), (&mut self.time, time)]
        {
            if !of_flight.is_empty() {
                sums.push(mean(&of_flight));
            }
        }
    }

    fn normalized(&mut self, motion: &Motion, truth: &Truth, [pose, all, closing, time]: [&mut Vec<f64>; 4]) {
        let Truth { camera_from_target, velocity_mps, angular_velocity_radps } = truth;
        pose.push(
            motion.pose_covariance().normalized_error_squared(motion.camera_from_target(), camera_from_target) / 6.0,
        );
        all.push(motion.normalized_error_squared(camera_from_target, velocity_mps, angular_velocity_radps) / 12.0);
        let position = camera_from_target.translation;
        let true_closing = -position.dot(velocity_mps) / position.norm();
        let found = motion.closing_speed_mps().expect("far");
        closing.push(((found.value - true_closing) / found.sigma).powi(2));
        if let Ok(found) = motion.closest_approach() {
            let true_time = -position.dot(velocity_mps) / velocity_mps.norm_squared();
            self.times += 1;
            let off = (found.time_s.value - true_time) / found.time_s.sigma;
            self.times_inside += u64::from(off.abs() < 1.96);
            time.push(off.powi(2));
        }
    }

    /// The squared error is what the covariance says within a tenth or so, never much more; the track beats the single frame.
    fn check(&self) {
        assert!((0.8..1.08).contains(&mean(&self.pose)), "pose {}", mean(&self.pose));
        assert!((0.85..1.08).contains(&mean(&self.all)), "all twelve {}", mean(&self.all));
        assert!((0.8..1.15).contains(&mean(&self.closing)), "closing speed {}", mean(&self.closing));
        let inside = self.inside as f64 / (self.frames - self.flips[0]) as f64;
        assert!((0.93..0.98).contains(&inside), "{inside} inside of 95 %");
        for what in 0..3 {
            assert!(self.squared[0][what] < 0.6 * self.squared[1][what], "{:?}", self.squared);
        }
        let right = 1.0 - self.flips[0] as f64 / self.frames as f64;
        // Calibrated: as probable as it says, or a little more.
        assert!((-0.005..0.03).contains(&(right - self.claimed / self.frames as f64)), "right in {right}");
    }

    fn show(&self, name: &str) {
        let with_sigma = |values: &[f64]| format!("{:.3} +- {:.3}", mean(values), mean_sigma(values));
        let rms = |which: usize, what: usize| (self.squared[which][what] / self.count).sqrt();
        println!(
            "{name}: {} frames, inside {:.3}; squared error over expected: pose {}, all twelve {}, closing speed {}, time to closest \
             approach {} ({} in {} flights)",
            self.frames,
            self.inside as f64 / (self.frames - self.flips[0]) as f64,
            with_sigma(&self.pose),
            with_sigma(&self.all),
            with_sigma(&self.closing),
            with_sigma(&self.time),
            self.times,
            self.time.len(),
        );
        println!(
            "  root mean square, track / single: position {:.4} / {:.4} m, range {:.4} / {:.4} m, attitude {:.3} / {:.3} deg",
            rms(0, 0),
            rms(1, 0),
            rms(0, 1),
            rms(1, 1),
            rms(0, 2).to_degrees(),
            rms(1, 2).to_degrees(),
        );
        let [track, single] = self.flips.map(|count| Rate { count, of: self.frames });
        println!(
            "  flips: track {:.5}, single {:.5}; mean probability of the best hypothesis {:.5}; {} of {} where it is 0.95 or more; \
             times inside {:.3}",
            track.ratio().unwrap_or(f64::NAN),
            single.ratio().unwrap_or(f64::NAN),
            self.claimed / self.frames as f64,
            self.sure[1],
            self.sure[0],
            self.times_inside as f64 / self.times as f64,
        );
    }
}

/// 200 flights, which begin so, at this pixel noise.
fn wandered(start: Start, noise_px: f64) -> Sums {
    let mut sums = Sums::default();
    for index in 0..200 {
        let flight = wandering(&mut case("wandering", index), start, 80);
        sums.fly(&seed_camera(), &flight, noise_px, wandering_options(), ("wandering noise", index));
    }
    sums.show(&format!("{start:?}, {noise_px} px"));
    sums
}

#[test]
fn wandering_targets_are_where_the_track_says() {
    let mut flips = [0; 2];
    for noise_px in [0.2, 0.5, 1.0] {
        let sums = wandered(Start::Near, noise_px);
        sums.check();
        (0..2).for_each(|which| flips[which] += sums.flips[which]);
    }
    println!("flips in all: track {}, single {}", flips[0], flips[1]);
    assert!(flips[0] * 10 < flips[1], "{flips:?}");
}

#[test]
fn what_is_wrong_in_every_frame_the_track_believes_but_it_is_still_better_than_single_frames() {
    // A bias of the markers that is small against the noise, and one that is larger.
    for (bias, most_flips_ratio) in [(0.1, 0.15), (0.5, 0.8)] {
        let mut sums = Sums::default();
        for index in 0..200 {
            let flight = wandering(&mut case("wandering", index), Start::Near, 80);
            let mut rng = case("bias of the markers", index);
            let bias_px = [(); 6].map(|()| normal2(&mut rng) * bias);
            sums.fly_beside(&seed_camera(), &flight, (0.3, &bias_px), wandering_options(), ("wandering noise", index));
        }
        sums.show(&format!("bias of {bias} px"));
        assert!((sums.flips[0] as f64) < most_flips_ratio * sums.flips[1] as f64, "{:?}", sums.flips);
        assert!((0..3).all(|what| sums.squared[0][what] < sums.squared[1][what]), "{:?}", sums.squared);
    }
}

#[test]
fn coming_targets_come_when_the_track_says() {
    for noise_px in [0.2, 0.5, 1.0] {
        let sums = wandered(Start::Coming, noise_px);
        sums.check();
        assert!(sums.times > 5000, "{}", sums.times);
        // Times are told where the speed looks well known, which it does a little more often where it errs upwards.
        let inside = sums.times_inside as f64 / sums.times as f64;
        assert!((0.92..0.97).contains(&inside) && mean(&sums.time) < 1.5, "{inside} {}", mean(&sums.time));
    }
}

#[test]
fn the_scenes_flights_are_followed_with_the_default_options() {
    for flight in Flight::ALL {
        let mut sums = Sums::default();
        let truths: Vec<Truth> = (0..flight.len())
            .map(|step| {
                let moved = flight.pose(step.saturating_sub(1)).difference_to(&flight.pose(step + 1)) * RATE_HZ;
                let steps = if step == 0 || step + 1 == flight.len() { 1.0 } else { 2.0 };
                Truth {
                    camera_from_target: flight.pose(step),
                    velocity_mps: moved.fixed_rows::<3>(0) / steps,
                    angular_velocity_radps: moved.fixed_rows::<3>(3) / steps,
                }
            })
            .collect();
        for index in 0..40 {
            sums.fly(&demo_camera(), &truths, 0.5, TrackOptions::default(), (flight.name(), index));
        }
        sums.show(flight.name());
        // Smoother than the default process noise allows for, so that the velocities are surer than they say.
        assert!(
            (0.8..1.05).contains(&mean(&sums.pose)) && mean(&sums.all) < 1.0,
            "{} {}",
            mean(&sums.pose),
            mean(&sums.all)
        );
        assert!(sums.flips[0] * 10 < sums.flips[1], "{:?}", sums.flips);
        assert!((0..3).all(|what| sums.squared[0][what] < 0.7 * sums.squared[1][what]), "{:?}", sums.squared);
    }
}
