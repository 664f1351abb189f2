//! Where a point stands as seen from the camera.

use super::point::Point;
use super::space;

/// Range and direction of a point in the camera's space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// Distance from the camera's centre, metres.
    pub range_m: f64,
    /// `atan2(x, z)`: positive to the right.
    pub azimuth_rad: f64,
    /// `atan2(-y, hypot(x, z))`: positive up.
    pub elevation_rad: f64,
}

impl Direction {
    /// The direction to `point`.
    #[must_use]
    pub fn of(point: Point<space::Camera>) -> Self {
        let (x, y, z) = (point.coords.x, point.coords.y, point.coords.z);
        Self { range_m: point.coords.norm(), azimuth_rad: x.atan2(z), elevation_rad: (-y).atan2(x.hypot(z)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_is_positive_azimuth_and_up_is_positive_elevation() {
        let right_and_up = Direction::of(Point::new(1.0, -1.0, 1.0));
        assert!((right_and_up.azimuth_rad - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
        assert!((right_and_up.elevation_rad - 1.0_f64.atan2(2.0_f64.sqrt())).abs() < 1e-15);
        assert!((right_and_up.range_m - 3.0_f64.sqrt()).abs() < 1e-15);
    }
}
