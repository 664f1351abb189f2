//! One encounter: where the intruder is at any time, and the pose in which the camera sees its constellation.

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::geometry::mount::{BodyFromCamera, body_from_camera};
use crate::geometry::rotation::EulerAngles;
use crate::geometry::space::{Body, Target};
use crate::geometry::{CameraFromTarget, Transform};

/// How the constellation sits on the intruder. Target space is taken as x to the nose, y to the left, z up, as that of the
/// flying wing of [`models`](crate::scene::models), whose markers look down, along -z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mount {
    /// Turned forward, so that -z looks along the intruder's course: seen by whom it comes towards.
    Nose,
    /// As it is: -z looks down, x along the course.
    Belly,
    /// -z always looks to our camera, as by a gimbal: what could be seen if the intruder's attitude were no matter.
    Facing,
}

impl Mount {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Nose, Self::Belly, Self::Facing];

    /// As in requests.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nose => "nose",
            Self::Belly => "belly",
            Self::Facing => "facing",
        }
    }
}

/// Two aircraft in level flight at one speed each. Time zero is that of their closest approach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encounter {
    /// Speed of the own aircraft, m/s.
    pub own_speed_mps: f64,
    /// Of the intruder.
    pub intruder_speed_mps: f64,
    /// Its course from ours, rad, positive to the right.
    pub course_rad: f64,
    /// Where it is when it is nearest, m, if nobody turns.
    pub nearest_m: Vector3<f64>,
    /// Its velocity less ours, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Turns it from level flight along its course to how it flies.
    pub attitude: Rotation3<f64>,
}

impl Encounter {
    /// Where the intruder is, m from us, if nobody turns; before the closest approach at negative times, s.
    #[must_use]
    pub fn position_m(&self, time_s: f64) -> Vector3<f64> {
        self.nearest_m + self.velocity_mps * time_s
    }

    /// Distance at which the two pass if nobody turns, m.
    #[must_use]
    pub fn miss_m(&self) -> f64 {
        self.nearest_m.norm()
    }

    /// Velocity of the intruder against the air, m/s.
    #[must_use]
    pub fn intruder_velocity_mps(&self) -> Vector3<f64> {
        self.velocity_mps + Vector3::x() * self.own_speed_mps
    }

    /// The time, before the closest approach, at which the intruder comes within `range_m`; zero if it never does.
    #[must_use]
    pub fn within_from_s(&self, range_m: f64) -> f64 {
        let along_m = (range_m * range_m - self.nearest_m.norm_squared()).max(0.0).sqrt();
        -along_m / self.velocity_mps.norm()
    }

    /// The pose in which a camera that is mounted so on the own aircraft, level on its course, sees the constellation.
    #[must_use]
    pub fn camera_from_target(&self, time_s: f64, camera: &BodyFromCamera, mount: Mount) -> CameraFromTarget {
        let position = self.position_m(time_s);
        let level_from_intruder = Rotation3::from_axis_angle(&Vector3::z_axis(), self.course_rad) * self.attitude;
        let turn = match mount {
            Mount::Nose => level_from_intruder * body_from_nose_plate(),
            Mount::Belly => level_from_intruder * body_from_belly_plate(),
            Mount::Facing => self.attitude * facing(&position),
        };
        camera.inverse() * Transform::<Body, Target>::new(turn, position)
    }
}

/// The camera in the middle of the aircraft, turned from its course to the right and up by these angles, rad.
#[must_use]
pub fn camera_turned(azimuth_rad: f64, elevation_rad: f64) -> BodyFromCamera {
    body_from_camera(EulerAngles { roll_rad: 0.0, pitch_rad: elevation_rad, yaw_rad: azimuth_rad }, [0.0; 3])
}

/// x forward, y left, z up to x forward, y right, z down.
fn body_from_belly_plate() -> Rotation3<f64> {
    Rotation3::from_matrix_unchecked(Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)))
}

/// -z forward, x up.
fn body_from_nose_plate() -> Rotation3<f64> {
    Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[-Vector3::z(), -Vector3::y(), -Vector3::x()]))
}

/// -z to where we are, seen from `position`, x as far up as that allows.
fn facing(position: &Vector3<f64>) -> Rotation3<f64> {
    let away = position.try_normalize(1e-9).unwrap_or_else(Vector3::x);
    let up = -Vector3::z();
    let nose = (up - away * away.dot(&up)).try_normalize(1e-6).unwrap_or_else(Vector3::y);
    Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[nose, away.cross(&nose), away]))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;
    use crate::geometry::{Point, space};

    fn encounter(course_rad: f64, nearest_m: [f64; 3]) -> Encounter {
        let velocity = Vector3::new(course_rad.cos(), course_rad.sin(), 0.0) * 10.0 - Vector3::x() * 10.0;
        Encounter {
            own_speed_mps: 10.0,
            intruder_speed_mps: 10.0,
            course_rad,
            nearest_m: nearest_m.into(),
            velocity_mps: velocity,
            attitude: Rotation3::identity(),
        }
    }

    /// Which way the markers look and the nose points, in the camera's axes.
    fn axes(encounter: &Encounter, time_s: f64, mount: Mount) -> [Vector3<f64>; 2] {
        let pose = encounter.camera_from_target(time_s, &camera_turned(0.0, 0.0), mount);
        [pose.rotation * -Vector3::z(), pose.rotation * Vector3::x()]
    }

    #[test]
    fn head_on_a_nose_plate_looks_at_the_camera_and_a_belly_plate_down() {
        let coming = encounter(PI, [0.0, 0.0, 2.0]);
        let pose = coming.camera_from_target(-1.0, &camera_turned(0.0, 0.0), Mount::Nose);
        // Twenty metres ahead, two below.
        assert!((pose.translation - Vector3::new(0.0, 2.0, 20.0)).norm() < 1e-9);
        let [looks, nose] = axes(&coming, -1.0, Mount::Nose);
        assert!((looks + Vector3::z()).norm() < 1e-9 && (nose + Vector3::y()).norm() < 1e-9, "{looks} {nose}");
        let [looks, nose] = axes(&coming, -1.0, Mount::Belly);
        assert!((looks - Vector3::y()).norm() < 1e-9 && (nose + Vector3::z()).norm() < 1e-9, "{looks} {nose}");
    }

    #[test]
    fn from_the_right_it_is_seen_to_the_right_and_its_nose_points_left() {
        let crossing = encounter(-FRAC_PI_2, [0.0, 0.0, 0.0]);
        let pose = crossing.camera_from_target(-1.0, &camera_turned(0.0, 0.0), Mount::Belly);
        assert!((pose.translation - Vector3::new(10.0, 0.0, 10.0)).norm() < 1e-9, "{}", pose.translation);
        let [_, nose] = axes(&crossing, -1.0, Mount::Belly);
        assert!((nose + Vector3::x()).norm() < 1e-9, "{nose}");
    }

    #[test]
    fn a_facing_plate_looks_at_the_camera_wherever_it_is() {
        for course_rad in [PI, 2.0, -1.2, 0.3] {
            let encounter = encounter(course_rad, [0.0, 3.0, -5.0]);
            let pose = encounter.camera_from_target(-2.0, &camera_turned(0.0, 0.2), Mount::Facing);
            let camera_in_target = (pose.inverse() * Point::<space::Camera>::from([0.0; 3])).coords;
            assert!((camera_in_target.normalize() + Vector3::z()).norm() < 1e-9, "{camera_in_target}");
            let matrix = pose.rotation.matrix();
            assert!((matrix.determinant() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_camera_that_looks_up_sees_the_level_below_its_middle() {
        let pose = encounter(PI, [0.0; 3]).camera_from_target(-1.0, &camera_turned(0.0, 0.1), Mount::Nose);
        assert!((pose.translation.y / pose.translation.z - 0.1_f64.tan()).abs() < 1e-9);
    }

    #[test]
    fn a_camera_that_looks_aside_has_it_in_its_middle() {
        let crossing = encounter(-FRAC_PI_2, [0.0; 3]);
        let pose = crossing.camera_from_target(-1.0, &camera_turned(0.25 * PI, 0.0), Mount::Belly);
        assert!((pose.translation.normalize() - Vector3::z()).norm() < 1e-9, "{}", pose.translation);
    }

    #[test]
    fn it_comes_within_a_range_when_it_is_there() {
        let passing = encounter(PI, [0.0, 3.0, 4.0]);
        assert!((passing.position_m(passing.within_from_s(60.0)).norm() - 60.0).abs() < 1e-9);
        assert!(passing.within_from_s(4.0).abs() < 1e-12, "it passes at five");
    }
}
