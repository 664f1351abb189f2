//! The page about an encounter: one file that needs nothing else.

use askama::Template;

use crate::encounter::{Answer, Question, Side, Situation, pictures};
use crate::shell::service::drawing::Drawing;
use crate::shell::service::evaluation::number;
use crate::shell::wire::EncounterReply;
use crate::shell::wire::encounter::{MeasureName, NoTurnName, TaskName, TaskWire};

#[derive(Template)]
#[template(path = "encounter.html")]
struct Page {
    title: &'static str,
    verdict: Vec<Line>,
    facts: Vec<(&'static str, String)>,
    budget: Vec<[String; 3]>,
    turns: Vec<[String; 5]>,
    view: Vec<(&'static str, String)>,
    tasks: Vec<Row>,
    guidance: Vec<[String; 6]>,
    pictures: Vec<Drawing>,
}

/// A sentence, and whether it is good news.
struct Line {
    words: String,
    is_good: bool,
}

struct Row {
    cells: [String; 4],
    is_feasible: bool,
}

/// The page.
///
/// # Errors
/// If it cannot be written, which is our failure.
pub(super) fn page(question: &Question, wire: &EncounterReply, answer: &Answer) -> askama::Result<String> {
    let page = Page {
        title: title(question),
        verdict: verdict(wire),
        facts: facts(question, wire),
        budget: budget(question, wire),
        turns: turns(wire),
        view: view(wire),
        tasks: tasks(wire),
        guidance: guidance(wire),
        pictures: pictures(question, answer).iter().map(Drawing::from).collect(),
    };
    page.render()
}

fn title(question: &Question) -> &'static str {
    match question.situation {
        Situation::Given { .. } => "as measured",
        Situation::Meeting { course, .. } => {
            let angle = course.course_rad().rem_euclid(std::f64::consts::TAU);
            if (angle - std::f64::consts::PI).abs() < 1e-6 {
                "head-on"
            } else if (angle.sin().abs() - 1.0).abs() < 1e-9 {
                "crossing"
            } else {
                "at an angle"
            }
        }
    }
}

/// What it comes to.
pub(in crate::shell) fn sentences(wire: &EncounterReply) -> Vec<(String, bool)> {
    let mut said = Vec::new();
    if let (Some(avoid_s), Some(avoid_m), Some(detect_s), Some(detect_m)) =
        (wire.time_to_avoid_s, wire.distance_to_avoid_m, wire.time_to_detect_s, wire.distance_to_detect_m)
    {
        let needed = format!(
            "The turn must begin {avoid_s:.2} s before the closest approach, {avoid_m:.0} m apart; the intruder must be in sight \
             {detect_s:.2} s before it, {detect_m:.0} m apart."
        );
        let (left_s, range_m) = (wire.time_left_s.unwrap_or_default(), wire.range_m);
        let now = if left_s >= 0.0 {
            format!("Now {range_m:.0} m apart, {left_s:.1} s are left until then.")
        } else {
            format!("Now {range_m:.0} m apart, that moment has passed by {:.1} s.", -left_s)
        };
        said.extend([(needed, true), (now, left_s >= 0.0)]);
    } else {
        let detail = wire.detail.clone().unwrap_or_default();
        said.push((format!("No turn is told: {detail}."), wire.reason == Some(NoTurnName::NotNeeded)));
    }
    if let Some(room) = wire.airspace.filter(|room| room.enough == Some(false)) {
        let room_m = room.range_m;
        said.push((format!("The airspace has room for {room_m:.0} m only: in it nobody is in sight so early."), false));
    }
    if let Some(view) = &wire.view {
        if !view.in_picture {
            let azimuth = view.azimuth_rad.to_degrees();
            said.push((
                format!("The camera does not look there: the intruder comes from an azimuth of {azimuth:.0}°."),
                false,
            ));
        }
        for task in &view.tasks {
            let reach = task.reach_m.map_or_else(|| "at no distance".into(), |reach_m| format!("up to {reach_m:.0} m"));
            let can = if task.feasible { "can be done" } else { "cannot be done" };
            said.push((
                format!("{} {can} at {:.0} m (it serves {reach}).", task_name(task.task), view.distance_m),
                task.feasible,
            ));
        }
    }
    said
}

fn verdict(wire: &EncounterReply) -> Vec<Line> {
    sentences(wire).into_iter().map(|(words, is_good)| Line { words, is_good }).collect()
}

const fn task_name(task: TaskName) -> &'static str {
    match task {
        TaskName::Detection => "Detection without markers",
        TaskName::Classification => "Telling it from a bird",
        TaskName::MarkerDetection => "Finding its markers",
        TaskName::Identification => "Telling its markers apart",
        TaskName::Pose => "Its pose",
    }
}

fn knots(speed_mps: f64) -> String {
    format!("{speed_mps:.1} m/s ({:.0} kn)", speed_mps / crate::encounter::KNOT_MPS)
}

fn degrees(angle_rad: f64) -> String {
    format!("{:.1}°", angle_rad.to_degrees())
}

fn facts(question: &Question, wire: &EncounterReply) -> Vec<(&'static str, String)> {
    let manoeuvre = &question.manoeuvre;
    let side = match manoeuvre.side() {
        Side::Left => "to the left",
        Side::Right => "to the right",
        Side::Either => "to the better side",
    };
    let bank = format!(
        "{} of bank {side}, {}, up to {} of turn, to clear by {:.1} m",
        degrees(manoeuvre.bank_rad()),
        manoeuvre.roll_rate_radps().map_or_else(
            || "there at once".to_owned(),
            |rate| format!("rolled in at {}/s in {:.2} s", degrees(rate), manoeuvre.roll_in_s())
        ),
        degrees(manoeuvre.max_turn_rad()),
        manoeuvre.miss_distance_m()
    );
    let turn = &wire.manoeuvre;
    let approach = wire.closest_approach.map_or_else(
        || "they do not come nearer".to_owned(),
        |approach| format!("in {:.1} s, at {:.1} m", approach.time_s, approach.miss_m),
    );
    vec![
        ("our speed", knots(wire.own_speed_mps)),
        ("the intruder's", knots(wire.intruder_speed_mps)),
        ("closing speed", knots(wire.closing_speed_mps)),
        (
            "the intruder now",
            format!(
                "{:.0} m away, azimuth {}, elevation {}",
                wire.range_m,
                degrees(wire.azimuth_rad),
                degrees(wire.elevation_rad)
            ),
        ),
        ("nearest without a turn", approach),
        ("the turn", bank),
        (
            "that is",
            format!(
                "a radius of {:.0} m, {}/s, {:.2} g",
                turn.radius_m,
                degrees(turn.turn_rate_radps),
                turn.load_factor
            ),
        ),
        (
            "the intruder's size",
            format!("{} x {} m", number(Some(question.size_m[0]), ""), number(Some(question.size_m[1]), "")),
        ),
    ]
}

fn budget(question: &Question, wire: &EncounterReply) -> Vec<[String; 3]> {
    let (Some(avoid_s), Some(avoid_m)) = (wire.time_to_avoid_s, wire.distance_to_avoid_m) else { return Vec::new() };
    let row = |what: &str, time_s: f64, distance_m: Option<f64>| {
        [what.to_owned(), format!("{time_s:.2}"), distance_m.map_or_else(String::new, |m| format!("{m:.0}"))]
    };
    let mut rows = vec![row("the turn, roll-in included", avoid_s, Some(avoid_m))];
    rows.extend(question.delays.named().into_iter().map(|(name, time_s)| row(name, time_s, None)));
    rows.push(row("in sight", wire.time_to_detect_s.unwrap_or_default(), wire.distance_to_detect_m));
    rows
}

fn turns(wire: &EncounterReply) -> Vec<[String; 5]> {
    let all = &wire.turns;
    let mut rows: Vec<[String; 5]> = [("exact arc, to the left", &all.left), ("exact arc, to the right", &all.right)]
        .into_iter()
        .map(|(name, turn)| {
            let cell =
                |value: Option<f64>, digits: usize| value.map_or_else(|| "–".into(), |v| format!("{v:.digits$}"));
            [
                name.to_owned(),
                cell(turn.map(|t| t.time_s), 2),
                cell(turn.map(|t| t.distance_m), 0),
                cell(turn.map(|t| t.nearest_s), 2),
                cell(turn.map(|t| t.turned_rad.to_degrees()), 0),
            ]
        })
        .collect();
    let parabola = &all.parabolic;
    rows.push([
        "the thesis' parabola".into(),
        format!("{:.2}", parabola.time_s),
        format!("{:.0}", parabola.distance_m),
        String::new(),
        String::new(),
    ]);
    rows
}

fn view(wire: &EncounterReply) -> Vec<(&'static str, String)> {
    let Some(view) = &wire.view else { return Vec::new() };
    let regard = &view.field_of_regard;
    let span = |ends: Option<[f64; 2]>| {
        ends.map_or_else(|| "not seen".to_owned(), |[from, to]| format!("{} to {}", degrees(from), degrees(to)))
    };
    let place = view.pixel.map_or_else(|| "not on the picture".to_owned(), |[u, v]| format!("at ({u:.0}, {v:.0}) px"));
    vec![
        (
            "the intruder there",
            format!("{:.0} m away, azimuth {}, {place}", view.distance_m, degrees(view.azimuth_rad)),
        ),
        (
            "its size",
            format!(
                "{} x {} px, {} px of silhouette",
                number(Some(view.width_px), ""),
                number(Some(view.height_px), ""),
                number(Some(view.area_px), "")
            ),
        ),
        ("azimuths at the horizon", span(regard.azimuth_rad)),
        ("elevations ahead of the camera", span(regard.elevation_rad)),
        ("whole picture", format!("{:.3} sr", regard.solid_angle_sr)),
    ]
}

fn tasks(wire: &EncounterReply) -> Vec<Row> {
    let Some(view) = &wire.view else { return Vec::new() };
    let row = |task: &TaskWire| {
        let (what, sign) = match task.measure {
            MeasureName::AreaPx => ("px of silhouette", "at least"),
            MeasureName::MarkerAreaPx => ("px of the smallest marker", "at least"),
            MeasureName::IdentifiedRate => ("of pictures told apart", "at least"),
            MeasureName::FlipRate => ("of poses the wrong one of two", "at most"),
        };
        Row {
            cells: [
                task_name(task.task).to_owned(),
                format!("{} {what}", number(task.found, "")),
                format!("{sign} {}", number(Some(task.needed), "")),
                task.reach_m.map_or_else(|| "–".into(), |reach_m| format!("{reach_m:.0} m")),
            ],
            is_feasible: task.feasible,
        }
    };
    view.tasks.iter().map(row).collect()
}

fn guidance(wire: &EncounterReply) -> Vec<[String; 6]> {
    let Some(view) = &wire.view else { return Vec::new() };
    let percent = |ratio: f64| format!("{:.0} %", 100.0 * ratio);
    let span = |[from, to]: [f64; 2]| format!("{:.0}° to {:.0}°", from.to_degrees(), to.to_degrees());
    view.field_of_regard
        .guidance
        .iter()
        .map(|guidance| {
            [
                format!("{} ({})", guidance.source, guidance.about),
                span(guidance.azimuth_rad),
                guidance.elevation_rad.map_or_else(|| "none".into(), span),
                percent(guidance.azimuth_ratio),
                guidance.elevation_ratio.map_or_else(|| "–".into(), percent),
                percent(guidance.covered_ratio),
            ]
        })
        .collect()
}
