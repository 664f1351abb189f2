//! Recorded frames with truth: what `skypose evaluate` counts is counted again here, from the pipeline's own answers.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stderr,
    reason = "a test says what it takes for granted, and what it leaves out"
)]

#[path = "known/frames.rs"]
mod data;
#[path = "program/said.rs"]
mod said;
#[path = "known/tally.rs"]
#[allow(dead_code, clippy::print_stdout, reason = "another test prints it")]
mod tally;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use said::Said;
use serde_json::{Value, json};
use skypose::pipeline::estimate;
use tally::{Tally, outcome};
use tempfile::TempDir;

fn evaluate(source: &Path, more: &[&str]) -> Said {
    let mut command = Command::new(env!("CARGO_BIN_EXE_skypose"));
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("SKYPOSE_")) {
        command.env_remove(name);
    }
    Said::of(command.arg("evaluate").arg(source).args(more).stdin(Stdio::null()).output().expect("starts"))
}

/// The figures without the times taken.
fn figures(source: &Path, more: &[&str]) -> Value {
    let said = evaluate(source, &[&["--json", "-"], more].concat());
    assert_eq!(said.code, Some(0), "{said:?}");
    let mut figures: Value = serde_json::from_str(&said.out).expect("JSON");
    let timing = figures.as_object_mut().expect("an object").remove("timing").expect("times");
    assert!(timing["stages_us"]["total"]["median"].as_f64() > Some(0.0), "{timing}");
    figures
}

fn committed() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/frames")
}

fn count(value: &Value) -> u32 {
    u32::try_from(value.as_u64().unwrap_or_else(|| panic!("{value} is no count"))).expect("small")
}

/// Counts everything again: outcomes by the judgement of another test, hits and false alarms by looking for neighbours.
fn compare(folder: &Path, found: &Value) {
    let (mut tally, mut seen, mut alarms, mut detected, mut facing) = (Tally::default(), 0, 0, 0, 0);
    for known in data::frames(folder) {
        let targets = std::slice::from_ref(&known.target);
        let estimate = estimate(&known.frame, &known.camera, targets, &known.options(), |_| {}).expect("of its camera");
        let markers: Vec<_> = (0..known.target.markers().len()).filter_map(|marker| known.centroid(marker)).collect();
        seen += markers.len();
        for centroid in &estimate.detection.centroids {
            // Markers are farther apart than this reaches, so each centroid has one neighbour at most.
            match markers.iter().find(|truth| (centroid.pixel - **truth).norm() < 3.0) {
                Some(truth) => tally.add_centroid(&centroid.pixel, centroid.sigma_px, truth),
                None if known.hidden().iter().any(|hidden| (centroid.pixel - hidden).norm() < 3.0) => {}
                None => alarms += 1,
            }
        }
        if let Some(pose) = known.pose.filter(|_| known.facing) {
            facing += 1;
            detected += u32::from(estimate.targets[0].is_detected());
            tally.add(outcome(&estimate.targets[0], &pose));
        } else {
            assert!(estimate.targets[0].answer.is_err(), "{}: a pose of nothing", known.name);
        }
    }
    let (targets, detection) = (&found["all"]["targets"], &found["all"]["detection"]);
    assert_eq!([count(&targets["detected"]["count"]), count(&targets["detected"]["of"])], [detected, facing]);
    assert_eq!(count(&targets["right"]["count"]), tally.right);
    let others = ["flagged", "missed", "wrong"].map(|name| count(&targets[name]));
    assert_eq!(others, [tally.flagged, tally.missed, tally.wrong]);
    assert_eq!(count(&targets["invented"]["count"]), 0);
    let hits = [&detection["found"]["count"], &detection["found"]["of"], &detection["false_alarms"]].map(count);
    assert_eq!(hits, [tally.markers, u32::try_from(seen).expect("small"), alarms]);
    let beyond = &detection["beyond_four_sigma"]["count"];
    assert_eq!(count(beyond), tally.beyond_four);
    // The same squares in another order.
    let near = |value: &Value, expected: f64| (value.as_f64().expect("a number") / expected - 1.0).abs() < 1e-12;
    assert!(near(&detection["axis_rms_px"], tally.rms_px()), "{} {}", detection["axis_rms_px"], tally.rms_px());
    assert!(near(&detection["normalized_mean_square"], tally.mean_square()));
}

#[test]
fn figures_are_those_counted_by_hand() {
    let found = figures(&committed(), &[]);
    assert_eq!((count(&found["all"]["frames"]), count(&found["all"]["failed"])), (22, 0));
    compare(&committed(), &found);
    let suites: Vec<&str> =
        found["suites"].as_array().expect("suites").iter().filter_map(|suite| suite["suite"].as_str()).collect();
    assert_eq!(suites.len(), 9, "{suites:?}");
}

#[test]
fn the_development_frames_give_the_same_as_by_hand() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/markers");
    if !folder.is_dir() {
        eprintln!("left out: there is no {}", folder.display());
        return;
    }
    let found = figures(&folder, &[]);
    compare(&folder, &found);
    let targets = &found["all"]["targets"];
    assert_eq!((count(&targets["wrong"]), count(&targets["sure_and_wrong"])), (0, 0), "{targets}");
}

fn zipped(folder: &Path, file: &Path) {
    let mut writer = zip::ZipWriter::new(fs::File::create(file).expect("a file"));
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = format!("inside/{}", path.file_name().expect("a name").to_string_lossy());
        writer.start_file(name, zip::write::SimpleFileOptions::default()).expect("starts");
        writer.write_all(&fs::read(path).expect("reads")).expect("writes");
    }
    writer.finish().expect("finishes");
}

#[test]
fn neither_threads_nor_an_archive_change_a_digit() {
    let alone = figures(&committed(), &["--threads", "1"]);
    let folder = TempDir::new().expect("a folder");
    let (zip, tar) = (folder.path().join("set.zip"), folder.path().join("set.tar"));
    zipped(&committed(), &zip);
    let mut builder = tar::Builder::new(fs::File::create(&tar).expect("a file"));
    builder.append_dir_all(".", committed()).expect("appends");
    builder.into_inner().expect("finishes");
    assert_eq!(figures(&committed(), &["--threads", "5"]), alone);
    assert_eq!(figures(&zip, &["--threads", "3"]), alone);
    assert_eq!(figures(&tar, &[]), alone);
    assert_eq!(figures(&committed().join("truth.json"), &[]), alone);
}

#[test]
fn there_are_tables_a_page_and_a_row_for_each_frame() {
    let folder = TempDir::new().expect("a folder");
    let [report, cases] = ["report.html", "cases.csv"].map(|name| folder.path().join(name));
    let (report_text, cases_text) = (report.display().to_string(), cases.display().to_string());
    let said = evaluate(&committed(), &["--report", &report_text, "--cases", &cases_text]);
    assert_eq!(said.code, Some(0), "{said:?}");
    for words in ["led_night", "s/frame", "errors of all poses (20)", "latency, ms", "probabilities"] {
        assert!(said.out.contains(words), "{words} is not in\n{}", said.out);
    }
    let rows = fs::read_to_string(cases).expect("rows");
    assert_eq!(rows.lines().count(), 23);
    assert!(rows.lines().all(|row| row.split(',').count() == 23), "{rows}");
    let page = fs::read_to_string(report).expect("a page");
    assert!(page.matches("<svg").count() >= 4 && !page.contains("http://") | page.contains("www.w3.org"), "{page}");
    for words in ["Receiver curve", "Whether covariances hold", "Position", "Latency"] {
        assert!(page.contains(words), "{words} is not in the page");
    }
}

/// A folder with a truth and one committed frame, `a.jpg`.
fn folder_with(truth: &str) -> TempDir {
    let folder = TempDir::new().expect("a folder");
    fs::copy(committed().join("easy_00.jpg"), folder.path().join("a.jpg")).expect("copies");
    fs::write(folder.path().join("truth.json"), truth).expect("writes");
    folder
}

/// The truth of that frame.
fn easy() -> Value {
    let text = fs::read_to_string(committed().join("truth.json")).expect("reads");
    let truth: Value = serde_json::from_str(&text).expect("JSON");
    let frames = truth["frames"].as_array().expect("frames");
    let mut easy = frames.iter().find(|frame| frame["frame"] == "easy_00.jpg").expect("it is there").clone();
    easy["frame"] = json!("a.jpg");
    easy
}

#[test]
fn what_is_wrong_with_a_truth_is_said_with_its_place() {
    let complains = |truth: &str, words: &[&str]| {
        let folder = folder_with(truth);
        evaluate(folder.path(), &[]).assert_complains(2, words);
    };
    let with = |change: &dyn Fn(&mut Value)| {
        let mut frame = easy();
        change(&mut frame);
        json!({"frames": [easy(), frame]}).to_string()
    };
    complains("{\"frames\": [", &["truth.json", "not JSON", "line 1"]);
    complains("{}", &["truth.json", "/frames"]);
    complains(&with(&|frame| frame["frame"] = json!("b.jpg")), &["/frames/1/frame", "b.jpg", "no such file"]);
    complains(&with(&|frame| frame["frame"] = json!("../a.jpg")), &["/frames/1/frame", "leads out"]);
    complains(
        &with(&|frame| _ = frame.as_object_mut().expect("an object").remove("camera")),
        &["a.jpg", "/frames/1/camera"],
    );
    complains(&with(&|frame| frame["camera"] = json!("front")), &["/frames/1/camera", "front"]);
    complains(&with(&|frame| frame["camera"]["fx"] = json!(-1)), &["a.jpg", "/frames/1/camera/fx"]);
    complains(
        &with(&|frame| frame["pose"]["rotation"]["matrix"][0] = json!([2, 0, 0])),
        &["a.jpg", "/frames/1/pose/rotation/matrix", "no rotation"],
    );
    complains(&with(&|frame| frame["markers"][2]["marker"] = json!("fin")), &["/frames/1/markers/2/marker", "fin"]);
    complains(&with(&|frame| frame["markers"][2] = frame["markers"][0].clone()), &["/frames/1/markers/2", "before"]);
    complains(&with(&|frame| frame["detectr"] = json!({})), &["/frames/1", "detectr"]);
    complains(&with(&|frame| frame["boxes"] = json!([{"box_px": [0, 0, -1, 4]}])), &["/frames/1/boxes/0/box_px"]);
    complains(r#"{"frames": [{"frame": "a.jpg"}]}"#, &["/frames/0", "nothing is known"]);
    complains(r#"{"frames": [{"frame": "a.jpg", "markers": []}]}"#, &["/frames/0/target"]);
    let empty = TempDir::new().expect("a folder");
    evaluate(empty.path(), &[]).assert_complains(2, &["truth.json"]);
    evaluate(&empty.path().join("no.zip"), &[]).assert_complains(2, &["no.zip"]);
    evaluate(&committed().join("easy_00.jpg"), &[]).assert_complains(2, &["archive"]);
}

#[test]
fn what_cannot_be_decoded_is_named_and_the_rest_goes_on() {
    let mut broken = easy();
    broken["frame"] = json!("broken.jpg");
    let folder = folder_with(&json!({"frames": [broken, easy()]}).to_string());
    fs::write(folder.path().join("broken.jpg"), b"no picture").expect("writes");
    let said = evaluate(folder.path(), &["--json", "-"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.err.contains("broken.jpg"), "{said:?}");
    let found: Value = serde_json::from_str(&said.out).expect("JSON");
    assert_eq!((count(&found["all"]["frames"]), count(&found["all"]["failed"])), (1, 1), "{found}");
    assert_eq!(found["failed"][0]["frame"], "broken.jpg");
    assert_eq!(count(&found["all"]["targets"]["right"]["count"]), 1);
}

/// A video without loss of a dark thing that crosses a gray sky, `frames` frames of 160 x 120, and the boxes of the thing.
fn clip(path: &Path, frames: u64) -> Vec<Value> {
    let arguments = [
        "-loglevel",
        "error",
        "-y",
        "-f",
        "rawvideo",
        "-pix_fmt",
        "gray",
        "-s",
        "160x120",
        "-r",
        "30",
        "-i",
        "-",
        "-c:v",
        "ffv1",
    ];
    let mut ffmpeg =
        Command::new("ffmpeg").args(arguments).arg(path).stdin(Stdio::piped()).spawn().expect("ffmpeg starts");
    let mut pipe = ffmpeg.stdin.take().expect("piped");
    let mut boxes = Vec::new();
    for index in 0..frames {
        let (x, y) = (20 + 2 * index, 50 + index / 2);
        let pixel = |place: u64| {
            let is_thing = (x..x + 9).contains(&(place % 160)) && (y..y + 5).contains(&(place / 160));
            if is_thing {
                60
            } else {
                u8::try_from(170 + (place / 160) / 4 + (place * 7 + index * 13) % 3).expect("gray")
            }
        };
        pipe.write_all(&(0..160 * 120).map(pixel).collect::<Vec<u8>>()).expect("writes");
        boxes.push(json!({"frame_index": index, "boxes": [{"box_px": [x, y, 9, 5], "class": "aircraft"}]}));
    }
    drop(pipe);
    assert!(ffmpeg.wait().expect("ends").success());
    boxes
}

#[test]
fn a_video_is_followed_and_what_it_lacks_is_told() {
    let runs = Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    if !runs {
        eprintln!("left out: ffmpeg is not installed");
        return;
    }
    let folder = TempDir::new().expect("a folder");
    let mut frames = clip(&folder.path().join("crossing.mkv"), 40);
    let truth = |frames: &[Value]| {
        let video =
            json!({"video": "crossing.mkv", "suite": "crossing", "detector": {"method": "edge"}, "frames": frames});
        fs::write(folder.path().join("truth.json"), json!({"videos": [video]}).to_string()).expect("writes");
    };
    truth(&frames);
    let found = figures(folder.path(), &[]);
    let detection = &found["all"]["detection"];
    assert_eq!([count(&detection["frames"]), count(&detection["found"]["of"])], [40, 40]);
    // It takes a few frames until a thing is believed.
    assert!(count(&detection["found"]["count"]) >= 35, "{detection}");
    // Frames that are not labelled are part of the sequence and count nowhere.
    let lone = frames[39].clone();
    truth(&[lone]);
    let alone = figures(folder.path(), &[]);
    assert_eq!(count(&alone["all"]["detection"]["found"]["count"]), 1, "{alone}");
    frames.push(json!({"frame_index": 45, "boxes": []}));
    truth(&frames);
    let longer = figures(folder.path(), &[]);
    assert_eq!((count(&longer["all"]["frames"]), count(&longer["all"]["failed"])), (40, 1), "{longer}");
    assert_eq!(count(&longer["failed"][0]["frame_index"]), 45);
}
