//! The seed's two encounters as a camera on the own aircraft sees them, cut to the stretch in which six discs of 30 mm can be
//! told apart: nearer and slower than two aircraft that pass each other.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Rotation3, Vector3};

use crate::geometry::{CameraFromTarget, rotation};

/// A flight of [`wing_six`](super::models::wing_six) before [`demo_camera`](super::models::demo_camera), in steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flight {
    /// The target comes straight at the camera from 11.5 m to 2 m and rocks a little.
    HeadOn,
    /// The target crosses the view from left to right in a banked turn, 8 m to 5 m away.
    Crossing,
}

impl Flight {
    /// Both of them.
    pub const ALL: [Self; 2] = [Self::HeadOn, Self::Crossing];

    /// Steps a second at which the flights look natural.
    pub const RATE_HZ: f64 = 20.0;

    /// The flight's name, which is that of the seed's scenario.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::HeadOn => "head-on",
            Self::Crossing => "crossing",
        }
    }

    /// The flight of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|flight| flight.name() == name)
    }

    /// Number of steps.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "no flight is empty")]
    pub const fn len(self) -> usize {
        match self {
            Self::HeadOn => 200,
            Self::Crossing => 160,
        }
    }

    /// Where the target is at a step; after the last it stays where it is.
    #[must_use]
    pub fn pose(self, step: usize) -> CameraFromTarget {
        let last = self.len() - 1;
        let progress = step.min(last) as f64 / last as f64;
        match self {
            Self::HeadOn => head_on(progress),
            Self::Crossing => crossing(progress),
        }
    }
}

/// Constant bearing, which is what makes it a collision course; the nose points down in the picture and to the camera.
fn head_on(progress: f64) -> CameraFromTarget {
    let depth_m = 11.5 + (2.0 - 11.5) * progress;
    let sway = |waves: f64, phase: f64| (TAU * waves * progress + phase).sin();
    let bearing = Vector3::new(-0.05 + 0.02 * sway(1.5, 0.0), -0.04 + 0.015 * sway(2.0, 1.0), 1.0);
    let nose_up = about(Vector3::x(), -27.0 - 9.0 * sway(2.5, 0.4));
    let bank = about(Vector3::y(), 9.0 * sway(2.0, 0.0));
    let heading = about(Vector3::z(), FRAC_PI_2.to_degrees() + 7.0 * sway(1.5, 0.9));
    CameraFromTarget::new(nose_up * bank * heading, bearing * depth_m)
}

/// From left to right, nearest in the middle, the underside banked towards the camera.
fn crossing(progress: f64) -> CameraFromTarget {
    let depth_m = 8.0 - 3.0 * (PI * progress).sin();
    let across = -0.48 + 0.96 * progress;
    let bearing = Vector3::new(across, 0.06 - 0.12 * progress, 1.0);
    let bank = about(Vector3::x(), 24.0 - 8.0 * (TAU * progress).cos());
    let climb = about(Vector3::z(), -6.0 + 10.0 * (TAU * 0.8 * progress).sin());
    CameraFromTarget::new(bank * climb, bearing * depth_m)
}

fn about(axis: Vector3<f64>, degrees: f64) -> Rotation3<f64> {
    rotation::exp(&(axis * degrees.to_radians()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Decoding, Frame};
    use crate::pipeline::{Options, estimate};
    use crate::random::case;
    use crate::scene::render::{Optics, Sky, render};
    use crate::scene::truth::{Sight, truth};
    use crate::scene::{encode, models};

    #[test]
    fn all_the_way_the_marked_side_is_turned_to_the_camera_and_in_view() {
        let (camera, model) = (models::demo_camera(), models::wing());
        for flight in Flight::ALL {
            for step in 0..flight.len() {
                let pose = flight.pose(step);
                for (index, marker) in truth(&camera, &pose, &model).iter().enumerate() {
                    let at = format!("{} step {step} marker {index}", flight.name());
                    let cosine = model.target.facing_cosine(index, &pose).expect("has a normal");
                    let tilt = cosine.acos().to_degrees();
                    assert!((5.0..=45.0).contains(&tilt), "{at}: tilt {tilt}");
                    let depth = (pose * model.target.markers()[index].position).coords.z;
                    let radius = 0.03 * 1000.0 / depth;
                    assert!((2.5..=20.0).contains(&radius), "{at}: radius {radius}");
                    let pixel = marker.centroid.expect("in view");
                    assert_eq!(marker.sight, Sight::Whole, "{at}");
                    assert!((25.0..1255.0).contains(&pixel.x) && (25.0..695.0).contains(&pixel.y), "{at}: {pixel}");
                }
            }
        }
    }

    #[test]
    fn a_flight_is_smooth_and_ends_where_it_ends() {
        for flight in Flight::ALL {
            for step in 1..flight.len() {
                let moved = flight.pose(step - 1).difference_to(&flight.pose(step));
                // At most 3 m/s and 60 degrees a second.
                assert!(moved.fixed_rows::<3>(0).norm() < 0.15, "{} {step}", flight.name());
                assert!(moved.fixed_rows::<3>(3).norm() < 0.053, "{} {step}", flight.name());
            }
            assert_eq!(flight.pose(usize::MAX), flight.pose(flight.len() - 1));
            assert_eq!(Flight::named(flight.name()), Some(flight));
        }
        let [from, to] = [0, usize::MAX].map(|step| Flight::HeadOn.pose(step).translation.norm());
        assert!(from > 11.0 && to < 2.1);
    }

    #[test]
    fn the_pipeline_finds_the_pose_along_the_way() {
        let (camera, model) = (models::demo_camera(), models::wing());
        let targets = [model.target.clone()];
        for flight in Flight::ALL {
            for step in [0, flight.len() / 2, flight.len() - 1] {
                let (pose, mut rng) = (flight.pose(step), case(flight.name(), step as u64));
                let taken = render(&camera, &pose, &model, &Sky::fair(7, [0.0; 2]), &Optics::default(), &mut rng);
                let bytes = encode::jpeg(&taken, 92).expect("fits");
                let frame = Frame::decode(&bytes, &Decoding::default()).expect("decodes");
                let found = estimate(&frame, &camera, &targets, &Options::default(), |_| ()).expect("of this camera");
                let at = format!("{} step {step}", flight.name());
                let answer = found.targets[0].answer.as_ref().unwrap_or_else(|reason| panic!("{at}: {reason}"));
                let error = std::iter::once(&answer.best)
                    .chain(&answer.alternatives)
                    .map(|e| e.covariance.normalized_error_squared(&e.camera_from_target, &pose))
                    .fold(f64::INFINITY, f64::min);
                // Chi-square with six degrees of freedom passes 35 once in 250 000.
                assert!(error < 35.0, "{at}: squared error {error:.1}");
            }
        }
    }
}
