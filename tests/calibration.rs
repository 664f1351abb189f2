//! `skypose calibrate` as users call it: rendered pictures with known truth, and, where they are, real ones beside what OpenCV makes of
//! them.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test says what it takes for granted, and shows its figures"
)]

#[path = "program/said.rs"]
mod said;
#[path = "known/spoiled.rs"]
mod spoiled;

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use skypose::board::Board;
use skypose::camera::{Camera, Distortion};
use skypose::random::named;
use skypose::scene::boards::{STUDY_LENSES, pose_in_view, study_camera};
use skypose::scene::encode::jpeg;
use skypose::scene::render::{Optics, Rays, Sheet, render_sheet};

use said::Said;

fn said(arguments: &[&str]) -> Said {
    let output = Command::new(env!("CARGO_BIN_EXE_skypose")).args(arguments).output();
    Said::of(output.expect("the program runs"))
}

const PATTERN: &str = "chessboard:9x6:0.025";

/// Pictures of a board through a bent lens, as files.
fn pictures(folder: &Path, pattern: &str, count: usize) {
    let board: Board = pattern.parse().expect("a board");
    let camera = study_camera(STUDY_LENSES[1]);
    let (rays, mut rng) = (Rays::of(&camera), named("pictures of a board"));
    for number in 0..count {
        let pose = pose_in_view(&camera, &board, &mut rng);
        let frame = render_sheet(&rays, &pose, &Sheet::of(&board), &Optics::default(), &mut rng);
        let bytes = jpeg(&frame, 92).expect("encodes");
        std::fs::write(folder.join(format!("{number:02}.jpg")), bytes).expect("written");
    }
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("written")).expect("JSON")
}

#[test]
fn a_folder_of_pictures_becomes_a_camera_and_a_page() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    for (pattern, points) in [(PATTERN, 54), ("circles:7x5:0.03", 35), ("dots:90:0.25x0.18:0.0035", 90)] {
        let shots = at(&pattern.replace(':', "-"));
        std::fs::create_dir(&shots).expect("a folder");
        pictures(&shots, pattern, 8);
        std::fs::write(shots.join("notes.png"), b"no picture").expect("written");
        let (result, page, camera) = (at("result.json"), at("report.html"), at("camera.json"));
        let said = said(&[
            "calibrate",
            text(&shots),
            "--pattern",
            pattern,
            "--fix",
            "k3",
            "--json",
            text(&result),
            "--report",
            text(&page),
            "--camera-out",
            text(&camera),
        ]);
        assert_eq!(said.code, Some(0), "{pattern}: {}", said.err);
        assert!(said.err.contains("notes.png: "), "{pattern}: {}", said.err);
        assert!(said.out.contains("8 of 9 pictures"), "{pattern}: {}", said.out);
        let result = json(&result);
        let truth = study_camera(STUDY_LENSES[1]);
        for (name, value) in ["fx", "fy"].into_iter().zip(truth.focal_lengths()) {
            let sigma = result["standard_deviations"][name].as_f64().expect("a deviation");
            let off = result["camera"][name].as_f64().expect("a number") - value;
            assert!(off.abs() < 4.0 * sigma && sigma < 4.0, "{pattern} {name}: {off} +- {sigma}");
        }
        assert_eq!(result["standard_deviations"]["k3"], 0.0);
        assert_eq!((&result["views"][0]["points"], &result["views"][0]["counts"]), (&points.into(), &true.into()));
        assert_eq!(json(&camera), result["camera"]);
        assert!(std::fs::read_to_string(&page).expect("a page").contains("Camera calibration"));
    }
}

#[test]
fn every_picture_that_is_left_out_is_named_and_the_others_are_used() {
    let folder = tempfile::tempdir().expect("a folder");
    let pictures = spoiled::pictures();
    for (name, bytes, _) in &pictures {
        std::fs::write(folder.path().join(name), bytes).expect("written");
    }
    // A good picture that another zoom took: it is found in, and does not fit.
    let zoomed = Camera::checked([640, 480], [900.0; 2], [320.0, 240.0], Distortion::None).expect("a camera");
    let board: Board = spoiled::BOARD.parse().expect("a board");
    let mut rng = named("another zoom");
    let pose = pose_in_view(&zoomed, &board, &mut rng);
    let frame = render_sheet(&Rays::of(&zoomed), &pose, &Sheet::of(&board), &Optics::default(), &mut rng);
    std::fs::write(folder.path().join("zoomed.jpg"), jpeg(&frame, 92).expect("encodes")).expect("written");
    let said = said(&["calibrate", text(folder.path()), "--pattern", spoiled::BOARD, "--fix", "k3"]);
    assert_eq!(said.code, Some(0), "{}", said.err);
    assert!(said.out.contains("7 of 14 pictures"), "{}", said.out);
    let spoiled = pictures.iter().map(|(name, _, reason)| (*name, *reason)).filter(|(_, reason)| !reason.is_empty());
    for (name, reason) in spoiled.chain([("zoomed.jpg", "it does not fit the others")]) {
        let line = said.err.lines().find(|line| line.contains(name)).unwrap_or_else(|| panic!("{name}: {}", said.err));
        assert!(line.contains(reason), "{name}: {line}");
    }
    assert!(!said.err.contains("good"), "{}", said.err);
}

#[test]
fn what_cannot_be_calibrated_is_told_in_one_line_each() {
    let folder = tempfile::tempdir().expect("a folder");
    pictures(folder.path(), PATTERN, 2);
    let shots = text(folder.path());
    let two = said(&["calibrate", shots, "--pattern", PATTERN]);
    assert_eq!(two.code, Some(2), "{}", two.err);
    assert!(two.err.contains("weak_geometry: "), "{}", two.err);
    let other = said(&["calibrate", shots, "--pattern", "chessboard:8x6:0.025"]);
    assert_eq!(other.code, Some(2));
    assert!(other.err.contains("00.jpg: a chessboard of 9 x 6 is seen, not of 8 x 6"), "{}", other.err);
    // What is not there is no picture without a board, and named once.
    let missing = said(&["calibrate", shots, "nothere", "--pattern", PATTERN]);
    missing.assert_complains(2, &["skypose: nothere: No such file"]);
    said(&["calibrate", shots, "--pattern", "chess"]).assert_complains(2, &["chess", "is no pattern"]);
    said(&["calibrate", shots, "--pattern", PATTERN, "--fix", "k4"]).assert_complains(2, &["plumb_bob has no k4"]);
}

#[test]
fn real_pictures_give_what_opencv_makes_of_them_and_less_error() {
    let data = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/chessboard"));
    if !data.exists() {
        println!("skipped: {} is not there", data.display());
        return;
    }
    // With a wrong count every picture is named, also those in which something small looks like that.
    let wrong = said(&["calibrate", text(&data), "--pattern", "chessboard:8x6:1"]);
    // In one of them the picture ends so near to the board that it might go on.
    let is_named =
        |line: &&str| line.replace("of at least", "of").ends_with(".jpg: a chessboard of 9 x 6 is seen, not of 8 x 6");
    assert_eq!(wrong.err.lines().filter(is_named).count(), 13, "{}", wrong.err);
    let said = said(&["calibrate", text(&data), "--pattern", "chessboard:9x6:1", "--json", "-"]);
    assert_eq!(said.code, Some(0), "{}", said.err);
    let result: Value = serde_json::from_str(&said.out).expect("JSON");
    let reference = json(&data.join("reference.json"));
    let reference = &reference["models"]["k1k2p1p2k3"];
    let views = result["views"].as_array().expect("views");
    assert_eq!(views.iter().filter(|view| view["counts"] == true && view["points"] == 54).count(), 13);
    let number = |value: &Value| value.as_f64().expect("a number");
    let [ours, theirs] = [&result["reprojection_rms_px"], &reference["reprojection_rms_px"]].map(number);
    assert!(ours < theirs, "{ours} {theirs}");
    let names = ["fx", "fy", "cx", "cy"];
    let sigmas = reference["std_fx_fy_cx_cy_k1_k2_p1_p2_k3"].as_array().expect("deviations");
    let coefficients = reference["k1_k2_p1_p2_k3"].as_array().expect("coefficients");
    let mut off: Vec<f64> =
        names.iter().map(|name| number(&result["camera"][name]) - number(&reference[*name])).collect();
    let ours = result["camera"]["distortion"]["coefficients"].as_array().expect("coefficients");
    off.extend(ours.iter().zip(coefficients).map(|(ours, theirs)| number(ours) - number(theirs)));
    let off: Vec<f64> = off.iter().zip(sigmas).map(|(off, sigma)| off / number(sigma)).collect();
    println!("from OpenCV's, in its standard deviations: {off:.2?}");
    // The estimators agree to a thousandth of that; the corners differ, and docs/accuracy.md shows whose are nearer the truth.
    assert!(off.iter().all(|off| off.abs() < 2.0), "{off:?}");
}
