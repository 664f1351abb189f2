//! The page about an evaluation of recorded frames: one file that needs nothing else.

use askama::Template;

use super::finish::Finished;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::rate::RateWire;
use crate::shell::wire::recorded::{
    ConsistencyWire, FailedWire, FiguresWire, PoseErrorsWire, RecordedWire, SpreadWire,
};

#[derive(Template)]
#[template(path = "recorded.html")]
struct Page<'a> {
    name: &'a str,
    frames: u32,
    failed: &'a [FailedWire],
    targets: Vec<Vec<String>>,
    detections: Vec<Vec<String>>,
    errors: Vec<ErrorTable>,
    consistency: Vec<Vec<String>>,
    reasons: Vec<(String, u32)>,
    classes: Vec<Vec<String>>,
    stages: Vec<Vec<String>>,
    suite_times: Vec<Vec<String>>,
    curve: Option<&'a str>,
    centroids: Option<&'a str>,
    poses: Option<&'a str>,
    probabilities: Option<&'a str>,
    latency: Option<&'a str>,
}

struct ErrorTable {
    title: &'static str,
    count: usize,
    rows: Vec<Vec<String>>,
}

/// The page.
///
/// # Errors
/// If it cannot be written, which is our failure.
pub fn page(name: &str, finished: &Finished) -> Result<String, Fault> {
    let (wire, plots) = (&finished.wire, &finished.plots);
    let all = &wire.all;
    let targets = all.targets.as_ref();
    let errors = targets.into_iter().flat_map(|targets| {
        // Where all are right they are the same.
        let of_right = targets.errors_of_right.as_ref().filter(|_| targets.errors != targets.errors_of_right);
        [("Of all poses", targets.errors.as_ref()), ("Of the right poses", of_right)]
    });
    let consistency = targets.into_iter().flat_map(|targets| {
        [
            ("all", &targets.normalized_error_squared),
            ("covariance called reliable", &targets.normalized_error_squared_of_reliable),
        ]
    });
    let classes = all.detection.iter().flat_map(|detection| &detection.classes).map(|class| {
        vec![class.stated.clone().unwrap_or_else(|| "no class".into()), class.truth.clone(), class.count.to_string()]
    });
    Page {
        name,
        frames: all.frames,
        failed: &wire.failed,
        targets: of_suites(wire, target_row),
        detections: of_suites(wire, detection_row),
        errors: errors.filter_map(|(title, errors)| Some(error_table(title, errors?))).collect(),
        consistency: consistency.filter_map(|(name, found)| Some(consistency_row(name, found.as_ref()?))).collect(),
        reasons: targets.map(|targets| targets.reasons.clone().into_iter().collect()).unwrap_or_default(),
        classes: classes.collect(),
        stages: wire.timing.stages_us.iter().map(|(stage, spread)| time_row(stage, spread)).collect(),
        suite_times: wire.timing.suites.iter().map(|suite| time_row(&suite.suite, &suite.total_us)).collect(),
        curve: plots.curve.as_deref(),
        centroids: plots.centroids.as_deref(),
        poses: plots.poses.as_deref(),
        probabilities: plots.probabilities.as_deref(),
        latency: plots.latency.as_deref(),
    }
    .render()
    .map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))
}

/// A row for each suite and one for all.
fn of_suites(wire: &RecordedWire, row: fn(&FiguresWire) -> Option<Vec<String>>) -> Vec<Vec<String>> {
    let all = (wire.suites.len() > 1).then_some(&wire.all);
    wire.suites.iter().chain(all).filter_map(row).collect()
}

fn percent(rate: &RateWire) -> String {
    rate.ratio.map_or_else(|| "–".into(), |share| format!("{:.1} %", 100.0 * share))
}

/// The share with its interval, percent.
fn with_interval(rate: &RateWire) -> String {
    let [low, high] = rate.interval.map(|end| 100.0 * end);
    if rate.of == 0 { "–".into() } else { format!("{} ({low:.0}–{high:.0})", percent(rate)) }
}

fn of(rate: &RateWire) -> String {
    format!("{}/{}", rate.count, rate.of)
}

fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "–".into(), |value| format!("{value:.digits$}"))
}

fn target_row(figures: &FiguresWire) -> Option<Vec<String>> {
    let found = figures.targets.as_ref()?;
    Some(vec![
        figures.suite.clone(),
        figures.frames.to_string(),
        of(&found.detected),
        with_interval(&found.detected),
        of(&found.identified),
        with_interval(&found.identified),
        of(&found.right),
        with_interval(&found.right),
        found.flagged.to_string(),
        found.missed.to_string(),
        found.wrong.to_string(),
        if found.invented.of == 0 { "–".into() } else { of(&found.invented) },
    ])
}

fn detection_row(figures: &FiguresWire) -> Option<Vec<String>> {
    let found = figures.detection.as_ref()?;
    let error = found.centroid_error_px.as_ref();
    let mut row = vec![
        figures.suite.clone(),
        found.frames.to_string(),
        of(&found.found),
        with_interval(&found.found),
        with_interval(&found.frames_found),
        format!("{:.3}", found.false_alarms_per_frame),
    ];
    row.extend(found.operating_points.iter().map(|point| optional(point.reached.map(|r| r.found_share), 3)));
    row.extend([
        optional(error.map(|error| error.median), 3),
        optional(error.map(|error| error.p95), 3),
        optional(found.axis_rms_px, 3),
        optional(found.normalized_mean_square, 2),
    ]);
    Some(row)
}

fn error_table(title: &'static str, errors: &PoseErrorsWire) -> ErrorTable {
    let row = |name: &str, spread: &SpreadWire, factor: f64, digits: usize| {
        let shown = |value: f64| format!("{:.digits$}", value * factor);
        let numbers = [spread.mean, spread.standard_deviation, spread.median, spread.p95, spread.rms, spread.max];
        std::iter::once(name.to_owned()).chain(numbers.map(shown)).collect::<Vec<String>>()
    };
    let degrees = 1.0_f64.to_degrees();
    let rows = vec![
        row("x, mm", &errors.x_m, 1e3, 2),
        row("y, mm", &errors.y_m, 1e3, 2),
        row("z, mm", &errors.z_m, 1e3, 2),
        row("roll, °", &errors.roll_rad, degrees, 3),
        row("pitch, °", &errors.pitch_rad, degrees, 3),
        row("yaw, °", &errors.yaw_rad, degrees, 3),
        row("position, mm", &errors.position_m, 1e3, 2),
        row("position, % of the range", &errors.position_ratio, 100.0, 3),
        row("attitude, °", &errors.attitude_rad, degrees, 3),
    ];
    ErrorTable { title, count: errors.position_m.count, rows }
}

fn consistency_row(name: &str, found: &ConsistencyWire) -> Vec<String> {
    let [low, high] = found.band_95;
    vec![
        name.to_owned(),
        found.count.to_string(),
        format!("{:.2}", found.mean),
        format!("{low:.2} – {high:.2}"),
        with_interval(&found.within_95),
    ]
}

fn time_row(name: &str, spread: &SpreadWire) -> Vec<String> {
    let shown = |us: f64| format!("{:.2}", us * 1e-3);
    let numbers = [spread.mean, spread.median, spread.p95, spread.max].map(shown);
    [name.to_owned(), spread.count.to_string()].into_iter().chain(numbers).collect()
}
