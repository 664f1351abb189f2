//! Encounters on the threads of this machine.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread;

use serde_json::Value;

use super::super::film::film;
use super::super::inputs::json_of;
use super::super::outputs::write;
use super::super::{Stop, runtime};
use super::Evaluate;
use crate::evaluate::encounters::{EncounterStudy, Outcome};
use crate::shell::console::{print_line, progress};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::grab::is_interrupted;
use crate::shell::service::encounters::{checked, csv, evaluated, flown, json_rows, resolved};
use crate::shell::service::evaluation::number;
use crate::shell::service::lookup::Lookup;
use crate::shell::store::Store;
use crate::shell::wire::encounters::figures::{QuantilesWire, RiskRatioWire};
use crate::shell::wire::encounters::{AskedEvaluation, ENCOUNTERS, EncountersRequest, EncountersWire};
use crate::shell::wire::rate::RateWire;

/// The request, if encounters are what is asked for.
pub(super) fn asked(what: &Path) -> Result<Option<EncountersRequest>, Fault> {
    if what.as_os_str() == ENCOUNTERS {
        return Ok(Some(EncountersRequest::default()));
    }
    if !what.exists() {
        return Ok(None);
    }
    let value: Value = json_of(what)?;
    if value.get("kind").is_none() {
        return Ok(None);
    }
    let named = |fault: Fault| Fault { detail: format!("{}: {}", what.display(), fault.detail), ..fault };
    match AskedEvaluation::read(value).map_err(named)? {
        AskedEvaluation::Encounters(request) => Ok(Some(*request)),
        AskedEvaluation::Study(_) => Ok(None),
    }
}

pub(super) fn run(options: &Evaluate, mut request: EncountersRequest) -> Result<(), Stop> {
    let settings = options.settings.load(Vec::new())?;
    let is_other_printed = options.is_other_printed()?;
    request.runs = options.runs.unwrap_or(request.runs);
    request.seed = options.seed.unwrap_or(request.seed);
    request.sensing = options.sensing.unwrap_or(request.sensing);
    if let Some(detector) = &options.detector {
        request.detector = detector.clone();
    }
    let request = runtime()?.block_on(async {
        let store = match &options.settings.data {
            Some(folder) => Some(Store::open(folder).await?),
            None => None,
        };
        resolved(request, &Lookup::new(store.as_ref(), std::sync::Arc::default())).await
    })?;
    let study = checked(&request)?;
    if let Some(out) = &options.video {
        return film(&study, options.encounter, out);
    }
    let threads = options.threads.map_or_else(|| settings.workers.thread_count(), usize::from);
    let outcomes = all(&study, threads)?;
    if let Some(path) = &options.cases {
        let is_json = path.extension().is_some_and(|ending| ending == "json" || ending == "jsonl");
        write(path, &if is_json { json_rows(&outcomes) } else { csv(&outcomes) })?;
    }
    let done = evaluated(request, &study, &outcomes)?;
    if let Some(path) = &options.report {
        write(path, &done.page)?;
    }
    let json =
        serde_json::to_string_pretty(&done.wire).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))?;
    if let Some(path) = &options.json {
        write(path, &json)?;
    }
    if !is_other_printed {
        print_line(&table(&done.wire))?;
    }
    options.note_report();
    Ok(())
}

/// All encounters, several parts at a time, in their order.
fn all(study: &EncounterStudy, threads: usize) -> Result<Vec<Outcome>, Stop> {
    let bar = progress(usize::try_from(study.runs).unwrap_or(usize::MAX), "encounters");
    let (next, goes_on) = (AtomicU64::new(0), AtomicBool::new(true));
    let (send, receive) = mpsc::channel();
    let mut parts: Vec<(u64, Vec<Outcome>)> = thread::scope(|scope| {
        for _ in 0..threads.clamp(1, usize::try_from(study.shards()).unwrap_or(usize::MAX)) {
            let (send, next, goes_on, bar) = (send.clone(), &next, &goes_on, &bar);
            scope.spawn(move || {
                let wanted = || {
                    if is_interrupted() {
                        goes_on.store(false, Ordering::Relaxed);
                    }
                    goes_on.load(Ordering::Relaxed)
                };
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= study.shards() {
                        return;
                    }
                    let Some(part) = flown(study, number, &wanted) else { return };
                    bar.inc(part.len() as u64);
                    if send.send((number, part)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(send);
        receive.into_iter().collect()
    });
    bar.finish_and_clear();
    if !goes_on.load(Ordering::Relaxed) {
        return Err(Stop::Interrupted);
    }
    parts.sort_by_key(|(number, _)| *number);
    Ok(parts.into_iter().flat_map(|(_, part)| part).collect())
}

/// The figures for people.
fn table(wire: &EncountersWire) -> String {
    let mut lines = vec![format!("{} encounters, {} of them conflicts", wire.encounters, wire.conflicts), risk(wire)];
    lines.push(String::new());
    for (what, rate) in [
        ("conflicts: alarm in time", wire.timely_rate),
        ("conflicts: too late", wire.late_rate),
        ("conflicts: none", wire.missed_rate),
        ("alarms for nothing", wire.nuisance_rate),
        ("alarms by a wrong track", wire.false_rate),
        ("near misses without it", wire.nmac_without_rate),
        ("near misses with it", wire.nmac_with_rate),
    ] {
        lines.push(format!("{what:<28}{:>14}   {}", format!("{} of {}", rate.count, rate.of), percent(&rate)));
    }
    let missed: Vec<String> =
        wire.missed_at.iter().filter(|(_, count)| **count > 0).map(|(at, count)| format!("{at} {count}")).collect();
    if !missed.is_empty() {
        lines.push(format!("without alarm, how far it came: {}", missed.join(", ")));
    }
    if wire.unclearable > 0 {
        lines.push(format!("cleared by no turn, however early: {}", wire.unclearable));
    }
    lines.push(String::new());
    lines.push(format!("{:<28}{:>10}{:>10}{:>10}{:>10}", "", "of", "5 %", "median", "95 %"));
    for (what, found) in [
        ("detection range, m", wire.detection_range_m),
        ("pose range, m", wire.pose_range_m),
        ("track range, m", wire.track_range_m),
        ("alarm range, m", wire.alert_range_m),
        ("time to track, s", wire.time_to_track_s),
        ("alarm leaves, s", wire.alert_time_s),
        ("needed, s", wire.needed_time_s),
        ("margin, s", wire.margin_s),
    ] {
        lines.extend(found.map(|found| spread(what, &found)));
    }
    lines.join("\n")
}

fn risk(wire: &EncountersWire) -> String {
    let RiskRatioWire { ratio, interval, both, averted, induced } = wire.risk_ratio;
    let (Some(ratio), Some([low, high])) = (ratio, interval) else {
        return "no near miss without the system, so no risk ratio".into();
    };
    let [ratio, low, high] = [ratio, low, high].map(|value| number(Some(value), ""));
    format!("risk ratio {ratio} ({low} to {high}): near misses averted {averted}, not {both}, brought about {induced}")
}

fn spread(what: &str, found: &QuantilesWire) -> String {
    let [p05, median, p95] = [found.p05, found.median, found.p95].map(|value| number(Some(value), ""));
    format!("{what:<28}{:>10}{p05:>10}{median:>10}{p95:>10}", found.count)
}

fn percent(rate: &RateWire) -> String {
    let Some(ratio) = rate.ratio else { return "–".into() };
    let [low, high] = rate.interval.map(|share| 100.0 * share);
    format!("{:.1} % ({low:.1} to {high:.1})", 100.0 * ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outcomes_are_the_same_on_any_number_of_threads() {
        let study = EncounterStudy::standard(80, 3);
        assert!(study.shards() > 2);
        let [one, three] = [1, 3].map(|threads| all(&study, threads).expect("nobody stops it"));
        assert_eq!((one.len(), &one), (80, &three));
    }
}
