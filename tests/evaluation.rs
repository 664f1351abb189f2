//! `skypose evaluate` as people start it, and the figures held against calculations of our own on its cases.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test says what it takes for granted, and shows its figures"
)]

#[path = "program/said.rs"]
mod said;

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use said::Said;
use serde_json::{Value, json};
use tempfile::TempDir;

fn evaluate(arguments: &[&str]) -> Said {
    let mut command = Command::new(env!("CARGO_BIN_EXE_skypose"));
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("SKYPOSE_")) {
        command.env_remove(name);
    }
    Said::of(command.arg("evaluate").args(arguments).stdin(Stdio::null()).output().expect("starts"))
}

fn figures(arguments: &[&str]) -> Value {
    let said = evaluate(&[arguments, &["--json", "-"]].concat());
    assert_eq!(said.code, Some(0), "{said:?}");
    serde_json::from_str(&said.out).expect("JSON")
}

fn without_times(mut figures: Value) -> Value {
    assert!(figures.as_object_mut().expect("an object").remove("timing").is_some());
    figures
}

fn text(path: &Path) -> String {
    fs::read_to_string(path).expect("is there")
}

fn place(folder: &TempDir, name: &str) -> String {
    folder.path().join(name).display().to_string()
}

#[test]
fn the_same_study_has_the_same_figures_on_any_number_of_threads_and_another_seed_has_others() {
    let study = |seed, threads| {
        without_times(figures(&["thesis-2012", "--runs", "5000", "--seed", seed, "--threads", threads]))
    };
    let first = study("1", "1");
    assert_eq!(first, study("1", "3"));
    assert_ne!(first["solvers"], study("2", "2")["solvers"]);
}

#[test]
fn figures_are_those_of_the_cases() {
    let folder = tempfile::tempdir().expect("a folder");
    let (csv, jsonl) = (place(&folder, "cases.csv"), place(&folder, "cases.jsonl"));
    let figures = figures(&["thesis-2012", "--runs", "200", "--cases", &csv]);
    let _ = self::figures(&["thesis-2012", "--runs", "200", "--cases", &jsonl]);
    let csv = text(Path::new(&csv));
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().expect("a head");
    let rows: Vec<Vec<&str>> = lines.collect();
    assert_eq!(rows.len(), 600);
    let column = |name: &str| head.iter().position(|title| *title == name).expect("a column");
    for solver in figures["solvers"].as_array().expect("solvers") {
        let own = || rows.iter().filter(|row| row[column("solver")] == solver["solver"]);
        for (error, name) in
            [("roll_deg", "roll_error_deg"), ("z_m", "z_error_m"), ("rotation_deg", "rotation_error_deg")]
        {
            let values: Vec<f64> = own().filter_map(|row| row[column(name)].parse().ok()).collect();
            let count = values.len() as f64;
            let mean = values.iter().sum::<f64>() / count;
            let std = (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt();
            let rmse = (values.iter().map(|value| value * value).sum::<f64>() / count).sqrt();
            let found = &solver["errors"][error];
            for (value, key) in [(mean, &found["mean"]), (std, &found["std"]), (rmse, &found["rmse"]["value"])] {
                let key = key.as_f64().expect("a number");
                assert!((key - value).abs() <= 1e-9 * rmse, "{solver} {error}: {key} {value}");
            }
        }
        let posed = own().filter(|row| row[column("outcome")] == "pose").count();
        assert_eq!(solver["success_rate"]["count"], json!(posed));
    }
    // The same rows, each an object.
    for (line, row) in text(Path::new(&jsonl)).lines().zip(&rows) {
        let object: Value = serde_json::from_str(line).expect("JSON");
        assert_eq!(object["solver"], row[column("solver")]);
        let error = row[column("yaw_error_deg")].parse::<f64>().ok();
        assert_eq!(object["yaw_error_deg"].as_f64(), error);
    }
}

#[test]
fn a_report_holds_the_seeds_pictures_and_loads_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let report = place(&folder, "report.html");
    let said = evaluate(&["thesis-2012", "--solvers", "epnp,posit,homography,auto", "--report", &report]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.contains("roll error, deg") && said.out.contains("auto is better"), "{}", said.out);
    let page = text(Path::new(&report));
    // Errors and times of four solvers, their shares, and the probabilities of the one that states some.
    assert_eq!(page.matches("<svg").count(), 6);
    for words in ["http://", "https://", "<script", "<link", "@import", "url("] {
        let at = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!at.contains(words), "{words}");
    }
    assert!(!page.contains("NaN") && !page.contains("inf "), "a figure is none");
}

#[test]
fn a_study_of_a_file_is_swept() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = place(&folder, "study.json");
    let study = json!({
        "study": {
            "points": {"count": 8, "size_m": [0.8, 0.8, 0.3]},
            "poses": {"kind": "in_picture", "range_m": [2, 6], "tilt_rad": [0, 3]},
            "noise": {"pixel_sigma_px": 0.3, "outlier_ratio": 0.0, "missing_ratio": 0.1}
        },
        "runs": 60
    });
    fs::write(&file, study.to_string()).expect("writes");
    let found = figures(&[&file, "--solvers", "auto", "--sweep", "pixel_sigma_px=0.1,0.4,1.6"]);
    let steps = found["steps"].as_array().expect("steps");
    let median =
        |step: &Value| step["solvers"][0]["errors"]["rotation_deg"]["median"]["value"].as_f64().expect("a number");
    assert_eq!(steps.iter().map(|step| step["value"].as_f64()).collect::<Vec<_>>(), [Some(0.1), Some(0.4), Some(1.6)]);
    // The same cases with four times the noise have about four times the error.
    for pair in steps.windows(2) {
        let ratio = median(&pair[1]) / median(&pair[0]);
        assert!((3.0..5.5).contains(&ratio), "{ratio}");
    }
}

#[test]
fn encounters_have_the_same_figures_on_any_number_of_threads_a_report_and_a_table() {
    let folder = tempfile::tempdir().expect("a folder");
    let [report, cases, file] = ["report.html", "cases.csv", "asked.json"].map(|name| place(&folder, name));
    let on = |threads| {
        figures(&[
            "encounters",
            "--runs",
            "60",
            "--seed",
            "5",
            "--threads",
            threads,
            "--report",
            &report,
            "--cases",
            &cases,
        ])
    };
    let first = on("1");
    assert_eq!(first, on("3"));
    assert_ne!(first["courses"], figures(&["encounters", "--runs", "60", "--seed", "6"])["courses"]);
    assert_eq!((first["encounters"].as_u64(), text(Path::new(&cases)).lines().count()), (Some(60), 61));
    assert!(text(Path::new(&report)).contains("Risk ratio"));
    // What was asked, asked again from a file.
    fs::write(&file, first["request"].to_string()).expect("writes");
    assert_eq!(figures(&[&file]), first);
    let said = evaluate(&[&file]);
    assert!(said.code == Some(0) && said.out.contains("risk ratio"), "{said:?}");
}

#[test]
fn an_encounter_is_shown_frame_by_frame() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = place(&folder, "asked.json");
    let asked = json!({"kind": "encounters", "rate_hz": 2, "traffic": {"course_rad": [3.0, 3.3], "miss_m": [0, 2]}});
    fs::write(&file, asked.to_string()).expect("writes");
    let pictures = place(&folder, "pictures");
    let said = evaluate(&[&file, "--video", &pictures, "--encounter", "2"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let count = fs::read_dir(&pictures).expect("a folder").count();
    assert!((4..30).contains(&count), "{count}");
    let video = place(&folder, "encounter.mp4");
    let said = evaluate(&[&file, "--video", &video, "--encounter", "2"]);
    if Command::new("ffmpeg").arg("-version").output().is_ok() {
        assert!(said.code == Some(0) && fs::metadata(&video).expect("is there").len() > 10_000, "{said:?}");
        let grabbed = place(&folder, "grabbed");
        let grab = Command::new(env!("CARGO_BIN_EXE_skypose")).args(["grab", &video, "--out", &grabbed]).output();
        assert!(grab.expect("starts").status.success());
        let frames = text(&Path::new(&grabbed).join("frames.jsonl"));
        assert_eq!(frames.lines().count(), count, "the same frames");
        evaluate(&[&file, "--video", "/nowhere/encounter.mp4"]).assert_complains(2, &["/nowhere/encounter.mp4"]);
    } else {
        said.assert_complains(1, &["ffmpeg", "not installed"]);
    }
    let mut without = Command::new(env!("CARGO_BIN_EXE_skypose"));
    let output = without.args(["evaluate", &file, "--video", &video]).env("PATH", folder.path()).output();
    Said::of(output.expect("starts")).assert_complains(1, &["encounter.mp4", "ffmpeg", "not installed"]);
    evaluate(&[&file, "--video", &place(&folder, "a.pdf")]).assert_complains(2, &["a.pdf", ".mp4"]);
}

#[test]
fn what_is_wrong_is_said_in_a_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = place(&folder, "study.json");
    fs::write(&file, json!({"study": {"noise": {"pixel_sigma_px": "much"}}}).to_string()).expect("writes");
    evaluate(&["thesis-2013"]).assert_complains(2, &["thesis-2013", "thesis-2012"]);
    evaluate(&["thesis-2012", "--solvers", "pnp"]).assert_complains(2, &["pnp", "epnp"]);
    evaluate(&["thesis-2012", "--runs", "0"]).assert_complains(2, &["runs"]);
    evaluate(&["thesis-2012", "--sweep", "range_m=1,2"]).assert_complains(2, &["range_m", "in the picture"]);
    evaluate(&[&file]).assert_complains(2, &["study.json", "pixel_sigma_px"]);
    evaluate(&["thesis-2012", "--sensing", "frames"]).assert_complains(2, &["--sensing", "encounters"]);
    evaluate(&["encounters", "--solvers", "epnp"]).assert_complains(2, &["--solvers", "studies"]);
    evaluate(&["encounters", "--runs", "0"]).assert_complains(2, &["runs"]);
    fs::write(&file, json!({"kind": "encounters", "rate_hz": -1}).to_string()).expect("writes");
    evaluate(&[&file]).assert_complains(2, &["rate_hz"]);
    evaluate(&["thesis-2012", "--json", "/nowhere/figures.json"]).assert_complains(2, &["/nowhere/figures.json"]);
}
