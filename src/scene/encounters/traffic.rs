//! What encounters are drawn from.

use nalgebra::Vector3;
use rand::{Rng, RngExt};

use super::course::Encounter;
use crate::geometry::rotation;
use crate::random::normal;

/// Ranges from which encounters are drawn, each number evenly on its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traffic {
    /// Least and largest speed of the own aircraft, m/s.
    pub own_speed_mps: [f64; 2],
    /// Of the intruder.
    pub intruder_speed_mps: [f64; 2],
    /// The intruder's course from ours, rad, positive to the right: pi comes towards us.
    pub course_rad: [f64; 2],
    /// Distance at which the two pass each other if nobody turns, m; evenly in distance, so that close ones are as many as far
    /// ones, on any side of us, above and below.
    pub miss_m: [f64; 2],
    /// Standard deviation of the intruder's roll, pitch and yaw from level flight along its course, rad, once for each encounter.
    pub attitude_sigma_rad: f64,
}

/// Encounters slower than this have no end worth waiting for, m/s.
pub const MIN_RELATIVE_SPEED_MPS: f64 = 0.5;

/// How often an encounter is drawn anew until the two close.
const ATTEMPTS: u32 = 100;

impl Traffic {
    /// An encounter. `None` if these ranges hardly hold one in which the two close.
    pub fn draw(&self, rng: &mut impl Rng) -> Option<Encounter> {
        for _ in 0..ATTEMPTS {
            let [own_speed_mps, intruder_speed_mps, course_rad, miss_m] =
                [self.own_speed_mps, self.intruder_speed_mps, self.course_rad, self.miss_m]
                    .map(|range| within(range, rng));
            let side_rad = within([0.0, std::f64::consts::TAU], rng);
            let turn = Vector3::from_fn(|_, _| normal(rng)) * self.attitude_sigma_rad;
            let (sine, cosine) = course_rad.sin_cos();
            let velocity_mps = Vector3::new(cosine, sine, 0.0) * intruder_speed_mps - Vector3::x() * own_speed_mps;
            let Some(along) = velocity_mps.try_normalize(MIN_RELATIVE_SPEED_MPS) else { continue };
            // Across the path: level, and down.
            let (level, down) = (Vector3::new(-along.y, along.x, 0.0), Vector3::z());
            return Some(Encounter {
                own_speed_mps,
                intruder_speed_mps,
                course_rad,
                nearest_m: (level * side_rad.cos() + down * side_rad.sin()) * miss_m,
                velocity_mps,
                attitude: rotation::exp(&turn),
            });
        }
        None
    }
}

fn within([low, high]: [f64; 2], rng: &mut impl Rng) -> f64 {
    low + (high - low) * rng.random_range(0.0..1.0)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::random::case;

    const OPEN: Traffic = Traffic {
        own_speed_mps: [8.0, 12.0],
        intruder_speed_mps: [8.0, 15.0],
        course_rad: [0.5 * PI, 1.5 * PI],
        miss_m: [0.0, 9.0],
        attitude_sigma_rad: 0.05,
    };

    #[test]
    fn a_drawn_encounter_passes_at_the_drawn_distance_and_is_nearest_at_time_zero() {
        let mut inside = 0;
        for index in 0..500 {
            let encounter = OPEN.draw(&mut case("passes", index)).expect("they close");
            let gap = |time_s: f64| encounter.position_m(time_s).norm();
            let miss_m = gap(0.0);
            assert!(miss_m <= 9.0 && gap(-0.1) > miss_m && gap(0.1) > miss_m, "{encounter:?}");
            let speeds = encounter.intruder_velocity_mps().norm() - encounter.intruder_speed_mps;
            assert!(speeds.abs() < 1e-12);
            inside += usize::from(miss_m < 3.0);
        }
        // A third of them, within four deviations of a share of 500.
        assert!((124..=210).contains(&inside), "{inside}");
    }

    #[test]
    fn side_by_side_at_one_speed_there_is_no_encounter() {
        let along = Traffic { own_speed_mps: [10.0; 2], intruder_speed_mps: [10.0; 2], course_rad: [0.0; 2], ..OPEN };
        assert_eq!(along.draw(&mut case("beside", 0)), None);
    }
}
