//! Pictures of an encounter: the budget of time and distance, pixels over range, and what the camera covers.

use nalgebra::Vector3;

use super::approach::RelativeState;
use super::avoid::latest_turn;
use super::eye::Eye;
use super::manoeuvre::Manoeuvre;
use super::parabola::parabolic_time_s;
use super::study::{Answer, Question, View};
use crate::plot::{Axis, Figure, Limits, Panel, Picture, Series};

/// Points of a curve.
const POINTS: u32 = 48;

/// Bank angles of the first picture, degrees.
const BANKS_DEG: [f64; 2] = [5.0, 75.0];

/// Speeds of the second, of the intruder's own.
const SPEED_RATIOS: [f64; 2] = [0.2, 3.0];

/// Far before the encounter, so that no turn is too late, m.
const FAR_M: f64 = 2e5;

/// All pictures of the encounter.
#[must_use]
pub fn pictures(question: &Question, answer: &Answer) -> Vec<Picture> {
    let mut found = Vec::new();
    if answer.approach.is_some() {
        found.push(bank(question, answer));
        found.push(speed(question, answer));
    }
    if let Some((eye, view)) = question.eye.as_ref().zip(answer.view.as_ref()) {
        found.push(pixels(question, eye, view));
        found.push(coverage(view));
    }
    found
}

/// The figures of one place on a curve.
struct Budget {
    arc_s: Option<f64>,
    parabola_s: f64,
    /// The thesis' formula as it is printed.
    printed_s: f64,
    relative_speed_mps: f64,
}

fn budget(velocity: &Vector3<f64>, own_speed_mps: f64, manoeuvre: &Manoeuvre) -> Option<Budget> {
    let relative_speed_mps = velocity.norm();
    let far = RelativeState::checked(-velocity * (FAR_M / relative_speed_mps), *velocity).ok()?;
    // Of the miss distance's square root, as 5.6 is that of twice 500 ft over g.
    let cotangent = std::f64::consts::FRAC_PI_2 - manoeuvre.bank_rad();
    Some(Budget {
        arc_s: latest_turn(&far, own_speed_mps, manoeuvre).ok().map(|turn| turn.time_s),
        parabola_s: parabolic_time_s(manoeuvre),
        printed_s: (2.0 * manoeuvre.miss_distance_m() / super::GRAVITY_MPS2 * cotangent).sqrt(),
        relative_speed_mps,
    })
}

/// Time and distance over `x`, with the place of this encounter.
fn budget_panels(
    question: &Question,
    axis: &Axis,
    curve: &[(f64, Budget)],
    here: Option<(f64, [f64; 2])>,
) -> Vec<Panel> {
    let delays_s = question.delays.total_s();
    let line = |name: &str, value: &dyn Fn(&Budget) -> Option<f64>| Series {
        name: name.into(),
        points: curve.iter().map(|(x, budget)| value(budget).map(|y| [*x, y])).collect(),
    };
    let lines = |per_s: &dyn Fn(&Budget) -> f64| {
        let mut series = vec![
            line("exact arc", &|b| b.arc_s.map(|time| time * per_s(b))),
            line("parabola", &|b| Some(b.parabola_s * per_s(b))),
            line("as printed in the thesis", &|b| Some(b.printed_s * per_s(b))),
        ];
        if delays_s > 0.0 {
            series.push(line("exact arc and all delays", &|b| b.arc_s.map(|time| (time + delays_s) * per_s(b))));
        }
        series
    };
    let panel = |title: &str, label: &str, which: usize, per_s: &dyn Fn(&Budget) -> f64| {
        let mut series = lines(per_s);
        series.extend(here.map(|(x, y)| Series::of("this encounter", [(x, y[which])])));
        Panel { title: title.into(), x: axis.clone(), y: Axis::linear(label), series }
    };
    vec![
        panel("Time", "before the closest approach (s)", 0, &|_| 1.0),
        panel("Distance", "then (m)", 1, &|b| b.relative_speed_mps),
    ]
}

fn here(answer: &Answer) -> Option<[f64; 2]> {
    answer.needed.ok().map(|needed| [needed.time_to_detect_s, needed.distance_to_detect_m])
}

fn bank(question: &Question, answer: &Answer) -> Picture {
    let velocity = answer.state.velocity_mps();
    let curve: Vec<(f64, Budget)> = evenly(BANKS_DEG)
        .filter_map(|bank_deg| {
            let manoeuvre = question.manoeuvre.banked(bank_deg.to_radians()).ok()?;
            Some((bank_deg, budget(velocity, answer.own_speed_mps, &manoeuvre)?))
        })
        .collect();
    let place = here(answer).map(|y| (question.manoeuvre.bank_rad().to_degrees(), y));
    Picture {
        name: "bank".into(),
        caption: format!(
            "When the turn must begin, and how far apart the two are then, over the bank, to clear by {:.0} m on a collision course. The \
             formula as printed in the thesis asks for too little.",
            question.manoeuvre.miss_distance_m()
        ),
        figure: Figure {
            title: "Time and distance against bank".into(),
            panels: budget_panels(question, &Axis::linear("bank (deg)"), &curve, place),
        },
    }
}

fn speed(question: &Question, answer: &Answer) -> Picture {
    let own = Vector3::x() * answer.own_speed_mps;
    let intruder = answer.state.velocity_mps() + own;
    // One that hovers is thought to come towards us.
    let course = intruder.try_normalize(1e-9).unwrap_or_else(|| -Vector3::x());
    let from_mps = if intruder.norm() > 1e-9 { intruder.norm() } else { answer.own_speed_mps };
    let curve: Vec<(f64, Budget)> = evenly(SPEED_RATIOS.map(|ratio| ratio * from_mps))
        .filter_map(|speed_mps| {
            let velocity = course * speed_mps - own;
            // Side by side they never meet, whatever the turn.
            let closes = velocity.norm() > 1e-3 * answer.own_speed_mps;
            closes
                .then(|| budget(&velocity, answer.own_speed_mps, &question.manoeuvre))
                .flatten()
                .map(|b| (speed_mps, b))
        })
        .collect();
    let place = here(answer).map(|y| (intruder.norm(), y));
    Picture {
        name: "speed".into(),
        caption: format!(
            "The same over the intruder's speed, ours being {:.1} m/s and the bank {:.0}°.",
            answer.own_speed_mps,
            question.manoeuvre.bank_rad().to_degrees()
        ),
        figure: Figure {
            title: "Time and distance against the intruder's speed".into(),
            panels: budget_panels(question, &Axis::linear("intruder's speed (m/s)"), &curve, place),
        },
    }
}

fn pixels(question: &Question, eye: &Eye, view: &View) -> Picture {
    let direction = Vector3::new(
        view.bearing_rad[1].cos() * view.bearing_rad[0].cos(),
        view.bearing_rad[1].cos() * view.bearing_rad[0].sin(),
        -view.bearing_rad[1].sin(),
    );
    let [near_m, far_m] = [5.0 * question.size_m[0], 2.0 * view.distance_m.max(20.0 * question.size_m[0])];
    let ranges: Vec<f64> = evenly([0.0, 1.0]).map(|share| near_m * (far_m / near_m).powf(share)).collect();
    let seen: Vec<_> =
        ranges.iter().map(|range| (*range, eye.sighting(&(direction * *range), question.size_m))).collect();
    let mut sizes = vec![
        Series::of("width", seen.iter().map(|(range, s)| (*range, s.size_px[0]))),
        Series::of("height", seen.iter().map(|(range, s)| (*range, s.size_px[1]))),
    ];
    let mut areas = vec![Series::of("area", seen.iter().map(|(range, s)| (*range, s.area_px)))];
    for task in view.tasks.iter().filter(|task| task.measure == super::tasks::Measure::AreaPx) {
        areas.push(Series::of(format!("{} needs", task.task.name()), [(near_m, task.needed), (far_m, task.needed)]));
    }
    sizes.push(Series::of("where it must be in sight", [(view.distance_m, view.sighting.size_px[0])]));
    areas.push(Series::of("where it must be in sight", [(view.distance_m, view.sighting.area_px)]));
    let panel = |title: &str, label: &str, series: Vec<Series>| Panel {
        title: title.into(),
        x: Axis::logarithmic("distance (m)"),
        y: Axis::logarithmic(label),
        series,
    };
    Picture {
        name: "pixels".into(),
        caption: format!(
            "The intruder, {} m wide and {} m high, in the camera's picture, {}.",
            question.size_m[0],
            question.size_m[1],
            if view.sighting.is_in_picture {
                "in the direction in which it comes, with the lens"
            } else {
                "in the middle: where it comes from the camera does not look"
            }
        ),
        figure: Figure {
            title: "Pixels against range".into(),
            panels: vec![panel("Size", "px", sizes), panel("Silhouette", "area (px)", areas)],
        },
    }
}

fn coverage(view: &View) -> Picture {
    let degrees = |[azimuth, elevation]: [f64; 2]| [azimuth.to_degrees(), elevation.to_degrees()];
    let mut points: Vec<Option<[f64; 2]>> = Vec::new();
    for point in view.regard.rim_rad.iter().copied().map(degrees) {
        // Behind us azimuths jump by a whole turn: no line across the chart.
        if points.last().copied().flatten().is_some_and(|[last, _]| (point[0] - last).abs() > 180.0) {
            points.push(None);
        }
        points.push(Some(point));
    }
    let mut series = vec![Series { name: "camera".into(), points }];
    for covered in &view.regard.covered {
        let azimuth = covered.guidance.azimuth_rad.to_degrees();
        let name = covered.guidance.source;
        series.push(match covered.guidance.elevation_rad.map(|limits| limits.map(f64::to_degrees)) {
            Some([low, high]) => {
                Series::of(name, [(-azimuth, low), (azimuth, low), (azimuth, high), (-azimuth, high), (-azimuth, low)])
            }
            None => Series::of(name, [(-azimuth, 0.0), (azimuth, 0.0)]),
        });
    }
    let [azimuth, elevation] = degrees(view.bearing_rad);
    series.push(Series::of("the intruder", [(azimuth, elevation)]));
    let fixed = |label: &str, most: f64| Axis { limits: Limits::Fixed(-most, most), ..Axis::linear(label) };
    Picture {
        name: "coverage".into(),
        caption: "What the camera covers, its lens included, and where guidance asks to look. Of the ICAO's rules only azimuths are known: \
            they are drawn at the horizon."
            .into(),
        figure: Figure {
            title: "Field of regard".into(),
            panels: vec![Panel {
                title: String::new(),
                x: fixed("azimuth (deg), right positive", 180.0),
                y: fixed("elevation (deg)", 90.0),
                series,
            }],
        },
    }
}

/// From the first to the second.
fn evenly([low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
    (0..=POINTS).map(move |index| low + (high - low) * f64::from(index) / f64::from(POINTS))
}
