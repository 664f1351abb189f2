//! A simulated study on the threads of this machine.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread;

use super::super::inputs::{json_of, unwritable};
use super::super::outputs::{is_printed, write};
use super::super::{Stop, runtime};
use super::{Evaluate, table};
use crate::evaluate::{Row, Shard, Study};
use crate::shell::console::{print_line, progress};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::evaluation::cases::{csv_head, csv_line, json_line};
use crate::shell::service::evaluation::{checked, clock, evaluated, resolved};
use crate::shell::service::lookup::Lookup;
use crate::shell::store::Store;
use crate::shell::wire::EvaluationRequest;
use crate::shell::wire::encounters::ENCOUNTERS;
use crate::shell::wire::evaluation::{EvaluationWire, SweepWire, THESIS};

/// Rows that are written at most: some gigabytes.
const MAX_ROWS: u64 = 20_000_000;

pub(super) fn run(asked: &Evaluate) -> Result<(), Stop> {
    let settings = asked.settings.load(Vec::new())?;
    let is_other_printed = asked.is_other_printed()?;
    let request = request_of(asked)?;
    let request = runtime()?.block_on(async {
        let store = match &asked.settings.data {
            Some(folder) => Some(Store::open(folder).await?),
            None => None,
        };
        resolved(request, &Lookup::new(store.as_ref(), std::sync::Arc::default())).await
    })?;
    let study = checked(&request)?;
    let rows = study.solves();
    if asked.cases.is_some() && rows > MAX_ROWS {
        let detail = format!("{rows} cases are too many for a file: at most {MAX_ROWS} are written");
        return Err(Fault::new(FaultKind::Senseless, detail).into());
    }
    let threads = asked.threads.map_or_else(|| settings.workers.thread_count(), usize::from);
    let mut writer = asked.cases.as_deref().map(|path| Cases::create(path, &study)).transpose()?;
    let keeps_rows = study.keeps_rows() || writer.is_some();
    let sums = computed(&study, threads, keeps_rows, &mut |rows| {
        writer.as_mut().map_or(Ok(()), |writer| writer.write(&study, rows))
    })?;
    if let Some(writer) = writer {
        writer.close()?;
    }
    let done = evaluated(request, &study, &sums)?;
    for (path, text) in [(&asked.report, &done.page), (&asked.json, &json_text(&done.wire)?)] {
        if let Some(path) = path {
            write(path, text)?;
        }
    }
    if !is_other_printed {
        print_line(&table::of(&done.wire))?;
    }
    asked.note_report();
    Ok(())
}

/// The request of the file or of the name, with what the options say over it.
fn request_of(asked: &Evaluate) -> Result<EvaluationRequest, Fault> {
    let mut request = if asked.what.as_os_str() == THESIS {
        EvaluationRequest::named(THESIS)
    } else if asked.what.exists() {
        json_of(&asked.what)?
    } else {
        let detail = format!(
            "{}: no such file, and no study of that name; there is {THESIS}, and {ENCOUNTERS}",
            asked.what.display()
        );
        return Err(Fault::new(FaultKind::NotFound, detail));
    };
    if let Some(runs) = asked.runs {
        request.runs = runs;
    }
    if let Some(seed) = asked.seed {
        request.seed = seed;
    }
    if asked.solvers.is_some() {
        request.solvers.clone_from(&asked.solvers);
    }
    if let Some(text) = &asked.sweep {
        request.sweep = Some(sweep_of(text)?);
    }
    Ok(request)
}

fn sweep_of(text: &str) -> Result<SweepWire, Fault> {
    let wrong = |detail: String| Fault::new(FaultKind::Senseless, format!("--sweep {text}: {detail}"));
    let (name, values) = text.split_once('=').ok_or_else(|| wrong("PARAMETER=V,V,... is expected".into()))?;
    let parameter =
        serde_json::from_value(serde_json::Value::String(name.into())).map_err(|error| wrong(error.to_string()))?;
    let values =
        values.split(',').map(|value| value.trim().parse().map_err(|_| wrong(format!("{value:?} is no number"))));
    Ok(SweepWire { parameter, values: values.collect::<Result<_, _>>()? })
}

fn json_text(wire: &EvaluationWire) -> Result<String, Fault> {
    serde_json::to_string_pretty(wire).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))
}

/// All parts of the study, merged in their order. `write` gets the rows in their order too, if they are kept at all.
fn computed(
    study: &Study,
    threads: usize,
    keeps_rows: bool,
    write: &mut dyn FnMut(&[Row]) -> Result<(), Fault>,
) -> Result<Shard, Fault> {
    let bar = progress(usize::try_from(study.solves()).unwrap_or(usize::MAX), "solves");
    let (next, wanted) = (AtomicU64::new(0), AtomicBool::new(true));
    // A few parts ahead of the one that is waited for, so that rows do not pile up.
    let (send, receive) = mpsc::sync_channel(threads.max(1));
    let sums = thread::scope(|scope| {
        for _ in 0..threads.clamp(1, usize::try_from(study.shards()).unwrap_or(usize::MAX)) {
            let (send, next, wanted, bar) = (send.clone(), &next, &wanted, &bar);
            scope.spawn(move || {
                let clock = clock();
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= study.shards() {
                        return;
                    }
                    let mut rows = Vec::new();
                    let mut fresh = 0_u32;
                    let part = Shard::run(study, number, &clock, &mut |row| {
                        if keeps_rows {
                            rows.push(row);
                        }
                        fresh += 1;
                        if fresh == 256 {
                            bar.inc(256);
                            fresh = 0;
                        }
                        wanted.load(Ordering::Relaxed)
                    });
                    bar.inc(fresh.into());
                    let Some(part) = part else { return };
                    if send.send((number, part, rows)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(send);
        let mut sums = Shard::default();
        let mut early = BTreeMap::new();
        let mut turn = 0;
        for (number, part, rows) in receive {
            early.insert(number, (part, rows));
            while let Some((mut part, rows)) = early.remove(&turn) {
                if let Err(fault) = write(&rows) {
                    wanted.store(false, Ordering::Relaxed);
                    return Err(fault);
                }
                if study.keeps_rows() {
                    part.rows = rows;
                }
                sums.merge(part);
                turn += 1;
            }
        }
        Ok(sums)
    });
    bar.finish_and_clear();
    sums
}

/// A file of rows.
struct Cases<'a> {
    path: &'a Path,
    file: BufWriter<Box<dyn Write>>,
    is_csv: bool,
}

impl<'a> Cases<'a> {
    fn create(path: &'a Path, study: &Study) -> Result<Self, Fault> {
        let file: Box<dyn Write> = if is_printed(path) {
            Box::new(std::io::stdout())
        } else {
            Box::new(File::create(path).map_err(|error| unwritable(path, &error))?)
        };
        let is_csv = path.extension().is_none_or(|ending| ending != "json" && ending != "jsonl");
        let mut cases = Self { path, file: BufWriter::new(file), is_csv };
        if is_csv {
            cases.line(&csv_head(study))?;
        }
        Ok(cases)
    }

    fn write(&mut self, study: &Study, rows: &[Row]) -> Result<(), Fault> {
        let line = if self.is_csv { csv_line } else { json_line };
        rows.iter().try_for_each(|row| self.line(&line(study, row)))
    }

    fn line(&mut self, line: &str) -> Result<(), Fault> {
        writeln!(self.file, "{line}").map_err(|error| unwritable(self.path, &error))
    }

    fn close(mut self) -> Result<(), Fault> {
        self.file.flush().map_err(|error| unwritable(self.path, &error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_the_same_on_any_number_of_threads() {
        let study = Study::thesis_2012(6_000, 11);
        assert!(study.shards() > 2);
        let on = |threads| {
            let mut order = Vec::new();
            let sums = computed(&study, threads, true, &mut |rows| {
                order.extend(rows.iter().map(|row| (row.run, row.method)));
                Ok(())
            });
            (sums.expect("computes"), order)
        };
        let (one, one_order) = on(1);
        let (three, three_order) = on(3);
        assert_eq!((one_order.len() as u64, &one_order), (study.solves(), &three_order));
        assert!(one_order.is_sorted());
        for (a, b) in one.steps.iter().zip(&three.steps) {
            assert_eq!((&a.tallies, &a.versus), (&b.tallies, &b.versus));
        }
    }

    #[test]
    fn who_cannot_write_stops_the_rest() {
        let full = || Fault::new(FaultKind::Internal, "full");
        let stopped = computed(&Study::thesis_2012(20_000, 11), 2, true, &mut |_| Err(full()));
        assert_eq!(stopped, Err(full()));
    }

    #[test]
    fn sweeps_are_read() {
        let sweep = sweep_of("pixel_sigma_px=0.1, 2").expect("a sweep");
        assert_eq!(sweep.values, [0.1, 2.0]);
        for wrong in ["pixel_sigma_px", "colour=1", "points=a"] {
            assert!(sweep_of(wrong).is_err(), "{wrong}");
        }
    }
}
