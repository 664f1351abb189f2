//! What is left to do about a target that is tracked.

use nalgebra::{Matrix6, Rotation3};

use super::approach::RelativeState;
use super::avoid::{LatestTurn, NoTurn};
use super::delays::Delays;
use super::left::time_left;
use super::manoeuvre::Manoeuvre;
use crate::track::{Motion, NoApproach, Uncertain};

/// What our aircraft can do, and what passes before it does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Means {
    /// Our speed, m/s, above zero.
    pub own_speed_mps: f64,
    /// The turn.
    pub manoeuvre: Manoeuvre,
    /// Until the turn begins.
    pub delays: Delays,
    /// How the camera is turned on our aircraft, which flies level along its own x.
    pub body_from_camera: Rotation3<f64>,
}

/// What is left to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToAct {
    /// The turn clears if it is set about in this time.
    Turn {
        /// From the moment of the track until it must be set about, s; negative where that is past.
        time_s: Uncertain,
        /// The turn.
        turn: LatestTurn,
    },
    /// It goes away, or passes far enough without a turn, by two deviations at least.
    NoConflict,
    /// It is inside the miss distance, or no such turn leads so far.
    TooLate,
    /// Whether it comes nearer is not known yet, or not at what speed, or not whether it passes far enough.
    Undetermined,
}

/// It passes far enough if it does by so many deviations.
const SURE: f64 = 2.0;

/// What is left to do about a target that moves so against our camera, if its velocity against ours stays as it is. The camera must not
/// turn: what it does itself is in the motion.
#[must_use]
pub fn to_act(motion: &Motion, means: &Means) -> ToAct {
    let passes_m = match motion.closest_approach() {
        Err(NoApproach::Receding { .. }) => return ToAct::NoConflict,
        Err(NoApproach::Undetermined { .. }) => return ToAct::Undetermined,
        Ok(approach) => approach.miss_m,
    };
    let turn = means.body_from_camera;
    let place = turn * motion.camera_from_target().translation;
    let Ok(state) = RelativeState::checked(place, turn * motion.velocity_mps()) else { return ToAct::Undetermined };
    match time_left(&state, &covariance(motion, &turn), means.own_speed_mps, &means.manoeuvre) {
        Ok(left) => {
            let Uncertain { value, sigma } = left.time_s;
            let time_s = Uncertain { value: value - means.delays.total_s(), sigma };
            if time_s.value.is_finite() && sigma.is_finite() {
                ToAct::Turn { time_s, turn: left.turn }
            } else {
                ToAct::Undetermined
            }
        }
        Err(NoTurn::NeverClosing { .. }) => ToAct::NoConflict,
        Err(NoTurn::NotNeeded { .. }) => {
            let is_sure = passes_m.value - SURE * passes_m.sigma >= means.manoeuvre.miss_distance_m();
            if is_sure { ToAct::NoConflict } else { ToAct::Undetermined }
        }
        Err(NoTurn::InsideMissDistance { .. } | NoTurn::Unreachable { .. }) => ToAct::TooLate,
    }
}

/// Of place and velocity together, along our aircraft's axes.
fn covariance(motion: &Motion, turn: &Rotation3<f64>) -> Matrix6<f64> {
    let all = motion.covariance();
    let mut both = Matrix6::zeros();
    for (row, from_row) in [(0, 0), (3, 6)] {
        for (column, from_column) in [(0, 0), (3, 6)] {
            both.fixed_view_mut::<3, 3>(row, column).copy_from(&all.fixed_view::<3, 3>(from_row, from_column));
        }
    }
    // Both are vectors, and turn alike.
    let mut turned = Matrix6::zeros();
    for at in [0, 3] {
        turned.fixed_view_mut::<3, 3>(at, at).copy_from(turn.matrix());
    }
    turned * both * turned.transpose()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::print_stdout, reason = "a test shows its figures")]

    use std::f64::consts::FRAC_PI_4;
    use std::time::Duration;

    use nalgebra::Vector3;
    use rand::{Rng, RngExt};

    use super::*;
    use crate::camera::Pixel;
    use crate::geometry::mount::body_from_forward_camera;
    use crate::geometry::{CameraFromTarget, rotation};
    use crate::pose::{PoseAnswer, PoseOptions, estimate_pose};
    use crate::random::{case, normal, normal2};
    use crate::refine::Correspondence;
    use crate::scene::cases::seed_camera;
    use crate::scene::models::wing_six;
    use crate::track::{TrackOptions, Tracker};

    const RATE_HZ: f64 = 20.0;

    /// Small and slow, so that a wing of a metre is seen from far enough: 3 m/s each, a miss distance of 2 m.
    fn means() -> Means {
        Means {
            own_speed_mps: 3.0,
            manoeuvre: Manoeuvre::checked(FRAC_PI_4, 2.0).expect("a turn"),
            delays: Delays::checked(0.0, 0.0, 0.1, 0.2).expect("times"),
            body_from_camera: body_from_forward_camera(),
        }
    }

    fn seen(rng: &mut impl Rng, pose: &CameraFromTarget, sigma_px: f64) -> PoseAnswer {
        let seen: Vec<Correspondence> = wing_six()
            .markers()
            .iter()
            .map(|marker| {
                let pixel: Pixel = seed_camera().project(&(*pose * marker.position)).expect("in view");
                Correspondence { point: marker.position, pixel: pixel + normal2(rng) * sigma_px, sigma_px }
            })
            .collect();
        estimate_pose(&seed_camera(), &seen, &PoseOptions::default()).expect("a pose")
    }

    /// A flight of a target that is there and moves so, but for white accelerations: what is to be done at the end of it by track and by
    /// truth.
    fn flown(
        rng: &mut impl Rng,
        mut place: Vector3<f64>,
        mut velocity: Vector3<f64>,
        means: &Means,
    ) -> Option<[ToAct; 2]> {
        let options = TrackOptions { acceleration_mps2_per_rthz: 0.3, ..TrackOptions::default() };
        let mut tracker = Tracker::new(options).expect("good options");
        let attitude = rotation::exp(&Vector3::new(0.5, 0.3, 0.2));
        let mut last = None;
        for frame in 0..40 {
            let answer = seen(rng, &CameraFromTarget::new(attitude, place), 0.2);
            let stamp = Duration::from_secs_f64(1000.0 + f64::from(frame) / RATE_HZ);
            let report = tracker.step(stamp, Some(&answer)).expect("later");
            last = report.believed().next().map(|track| to_act(&track.best().motion, means));
            if frame == 39 {
                let turn = means.body_from_camera;
                let state = RelativeState::checked(turn * place, turn * velocity).expect("an encounter");
                let truth = match time_left(&state, &Matrix6::zeros(), means.own_speed_mps, &means.manoeuvre) {
                    Ok(left) => {
                        let value = left.time_s.value - means.delays.total_s();
                        ToAct::Turn { time_s: Uncertain { value, sigma: 0.0 }, turn: left.turn }
                    }
                    Err(_) => ToAct::NoConflict,
                };
                return Some([last?, truth]);
            }
            let push = Vector3::from_fn(|_, _| 0.3 * normal(rng)) / RATE_HZ.sqrt();
            place += (velocity + push * 0.5) / RATE_HZ;
            velocity += push;
        }
        last.map(|last| [last, last])
    }

    #[test]
    fn the_time_left_is_as_far_off_as_it_says() {
        let means = means();
        let (mut squared, mut count, mut inside, mut others) = (0.0, 0_u32, 0_u32, 0_u32);
        for index in 0..300 {
            let mut rng = case("time left", index);
            // Head on, or nearly, twenty metres away: nearest after some three seconds from the start.
            let place =
                Vector3::new(rng.random_range(-0.5..0.5), rng.random_range(-0.3..0.3), rng.random_range(18.0..24.0));
            let velocity =
                Vector3::new(rng.random_range(-0.1..0.1), rng.random_range(-0.1..0.1), -rng.random_range(4.5..6.0));
            match flown(&mut rng, place, velocity, &means) {
                Some([ToAct::Turn { time_s, .. }, ToAct::Turn { time_s: truth, .. }]) => {
                    let off = (time_s.value - truth.value) / time_s.sigma;
                    squared += off * off;
                    count += 1;
                    inside += u32::from(off.abs() < 1.96);
                }
                _ => others += 1,
            }
        }
        let (mean, inside) = (squared / f64::from(count), f64::from(inside) / f64::from(count));
        println!(
            "{count} flights, {others} others; squared error {mean:.3} of what it says, inside of 95 %: {inside:.3}"
        );
        // Of the others most pass far enough.
        assert!(count > 150, "{count} {others}");
        // Three deviations of a mean of squares of so many normal variables are 0.25; first order and the track's own few percent beside.
        assert!((0.65..1.35).contains(&mean) && (0.9..0.985).contains(&inside), "{mean} {inside}");
    }

    #[test]
    fn what_may_still_come_too_near_is_no_case_of_no_conflict() {
        let means = means();
        let (mut calm, mut wrong, mut open) = (0_u32, 0_u32, 0_u32);
        for index in 0..200 {
            let mut rng = case("grazing", index);
            // Its course passes at about the miss distance of 2 m.
            let place = Vector3::new(rng.random_range(1.6..2.4), 0.0, rng.random_range(18.0..24.0));
            let velocity = Vector3::new(0.0, 0.0, -rng.random_range(4.5..6.0));
            let Some([found, truth]) = flown(&mut rng, place, velocity, &means) else { continue };
            calm += u32::from(found == ToAct::NoConflict);
            wrong += u32::from(found == ToAct::NoConflict && truth != ToAct::NoConflict);
            open += u32::from(found == ToAct::Undetermined);
        }
        println!("no conflict {calm}, of them wrong {wrong}, undetermined {open}");
        // Two deviations on one side are 2.3 %.
        assert!(calm > 20 && open > 10, "{calm} {open}");
        assert!(f64::from(wrong) <= 0.05 * f64::from(calm), "{wrong} of {calm}");
    }

    #[test]
    fn what_is_no_conflict_or_too_late_says_so() {
        let means = means();
        let at = |name: &str, place: [f64; 3], velocity: [f64; 3], means: &Means| {
            let found = flown(&mut case(name, 0), place.into(), velocity.into(), means).expect("tracked");
            found[0]
        };
        let away = at("away", [0.0, 0.0, 6.0], [0.0, 0.0, 2.5], &means);
        assert_eq!(away, ToAct::NoConflict);
        let beside = at("beside", [4.0, 0.0, 22.0], [0.6, 0.0, -6.0], &means);
        assert_eq!(beside, ToAct::NoConflict);
        let wide = Means { manoeuvre: Manoeuvre::checked(FRAC_PI_4, 40.0).expect("a turn"), ..means };
        assert_eq!(at("near", [0.0, 0.0, 20.0], [0.0, 0.0, -5.0], &wide), ToAct::TooLate);
        let still = at("still", [0.5, 0.0, 12.0], [0.0; 3], &means);
        assert_eq!(still, ToAct::Undetermined);
        // With a decision of a minute it is past, and the number says by how much.
        let slow = Means { delays: Delays::checked(0.0, 0.0, 0.0, 60.0).expect("times"), ..means };
        match at("slow", [0.0, 0.0, 20.0], [0.0, 0.0, -5.0], &slow) {
            ToAct::Turn { time_s, .. } => assert!(time_s.value < -50.0 && time_s.value > -60.0, "{time_s:?}"),
            other => panic!("{other:?}"),
        }
    }
}
