//! Flights with truth, and what a camera makes of them.

use nalgebra::Vector3;
use rand::{Rng, RngExt};

use crate::camera::{Camera, Pixel};
use crate::geometry::{CameraFromTarget, rotation};
use crate::pose::{PoseAnswer, PoseOptions, estimate_pose};
use crate::random::{normal, normal2};
use crate::refine::Correspondence;
pub use crate::scene::cases::seed_camera;
pub use crate::scene::models::wing_six;
use crate::target::Target;
use crate::track::TrackOptions;

/// Frames a second.
pub const RATE_HZ: f64 = 20.0;

/// The truth at one frame.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    pub camera_from_target: CameraFromTarget,
    pub velocity_mps: Vector3<f64>,
    pub angular_velocity_radps: Vector3<f64>,
}

/// Options whose process noise is that of [`wandering`].
pub fn wandering_options() -> TrackOptions {
    TrackOptions {
        acceleration_mps2_per_rthz: 0.5,
        angular_acceleration_radps2_per_rthz: 0.2,
        ..TrackOptions::default()
    }
}

/// How a flight begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// 4 to 12 m away, at less than a metre per second in any direction.
    Near,
    /// 13 to 16 m away, coming at about 3 m/s, to pass by within a metre or two.
    Coming,
}

/// A target that keeps its velocities but for white accelerations of the size that [`wandering_options`] states, all of it in
/// view of the camera and turned to it.
pub fn wandering(rng: &mut impl Rng, start: Start, frames: usize) -> Vec<Truth> {
    let (camera, target, options) = (seed_camera(), wing_six(), wandering_options());
    loop {
        let tilt_rad = rng.random_range(0.0..60.0_f64).to_radians();
        let about: f64 = rng.random_range(0.0..std::f64::consts::TAU);
        let tilt = rotation::exp(&(Vector3::new(about.cos(), about.sin(), 0.0) * tilt_rad));
        let spin = rotation::exp(&(Vector3::z() * rng.random_range(0.0..std::f64::consts::TAU)));
        let (depths_m, aside, closing_mps) = match start {
            Start::Near => (4.0..12.0, 0.3, 0.0),
            Start::Coming => (13.0..16.0, 0.1, 3.0),
        };
        let depth_m = rng.random_range(depths_m);
        let bearing = Vector3::new(rng.random_range(-aside..aside), rng.random_range(-aside..aside), 1.0);
        let mut draw = |sigma: f64| Vector3::from_fn(|_, _| sigma * normal(rng));
        let mut truth = Truth {
            camera_from_target: CameraFromTarget::new(tilt * spin, bearing * depth_m),
            velocity_mps: draw(if start == Start::Near { 0.8 } else { 0.3 }) - bearing * closing_mps,
            angular_velocity_radps: draw(0.15),
        };
        let mut flight = Vec::with_capacity(frames);
        while flight.len() < frames && is_seen(&camera, &target, &truth.camera_from_target) {
            flight.push(truth);
            truth = later(rng, truth, &options);
        }
        if flight.len() == frames {
            return flight;
        }
    }
}

/// One frame later, in small steps.
fn later(rng: &mut impl Rng, mut truth: Truth, options: &TrackOptions) -> Truth {
    let steps = 20;
    let dt_s = 1.0 / RATE_HZ / f64::from(steps);
    for _ in 0..steps {
        let mut kick = |density: f64| Vector3::from_fn(|_, _| density * dt_s.sqrt() * normal(rng));
        let (push, twist) =
            (kick(options.acceleration_mps2_per_rthz), kick(options.angular_acceleration_radps2_per_rthz));
        let pose = truth.camera_from_target;
        // Half of the kick before and half after, so that the step is exact to second order.
        let (velocity, rate) = (truth.velocity_mps + push * 0.5, truth.angular_velocity_radps + twist * 0.5);
        truth = Truth {
            camera_from_target: CameraFromTarget::new(
                rotation::exp(&(rate * dt_s)) * pose.rotation,
                pose.translation + velocity * dt_s,
            ),
            velocity_mps: truth.velocity_mps + push,
            angular_velocity_radps: truth.angular_velocity_radps + twist,
        };
    }
    truth
}

/// All markers in the picture, turned to the camera by 75 degrees at most.
fn is_seen(camera: &Camera, target: &Target, pose: &CameraFromTarget) -> bool {
    target.markers().iter().enumerate().all(|(index, marker)| {
        let is_inside = camera.project(&(*pose * marker.position)).is_some_and(|pixel| camera.contains(&pixel));
        is_inside && target.facing_cosine(index, pose).is_none_or(|cosine| cosine > 0.26)
    })
}

/// The answer to one frame with pixel noise; in all frames the markers are seen beside their places by `bias_px`.
pub fn answer(
    rng: &mut impl Rng,
    camera: &Camera,
    pose: &CameraFromTarget,
    noise_px: f64,
    bias_px: &[Pixel; 6],
) -> Option<PoseAnswer> {
    let seen: Option<Vec<Correspondence>> = wing_six()
        .markers()
        .iter()
        .zip(bias_px)
        .map(|(marker, bias_px)| {
            let pixel = camera.project(&(*pose * marker.position))? + bias_px + normal2(rng) * noise_px;
            Some(Correspondence {
                point: marker.position,
                pixel,
                sigma_px: noise_px.hypot(bias_px.norm() / 2.0_f64.sqrt()),
            })
        })
        .collect();
    let target = wing_six();
    let faces = |pose: &CameraFromTarget| (0..target.markers().len()).all(|index| target.faces_camera(index, pose));
    estimate_pose(camera, &seen?, &PoseOptions::default()).ok()?.restricted(faces).ok()
}
