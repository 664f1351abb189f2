//! Recorded frames with truth: figures of the whole pipeline.

mod table;

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

use super::super::Stop;
use super::super::outputs::write;
use super::Evaluate;
use crate::detect::Workspace;
use crate::shell::console::{complain, print_line, progress};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::grab::is_interrupted;
use crate::shell::service::compute::Terms;
use crate::shell::service::recorded::{Files, Unit, csv, finish, page, run_unit, units};
use crate::shell::wire::recorded::UnitOutcome;

/// Evaluates.
pub(super) fn run(asked: &Evaluate) -> Result<(), Stop> {
    let settings = asked.settings.load(Vec::new())?;
    let is_other_printed = asked.is_other_printed()?;
    let source = &asked.what;
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
    if let Some(path) = &asked.json {
        write(path, &json)?;
    }
    if !is_other_printed {
        print_line(table::of(&finished.wire).trim_end())?;
    }
    asked.note_report();
    Ok(())
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
                let mut workspace = Workspace::default();
                while goes_on.load(Ordering::Relaxed) {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(unit) = units.get(index) else { return };
                    if send.send((index, run_unit(unit, terms, &mut workspace, &mut step))).is_err() {
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
