//! What every solver said of every case, for those who plot themselves: CSV, or one JSON object a line.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use crate::evaluate::row::COLUMNS;
use crate::evaluate::{Row, Study};

/// The first line of the CSV.
#[must_use]
pub fn csv_head(study: &Study) -> String {
    let swept = study.sweep.as_ref().map(|sweep| sweep.parameter.name());
    let first = swept.into_iter().chain(["run", "solver", "outcome"]);
    first.chain(COLUMNS).collect::<Vec<_>>().join(",")
}

/// A row as a line of CSV. What there is not is empty.
#[must_use]
pub fn csv_line(study: &Study, row: &Row) -> String {
    let mut line = String::new();
    if let Some(value) = value_of(study, row) {
        let _ = write!(line, "{value},");
    }
    let _ = write!(line, "{},{},{}", row.run, solver_of(study, row), row.outcome_name());
    for value in &row.values {
        line.push(',');
        if let Some(value) = value {
            let _ = write!(line, "{value}");
        }
    }
    line
}

/// A row as a line of JSON. What there is not is null.
#[must_use]
pub fn json_line(study: &Study, row: &Row) -> String {
    let mut object = Map::new();
    if let Some((sweep, value)) = study.sweep.as_ref().zip(value_of(study, row)) {
        object.insert(sweep.parameter.name().into(), json!(value));
    }
    object.insert("run".into(), json!(row.run));
    object.insert("solver".into(), json!(solver_of(study, row)));
    object.insert("outcome".into(), json!(row.outcome_name()));
    for (name, value) in COLUMNS.iter().zip(&row.values) {
        object.insert((*name).into(), json!(value));
    }
    Value::Object(object).to_string()
}

/// All rows as CSV.
#[must_use]
pub fn csv(study: &Study, rows: &[Row]) -> String {
    let mut text = csv_head(study) + "\n";
    for row in rows {
        text += &csv_line(study, row);
        text.push('\n');
    }
    text
}

/// All rows as one JSON array.
#[must_use]
pub fn json(study: &Study, rows: &[Row]) -> String {
    let objects: Vec<String> = rows.iter().map(|row| json_line(study, row)).collect();
    format!("[{}]", objects.join(",\n"))
}

fn value_of(study: &Study, row: &Row) -> Option<f64> {
    study.sweep.as_ref()?.values.get(usize::try_from(row.step).ok()?).copied()
}

fn solver_of(study: &Study, row: &Row) -> String {
    let method = usize::try_from(row.method).ok().and_then(|place| study.methods.get(place));
    method.map(ToString::to_string).unwrap_or_default()
}
