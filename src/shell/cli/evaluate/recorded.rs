//! Recorded frames with truth: figures of the whole pipeline.

mod table;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

use clap::Args;

use super::super::inputs::unwritable;
use super::super::{SettingsArgs, Stop};
use crate::detect::Detector;
use crate::shell::console::{complain, note, print_line, progress};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::grab::is_interrupted;
use crate::shell::service::compute::Terms;
use crate::shell::service::recorded::{Files, Unit, csv, finish, page, run_unit, units};
use crate::shell::wire::recorded::UnitOutcome;
use crate::shell::wire::{DetectorWire, from_json};

pub(in crate::shell::cli) const EXAMPLES: &str = "Examples:
  skypose evaluate recordings --report report.html
  skypose evaluate recordings.zip --json figures.json --cases frames.csv
  skypose evaluate recordings --detector '{\"method\": \"edge\", \"preset\": \"thesis\"}'

The folder or archive holds frames or videos and truth.json, which says what they show (docs/recorded.md).";

#[derive(Args, Debug)]
pub(in crate::shell::cli) struct Recorded {
    /// A folder or an archive (zip, tar) of frames or videos with truth.json, or that file itself.
    #[arg(value_name = "FOLDER|ARCHIVE")]
    source: PathBuf,
    /// Take this detector for all frames, whatever their truth names: JSON as in the API, such as '{"method": "edge", "preset": "thesis"}'.
    #[arg(long, value_name = "JSON", value_parser = detector)]
    detector: Option<DetectorWire>,
    /// Write the figures as JSON; - prints them instead of the tables.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a page that needs nothing else: tables, receiver curve, errors over range, whether probabilities hold.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Write a table with a row for each frame.
    #[arg(long, value_name = "FILE.csv")]
    cases: Option<PathBuf>,
    /// Frames or videos at once [default: one for each core]. With 1 no frame waits for another, and latencies are those of a
    /// frame alone.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    #[command(flatten)]
    settings: SettingsArgs,
}

fn detector(text: &str) -> Result<DetectorWire, String> {
    let wire: DetectorWire = from_json(text.as_bytes()).map_err(|fault| fault.to_string())?;
    Detector::try_from(&wire).map(|_| wire).map_err(|fault| fault.to_string())
}

/// Evaluates.
pub(super) fn run(asked: &Recorded) -> Result<(), Stop> {
    let settings = asked.settings.load(Vec::new())?;
    let source = &asked.source;
    let named =
        |fault: Fault, name: &Path| Fault { detail: format!("{}: {fault}", name.display()), pointer: None, ..fault };
    let files = Files::open(source).map_err(|fault| named(fault, source))?;
    let truth = if source.ends_with(files.truth_name()) { source.clone() } else { source.join(files.truth_name()) };
    let units = units(&files, asked.detector.as_ref()).map_err(|fault| named(fault, &truth))?;
    let threads = asked.threads.map_or_else(|| settings.workers.thread_count(), usize::from);
    let outcomes = looked(&units, &Terms::of(&settings), threads)?;
    for lost in outcomes.iter().flat_map(|outcome| &outcome.failed) {
        let from = lost.frame_index.map(|index| format!(", from frame {index} on")).unwrap_or_default();
        complain(&format!("{}{from}: {}", lost.frame, lost.reason));
    }
    if let Some(path) = &asked.cases {
        write(path, &csv(&outcomes))?;
    }
    let finished = finish(outcomes);
    if let Some(path) = &asked.report {
        let name = source.canonicalize().ok().and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned()));
        write(path, &page(&name.unwrap_or_else(|| "frames".into()), &finished)?)?;
    }
    let json =
        serde_json::to_string(&finished.wire).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))?;
    match &asked.json {
        Some(path) if path.as_os_str() == "-" => return Ok(print_line(&json)?),
        Some(path) => write(path, &json)?,
        None => {}
    }
    print_line(table::of(&finished.wire).trim_end())?;
    if let Some(path) = &asked.report {
        note(&format!("The report: {}", path.display()));
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<(), Fault> {
    std::fs::write(path, text).map_err(|error| unwritable(path, &error))
}

/// All units, several at a time, in their order.
fn looked(units: &[Unit], terms: &Terms, threads: usize) -> Result<Vec<UnitOutcome>, Stop> {
    let bar = progress(units.iter().map(Unit::frame_count).sum(), "frames");
    let next = AtomicUsize::new(0);
    let goes_on = AtomicBool::new(true);
    let (send, receive) = mpsc::channel();
    let mut found: Vec<(usize, UnitOutcome)> = std::thread::scope(|scope| {
        for _ in 0..threads.min(units.len()) {
            let (send, next, bar, goes_on) = (send.clone(), &next, &bar, &goes_on);
            scope.spawn(move || {
                let mut step = || {
                    bar.inc(1);
                    if is_interrupted() {
                        goes_on.store(false, Ordering::Relaxed);
                    }
                    goes_on.load(Ordering::Relaxed)
                };
                while goes_on.load(Ordering::Relaxed) {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(unit) = units.get(index) else { return };
                    if send.send((index, run_unit(unit, terms, &mut step))).is_err() {
                        return;
                    }
                }
            });
        }
        drop(send);
        receive.into_iter().collect()
    });
    bar.finish_and_clear();
    if !goes_on.load(Ordering::Relaxed) || is_interrupted() {
        return Err(Stop::Interrupted);
    }
    found.sort_by_key(|(index, _)| *index);
    Ok(found.into_iter().map(|(_, outcome)| outcome).collect())
}
