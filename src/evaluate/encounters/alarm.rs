//! When the system gives an alarm, and to which side the own aircraft then turns: by what the track says, and nothing else.

use nalgebra::Vector3;

use crate::encounter::{Manoeuvre, RelativeState, Side, latest_turn, miss_if_turned_now_m};
use crate::geometry::BodyFromCamera;
use crate::track::Track;

/// When an alarm is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alarm {
    /// Time from the frame that gives the alarm to the beginning of the turn, s: computing, link, decision.
    pub delay_s: f64,
    /// The track must not lead past us by the miss distance and so many of its own deviations. The more, the earlier, and the more
    /// often for nothing.
    pub sigmas: f64,
    /// How long before the last moment for the turn it is given, s; as soon as the track leads to us, if that is not said.
    pub lead_s: Option<f64>,
}

/// An alarm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alert {
    /// Of the frame, s; negative before the closest approach.
    pub time_s: f64,
    /// Where the track has the intruder then, and how it moves, in our level axes.
    pub believed: RelativeState,
    /// To which side we turn.
    pub side: Side,
}

impl Alarm {
    /// The alarm that a believed track gives, if it gives one.
    #[must_use]
    pub fn of(
        &self,
        track: &Track,
        time_s: f64,
        camera: &BodyFromCamera,
        own_speed_mps: f64,
        manoeuvre: &Manoeuvre,
    ) -> Option<Alert> {
        let motion = &track.best().motion;
        let approach = motion.closest_approach().ok()?;
        if !(approach.miss_m.value - self.sigmas * approach.miss_m.sigma < manoeuvre.miss_distance_m()) {
            return None;
        }
        let position = (*camera * *motion.camera_from_target()).translation;
        let believed = RelativeState::checked(position, camera.rotation * motion.velocity_mps()).ok()?;
        if let Some(lead_s) = self.lead_s {
            // Where no turn is needed by the middle of what is believed, its rim is near: no time is to be lost.
            let needed_s = latest_turn(&believed, own_speed_mps, manoeuvre).map_or(f64::INFINITY, |turn| turn.time_s);
            if approach.time_s.value > needed_s + self.delay_s + lead_s {
                return None;
            }
        }
        let side = self.side(&believed, own_speed_mps, manoeuvre);
        Some(Alert { time_s, believed, side })
    }

    /// The side on which what is believed leaves more room when the turn begins; the right where both do, as the rules of the air
    /// have it.
    fn side(&self, believed: &RelativeState, own_speed_mps: f64, manoeuvre: &Manoeuvre) -> Side {
        if manoeuvre.side() != Side::Either {
            return manoeuvre.side();
        }
        let then: Vector3<f64> = believed.position_m() + believed.velocity_mps() * self.delay_s;
        let Ok(then) = RelativeState::checked(then, *believed.velocity_mps()) else { return Side::Right };
        let room_m = |side| miss_if_turned_now_m(&then, own_speed_mps, &manoeuvre.to(side));
        if room_m(Side::Left) > room_m(Side::Right) { Side::Left } else { Side::Right }
    }
}
