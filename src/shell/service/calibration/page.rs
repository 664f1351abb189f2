//! The page about a calibration: one file that needs nothing else.

use askama::Template;

use super::sighting::Sighting;
use crate::board::Board;
use crate::calibrate::SeenPoint;
use crate::calibrate::drawing::{
    certainty_map, coverage_map, found_points, next_view_map, residual_field, view_errors,
};
use crate::calibrate::estimate::Calibration;
use crate::calibrate::report::Report;
use crate::shell::wire::CalibrationRequest;
use crate::shell::wire::calibration::CalibrationWire;

#[derive(Template)]
#[template(path = "calibration.html")]
struct Page<'a> {
    wire: &'a CalibrationWire,
    pattern: String,
    model: &'static str,
    width: u32,
    height: u32,
    counted: usize,
    held_out: Option<f64>,
    parameters: Vec<Parameter>,
    coverage: String,
    certainty: String,
    residuals: String,
    factor: f64,
    next_view: Option<String>,
    errors: String,
    rows: Vec<Row<'a>>,
    pictures: Vec<Picture<'a>>,
}

struct Parameter {
    name: &'static str,
    value: String,
    sigma: String,
}

struct Picture<'a> {
    name: &'a str,
    counts: bool,
    svg: String,
}

/// Pictures that are shown: a page of thousands opens nowhere.
const MAX_PICTURES: usize = 200;

/// A picture's line in the table.
struct Row<'a> {
    name: &'a str,
    points: usize,
    inliers: usize,
    rms_px: String,
    range_m: String,
    tilt_deg: String,
    reason: &'a str,
}

/// A number with so many digits after the point, or a dash.
fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "–".into(), |value| format!("{value:.digits$}"))
}

/// The page.
///
/// # Errors
/// If the page cannot be written, which is our failure.
pub(super) fn page(
    board: &Board,
    request: &CalibrationRequest,
    sightings: &[Sighting],
    found: &Calibration,
    report: &Report,
    wire: &CalibrationWire,
) -> askama::Result<String> {
    let size = [found.camera.width(), found.camera.height()];
    let views: Vec<Vec<SeenPoint>> =
        sightings.iter().map(|seen| if seen.reason.is_none() { seen.seen() } else { Vec::new() }).collect();
    let (residuals, factor) = residual_field(size, &views, found);
    let camera = &wire.camera;
    let values = [camera.fx, camera.fy, camera.cx, camera.cy];
    let names = ["fx, px", "fy, px", "cx, px", "cy, px"].iter().chain(found.camera.distortion().coefficient_names());
    let parameters = names
        .zip(values.iter().chain(&camera.distortion.coefficients))
        .zip(&found.standard_deviations)
        .map(|((name, value), sigma)| {
            let digits = digits_of(*sigma);
            let sigma = if *sigma > 0.0 { format!("{sigma:.digits$}") } else { "held".into() };
            Parameter { name, value: format!("{value:.digits$}"), sigma }
        })
        .collect();
    let pictures = sightings
        .iter()
        .zip(&views)
        .zip(&found.views)
        .take(MAX_PICTURES)
        .map(|((sighting, seen), fitted)| {
            let address = sighting.thumbnail.as_ref().map(|data| format!("data:image/jpeg;base64,{data}"));
            let svg = found_points(sighting.size.unwrap_or(size), address.as_deref(), seen, fitted);
            Picture { name: &sighting.name, counts: fitted.counts(), svg }
        })
        .collect();
    let rows = wire.views.iter().map(|view| Row {
        name: &view.name,
        points: view.points,
        inliers: view.inliers,
        rms_px: number(view.rms_px, 3),
        range_m: number(view.range_m, 3),
        tilt_deg: number(view.tilt_rad.map(f64::to_degrees), 0),
        reason: view.reason.as_deref().unwrap_or_default(),
    });
    Page {
        rows: rows.collect(),
        wire,
        pattern: match request.pattern.text() {
            text if text.len() > 80 => format!("{} dots", board.points().len()),
            text => text,
        },
        model: found.camera.distortion().name(),
        width: size[0],
        height: size[1],
        counted: wire.views.iter().filter(|view| view.counts).count(),
        held_out: wire.models.first().and_then(|chosen| chosen.held_out_rms_px),
        parameters,
        coverage: coverage_map(size, &report.coverage),
        certainty: certainty_map(size, &report.ray_sigmas_px),
        residuals,
        factor,
        next_view: report.next_view.as_ref().map(|next| next_view_map(size, &next.outline_px, &views)),
        errors: view_errors(found),
        pictures,
    }
    .render()
}

/// Digits after the point that show two digits of a deviation.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
fn digits_of(sigma: f64) -> usize {
    if sigma > 0.0 { (1.0 - sigma.log10().floor()).clamp(0.0, 9.0) as usize } else { 4 }
}
