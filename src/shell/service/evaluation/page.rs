//! The page about a study: one file that needs nothing else.

use askama::Template;

use crate::evaluate::row::ERRORS;
use crate::evaluate::study::{Layout, Poses, Study};
use crate::plot::Picture;
use crate::shell::service::drawing::Drawing;
use crate::shell::wire::Ref;
use crate::shell::wire::evaluation::EvaluationWire;
use crate::shell::wire::evaluation::figures::{ComparisonWire, EstimateWire, SolverFigures};
use crate::shell::wire::rate::RateWire;

#[derive(Template)]
#[template(path = "evaluation.html")]
struct Page<'a> {
    title: String,
    facts: Vec<(&'static str, String)>,
    parts: Vec<Part<'a>>,
    times: Vec<[String; 5]>,
    computing: String,
    pictures: Vec<Drawing>,
    undrawn: u64,
    /// Of a sweep they say more than its many tables.
    pictures_first: bool,
}

/// The tables at one value of the sweep, or the only ones.
struct Part<'a> {
    heading: String,
    solvers: Vec<Solver<'a>>,
    comparisons: Vec<Line>,
    has_claims: bool,
}

struct Solver<'a> {
    figures: &'a SolverFigures,
    rates: [String; 5],
    errors: Vec<[String; 6]>,
    over_bound: String,
    reasons: String,
    claims: Option<[String; 5]>,
}

struct Line {
    words: String,
    is_told: bool,
    p: String,
}

/// Values of a sweep whose tables stand in the page; the pictures show all.
const MAX_PARTS: usize = 12;

/// The page.
///
/// # Errors
/// If the page cannot be written, which is our failure.
pub(super) fn page(study: &Study, wire: &EvaluationWire, pictures: &[Picture]) -> askama::Result<String> {
    let mut parts = Vec::new();
    if wire.solvers.is_empty() {
        let name = study.sweep.as_ref().map_or("", |sweep| sweep.parameter.label());
        let stride = wire.steps.len().div_ceil(MAX_PARTS).max(1);
        for step in wire.steps.iter().step_by(stride) {
            let heading = format!("{name}: {}", step.value.unwrap_or_default());
            parts.push(part(heading, &step.solvers, &step.comparisons));
        }
    } else {
        parts.push(part("Figures".into(), &wire.solvers, &wire.comparisons));
    }
    let microseconds = |value: Option<f64>| number(value, "");
    let times = wire.timing.solvers.iter().map(|time| {
        let values = [time.mean_us, time.std_us, time.median_us, time.p95_us].map(microseconds);
        let [mean, std, median, p95] = values;
        [time.solver.clone(), mean, std, median, p95]
    });
    let page = Page {
        title: match &wire.request.study {
            Ref::Name(name) => name.clone(),
            Ref::Object(_) => "simulated study".into(),
        },
        facts: facts(study),
        parts,
        times: times.collect(),
        computing: number(Some(wire.timing.computing_s), " s"),
        pictures: pictures.iter().map(Drawing::from).collect(),
        undrawn: wire.undrawn,
        pictures_first: study.sweep.is_some(),
    };
    page.render()
}

fn part<'a>(heading: String, solvers: &'a [SolverFigures], comparisons: &[ComparisonWire]) -> Part<'a> {
    let has_claims = solvers.iter().any(|solver| solver.consistency.is_some());
    let line = |comparison: &ComparisonWire| {
        let [first, second] = &comparison.solvers;
        let [wins, losses] = comparison.wins;
        let by = match comparison.by.as_str() {
            "rotation_error" => "in rotation",
            "translation_error" => "in translation",
            _ => "alone near the truth",
        };
        let verdict = comparison.better.as_ref().map_or_else(
            || format!("no difference between {first} and {second}"),
            |better| format!("{better} is better than {}", if better == first { second } else { first }),
        );
        Line {
            words: format!("{verdict} {by}: {first} on {wins} cases, {second} on {losses}"),
            is_told: comparison.better.is_some(),
            p: if comparison.p_value < 1e-4 { "< 0.0001".into() } else { format!("{:.4}", comparison.p_value) },
        }
    };
    Part {
        heading,
        solvers: solvers.iter().map(solver).collect(),
        comparisons: comparisons.iter().map(line).collect(),
        has_claims,
    }
}

fn solver(figures: &SolverFigures) -> Solver<'_> {
    let errors = ERRORS.iter().filter_map(|name| {
        let error = figures.errors.get(*name)?;
        let (what, unit) = name.split_once('_').unwrap_or((name, ""));
        let unit = match unit {
            "deg" => "°",
            "ratio" => "",
            unit => unit,
        };
        let title = if unit.is_empty() { what.to_owned() } else { format!("{what}, {unit}") };
        Some([
            title,
            number(error.mean, ""),
            number(error.std, ""),
            estimate(error.rmse),
            estimate(error.median),
            number(error.p95, ""),
        ])
    });
    let claims = figures.consistency.as_ref().map(|consistency| {
        let [low, high] = consistency.band;
        [
            format!(
                "{} ({} to {})",
                number(Some(consistency.mean_nees), ""),
                number(Some(low), ""),
                number(Some(high), "")
            ),
            percent(&consistency.inside_95),
            figures.reliable_consistency.as_ref().map_or_else(dash, |reliable| percent(&reliable.inside_95)),
            number(figures.calibration_error, ""),
            number(figures.brier_score, ""),
        ]
    });
    // A solver alone states nothing of the kind.
    let claimed = |rate: &RateWire| if figures.consistency.is_some() { percent(rate) } else { dash() };
    let reasons = figures.reasons.iter().map(|(reason, count)| format!("{reason} {count}"));
    Solver {
        figures,
        rates: [
            percent(&figures.success_rate),
            percent(&figures.good_rate),
            percent(&figures.flip_rate),
            claimed(&figures.silent_flip_rate),
            claimed(&figures.ambiguous_rate),
        ],
        errors: errors.collect(),
        over_bound: estimate(figures.over_bound),
        reasons: reasons.collect::<Vec<_>>().join(", "),
        claims,
    }
}

fn facts(study: &Study) -> Vec<(&'static str, String)> {
    let camera = &study.camera;
    let [fx, fy] = camera.focal_lengths();
    let span = |[low, high]: [f64; 2]| if low < high { format!("{low} to {high}") } else { low.to_string() };
    let degrees = |[low, high]: [f64; 2]| span([low, high].map(|angle| (angle.to_degrees() * 10.0).round() / 10.0));
    let points = match &study.points {
        Layout::Random { count, size_m: [x, y, z] } => format!("{count}, anew for each case, in {x} x {y} x {z} m"),
        Layout::Given(target) => format!("the {} markers of {}", target.markers().len(), target.name()),
    };
    let poses = match study.poses {
        Poses::Free { max_angle_rad, translation_m: [x, y, z] } => format!(
            "angles within {:.1}°, x {} m, y {} m, z {} m",
            max_angle_rad.to_degrees(),
            span(x),
            span(y),
            span(z)
        ),
        Poses::InPicture { range_m, tilt_rad } => {
            format!("{} m away, tilted by {}°", span(range_m), degrees(tilt_rad))
        }
    };
    let noise = &study.disturbance;
    let disturbances: Vec<String> = [
        ("noise", noise.pixel_sigma_px, " px"),
        ("wrong pairs", 100.0 * noise.outlier_ratio, " %"),
        ("missing points", 100.0 * noise.missing_ratio, " %"),
        ("rounded to", noise.quantisation_px, " px"),
        ("focal length off by", 100.0 * noise.focal_error_ratio, " %"),
        ("principal point off by", noise.center_error_px, " px"),
    ]
    .into_iter()
    .filter(|(_, size, _)| *size > 0.0)
    .map(|(what, size, unit)| format!("{what} {size}{unit}"))
    .collect();
    let mut facts = vec![
        ("cases", format!("{} runs, seed {}", study.runs, study.seed)),
        ("camera", format!("{} x {} px, fx {fx:.1}, fy {fy:.1} px", camera.width(), camera.height())),
        ("points", points),
        ("poses", format!("{poses}, {}", if study.in_view { "all points in the picture" } else { "no limit of view" })),
        ("disturbances", if disturbances.is_empty() { "none".into() } else { disturbances.join(", ") }),
    ];
    if let Some(sweep) = &study.sweep {
        let values: Vec<String> = sweep.values.iter().map(ToString::to_string).collect();
        facts.push(("swept", format!("{}: {}", sweep.parameter.label(), values.join(", "))));
    }
    facts
}

fn dash() -> String {
    "–".into()
}

fn percent(rate: &RateWire) -> String {
    let Some(ratio) = rate.ratio else { return dash() };
    let [low, high] = rate.interval.map(|share| 100.0 * share);
    format!("{:.1} % ({low:.1} to {high:.1})", 100.0 * ratio)
}

fn estimate(estimate: Option<EstimateWire>) -> String {
    let Some(EstimateWire { value, interval }) = estimate else { return dash() };
    let value = number(Some(value), "");
    match interval {
        Some([low, high]) => format!("{value} ({} to {})", number(Some(low), ""), number(Some(high), "")),
        None => value,
    }
}

/// Three digits that count.
pub(in crate::shell) fn number(value: Option<f64>, unit: &str) -> String {
    let Some(value) = value.filter(|value| value.is_finite()) else { return dash() };
    let digits = match value.abs() {
        size if size >= 1e6 => return format!("{value:.2e}{unit}"),
        size if size >= 99.95 => 0,
        size if size >= 9.995 => 1,
        size if size >= 0.9995 => 2,
        size if size >= 0.099_95 => 3,
        size if size >= 0.009_995 => 4,
        0.0 => 0,
        size if size >= 1e-4 => 5,
        _ => return format!("{value:.2e}{unit}"),
    };
    format!("{value:.digits$}{unit}")
}
