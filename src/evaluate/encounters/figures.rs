//! Outcomes to figures.

use std::f64::consts::PI;

use super::outcome::{Moment, Outcome, Stage, Verdict};
use super::quantiles::Quantiles;
use super::risk::RiskRatio;
use super::study::EncounterStudy;
use crate::statistics::Rate;

/// The figures of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// Encounters that were flown.
    pub encounters: u64,
    /// Those in which an alarm was due.
    pub conflicts: u64,
    /// Of these, those that no turn clears, however early.
    pub hopeless: u64,
    /// How many of each verdict.
    pub verdicts: [u64; Verdict::ALL.len()],
    /// Of the conflicts that a turn clears, those with an alarm in time.
    pub timely: Rate,
    /// Of the conflicts, those with one too late.
    pub late: Rate,
    /// Of the conflicts, those without one.
    pub missed: Rate,
    /// Of the encounters in which none was due, those with an alarm.
    pub nuisance: Rate,
    /// Of all, those with an alarm by a track of something else.
    pub false_alarms: Rate,
    /// How far the conflicts got that had no alarm.
    pub missed_at: [u64; Stage::ALL.len()],
    /// Near mid-air collisions without the system.
    pub nmac_without: Rate,
    /// And with it.
    pub nmac_with: Rate,
    /// Their ratio.
    pub risk: RiskRatio,
    /// Range at the first marker found, m, over the encounters in which one was.
    pub seen_range_m: Option<Quantiles>,
    /// At the first pose.
    pub posed_range_m: Option<Quantiles>,
    /// At the first frame in which a track is believed.
    pub tracked_range_m: Option<Quantiles>,
    /// At the alarm.
    pub alert_range_m: Option<Quantiles>,
    /// From the first marker found to a track, s.
    pub time_to_track_s: Option<Quantiles>,
    /// From the alarm to the closest approach if nobody turns, s.
    pub alert_s: Option<Quantiles>,
    /// What of that is needed, s: over the conflicts that a turn clears.
    pub needed_s: Option<Quantiles>,
    /// The first less the second, over the conflicts with an alarm.
    pub margin_s: Option<Quantiles>,
    /// By how much the position that was believed at the alarm was off, m.
    pub alert_error_m: Option<Quantiles>,
    /// Distance at which the two pass without the system, m.
    pub unavoided_miss_m: Option<Quantiles>,
    /// And with it.
    pub miss_m: Option<Quantiles>,
    /// By the intruder's course.
    pub courses: Vec<Bin>,
}

/// Encounters of which the intruder's course lies in a sector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// From this course on, rad, from ours, 0 to two pi.
    pub from_rad: f64,
    /// To this.
    pub to_rad: f64,
    /// Of the conflicts that a turn clears, those with an alarm in time.
    pub timely: Rate,
    /// Collisions in it.
    pub risk: RiskRatio,
}

/// Sectors of the courses: 15 degrees each.
const SECTORS: u32 = 24;

impl Figures {
    /// Of outcomes in the order of their numbers.
    #[must_use]
    pub fn of(study: &EncounterStudy, outcomes: &[Outcome]) -> Self {
        let verdicts = Verdict::ALL.map(|verdict| count(outcomes, |one| one.verdict() == verdict));
        let missed_at =
            Stage::ALL.map(|stage| count(outcomes, |one| one.verdict() == Verdict::Missed && one.stage() == stage));
        let conflicts = || outcomes.iter().filter(|one| one.is_conflict);
        let rate = |verdict: Verdict| Rate::among(conflicts().map(|one| one.verdict() == verdict));
        let is_nmac = |miss_m: f64| miss_m < study.nmac_m;
        let quantiles = |number: &dyn Fn(&Outcome) -> Option<f64>| Quantiles::of(outcomes.iter().filter_map(number));
        let range = |moment: Option<Moment>| moment.map(|moment| moment.range_m);
        Self {
            encounters: outcomes.len() as u64,
            conflicts: count(outcomes, |one| one.is_conflict),
            hopeless: count(outcomes, |one| one.is_conflict && one.needed_s.is_none()),
            verdicts,
            timely: timely(outcomes.iter()),
            late: rate(Verdict::Late),
            missed: rate(Verdict::Missed),
            nuisance: Rate::among(
                outcomes.iter().filter(|one| !one.is_conflict).map(|one| one.verdict() == Verdict::Nuisance),
            ),
            false_alarms: Rate::among(outcomes.iter().map(|one| one.verdict() == Verdict::False)),
            missed_at,
            nmac_without: Rate::among(outcomes.iter().map(|one| is_nmac(one.unavoided_miss_m))),
            nmac_with: Rate::among(outcomes.iter().map(|one| is_nmac(one.miss_m))),
            risk: risk(study, outcomes.iter()),
            seen_range_m: quantiles(&|one| range(one.seen)),
            posed_range_m: quantiles(&|one| range(one.posed)),
            tracked_range_m: quantiles(&|one| range(one.tracked)),
            alert_range_m: quantiles(&|one| range(one.alert)),
            time_to_track_s: quantiles(&Outcome::time_to_track_s),
            alert_s: quantiles(&|one| one.alert.map(|moment| moment.time_s)),
            needed_s: quantiles(&|one| one.needed_s),
            margin_s: quantiles(&Outcome::margin_s),
            alert_error_m: quantiles(&|one| one.alert_error_m),
            unavoided_miss_m: quantiles(&|one| Some(one.unavoided_miss_m)),
            miss_m: quantiles(&|one| Some(one.miss_m)),
            courses: courses(study, outcomes),
        }
    }

    /// How many there are of a verdict.
    #[must_use]
    pub fn count_of(&self, verdict: Verdict) -> u64 {
        self.verdicts[verdict as usize]
    }
}

fn count(outcomes: &[Outcome], holds: impl Fn(&Outcome) -> bool) -> u64 {
    outcomes.iter().filter(|one| holds(one)).count() as u64
}

fn timely<'a>(outcomes: impl Iterator<Item = &'a Outcome>) -> Rate {
    let cleared = outcomes.filter(|one| one.is_conflict && one.needed_s.is_some());
    Rate::among(cleared.map(|one| one.verdict() == Verdict::Timely))
}

fn risk<'a>(study: &EncounterStudy, outcomes: impl Iterator<Item = &'a Outcome>) -> RiskRatio {
    RiskRatio::among(outcomes.map(|one| [one.unavoided_miss_m, one.miss_m].map(|miss_m| miss_m < study.nmac_m)))
}

fn courses(study: &EncounterStudy, outcomes: &[Outcome]) -> Vec<Bin> {
    let width_rad = 2.0 * PI / f64::from(SECTORS);
    (0..SECTORS)
        .filter_map(|sector| {
            let (from_rad, to_rad) = (f64::from(sector) * width_rad, f64::from(sector + 1) * width_rad);
            let among =
                || outcomes.iter().filter(move |one| (from_rad..to_rad).contains(&one.course_rad.rem_euclid(2.0 * PI)));
            among().next()?;
            Some(Bin { from_rad, to_rad, timely: timely(among()), risk: risk(study, among()) })
        })
        .collect()
}
