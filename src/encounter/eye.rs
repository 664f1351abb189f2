//! A camera that looks out of our aircraft, and how large another one is in its picture.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use nalgebra::{Rotation3, Vector3};

use super::error::EncounterError;
use crate::camera::{Camera, Pixel};
use crate::geometry::mount::body_from_camera;
use crate::geometry::{EulerAngles, Point};

/// The angle that a width fills at a distance, rad: exactly `2 atan(w / 2d)`; the thesis has `w / d`.
#[must_use]
pub fn arc_width_rad(width_m: f64, distance_m: f64) -> f64 {
    2.0 * (0.5 * width_m).atan2(distance_m)
}

/// A camera on our aircraft, turned from its course.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    camera: Camera,
    azimuth_rad: f64,
    elevation_rad: f64,
    camera_from_level: Rotation3<f64>,
}

/// An aircraft in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Where its centre is, px, the lens included; `None` where the lens has no place for it.
    pub pixel: Option<Pixel>,
    /// Whether that is on the picture.
    pub is_in_picture: bool,
    /// Its width and its height in the picture, px; in the middle of the picture if it is not on it.
    pub size_px: [f64; 2],
    /// Area of its silhouette, px: of the ellipse in its box.
    pub area_px: f64,
}

impl Eye {
    /// Turned to the right by `azimuth_rad` and up by `elevation_rad`, its picture upright.
    ///
    /// # Errors
    /// Names the angle that is none.
    pub fn checked(camera: Camera, azimuth_rad: f64, elevation_rad: f64) -> Result<Self, EncounterError> {
        let limits = [("camera_azimuth_rad", azimuth_rad, PI), ("camera_elevation_rad", elevation_rad, FRAC_PI_2)];
        // Degrees that were turned into radians may be off by rounding.
        if let Some((field, value, max)) = limits.into_iter().find(|(_, value, max)| !(value.abs() <= max + 1e-9)) {
            return Err(EncounterError::Angle { field, value, min: -max, max });
        }
        let turned = EulerAngles { roll_rad: 0.0, pitch_rad: elevation_rad, yaw_rad: azimuth_rad };
        let camera_from_level = body_from_camera(turned, [0.0; 3]).rotation.inverse();
        Ok(Self { camera, azimuth_rad, elevation_rad, camera_from_level })
    }

    /// The camera.
    #[must_use]
    pub const fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Azimuth and elevation of its optical axis, rad.
    #[must_use]
    pub const fn axis_rad(&self) -> [f64; 2] {
        [self.azimuth_rad, self.elevation_rad]
    }

    /// Where a direction of our level axes is seen; `None` where it is not on the picture.
    #[must_use]
    pub fn pixel(&self, direction: &Vector3<f64>) -> Option<Pixel> {
        let pixel = self.camera.project(&Point::from(self.camera_from_level * direction))?;
        // A lens model may give a place to what the lens does not reach: it must lead back.
        let back = self.camera.unproject(&pixel)?;
        let seen = Vector3::new(back.x, back.y, 1.0);
        let straight = self.camera_from_level * direction;
        (self.camera.contains(&pixel) && seen.angle(&straight) < 1e-6).then_some(pixel)
    }

    /// Azimuth and elevation of a pixel from our course and the level, rad; `None` where the lens has no ray.
    #[must_use]
    pub fn direction_rad(&self, pixel: &Pixel) -> Option<[f64; 2]> {
        let d = self.camera_from_level.inverse() * self.camera.bearing(pixel)?;
        Some([d.y.atan2(d.x), (-d.z).atan2(d.x.hypot(d.y))])
    }

    /// An aircraft of this width and height, m, at this place of our level axes, as it is seen square to the line of sight.
    #[must_use]
    pub fn sighting(&self, position_m: &Vector3<f64>, [width_m, height_m]: [f64; 2]) -> Sighting {
        let seen = self.pixel(position_m);
        let place = if seen.is_some() { *position_m } else { self.middle() * position_m.norm() };
        let [across, up] = square_to(&place);
        let length = |half: Vector3<f64>| {
            let end = |sign: f64| self.camera.project(&Point::from(self.camera_from_level * (place + half * sign)));
            // Where an end has no image, so near or so near the rim, the centre's scale stands for it.
            end(1.0)
                .zip(end(-1.0))
                .map_or_else(|| self.scaled_px(half.norm() * 2.0, place.norm()), |(a, b)| (a - b).norm())
        };
        let size_px = [length(across * (0.5 * width_m)), length(up * (0.5 * height_m))];
        Sighting {
            pixel: seen.or_else(|| self.camera.project(&Point::from(self.camera_from_level * position_m))),
            is_in_picture: seen.is_some(),
            size_px,
            area_px: FRAC_PI_4 * size_px[0] * size_px[1],
        }
    }

    /// The direction of the middle of the picture.
    fn middle(&self) -> Vector3<f64> {
        let middle = [self.camera.width(), self.camera.height()].map(|side| 0.5 * (f64::from(side) - 1.0));
        self.camera_from_level.inverse() * self.camera.bearing(&middle.into()).unwrap_or_else(Vector3::z)
    }

    /// By the focal lengths alone.
    fn scaled_px(&self, size_m: f64, distance_m: f64) -> f64 {
        let [fx, fy] = self.camera.focal_lengths();
        (fx * fy).sqrt() * size_m / distance_m
    }
}

/// Unit vectors across and up, square to a line of sight.
fn square_to(place: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let flat = Vector3::new(-place.y, place.x, 0.0);
    let across = flat.try_normalize(1e-9 * place.norm()).unwrap_or_else(Vector3::y);
    [across, place.cross(&across).normalize()]
}
