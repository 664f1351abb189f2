//! Figures of recorded frames for people.

use std::fmt::Write;

use crate::shell::wire::rate::RateWire;
use crate::shell::wire::recorded::{
    ConsistencyWire, DetectionFiguresWire, FiguresWire, PoseErrorsWire, RecordedWire, SpreadWire, TargetFiguresWire,
};

/// All tables.
pub(super) fn of(wire: &RecordedWire) -> String {
    let mut text = String::new();
    // Writing into a string does not fail.
    let _ = targets(&mut text, wire);
    let _ = detections(&mut text, wire);
    if let Some(found) = &wire.all.targets {
        let _ = poses(&mut text, found);
    }
    if let Some(found) = &wire.all.detection {
        let _ = classes(&mut text, found);
    }
    let _ = latency(&mut text, wire);
    if !wire.failed.is_empty() {
        let frames: u32 = wire.failed.iter().map(|lost| lost.frames).sum();
        let _ = writeln!(text, "{frames} frames could not be looked at and are counted nowhere above.");
    }
    text
}

/// The suites and, where there are several, all.
fn rows(wire: &RecordedWire) -> impl Iterator<Item = &FiguresWire> {
    wire.suites.iter().chain((wire.suites.len() > 1).then_some(&wire.all))
}

fn seconds(wire: &RecordedWire, suite: &str) -> String {
    let of_suite = wire.timing.suites.iter().find(|timing| timing.suite == suite).map(|timing| &timing.total_us);
    let total = of_suite.or_else(|| wire.timing.stages_us.get("total"));
    total.map_or_else(String::new, |total| format!("{:.4}", total.mean * 1e-6))
}

/// The share with its interval, percent.
fn percent(rate: &RateWire) -> String {
    let Some(share) = rate.ratio else { return "-".into() };
    let [low, high] = rate.interval.map(|end| 100.0 * end);
    format!("{:.1} ({low:.0}-{high:.0})", 100.0 * share)
}

fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".into(), |value| format!("{value:.digits$}"))
}

fn targets(text: &mut String, wire: &RecordedWire) -> std::fmt::Result {
    if wire.all.targets.is_none() {
        return Ok(());
    }
    writeln!(
        text,
        "{:<12}{:>7}{:>10}{:>18}{:>12}{:>18}{:>8}{:>9}{:>8}{:>7}{:>10}{:>9}",
        "targets",
        "frames",
        "detected",
        "rate, %",
        "identified",
        "rate, %",
        "right",
        "flagged",
        "missed",
        "wrong",
        "invented",
        "s/frame"
    )?;
    for (figures, found) in rows(wire).filter_map(|figures| Some((figures, figures.targets.as_ref()?))) {
        writeln!(
            text,
            "{:<12}{:>7}{:>10}{:>18}{:>12}{:>18}{:>8}{:>9}{:>8}{:>7}{:>10}{:>9}",
            figures.suite,
            figures.frames,
            found.detected.count,
            percent(&found.detected),
            found.identified.count,
            percent(&found.identified),
            found.right.count,
            found.flagged,
            found.missed,
            found.wrong,
            found.invented.count,
            seconds(wire, &figures.suite)
        )?;
    }
    writeln!(text)
}

fn detections(text: &mut String, wire: &RecordedWire) -> std::fmt::Result {
    let Some(all) = &wire.all.detection else { return Ok(()) };
    // The middle of a box is no centroid; of boxes the seed's rate is told instead, frames in which something was found.
    let has_centroids = all.axis_rms_px.is_some();
    let heads = if has_centroids { ["rms, px", "(e/s)^2"] } else { ["frames hit", "rate, %"] };
    writeln!(
        text,
        "{:<12}{:>7}{:>9}{:>8}{:>18}{:>13}{:>9}{:>8}{:>7}{:>12}{:>18}{:>9}",
        "detections",
        "frames",
        "things",
        "found",
        "rate, %",
        "false/frame",
        "at 0.01",
        "at 0.1",
        "at 1",
        heads[0],
        heads[1],
        "s/frame"
    )?;
    for (figures, found) in rows(wire).filter_map(|figures| Some((figures, figures.detection.as_ref()?))) {
        let at = |index: usize| {
            let point = found.operating_points.get(index);
            optional(point.and_then(|point| Some(point.reached?.found_share)), 3)
        };
        let last = if has_centroids {
            [optional(found.axis_rms_px, 3), optional(found.normalized_mean_square, 2)]
        } else {
            [found.frames_found.count.to_string(), percent(&found.frames_found)]
        };
        writeln!(
            text,
            "{:<12}{:>7}{:>9}{:>8}{:>18}{:>13.3}{:>9}{:>8}{:>7}{:>12}{:>18}{:>9}",
            figures.suite,
            found.frames,
            found.found.of,
            found.found.count,
            percent(&found.found),
            found.false_alarms_per_frame,
            at(0),
            at(1),
            at(2),
            last[0],
            last[1],
            seconds(wire, &figures.suite)
        )?;
    }
    writeln!(text)
}

fn poses(text: &mut String, found: &TargetFiguresWire) -> std::fmt::Result {
    if let Some(errors) = &found.errors {
        pose_errors(text, "errors of all poses", errors)?;
    }
    // Where all are right they are the same.
    if let Some(errors) = found.errors_of_right.as_ref().filter(|_| found.errors != found.errors_of_right) {
        pose_errors(text, "errors of right poses", errors)?;
    }
    let held: [(&str, &Option<ConsistencyWire>); 2] =
        [("all", &found.normalized_error_squared), ("called reliable", &found.normalized_error_squared_of_reliable)];
    for (name, consistency) in held {
        if let Some(found) = consistency {
            let [low, high] = found.band_95;
            writeln!(
                text,
                "covariances, {name}: error^2 over covariance {:.2} on average of {} (6 if they hold, then within {low:.2} to \
                 {high:.2}); {} % inside their 95 %",
                found.mean,
                found.count,
                percent(&found.within_95)
            )?;
        }
    }
    let stated: Vec<String> = found
        .probabilities
        .iter()
        .filter(|bin| bin.right.of > 0)
        .map(|bin| format!("{:.2}: {:.2} of {}", bin.stated, bin.right.ratio.unwrap_or_default(), bin.right.of))
        .collect();
    if !stated.is_empty() {
        writeln!(text, "probabilities, stated: right: {}", stated.join(", "))?;
    }
    writeln!(text)
}

fn pose_errors(text: &mut String, title: &str, errors: &PoseErrorsWire) -> std::fmt::Result {
    writeln!(
        text,
        "{:<26}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}",
        format!("{title} ({})", errors.position_m.count),
        "mean",
        "std",
        "median",
        "95 %",
        "rmse",
        "largest"
    )?;
    let degrees = 1.0_f64.to_degrees();
    let lines: [(&str, &SpreadWire, f64); 9] = [
        ("  x, mm", &errors.x_m, 1e3),
        ("  y, mm", &errors.y_m, 1e3),
        ("  z, mm", &errors.z_m, 1e3),
        ("  roll, deg", &errors.roll_rad, degrees),
        ("  pitch, deg", &errors.pitch_rad, degrees),
        ("  yaw, deg", &errors.yaw_rad, degrees),
        ("  position, mm", &errors.position_m, 1e3),
        ("  position, % of range", &errors.position_ratio, 100.0),
        ("  attitude, deg", &errors.attitude_rad, degrees),
    ];
    for (name, spread, factor) in lines {
        write!(text, "{name:<26}")?;
        for value in [spread.mean, spread.standard_deviation, spread.median, spread.p95, spread.rms, spread.max] {
            write!(text, "{:>10.3}", value * factor)?;
        }
        writeln!(text)?;
    }
    writeln!(text)
}

fn classes(text: &mut String, found: &DetectionFiguresWire) -> std::fmt::Result {
    if found.classes.is_empty() {
        return Ok(());
    }
    let counts: Vec<String> = found
        .classes
        .iter()
        .map(|class| format!("{} {} called {}", class.count, class.truth, class.stated.as_deref().unwrap_or("nothing")))
        .collect();
    writeln!(text, "classes of what was found: {}\n", counts.join(", "))
}

fn latency(text: &mut String, wire: &RecordedWire) -> std::fmt::Result {
    writeln!(text, "{:<12}{:>9}{:>9}{:>9}{:>9}", "latency, ms", "mean", "median", "95 %", "largest")?;
    for stage in ["decode", "detect", "identify", "solve", "total"] {
        if let Some(spread) = wire.timing.stages_us.get(stage) {
            write!(text, "  {stage:<10}")?;
            for us in [spread.mean, spread.median, spread.p95, spread.max] {
                write!(text, "{:>9.2}", us * 1e-3)?;
            }
            writeln!(text)?;
        }
    }
    Ok(())
}
