//! Pictures of a study of encounters.

use super::figures::Figures;
use super::outcome::{Moment, Outcome, Verdict};
use super::study::EncounterStudy;
use crate::plot::{Axis, Figure, Panel, Picture, Series};

/// Most encounters that are drawn one by one.
const MAX_DRAWN: usize = 1_500;
/// Points of a curve of shares.
const SHARES: usize = 100;

/// All pictures that there is something to draw for.
#[must_use]
pub fn pictures(study: &EncounterStudy, outcomes: &[Outcome], figures: &Figures) -> Vec<Picture> {
    let mut pictures = vec![ranges(outcomes), alerts(outcomes), misses(study, outcomes), courses(figures)];
    pictures.retain(|picture| {
        picture.figure.panels.iter().any(|panel| panel.series.iter().any(|series| !series.points.is_empty()))
    });
    pictures
}

/// At which range what share of the encounters has got how far.
fn ranges(outcomes: &[Outcome]) -> Picture {
    type Which = fn(&Outcome) -> Option<Moment>;
    let stages: [(&str, Which); 4] = [
        ("a marker found", |one| one.seen),
        ("a pose", |one| one.posed),
        ("a track", |one| one.tracked),
        ("an alarm", |one| one.alert),
    ];
    let curve = |name: &str, numbers: Vec<f64>| {
        let mut sorted = numbers;
        sorted.sort_by(|a, b| b.total_cmp(a));
        let stride = sorted.len().div_ceil(SHARES).max(1);
        let places = (0..sorted.len()).filter(|place| place % stride == 0 || place + 1 == sorted.len());
        let all = outcomes.len().max(1) as f64;
        let points = places.map(|place| (sorted[place], (place + 1) as f64 / all)).collect::<Vec<_>>();
        Series::of(name, points)
    };
    let panel = |title: &str, label: &str, number: fn(Moment) -> f64| Panel {
        title: title.into(),
        x: Axis::linear(label),
        y: Axis::share("share of all encounters"),
        series: stages
            .iter()
            .map(|(name, which)| curve(name, outcomes.iter().filter_map(which).map(number).collect()))
            .collect(),
    };
    Picture {
        name: "ranges".into(),
        caption: "The share of all encounters that have got so far at this range, and with so much time left. A curve that ends \
            below 1 stands for encounters that never do."
            .into(),
        figure: Figure {
            title: "How early the intruder is known".into(),
            panels: vec![
                panel("range", "still this far away (m)", |moment| moment.range_m),
                panel("time left", "closest approach in (s)", |moment| moment.time_s),
            ],
        },
    }
}

/// The time that alarms leave, over the time that is needed.
fn alerts(outcomes: &[Outcome]) -> Picture {
    let due: Vec<&Outcome> = outcomes.iter().filter(|one| one.is_conflict).take(MAX_DRAWN).collect();
    let of = |verdict: Verdict| {
        due.iter()
            .filter(move |one| one.verdict() == verdict)
            .filter_map(|one| Some((one.needed_s?, one.alert.map_or(0.0, |alert| alert.time_s))))
    };
    let least = due.iter().filter_map(|one| one.needed_s).fold(f64::INFINITY, f64::min);
    let most = due.iter().filter_map(|one| one.needed_s).fold(0.0, f64::max);
    let mut series: Vec<Series> =
        [("in time", Verdict::Timely), ("too late", Verdict::Late), ("no alarm", Verdict::Missed)]
            .into_iter()
            .map(|(name, verdict)| scattered(name, of(verdict)))
            .collect();
    series.retain(|series| !series.points.is_empty());
    if least < most {
        series.push(Series::of("just in time", [(least, least), (most, most)]));
    }
    Picture {
        name: "alerts".into(),
        caption: "Every encounter in which an alarm was due and a turn would clear the intruder: how long before the closest approach \
            the alarm came, over how long before it had to come. Those without alarm lie at zero."
            .into(),
        figure: Figure {
            title: String::new(),
            panels: vec![Panel {
                title: "Alarms".into(),
                x: Axis::linear("time needed (s)"),
                y: Axis::linear("time that the alarm left (s)"),
                series,
            }],
        },
    }
}

/// How near the two come, with and without the system.
fn misses(study: &EncounterStudy, outcomes: &[Outcome]) -> Picture {
    let points = |is_alerted: bool| {
        outcomes
            .iter()
            .take(MAX_DRAWN)
            .filter(move |one| one.alert.is_some() == is_alerted)
            .map(|one| (one.unavoided_miss_m, one.miss_m))
    };
    let most = outcomes.iter().map(|one| one.unavoided_miss_m).fold(0.0, f64::max);
    let series = vec![
        scattered("with an alarm", points(true)),
        scattered("without", points(false)),
        Series::of("near mid-air collision", [(0.0, study.nmac_m), (most, study.nmac_m)]),
        Series::of(
            "to be cleared",
            [(0.0, study.manoeuvre.miss_distance_m()), (most, study.manoeuvre.miss_distance_m())],
        ),
    ];
    Picture {
        name: "misses".into(),
        caption:
            "How near the two come when the own aircraft turns as it is told, over how near they come if nobody turns."
                .into(),
        figure: Figure {
            title: String::new(),
            panels: vec![Panel {
                title: "Closest approach".into(),
                x: Axis::linear("without the system (m)"),
                y: Axis::linear("with it (m)"),
                series: series.into_iter().filter(|series| !series.points.is_empty()).collect(),
            }],
        },
    }
}

/// Alarms in time and the risk ratio by the intruder's course.
fn courses(figures: &Figures) -> Picture {
    let middle = |from_rad: f64, to_rad: f64| f64::midpoint(from_rad, to_rad).to_degrees();
    let timely = figures.courses.iter().filter_map(|bin| Some((middle(bin.from_rad, bin.to_rad), bin.timely.ratio()?)));
    let risk = figures.courses.iter().filter_map(|bin| Some((middle(bin.from_rad, bin.to_rad), bin.risk.ratio()?)));
    Picture {
        name: "courses".into(),
        caption: "By the intruder's course from ours, in sectors of 15°: 180° comes towards us, 90° crosses from the left to the right. \
            Intruders that are never in view count as missed."
            .into(),
        figure: Figure {
            title: String::new(),
            panels: vec![Panel {
                title: "By course".into(),
                x: Axis::linear("intruder's course from ours (deg)"),
                y: Axis::linear("share, ratio"),
                series: vec![Series::of("alarms in time", timely), Series::of("risk ratio", risk)]
                    .into_iter()
                    .filter(|series| !series.points.is_empty())
                    .collect(),
            }],
        },
    }
}

/// Marks without a line.
fn scattered(name: &str, points: impl Iterator<Item = (f64, f64)>) -> Series {
    Series { name: name.into(), points: points.flat_map(|(x, y)| [Some([x, y]), None]).collect() }
}
