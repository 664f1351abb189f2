//! Evaluations: a study in, figures with a report out. As a job, one shard for each contiguous part of the runs. Jobs of recorded
//! frames and of encounters are of the same kind; they are computed in `recorded` and `encounters`.

pub mod cases;
mod page;

use std::time::Instant;

use base64::Engine;
use base64::engine::general_purpose::STANDARD_NO_PAD;
use serde_json::{Value, json};

use super::jobs::{Attachment, Cancel, Input, Kind, Outcome, REPORT, Shard};
use super::lookup::Lookup;
use super::recorded::job::RecordedTerms;
use super::{encounters, recorded};
use crate::evaluate::numbers::Numbers;
use crate::evaluate::{self, Figures, Study, plots};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::evaluation::{EvaluationWire, fault_of_study};
use crate::shell::wire::{CameraWire, EvaluationRequest, Ref, TargetWire, from_value};

pub(in crate::shell) use page::number;

/// The kind, as it stands in the store and in the API.
pub const EVALUATION: &str = "evaluation";

/// Name of the attachment with every case as a line of CSV.
pub const CASES_CSV: &str = "cases.csv";
/// Name of the attachment with every case as an object in a JSON array.
pub const CASES_JSON: &str = "cases.json";

/// Evaluations.
#[derive(Clone, Copy, Debug)]
pub struct EvaluationKind {
    /// What recorded frames may cost.
    pub recorded: RecordedTerms,
}

/// Whether a job is about recorded frames; otherwise it is a study.
fn is_recorded(input: &Input) -> bool {
    input.request.get("recorded").is_some()
}

/// What comes of a study.
#[derive(Debug)]
pub struct Evaluated {
    /// For programs.
    pub wire: EvaluationWire,
    /// For people.
    pub page: String,
}

/// The request with everything in it that decides its figures: stored cameras and targets as they are now, and what was not said.
///
/// # Errors
/// What is wrong with it.
pub async fn resolved(mut request: EvaluationRequest, lookup: &Lookup<'_>) -> Result<EvaluationRequest, Fault> {
    if let Ref::Object(study) = &mut request.study {
        if let Some(camera @ Ref::Name(_)) = &mut study.camera {
            let found = lookup.camera(camera).await.map_err(|fault| fault.within("/study/camera"))?;
            *camera = Ref::Object(CameraWire::from(&found));
        }
        if let Some(target @ Ref::Name(_)) = &mut study.target {
            let found = lookup.target(target).await.map_err(|fault| fault.within("/study/target"))?;
            *target = Ref::Object(TargetWire::from(&found));
        }
    }
    request.solvers = Some(request.study()?.methods.iter().map(ToString::to_string).collect());
    Ok(request)
}

/// The study of a request, checked; this takes a moment, as cases are drawn.
///
/// # Errors
/// What is wrong with it.
pub fn checked(request: &EvaluationRequest) -> Result<Study, Fault> {
    let study = request.study()?;
    study.check().map_err(|error| fault_of_study(&error))?;
    Ok(study)
}

/// Seconds from now on.
pub fn clock() -> impl Fn() -> f64 {
    let start = Instant::now();
    move || start.elapsed().as_secs_f64()
}

/// The figures of all parts of a study, and the page about them.
///
/// # Errors
/// If the page cannot be written, which is our failure.
pub fn evaluated(request: EvaluationRequest, study: &Study, sums: &evaluate::Shard) -> Result<Evaluated, Fault> {
    let figures = Figures::of(study, sums);
    let pictures = plots::pictures(study, sums, &figures);
    let wire = EvaluationWire::new(request, study, sums, &figures);
    let page = page::page(study, &wire, &pictures)
        .map_err(|error| Fault::new(FaultKind::Internal, format!("the report cannot be written: {error}")))?;
    Ok(Evaluated { wire, page })
}

/// A part of the work as it is stored: its numbers to the last bit.
pub(super) fn packed<T: Numbers>(sums: &T) -> Value {
    let mut numbers = Vec::new();
    sums.write(&mut numbers);
    let bytes: Vec<u8> = numbers.into_iter().flat_map(f64::to_le_bytes).collect();
    Value::String(STANDARD_NO_PAD.encode(bytes))
}

pub(super) fn unpacked<T: Numbers>(stored: &Value) -> Option<T> {
    let bytes = STANDARD_NO_PAD.decode(stored.as_str()?).ok()?;
    let (numbers, rest) = bytes.as_chunks::<8>();
    let mut numbers = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes));
    let sums = T::read(&mut numbers)?;
    (rest.is_empty() && numbers.next().is_none()).then_some(sums)
}

impl Kind for EvaluationKind {
    fn name(&self) -> &'static str {
        EVALUATION
    }

    fn shard_count(&self, input: &Input) -> Result<u32, Fault> {
        if is_recorded(input) {
            return recorded::job::shard_count(input, &self.recorded);
        }
        if encounters::is_of(input) {
            return encounters::shard_count(input);
        }
        let study = checked(&from_value(input.request.clone())?)?;
        u32::try_from(study.shards()).map_err(|error| Fault::new(FaultKind::TooLarge, error.to_string()))
    }

    fn run_shard(&self, input: &Input, number: u32, cancel: &Cancel) -> Result<Shard, Fault> {
        if is_recorded(input) {
            return recorded::job::run_shard(input, number, &self.recorded, cancel);
        }
        if encounters::is_of(input) {
            return encounters::run_shard(input, number, cancel);
        }
        let study = from_value::<EvaluationRequest>(input.request.clone())?.study()?;
        let clock = clock();
        let number = u64::from(number);
        let sums = evaluate::Shard::run_keeping(&study, number, &clock, &|| !cancel.is_cancelled());
        // Nobody waits for what was cancelled.
        let sums = sums.ok_or_else(|| Fault::new(FaultKind::Internal, "cancelled"))?;
        let runs = study.runs_of(number);
        Ok(Shard { result: packed(&sums), message: format!("runs {} to {}", runs.start + 1, runs.end) })
    }

    fn finish(&self, input: &Input, shards: Vec<Value>, _cancel: &Cancel) -> Result<Outcome, Fault> {
        if is_recorded(input) {
            return recorded::job::finished(shards);
        }
        if encounters::is_of(input) {
            return encounters::finished(input, &shards);
        }
        let request: EvaluationRequest = from_value(input.request.clone())?;
        let study = request.study()?;
        let mut sums = evaluate::Shard::default();
        for (number, shard) in shards.iter().enumerate() {
            let part = unpacked(shard).ok_or_else(|| {
                Fault::new(FaultKind::Internal, format!("part {number} of the study cannot be read as it was stored"))
            })?;
            sums.merge(part);
        }
        let Evaluated { wire, page } = evaluated(request, &study, &sums)?;
        let mut attachments = vec![Attachment { name: REPORT, content: page.into_bytes() }];
        if study.keeps_rows() {
            attachments.push(Attachment { name: CASES_CSV, content: cases::csv(&study, &sums.rows).into_bytes() });
            attachments.push(Attachment { name: CASES_JSON, content: cases::json(&study, &sums.rows).into_bytes() });
        }
        Ok(Outcome { result: json!(wire), attachments, ..Outcome::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_read_as_they_were_stored() {
        let study = Study::thesis_2012(30, 5);
        let sums = evaluate::Shard::run_keeping(&study, 0, &clock(), &|| true).expect("goes on");
        let stored = packed(&sums);
        assert_eq!(unpacked(&stored), Some(sums));
        let text = stored.as_str().expect("a text");
        assert_eq!(unpacked::<evaluate::Shard>(&json!(text[..text.len() - 8])), None);
        assert_eq!(unpacked::<evaluate::Shard>(&json!([1.0])), None);
    }
}
