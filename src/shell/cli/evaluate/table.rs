//! The figures of a study for people.

use std::fmt::Write;

use crate::shell::service::evaluation::number;
use crate::shell::wire::evaluation::EvaluationWire;
use crate::shell::wire::evaluation::figures::{ComparisonWire, SolverFigures, TimingWire};
use crate::shell::wire::rate::RateWire;

/// Letters for what a line is about.
const LEFT: usize = 26;
/// Letters for each solver.
const COLUMN: usize = 24;

/// Tables with one column a solver, as the thesis has them, and then one line a difference.
pub(super) fn of(wire: &EvaluationWire) -> String {
    let mut text = String::new();
    // Writing into a string does not fail.
    let _ = if wire.solvers.is_empty() {
        swept(&mut text, wire)
    } else {
        single(&mut text, &wire.solvers, &wire.comparisons, &wire.timing)
    };
    if wire.undrawn > 0 {
        let _ = writeln!(text, "\nFor {} runs no case could be drawn.", wire.undrawn);
    }
    text.trim_end().to_owned()
}

fn single(
    text: &mut String,
    solvers: &[SolverFigures],
    comparisons: &[ComparisonWire],
    timing: &TimingWire,
) -> std::fmt::Result {
    let mut line = |title: &str, cells: Vec<String>| {
        write!(text, "{title:<LEFT$}")?;
        for cell in cells {
            write!(text, "{cell:>COLUMN$}")?;
        }
        writeln!(text)
    };
    let each = |of: &dyn Fn(&SolverFigures) -> String| solvers.iter().map(of).collect::<Vec<_>>();
    line("", each(&|solver| solver.solver.clone()))?;
    for (name, unit) in
        [("roll_deg", "deg"), ("pitch_deg", "deg"), ("yaw_deg", "deg"), ("x_m", "m"), ("y_m", "m"), ("z_m", "m")]
    {
        let what = name.split('_').next().unwrap_or(name);
        let cells = each(&|solver| {
            let error = solver.errors.get(name);
            let part = |value: Option<f64>| number(value, "");
            format!("{} +- {}", part(error.and_then(|e| e.mean)), part(error.and_then(|e| e.std)))
        });
        line(&format!("{what} error, {unit}"), cells)?;
    }
    for (name, title) in [("rotation_deg", "rotation error, deg"), ("translation_m", "translation error, m")] {
        let of = |solver: &SolverFigures,
                  pick: fn(&crate::shell::wire::evaluation::figures::ErrorWire) -> Option<f64>| {
            number(solver.errors.get(name).and_then(pick), "")
        };
        line(&format!("{title}: median"), each(&|solver| of(solver, |error| error.median.map(|median| median.value))))?;
        line("    95 % below", each(&|solver| of(solver, |error| error.p95)))?;
        line("    RMSE", each(&|solver| of(solver, |error| error.rmse.map(|rmse| rmse.value))))?;
    }
    line("error / Cramer-Rao bound", each(&|solver| number(solver.over_bound.map(|bound| bound.value), "")))?;
    line("a pose", each(&|solver| percent(&solver.success_rate)))?;
    line("near the truth", each(&|solver| percent(&solver.good_rate)))?;
    line("flips", each(&|solver| percent(&solver.flip_rate)))?;
    if solvers.iter().any(|solver| solver.consistency.is_some()) {
        line("flips without warning", each(&|solver| percent(&solver.silent_flip_rate)))?;
        let inside = |solver: &SolverFigures| {
            solver.consistency.map_or_else(|| number(None, ""), |consistency| percent(&consistency.inside_95))
        };
        line("within the stated 95 %", each(&inside))?;
        line("probabilities off by", each(&|solver| number(solver.calibration_error, "")))?;
    }
    let times = timing.solvers.iter();
    line(
        "time, us",
        times.map(|time| format!("{} +- {}", number(time.mean_us, ""), number(time.std_us, ""))).collect(),
    )?;
    for solver in solvers.iter().filter(|solver| !solver.reasons.is_empty()) {
        let reasons: Vec<String> = solver.reasons.iter().map(|(reason, count)| format!("{reason} {count}")).collect();
        writeln!(text, "{} has no pose: {}", solver.solver, reasons.join(", "))?;
    }
    writeln!(text)?;
    differences(text, comparisons)?;
    let cases = solvers.first().map_or(0, |solver| solver.cases);
    writeln!(text, "{cases} cases, {} s of computing", number(Some(timing.computing_s), ""))
}

fn differences(text: &mut String, comparisons: &[ComparisonWire]) -> std::fmt::Result {
    for comparison in comparisons {
        let [first, second] = &comparison.solvers;
        let [wins, losses] = comparison.wins;
        let by = comparison.by.replace('_', " ");
        let verdict =
            comparison.better.as_ref().map_or_else(|| "may be chance".into(), |better| format!("{better} is better"));
        let p = if comparison.p_value < 1e-4 { "p < 0.0001".into() } else { format!("p = {:.4}", comparison.p_value) };
        writeln!(text, "{by}: {first} {wins}, {second} {losses}: {verdict} ({p})")?;
    }
    Ok(())
}

fn swept(text: &mut String, wire: &EvaluationWire) -> std::fmt::Result {
    let parameter = wire.request.sweep.as_ref().and_then(|sweep| serde_json::to_value(sweep.parameter).ok());
    let parameter = parameter.as_ref().and_then(|name| name.as_str()).unwrap_or_default();
    writeln!(
        text,
        "{parameter:>18}  {:<20}{:>12}{:>14}{:>10}{:>10}{:>9}{:>12}",
        "solver", "median, deg", "median, m", "/ bound", "near, %", "flips, %", "in 95 %, %"
    )?;
    let share = |rate: &RateWire| number(rate.ratio.map(|ratio| 100.0 * ratio), "");
    for step in &wire.steps {
        for solver in &step.solvers {
            let median = |name: &str| number(solver.errors.get(name).and_then(|error| Some(error.median?.value)), "");
            writeln!(
                text,
                "{:>18}  {:<20}{:>12}{:>14}{:>10}{:>10}{:>9}{:>12}",
                number(step.value, ""),
                solver.solver,
                median("rotation_deg"),
                median("translation_m"),
                number(solver.over_bound.map(|bound| bound.value), ""),
                share(&solver.good_rate),
                share(&solver.flip_rate),
                solver.consistency.map_or_else(|| number(None, ""), |consistency| share(&consistency.inside_95)),
            )?;
        }
    }
    writeln!(text, "\n{} s of computing", number(Some(wire.timing.computing_s), ""))
}

fn percent(rate: &RateWire) -> String {
    rate.ratio.map_or_else(|| "–".into(), |ratio| format!("{:.1} %", 100.0 * ratio))
}
