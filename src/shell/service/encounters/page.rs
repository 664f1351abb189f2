//! The page about encounters: one file that needs nothing else.

use askama::Template;

use super::super::evaluation::number;
use crate::evaluate::encounters::{EncounterStudy, Sensing};
use crate::plot::Picture;
use crate::shell::service::drawing::Drawing;
use crate::shell::wire::encounters::EncountersWire;
use crate::shell::wire::encounters::figures::{QuantilesWire, RiskRatioWire};
use crate::shell::wire::rate::RateWire;

#[derive(Template)]
#[template(path = "encounters.html")]
struct Page {
    facts: Vec<(&'static str, String)>,
    risk: String,
    shares: Vec<[String; 3]>,
    spreads: Vec<[String; 7]>,
    missed_at: String,
    unclearable: u64,
    pictures: Vec<Drawing>,
}

/// The page.
pub(super) fn page(study: &EncounterStudy, wire: &EncountersWire, pictures: &[Picture]) -> askama::Result<String> {
    let share =
        |what: &str, rate: &RateWire| [what.to_owned(), format!("{} of {}", rate.count, rate.of), percent(rate)];
    let spread = |what: &str, found: Option<QuantilesWire>| {
        let found = found?;
        let [least, p05, median, p95, largest] =
            [found.least, found.p05, found.median, found.p95, found.largest].map(|value| number(Some(value), ""));
        Some([what.to_owned(), found.count.to_string(), least, p05, median, p95, largest])
    };
    let spreads = [
        spread("range at the first marker found, m", wire.detection_range_m),
        spread("range at the first pose, m", wire.pose_range_m),
        spread("range at the first track, m", wire.track_range_m),
        spread("range at the alarm, m", wire.alert_range_m),
        spread("from the first marker to a track, s", wire.time_to_track_s),
        spread("time that the alarm leaves, s", wire.alert_time_s),
        spread("time needed, s", wire.needed_time_s),
        spread("margin, s", wire.margin_s),
        spread("error of the position at the alarm, m", wire.alert_error_m),
        spread("closest approach without the system, m", wire.miss_without_m),
        spread("closest approach with it, m", wire.miss_with_m),
    ];
    let words = [
        ("out_of_view", "never in the picture"),
        ("in_view", "no marker found"),
        ("seen", "no pose"),
        ("posed", "no track"),
        ("tracked", "a track without alarm"),
    ];
    let missed = words.iter().filter_map(|(key, word)| {
        wire.missed_at.get(*key).filter(|count| **count > 0).map(|count| format!("{word} {count}"))
    });
    Page {
        facts: facts(study),
        risk: risk(&wire.risk_ratio),
        shares: vec![
            share("conflicts with an alarm in time", &wire.timely_rate),
            share("conflicts with one too late", &wire.late_rate),
            share("conflicts without one", &wire.missed_rate),
            share("alarms for nothing where none was due", &wire.nuisance_rate),
            share("alarms by a track of something else", &wire.false_rate),
            share("near mid-air collisions without the system", &wire.nmac_without_rate),
            share("near mid-air collisions with it", &wire.nmac_with_rate),
        ],
        spreads: spreads.into_iter().flatten().collect(),
        missed_at: missed.collect::<Vec<_>>().join(", "),
        unclearable: wire.unclearable,
        pictures: pictures.iter().map(Drawing::from).collect(),
    }
    .render()
}

fn facts(study: &EncounterStudy) -> Vec<(&'static str, String)> {
    let camera = &study.camera;
    let [fx, fy] = camera.focal_lengths();
    let [own, intruder, miss] = [study.traffic.own_speed_mps, study.traffic.intruder_speed_mps, study.traffic.miss_m]
        .map(|[low, high]| if low < high { format!("{low} to {high}") } else { low.to_string() });
    let [from, to] = study.traffic.course_rad.map(|course| number(Some(course.to_degrees()), "°"));
    let turn = &study.manoeuvre;
    let roll = turn.roll_rate_radps().map_or_else(
        || "at once".into(),
        |rate| format!("rolled to at {} a second", number(Some(rate.to_degrees()), "°")),
    );
    let lead = study.alarm.lead_s.map_or_else(String::new, |lead_s| format!(", {lead_s} s before the last moment"));
    let target = &study.intruder.target;
    vec![
        ("encounters", format!("{} runs, seed {}", study.runs, study.seed)),
        (
            "sensing",
            match study.sensing {
                Sensing::Centroids(_) => format!("simulated centroids, {} frames a second", study.rate_hz),
                Sensing::Frames => format!("rendered frames, {} a second", study.rate_hz),
            },
        ),
        ("camera", format!("{} x {} px, fx {fx:.1}, fy {fy:.1} px, looking forward", camera.width(), camera.height())),
        (
            "intruder",
            format!("the {} markers of {}, mount {}", target.markers().len(), target.name(), study.mount.name()),
        ),
        (
            "traffic",
            format!(
                "own speed {own} m/s, intruder's {intruder} m/s on courses {from} to {to} from ours, passing at {miss} m"
            ),
        ),
        (
            "turn",
            format!(
                "bank {}, {roll}, to clear by {} m, {} s after the alarm's frame",
                number(Some(turn.bank_rad().to_degrees()), "°"),
                turn.miss_distance_m(),
                study.alarm.delay_s
            ),
        ),
        (
            "alarm",
            format!("where the track passes within the miss distance and {} deviations{lead}", study.alarm.sigmas),
        ),
        ("near mid-air collision", format!("within {} m", study.nmac_m)),
    ]
}

fn dash() -> String {
    "–".into()
}

fn percent(rate: &RateWire) -> String {
    let Some(ratio) = rate.ratio else { return dash() };
    let [low, high] = rate.interval.map(|share| 100.0 * share);
    format!("{:.1} % ({low:.1} to {high:.1})", 100.0 * ratio)
}

fn risk(risk: &RiskRatioWire) -> String {
    let (Some(ratio), Some([low, high])) = (risk.ratio, risk.interval) else {
        return "no near mid-air collision without the system, so no risk ratio".into();
    };
    let [ratio, low, high] = [ratio, low, high].map(|value| number(Some(value), ""));
    format!(
        "Risk ratio {ratio} ({low} to {high}): {} near mid-air collisions averted, {} not, {} brought about.",
        risk.averted, risk.both, risk.induced
    )
}
