//! Encounters, flown: a request in, figures with a report out. As a job, one shard for each contiguous part of the encounters.

mod page;

use std::fmt::Write;

use serde_json::{Value, json};

use super::evaluation::{CASES_CSV, CASES_JSON, packed, unpacked};
use super::jobs::{Attachment, Cancel, Input, Outcome, REPORT, Shard};
use super::lookup::Lookup;
use crate::evaluate::encounters::{EncounterStudy, Figures, Moment, Outcome as Flown, pictures};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::encounters::{ENCOUNTERS, EncountersWire, fault_of_study};
use crate::shell::wire::{CameraWire, EncountersRequest, Ref, TargetWire, from_value};

/// Rows that are kept beside the result.
const MAX_ROWS: usize = 100_000;

/// Whether a job is about encounters.
pub(super) fn is_of(input: &Input) -> bool {
    input.request.get("kind").is_some_and(|kind| kind == ENCOUNTERS)
}

/// The request with everything in it that decides its figures: stored cameras and targets as they are now.
///
/// # Errors
/// What is wrong with it.
pub async fn resolved(mut request: EncountersRequest, lookup: &Lookup<'_>) -> Result<EncountersRequest, Fault> {
    if let Some(camera @ Ref::Name(_)) = &mut request.camera {
        let found = lookup.camera(camera).await.map_err(|fault| fault.within("/camera"))?;
        *camera = Ref::Object(CameraWire::from(&found));
    }
    if let Some(target @ Ref::Name(_)) = &mut request.target {
        let found = lookup.target(target).await.map_err(|fault| fault.within("/target"))?;
        *target = Ref::Object(TargetWire::from(&found));
    }
    Ok(request)
}

/// The study of a request, checked.
///
/// # Errors
/// What is wrong with it.
pub fn checked(request: &EncountersRequest) -> Result<EncounterStudy, Fault> {
    let study = request.study()?;
    study.check().map_err(|error| fault_of_study(&error))?;
    Ok(study)
}

/// The encounters of one part; `None` if `go_on` said no.
#[must_use]
pub fn flown(study: &EncounterStudy, shard: u64, go_on: &dyn Fn() -> bool) -> Option<Vec<Flown>> {
    let outcomes = study.runs_of(shard).filter_map(|number| Flown::of(study, number, go_on)).collect();
    go_on().then_some(outcomes)
}

/// What comes of all encounters.
#[derive(Debug)]
pub struct Evaluated {
    /// For programs.
    pub wire: EncountersWire,
    /// For people.
    pub page: String,
}

/// The figures of all encounters, which come in the order of their numbers, and the page about them.
///
/// # Errors
/// If the page cannot be written, which is our failure.
pub fn evaluated(request: EncountersRequest, study: &EncounterStudy, outcomes: &[Flown]) -> Result<Evaluated, Fault> {
    let figures = Figures::of(study, outcomes);
    let pictures = pictures(study, outcomes, &figures);
    let wire = EncountersWire::new(request, &figures);
    let page = page::page(study, &wire, &pictures)
        .map_err(|error| Fault::new(FaultKind::Internal, format!("the report cannot be written: {error}")))?;
    Ok(Evaluated { wire, page })
}

/// How many shards the job has.
pub(super) fn shard_count(input: &Input) -> Result<u32, Fault> {
    let study = checked(&from_value(input.request.clone())?)?;
    u32::try_from(study.shards()).map_err(|error| Fault::new(FaultKind::TooLarge, error.to_string()))
}

/// Flies the encounters of one shard.
pub(super) fn run_shard(input: &Input, number: u32, cancel: &Cancel) -> Result<Shard, Fault> {
    let study = from_value::<EncountersRequest>(input.request.clone())?.study()?;
    let outcomes = flown(&study, number.into(), &|| !cancel.is_cancelled())
        .ok_or_else(|| Fault::new(FaultKind::Internal, "cancelled"))?;
    let runs = study.runs_of(number.into());
    let alarms = outcomes.iter().filter(|outcome| outcome.alert.is_some()).count();
    let message = format!("encounters {} to {}: {alarms} alarms", runs.start + 1, runs.end);
    Ok(Shard { result: packed(&outcomes), message })
}

/// The figures of all shards.
pub(super) fn finished(input: &Input, shards: &[Value]) -> Result<Outcome, Fault> {
    let request: EncountersRequest = from_value(input.request.clone())?;
    let study = request.study()?;
    let mut outcomes: Vec<Flown> = Vec::new();
    for (number, shard) in shards.iter().enumerate() {
        let part: Vec<Flown> = unpacked(shard).ok_or_else(|| {
            Fault::new(FaultKind::Internal, format!("part {number} of the encounters cannot be read as it was stored"))
        })?;
        outcomes.extend(part);
    }
    let Evaluated { wire, page } = evaluated(request, &study, &outcomes)?;
    let rows = &outcomes[..outcomes.len().min(MAX_ROWS)];
    let attachments = vec![
        Attachment { name: REPORT, content: page.into_bytes() },
        Attachment { name: CASES_CSV, content: csv(rows).into_bytes() },
        Attachment { name: CASES_JSON, content: json_rows(rows).into_bytes() },
    ];
    Ok(Outcome { result: json!(wire), attachments, ..Outcome::default() })
}

/// Names of the columns.
const COLUMNS: [&str; 22] = [
    "encounter",
    "verdict",
    "stage",
    "own_speed_mps",
    "intruder_speed_mps",
    "course_rad",
    "relative_speed_mps",
    "miss_without_m",
    "miss_with_m",
    "needed_time_s",
    "in_view_time_s",
    "detection_range_m",
    "detection_time_s",
    "pose_range_m",
    "pose_time_s",
    "track_range_m",
    "track_time_s",
    "alert_range_m",
    "alert_time_s",
    "margin_s",
    "alert_error_m",
    "frames",
];

/// One encounter in the order of the columns; null for what there is not.
fn cells(outcome: &Flown) -> [Value; COLUMNS.len()] {
    let time = |moment: Option<Moment>| json!(moment.map(|moment| moment.time_s));
    let range = |moment: Option<Moment>| json!(moment.map(|moment| moment.range_m));
    [
        json!(outcome.number),
        json!(outcome.verdict().name()),
        json!(outcome.stage().name()),
        json!(outcome.own_speed_mps),
        json!(outcome.intruder_speed_mps),
        json!(outcome.course_rad),
        json!(outcome.relative_speed_mps),
        json!(outcome.unavoided_miss_m),
        json!(outcome.miss_m),
        json!(outcome.needed_s),
        time(outcome.in_view),
        range(outcome.seen),
        time(outcome.seen),
        range(outcome.posed),
        time(outcome.posed),
        range(outcome.tracked),
        time(outcome.tracked),
        range(outcome.alert),
        time(outcome.alert),
        json!(outcome.margin_s()),
        json!(outcome.alert_error_m),
        json!(outcome.frames),
    ]
}

/// A table with a row for each encounter; what there is not is empty.
#[must_use]
pub fn csv(outcomes: &[Flown]) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    for outcome in outcomes {
        let cell = |value: &Value| match value {
            Value::Null => String::new(),
            Value::String(word) => word.clone(),
            number => number.to_string(),
        };
        let _ = writeln!(text, "{}", cells(outcome).iter().map(cell).collect::<Vec<_>>().join(","));
    }
    text
}

/// The same as a JSON array of objects.
#[must_use]
pub fn json_rows(outcomes: &[Flown]) -> String {
    let object = |outcome: &Flown| {
        let named = COLUMNS.iter().map(|name| (*name).to_owned()).zip(cells(outcome));
        Value::Object(named.collect()).to_string()
    };
    format!("[{}]", outcomes.iter().map(object).collect::<Vec<_>>().join(",\n"))
}
