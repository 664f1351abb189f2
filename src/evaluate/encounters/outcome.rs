//! What came of one encounter.

use nalgebra::Vector3;

use super::lookout::{Lookout, is_seen};
use super::study::EncounterStudy;
use crate::encounter::{NoTurn, RelativeState, latest_turn, miss_if_turned_now_m};
use crate::evaluate::numbers::Numbers;
use crate::scene::encounters::Encounter;

/// What came of one encounter. Times are counted back from the closest approach if nobody turns, s: more is earlier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Its number.
    pub number: u64,
    /// Speed of the own aircraft, m/s.
    pub own_speed_mps: f64,
    /// Of the intruder.
    pub intruder_speed_mps: f64,
    /// Its course from ours, rad.
    pub course_rad: f64,
    /// How fast the two come together: their relative speed, m/s.
    pub relative_speed_mps: f64,
    /// Distance at which they pass if nobody turns, m.
    pub unavoided_miss_m: f64,
    /// The same when the own aircraft turns as it was told to; the one above if it was not, or too late for any turn.
    pub miss_m: f64,
    /// The last moment for the alarm: the last one for the turn, and the delay before it. `None` if no turn is needed, or none helps.
    pub needed_s: Option<f64>,
    /// Whether they pass within the miss distance if nobody turns, so that an alarm is due.
    pub is_conflict: bool,
    /// The intruder's middle came into the picture.
    pub in_view: Option<Moment>,
    /// The first blob that is a marker of it.
    pub seen: Option<Moment>,
    /// The first pose.
    pub posed: Option<Moment>,
    /// The first frame in which a track of it is believed.
    pub tracked: Option<Moment>,
    /// The alarm.
    pub alert: Option<Moment>,
    /// By how much the position that was believed at the alarm was off, m.
    pub alert_error_m: Option<f64>,
    /// Frames that were looked at.
    pub frames: u64,
}

/// A moment of an encounter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Time left to the closest approach, s.
    pub time_s: f64,
    /// Distance of the two, m.
    pub range_m: f64,
}

/// How far an encounter got.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Never in the picture.
    OutOfView,
    /// In the picture, and no marker found.
    InView,
    /// Markers found, but never a pose.
    Seen,
    /// Poses, but never a track that is believed.
    Posed,
    /// Tracked, but without alarm.
    Tracked,
    /// With an alarm.
    Alerted,
}

impl Stage {
    /// All of them, in their order.
    pub const ALL: [Self; 6] = [Self::OutOfView, Self::InView, Self::Seen, Self::Posed, Self::Tracked, Self::Alerted];

    /// As in results.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::OutOfView => "out_of_view",
            Self::InView => "in_view",
            Self::Seen => "seen",
            Self::Posed => "posed",
            Self::Tracked => "tracked",
            Self::Alerted => "alerted",
        }
    }
}

/// What an encounter's alarm, or the lack of it, was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Due, and in time for the turn.
    Timely,
    /// Due, and too late for the turn to clear by the miss distance, or no turn could.
    Late,
    /// Due, and not given.
    Missed,
    /// Given where the two pass each other beyond the miss distance.
    Nuisance,
    /// Given on a track that was not where the intruder was.
    False,
    /// Neither due nor given.
    Quiet,
}

impl Verdict {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Timely, Self::Late, Self::Missed, Self::Nuisance, Self::False, Self::Quiet];

    /// As in results.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Timely => "timely",
            Self::Late => "late",
            Self::Missed => "missed",
            Self::Nuisance => "nuisance",
            Self::False => "false",
            Self::Quiet => "quiet",
        }
    }
}

/// A track that is off by more than this share of the range is not of the intruder.
const FALSE_RATIO: f64 = 0.3;

/// The last moment for a turn is the same from any distance: taken from so long before the closest approach, s.
const FAR_S: f64 = 1_000.0;

impl Outcome {
    /// Flies encounter number `number`. `go_on` is asked before each frame; `None` if it says no, or if there is no such encounter.
    #[must_use]
    pub fn of(study: &EncounterStudy, number: u64, go_on: &dyn Fn() -> bool) -> Option<Self> {
        let mut lookout = Lookout::of(study, number)?;
        let encounter = *lookout.encounter();
        let mut outcome = Self::begun(study, number, &encounter);
        loop {
            if !go_on() {
                return None;
            }
            let Some(look) = lookout.next() else { break };
            outcome.frames += 1;
            let moment = Moment { time_s: -look.time_s, range_m: look.truth.translation.norm() };
            let first = |known: &mut Option<Moment>, holds: bool| {
                if holds && known.is_none() {
                    *known = Some(moment);
                }
            };
            first(&mut outcome.in_view, look.is_in_view);
            first(&mut outcome.seen, is_seen(study, &look));
            first(&mut outcome.posed, look.estimate.targets.iter().any(|target| target.answer.is_ok()));
            first(&mut outcome.tracked, look.report.believed().next().is_some());
            if let Some(alert) = look.alert {
                outcome.alert = Some(moment);
                outcome.alert_error_m = Some((alert.believed.position_m() - encounter.position_m(look.time_s)).norm());
                let manoeuvre = study.manoeuvre.to(alert.side);
                let turn_s = look.time_s + study.alarm.delay_s;
                // Past the closest approach there is nothing left to avoid.
                if let Some(state) = state(&encounter, turn_s).filter(|_| turn_s < 0.0) {
                    outcome.miss_m = miss_if_turned_now_m(&state, encounter.own_speed_mps, &manoeuvre);
                }
                break;
            }
        }
        Some(outcome)
    }

    fn begun(study: &EncounterStudy, number: u64, encounter: &Encounter) -> Self {
        let unavoided_miss_m = encounter.miss_m();
        let turn = state(encounter, -FAR_S).ok_or(NoTurn::NeverClosing { closing_speed_mps: 0.0 });
        let turn = turn.and_then(|far| latest_turn(&far, encounter.own_speed_mps, &study.manoeuvre));
        Self {
            number,
            own_speed_mps: encounter.own_speed_mps,
            intruder_speed_mps: encounter.intruder_speed_mps,
            course_rad: encounter.course_rad,
            relative_speed_mps: encounter.velocity_mps.norm(),
            unavoided_miss_m,
            miss_m: unavoided_miss_m,
            needed_s: turn.ok().map(|turn| turn.time_s + study.alarm.delay_s),
            is_conflict: unavoided_miss_m < study.manoeuvre.miss_distance_m(),
            in_view: None,
            seen: None,
            posed: None,
            tracked: None,
            alert: None,
            alert_error_m: None,
            frames: 0,
        }
    }

    /// How far it got.
    #[must_use]
    pub fn stage(&self) -> Stage {
        let reached = [
            (Stage::Alerted, self.alert),
            (Stage::Tracked, self.tracked),
            (Stage::Posed, self.posed),
            (Stage::Seen, self.seen),
            (Stage::InView, self.in_view),
        ];
        reached.into_iter().find(|(_, moment)| moment.is_some()).map_or(Stage::OutOfView, |(stage, _)| stage)
    }

    /// What its alarm, or the lack of it, was.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        let Some(alert) = self.alert else {
            return if self.is_conflict { Verdict::Missed } else { Verdict::Quiet };
        };
        if self.alert_error_m.is_some_and(|error_m| error_m > FALSE_RATIO * alert.range_m) {
            return Verdict::False;
        }
        match (self.is_conflict, self.needed_s) {
            (false, _) => Verdict::Nuisance,
            (true, Some(needed_s)) if alert.time_s >= needed_s => Verdict::Timely,
            (true, _) => Verdict::Late,
        }
    }

    /// From the first marker found to the first frame in which a track is believed, s.
    #[must_use]
    pub fn time_to_track_s(&self) -> Option<f64> {
        Some(self.seen?.time_s - self.tracked?.time_s)
    }

    /// How much earlier than needed the alarm came, s; negative where it was late.
    #[must_use]
    pub fn margin_s(&self) -> Option<f64> {
        Some(self.alert?.time_s - self.needed_s?)
    }
}

fn state(encounter: &Encounter, time_s: f64) -> Option<RelativeState> {
    let position: Vector3<f64> = encounter.position_m(time_s);
    RelativeState::checked(position, encounter.velocity_mps).ok()
}

/// A number that may not be: whether it is, and what.
impl Numbers for Option<f64> {
    fn write(&self, to: &mut Vec<f64>) {
        u64::from(self.is_some()).write(to);
        self.unwrap_or_default().write(to);
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let is_some = u64::read(from)? == 1;
        let value = f64::read(from)?;
        Some(is_some.then_some(value))
    }
}

impl Numbers for Outcome {
    fn write(&self, to: &mut Vec<f64>) {
        self.number.write(to);
        for value in [
            self.own_speed_mps,
            self.intruder_speed_mps,
            self.course_rad,
            self.relative_speed_mps,
            self.unavoided_miss_m,
            self.miss_m,
        ] {
            value.write(to);
        }
        self.needed_s.write(to);
        u64::from(self.is_conflict).write(to);
        for moment in [self.in_view, self.seen, self.posed, self.tracked, self.alert] {
            moment.map(|moment| moment.time_s).write(to);
            moment.map(|moment| moment.range_m).write(to);
        }
        self.alert_error_m.write(to);
        self.frames.write(to);
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let number = u64::read(from)?;
        let [own_speed_mps, intruder_speed_mps, course_rad, relative_speed_mps, unavoided_miss_m, miss_m] =
            <[f64; 6]>::read(from)?;
        let needed_s = <Option<f64>>::read(from)?;
        let is_conflict = u64::read(from)? == 1;
        let mut moments = [None; 5];
        for moment in &mut moments {
            let [time_s, range_m] = <[Option<f64>; 2]>::read(from)?;
            *moment = time_s.zip(range_m).map(|(time_s, range_m)| Moment { time_s, range_m });
        }
        let [in_view, seen, posed, tracked, alert] = moments;
        Some(Self {
            number,
            own_speed_mps,
            intruder_speed_mps,
            course_rad,
            relative_speed_mps,
            unavoided_miss_m,
            miss_m,
            needed_s,
            is_conflict,
            in_view,
            seen,
            posed,
            tracked,
            alert,
            alert_error_m: <Option<f64>>::read(from)?,
            frames: u64::read(from)?,
        })
    }
}
