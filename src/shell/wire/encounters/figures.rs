//! What comes of encounters.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::EncountersRequest;
use crate::evaluate::encounters::{Bin, Figures, Quantiles, RiskRatio, Stage, Verdict};
use crate::shell::wire::rate::RateWire;

/// The figures of encounters: the same to the last digit whenever the same is asked. Times count back from the closest approach if nobody
/// turns.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncountersEvaluation)]
pub struct EncountersWire {
    /// What was asked, with what was not said.
    pub request: EncountersRequest,
    /// Encounters that were flown; runs for which none could be drawn are missing.
    pub encounters: u64,
    /// Those in which the two pass within the miss distance if nobody turns, so that an alarm is due.
    pub conflicts: u64,
    /// Conflicts that no turn of this kind clears, however early it begins.
    pub unclearable: u64,
    /// How many of each: `timely`, `late`, `missed`; `nuisance` where no alarm was due, `false` where the track was not where the intruder
    /// was; `quiet` where none was due and none given.
    pub verdicts: BTreeMap<String, u64>,
    /// Of the conflicts that a turn clears, those with an alarm in time.
    pub timely_rate: RateWire,
    /// Of the conflicts, those with an alarm too late.
    pub late_rate: RateWire,
    /// Of the conflicts, those without one.
    pub missed_rate: RateWire,
    /// Of the others, those with an alarm.
    pub nuisance_rate: RateWire,
    /// Of all encounters, those with an alarm by a track that was not where the intruder was.
    pub false_rate: RateWire,
    /// How far those came that were missed: `out_of_view`, `in_view`, `seen`, `posed`, `tracked`.
    pub missed_at: BTreeMap<String, u64>,
    /// Near mid-air collisions if nobody turns.
    pub nmac_without_rate: RateWire,
    /// And if the own aircraft turns at each alarm, late and wrong ones too.
    pub nmac_with_rate: RateWire,
    /// The second over the first.
    pub risk_ratio: RiskRatioWire,
    /// Range at the first marker found, over the encounters in which one was.
    pub detection_range_m: Option<QuantilesWire>,
    /// Range at the first pose.
    pub pose_range_m: Option<QuantilesWire>,
    /// Range at the first frame in which a track is believed.
    pub track_range_m: Option<QuantilesWire>,
    /// Range at the alarm.
    pub alert_range_m: Option<QuantilesWire>,
    /// From the first marker found to a track.
    pub time_to_track_s: Option<QuantilesWire>,
    /// What the alarm leaves.
    pub alert_time_s: Option<QuantilesWire>,
    /// What has to be left, the delay included: over the conflicts that a turn clears.
    pub needed_time_s: Option<QuantilesWire>,
    /// The one less the other: negative where the alarm was late.
    pub margin_s: Option<QuantilesWire>,
    /// By how much the position that was believed at the alarm was off.
    pub alert_error_m: Option<QuantilesWire>,
    /// How near the two come if nobody turns.
    pub miss_without_m: Option<QuantilesWire>,
    /// And with the system.
    pub miss_with_m: Option<QuantilesWire>,
    /// By the intruder's course, in sectors of 15 degrees.
    pub courses: Vec<CourseWire>,
}

/// A ratio of two shares of the same encounters.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RiskRatio)]
pub struct RiskRatioWire {
    /// The ratio: 0 averts all, 1 changes nothing; null where there were none without the system.
    pub ratio: Option<f64>,
    /// Where the true ratio lies with a confidence of 95 % (Nam and Blackwelder 2002).
    pub interval: Option<[f64; 2]>,
    /// Collisions with and without the system.
    pub both: u64,
    /// Those that it averted.
    pub averted: u64,
    /// Those that it brought about.
    pub induced: u64,
}

/// Order statistics.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Quantiles)]
pub struct QuantilesWire {
    /// How many there are.
    pub count: u64,
    /// The least.
    pub least: f64,
    /// 5 % are below, or at it.
    pub p05: f64,
    /// Half are.
    pub median: f64,
    /// 95 % are.
    pub p95: f64,
    /// The largest.
    pub largest: f64,
}

/// Encounters of which the intruder's course lies in a sector.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EncountersOfCourse)]
pub struct CourseWire {
    /// From this course on, from ours, 0 to 2 pi.
    pub from_rad: f64,
    /// To this.
    pub to_rad: f64,
    /// Of the conflicts that a turn clears, those with an alarm in time.
    pub timely_rate: RateWire,
    /// Collisions.
    pub risk_ratio: RiskRatioWire,
}

impl From<&RiskRatio> for RiskRatioWire {
    fn from(risk: &RiskRatio) -> Self {
        Self {
            ratio: risk.ratio(),
            interval: risk.interval(),
            both: risk.both,
            averted: risk.averted,
            induced: risk.induced,
        }
    }
}

impl From<Quantiles> for QuantilesWire {
    fn from(quantiles: Quantiles) -> Self {
        let Quantiles { count, least, p05, median, p95, largest } = quantiles;
        Self { count, least, p05, median, p95, largest }
    }
}

impl From<&Bin> for CourseWire {
    fn from(bin: &Bin) -> Self {
        Self {
            from_rad: bin.from_rad,
            to_rad: bin.to_rad,
            timely_rate: bin.timely.into(),
            risk_ratio: (&bin.risk).into(),
        }
    }
}

impl EncountersWire {
    /// The figures with what was asked.
    #[must_use]
    pub fn new(request: EncountersRequest, figures: &Figures) -> Self {
        let quantiles = |found: Option<Quantiles>| found.map(QuantilesWire::from);
        Self {
            request,
            encounters: figures.encounters,
            conflicts: figures.conflicts,
            unclearable: figures.hopeless,
            verdicts: Verdict::ALL.iter().map(|of| (of.name().to_owned(), figures.count_of(*of))).collect(),
            timely_rate: figures.timely.into(),
            late_rate: figures.late.into(),
            missed_rate: figures.missed.into(),
            nuisance_rate: figures.nuisance.into(),
            false_rate: figures.false_alarms.into(),
            missed_at: Stage::ALL
                .iter()
                .zip(figures.missed_at)
                // What is missed has no alarm.
                .filter(|(stage, _)| **stage != Stage::Alerted)
                .map(|(stage, count)| (stage.name().to_owned(), count))
                .collect(),
            nmac_without_rate: figures.nmac_without.into(),
            nmac_with_rate: figures.nmac_with.into(),
            risk_ratio: (&figures.risk).into(),
            detection_range_m: quantiles(figures.seen_range_m),
            pose_range_m: quantiles(figures.posed_range_m),
            track_range_m: quantiles(figures.tracked_range_m),
            alert_range_m: quantiles(figures.alert_range_m),
            time_to_track_s: quantiles(figures.time_to_track_s),
            alert_time_s: quantiles(figures.alert_s),
            needed_time_s: quantiles(figures.needed_s),
            margin_s: quantiles(figures.margin_s),
            alert_error_m: quantiles(figures.alert_error_m),
            miss_without_m: quantiles(figures.unavoided_miss_m),
            miss_with_m: quantiles(figures.miss_m),
            courses: figures.courses.iter().map(CourseWire::from).collect(),
        }
    }
}
