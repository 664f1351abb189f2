//! All outcomes to figures.

use std::collections::BTreeMap;

use crate::evaluate::recorded::{Figures, Plots, Spread, Tally, plots};
use crate::shell::wire::recorded::{
    FiguresWire, FrameOutcome, RecordedWire, SpreadWire, SuiteTimingWire, TimingFiguresWire, UnitOutcome,
};
use crate::shell::wire::sighting::Timing;

/// What an evaluation gives.
#[derive(Clone, Debug)]
pub struct Finished {
    /// The figures.
    pub wire: RecordedWire,
    /// Drawings.
    pub plots: Plots,
}

/// Times of one suite or of all, us.
#[derive(Default)]
struct Times(Vec<Timing>);

/// The stages in their order.
const STAGES: [&str; 5] = ["decode", "detect", "identify", "solve", "total"];

impl Times {
    fn of(&self, stage: &str) -> Option<Spread> {
        let time = |timing: &Timing| match stage {
            "decode" => Some(timing.decode),
            "detect" => Some(timing.detect),
            "identify" => timing.identify,
            "solve" => timing.solve,
            _ => Some(timing.total),
        };
        Spread::of(self.0.iter().filter_map(time).map(|us| us as f64))
    }
}

/// The figures of all outcomes, which come in the order of their units.
#[must_use]
pub fn finish(outcomes: Vec<UnitOutcome>) -> Finished {
    let mut order: Vec<String> = Vec::new();
    let mut suites: BTreeMap<String, (Tally, Times)> = BTreeMap::new();
    let (mut all, mut all_times) = (Tally::default(), Times::default());
    let mut failed = Vec::new();
    for outcome in outcomes {
        if !order.contains(&outcome.suite) {
            order.push(outcome.suite.clone());
        }
        let (tally, times) = suites.entry(outcome.suite).or_default();
        for frame in outcome.frames {
            times.0.push(frame.timing_us);
            all_times.0.push(frame.timing_us);
            let verdict = frame.verdict();
            tally.add(verdict.clone());
            all.add(verdict);
        }
        for lost in outcome.failed {
            for _ in 0..lost.frames {
                tally.add_failed();
                all.add_failed();
            }
            failed.push(lost);
        }
    }
    let figures: Vec<(&str, Figures)> =
        order.iter().filter_map(|name| Some((name.as_str(), suites.get(name)?.0.figures()))).collect();
    let all = all.figures();
    let milliseconds = |spread: Spread| Spread {
        median: spread.median * 1e-3,
        p95: spread.p95 * 1e-3,
        largest: spread.largest * 1e-3,
        ..spread
    };
    let latency: Vec<(&str, Spread)> =
        STAGES.into_iter().filter_map(|stage| Some((stage, milliseconds(all_times.of(stage)?)))).collect();
    let plots = plots(&figures, &all, &latency);
    let stages_us = STAGES
        .into_iter()
        .filter_map(|stage| Some((stage.to_owned(), SpreadWire::from(&all_times.of(stage)?))))
        .collect();
    let timed = order.iter().filter_map(|name| {
        let total = suites.get(name)?.1.of("total")?;
        Some(SuiteTimingWire { suite: name.clone(), total_us: (&total).into() })
    });
    let timing = TimingFiguresWire { stages_us, suites: timed.collect() };
    let wire = RecordedWire {
        suites: figures.iter().map(|(name, figures)| FiguresWire::of(name, figures)).collect(),
        all: FiguresWire::of("all", &all),
        failed,
        timing,
    };
    Finished { wire, plots }
}

/// A table with a row for each frame (RFC 4180).
#[must_use]
pub fn csv(outcomes: &[UnitOutcome]) -> String {
    let line = |cells: &mut dyn Iterator<Item = String>| cells.collect::<Vec<_>>().join(",") + "\r\n";
    let heads = ["suite", "frame", "frame_index"].into_iter().chain(FrameOutcome::HEADS).chain(["failed"]);
    let mut text = line(&mut heads.map(str::to_owned));
    let shown = |index: Option<u64>| index.map_or_else(String::new, |index| index.to_string());
    for unit in outcomes {
        let start = |index| [quoted(&unit.suite), quoted(&unit.name), shown(index)].into_iter();
        for frame in &unit.frames {
            let cells = frame.cells().into_iter().chain([String::new()]);
            text.push_str(&line(&mut start(frame.frame_index).chain(cells)));
        }
        for lost in &unit.failed {
            let nothing = std::iter::repeat_n(String::new(), FrameOutcome::HEADS.len());
            text.push_str(&line(&mut start(lost.frame_index).chain(nothing).chain([quoted(&lost.reason)])));
        }
    }
    text
}

fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.to_owned() }
}
