//! Camera files of other programs, on the command line.

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
use std::process::Command;

use said::Said;
use serde_json::{Value, json};

fn skypose(arguments: &[&str]) -> Said {
    Said::of(Command::new(env!("CARGO_BIN_EXE_skypose")).args(arguments).output().expect("starts"))
}

fn data(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/cameras").join(name).display().to_string()
}

fn json_of(said: &Said) -> Value {
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    serde_json::from_str(&said.out).expect("JSON")
}

#[test]
fn every_format_becomes_every_other() {
    let folder = tempfile::tempdir().expect("a folder");
    for file in ["ros.yaml", "opencv.yaml", "opencv4.yaml", "opencv_fisheye.xml"] {
        let camera = json_of(&skypose(&["camera", &data(file)]));
        for format in ["json", "ros", "opencv-yaml", "opencv-xml"] {
            let out = folder.path().join(format).display().to_string();
            let said = skypose(&["camera", &data(file), "--to", format, "--out", &out]);
            assert_eq!((said.code, said.out.as_str()), (Some(0), ""), "{said:?}");
            assert_eq!(json_of(&skypose(&["camera", &out])), camera, "{file} as {format}");
        }
    }
}

#[test]
fn a_camera_of_cut_and_scaled_pictures_is_derived() {
    let half = json_of(&skypose(&["camera", &data("ros.yaml"), "--size", "320x240"]));
    assert_eq!([&half["width"], &half["fx"], &half["cx"]], [&json!(320), &json!(304.35), &json!(156.875)]);
    assert_eq!(half["derived_from"], json!({"name": "ros", "width": 640, "height": 480}));
    let part = json_of(&skypose(&["camera", &data("ros.yaml"), "--crop", "100,50,320,240"]));
    assert_eq!([&part["fx"], &part["cx"], &part["cy"]], [&json!(608.7), &json!(214.25), &json!(190.5)]);
    skypose(&["camera", &data("ros.yaml"), "--crop", "400,0,320,240"])
        .assert_complains(2, &["ros.yaml", "/crop_px", "320 x 240", "640 x 480"]);
}

#[test]
fn a_camera_file_of_another_program_is_read_where_a_camera_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let target = folder.path().join("target.json").display().to_string();
    let marker = |id: &str, x: f64, y: f64| json!({"id": id, "position_m": [x, y, 0.0], "radius_m": 0.03});
    let markers = [marker("a", 0.0, 0.0), marker("b", 1.0, 0.0), marker("c", 1.0, 0.8), marker("d", 0.1, 1.0)];
    fs::write(&target, json!({"name": "four", "markers": markers}).to_string()).expect("writes");
    let said = skypose(&["assess", &target, "--camera", &data("ros.yaml")]);
    assert_eq!(said.code, Some(0), "{said:?}");
    skypose(&["assess", &target, "--camera", &data("README.md")]).assert_complains(2, &["README.md"]);
}

#[test]
fn a_frame_of_another_size_is_told_how_to_derive_its_camera() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    fs::write(path("frame.pgm"), [&b"P5 64 48 255\n"[..], &[90; 64 * 48]].concat()).expect("writes");
    let marker = |id: &str, x: f64, y: f64| json!({"id": id, "position_m": [x, y, 0.0], "radius_m": 0.03});
    let markers = [marker("a", 0.0, 0.0), marker("b", 1.0, 0.0), marker("c", 1.0, 0.8), marker("d", 0.1, 1.0)];
    fs::write(path("target.json"), json!({"name": "four", "markers": markers}).to_string()).expect("writes");
    let said =
        skypose(&["estimate", "--camera", &data("ros.yaml"), "--target", &path("target.json"), &path("frame.pgm")]);
    assert_eq!(said.code, Some(2), "{said:?}");
    for words in ["64 x 48", "640 x 480", "derived_from", "\\\"width\\\": 64"] {
        assert!(said.out.contains(words), "{words}: {said:?}");
    }
}
