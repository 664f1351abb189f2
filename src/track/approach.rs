//! Whether a target comes nearer, how fast, when it is nearest and how near that is.

use nalgebra::{Matrix6, Vector3, Vector6};

use super::motion::Motion;

/// A number and its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertain {
    /// The number.
    pub value: f64,
    /// Its standard deviation, in the same unit.
    pub sigma: f64,
}

/// The closest approach of target and camera if both velocities stay as they are; deviations by first-order propagation,
/// that of the time widened for the skew of one over a speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestApproach {
    /// Time until then, s.
    pub time_s: Uncertain,
    /// Distance of the target's origin from the camera then, m. On a collision course, where the distance is smaller than its
    /// uncertainty, the deviation is that across the path in both directions: the distance itself cannot be normal there.
    pub miss_m: Uncertain,
}

/// Why no closest approach is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoApproach {
    /// The target goes away: it was nearest in the past.
    Receding {
        /// Growth of the range, m/s.
        range_rate_mps: Uncertain,
    },
    /// Whether it comes nearer is not known yet, or not at what speed.
    Undetermined {
        /// Shrinking of the range, m/s.
        closing_speed_mps: Uncertain,
        /// Of the velocity in all directions, m/s.
        speed_sigma_mps: f64,
    },
}

/// The closing speed must be this many of its deviations from zero.
const DETERMINED_SIGMAS: f64 = 4.0;

/// The velocity's deviation in all directions may be this share of the speed at most: beyond, first order does not hold.
const MAX_SPEED_SIGMA_RATIO: f64 = 0.2;

impl Motion {
    /// Growth of the distance of the target's origin, m/s. `None` for a target at the camera itself.
    #[must_use]
    pub fn range_rate_mps(&self) -> Option<Uncertain> {
        let position = self.camera_from_target().translation;
        let range_m = position.norm();
        let sight = position.try_normalize(1e-9)?;
        let value = sight.dot(self.velocity_mps());
        let by_position = (self.velocity_mps() - sight * value) / range_m;
        finite(value, self.sigma_along(&by_position, &sight))
    }

    /// Shrinking of that distance, m/s.
    #[must_use]
    pub fn closing_speed_mps(&self) -> Option<Uncertain> {
        self.range_rate_mps().map(|rate| Uncertain { value: -rate.value, sigma: rate.sigma })
    }

    /// When the target is nearest, and how near.
    ///
    /// # Errors
    /// [`NoApproach`] says why there is no such time, or none that can be told.
    pub fn closest_approach(&self) -> Result<ClosestApproach, NoApproach> {
        let speed_sigma_mps = self.velocity_covariance().trace().max(0.0).sqrt();
        let unknown = Uncertain { value: 0.0, sigma: speed_sigma_mps };
        let closing_speed_mps = self.closing_speed_mps().unwrap_or(unknown);
        let undetermined = NoApproach::Undetermined { closing_speed_mps, speed_sigma_mps };
        let (position, velocity) = (self.camera_from_target().translation, *self.velocity_mps());
        let squared = velocity.norm_squared();
        if !(speed_sigma_mps <= MAX_SPEED_SIGMA_RATIO * squared.sqrt()) {
            return Err(undetermined);
        }
        if closing_speed_mps.value < -DETERMINED_SIGMAS * closing_speed_mps.sigma {
            let range_rate_mps = Uncertain { value: -closing_speed_mps.value, sigma: closing_speed_mps.sigma };
            return Err(NoApproach::Receding { range_rate_mps });
        }
        if !(closing_speed_mps.value > DETERMINED_SIGMAS * closing_speed_mps.sigma) {
            return Err(undetermined);
        }
        let time_s = -position.dot(&velocity) / squared;
        let by_position = -velocity / squared;
        let by_velocity = -(position + velocity * (2.0 * time_s)) / squared;
        let first_order_s = self.sigma_along(&by_position, &by_velocity);
        let time = finite(time_s, first_order_s * skew_factor(closing_speed_mps)).ok_or(undetermined)?;
        let miss = self.miss_m(&(position + velocity * time_s), time_s).ok_or(undetermined)?;
        Ok(ClosestApproach { time_s: time, miss_m: miss })
    }

    /// Distance of the nearest point. An error along the path moves the time and not the distance, so only what lies across
    /// counts.
    fn miss_m(&self, nearest: &Vector3<f64>, time_s: f64) -> Option<Uncertain> {
        let miss_m = nearest.norm();
        let path = self.velocity_mps().try_normalize(0.0)?;
        let one = path.cross(&Vector3::ith(path.iamin(), 1.0)).normalize();
        let other = path.cross(&one);
        let [first, second] = [one, other].map(|axis| self.sigma_along(&axis, &(axis * time_s)));
        let across_m = first.hypot(second);
        match nearest.try_normalize(1e-12) {
            Some(away) if miss_m > across_m => finite(miss_m, self.sigma_along(&away, &(away * time_s))),
            _ => finite(miss_m, across_m),
        }
    }

    /// Standard deviation of a number with these derivatives by position and velocity.
    fn sigma_along(&self, by_position: &Vector3<f64>, by_velocity: &Vector3<f64>) -> f64 {
        let all = self.covariance();
        let mut both = Matrix6::zeros();
        for (row, from_row) in [(0, 0), (3, 6)] {
            for (column, from_column) in [(0, 0), (3, 6)] {
                let block = all.fixed_view::<3, 3>(from_row, from_column);
                both.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
            }
        }
        let (p, v) = (by_position, by_velocity);
        let slope = Vector6::new(p.x, p.y, p.z, v.x, v.y, v.z);
        slope.dot(&(both * slope)).max(0.0).sqrt()
    }
}

/// What the second order adds to the deviation of one over a speed: its variance is `(sigma / v^2)^2 (1 + 8 sigma^2 / v^2)`.
fn skew_factor(speed_mps: Uncertain) -> f64 {
    (1.0 + 8.0 * (speed_mps.sigma / speed_mps.value).powi(2)).sqrt()
}

fn finite(value: f64, sigma: f64) -> Option<Uncertain> {
    (value.is_finite() && sigma.is_finite()).then_some(Uncertain { value, sigma })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::CameraFromTarget;
    use crate::track::motion::{Matrix12, Vector12};

    fn motion(position: [f64; 3], velocity: [f64; 3], sigma: f64) -> Motion {
        let pose = CameraFromTarget::new(nalgebra::Rotation3::identity(), position.into());
        let root = Matrix12::from_fn(|r, c| if r == c { sigma } else { 0.1 * sigma / (1.0 + r as f64 + c as f64) });
        Motion::checked(pose, velocity.into(), Vector3::zeros(), &(root * root.transpose())).expect("good numbers")
    }

    #[test]
    fn a_target_that_passes_is_nearest_abeam() {
        let found = motion([3.0, 0.0, 40.0], [0.0, 0.0, -20.0], 0.01).closest_approach().expect("it comes");
        assert!((found.time_s.value - 2.0).abs() < 1e-12 && (found.miss_m.value - 3.0).abs() < 1e-12);
        let away = motion([3.0, 0.0, 40.0], [0.0, 0.0, 20.0], 0.01).closest_approach();
        assert!(matches!(away, Err(NoApproach::Receding { .. })));
        let unknown = motion([3.0, 0.0, 40.0], [0.0, 0.0, -20.0], 10.0).closest_approach();
        assert!(matches!(unknown, Err(NoApproach::Undetermined { .. })));
    }

    proptest! {
        #[test]
        fn deviations_agree_with_central_differences(
            place in proptest::array::uniform3(-5.0..5.0_f64), speed in proptest::array::uniform3(-3.0..3.0_f64)
        ) {
            let motion = motion([place[0], place[1], 40.0], [speed[0], speed[1], -20.0], 0.01);
            let found = motion.closest_approach().expect("it comes");
            prop_assume!(found.miss_m.value > 0.5);
            let size = 1e-5;
            let (mut rate, mut time, mut miss) = (Vector12::zeros(), Vector12::zeros(), Vector12::zeros());
            for axis in 0..12 {
                let moved = |size: f64| motion.moved(&Vector12::ith(axis, size), motion.covariance()).expect("finite");
                let (ahead, behind) = (moved(size), moved(-size));
                let [one, other] = [ahead, behind].map(|m| m.range_rate_mps().expect("far").value);
                rate[axis] = (one - other) / (2.0 * size);
                let [one, other] = [ahead, behind].map(|m| m.closest_approach().expect("it comes"));
                time[axis] = (one.time_s.value - other.time_s.value) / (2.0 * size);
                miss[axis] = (one.miss_m.value - other.miss_m.value) / (2.0 * size);
            }
            let sigma = |slope: &Vector12| slope.dot(&(motion.covariance() * slope)).sqrt();
            prop_assert!((motion.range_rate_mps().expect("far").sigma - sigma(&rate)).abs() < 1e-7);
            let widened = sigma(&time) * skew_factor(motion.closing_speed_mps().expect("far"));
            prop_assert!((found.time_s.sigma - widened).abs() < 1e-7);
            prop_assert!((found.miss_m.sigma - sigma(&miss)).abs() < 1e-6);
        }
    }
}
