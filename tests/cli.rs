//! The program as people start it: arguments and files in, lines, pictures and exit codes out.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test says what it takes for granted, and shows its figures"
)]

#[path = "program/said.rs"]
mod said;

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::LazyLock;
use std::time::Duration;

use nalgebra::{Matrix3, Rotation3, Vector3};
use said::Said;
use serde_json::{Value, json};
use skypose::frame::Frame;
use skypose::geometry::{CameraFromTarget, rotation};
use skypose::random;
use skypose::scene::encode;
use skypose::scene::models::{demo_camera, wing};
use skypose::scene::render::{Optics, Sky, render};
use skypose::shell::wire::{CameraWire, TargetWire};
use tempfile::TempDir;

const SKYPOSE: &str = env!("CARGO_BIN_EXE_skypose");

/// The program without settings from outside.
fn skypose(arguments: &[&str]) -> Command {
    let mut command = Command::new(SKYPOSE);
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("SKYPOSE_")) {
        command.env_remove(name);
    }
    command.args(arguments).stdin(Stdio::null());
    command
}

fn run(arguments: &[&str]) -> Said {
    Said::of(skypose(arguments).output().expect("starts"))
}

/// With this on standard input.
fn fed(arguments: &[&str], input: &str) -> Said {
    let mut command = skypose(arguments);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("starts");
    let mut stdin = child.stdin.take().expect("piped");
    let input = input.to_owned();
    // Beside the reading, so that neither side waits for the other.
    let writer = std::thread::spawn(move || stdin.write_all(input.as_bytes()));
    let said = Said::of(child.wait_with_output().expect("ends"));
    writer.join().expect("no panic").expect("read to the end");
    said
}

// ---- pose ----

/// A square of a metre, five metres ahead, seen straight on.
fn square(id: &str) -> Value {
    json!({
        "id": id,
        "camera": {"width": 640, "height": 480, "fx": 600, "fy": 600, "cx": 320, "cy": 240},
        "object_points_m": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        "image_points_px": [[320, 240], [440, 240], [440, 360], [320, 360]]
    })
}

fn assert_square(reply: &Value) {
    let translation = numbers(&reply["pose"]["translation_m"]);
    // The points are exact.
    for (found, expected) in translation.into_iter().zip([0.0, 0.0, 5.0]) {
        assert!((found - expected).abs() < 1e-6, "{reply}");
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}

#[test]
fn each_request_has_its_line_and_a_bad_one_harms_no_other() {
    // Five points at one place of the picture explain no pose; that is an answer, not an error.
    let mut nowhere = square("nowhere");
    nowhere["image_points_px"] = json!([[320, 240], [320, 240], [320, 240], [320, 240]]);
    let mut senseless = square("senseless");
    senseless["camera"]["fx"] = json!(-600);
    let lines = [
        square("first").to_string(),
        nowhere.to_string(),
        "nonsense".into(),
        String::new(),
        senseless.to_string(),
        square("last").to_string(),
    ];
    let said = fed(&["pose"], &lines.join("\n"));
    assert_eq!(said.code, Some(2), "{said:?}");
    let replies = said.lines();
    assert_eq!(replies.len(), 5, "{said:?}");
    assert_eq!(replies[0]["id"], "first");
    assert_square(&replies[0]);
    assert_eq!((&replies[1]["id"], &replies[1]["pose"]), (&json!("nowhere"), &Value::Null));
    assert_eq!(replies[1]["reason"], "degenerate_geometry");
    assert_eq!(replies[2]["error"]["status"], 400);
    assert_eq!((&replies[3]["id"], &replies[3]["error"]["status"]), (&json!("senseless"), &json!(422)));
    assert_eq!(replies[3]["error"]["pointer"], "/camera/fx");
    assert_eq!(replies[4]["id"], "last");
    assert_square(&replies[4]);
    let complaints: Vec<&str> = said.err.lines().collect();
    assert_eq!(complaints.len(), 2, "{said:?}");
    assert!(complaints[0].contains("line 3") && complaints[1].contains("line 5: /camera/fx"), "{said:?}");
}

#[test]
fn no_pose_to_be_had_is_no_failure() {
    let mut nowhere = square("nowhere");
    nowhere["image_points_px"] = json!([[320, 240], [320, 240], [320, 240], [320, 240]]);
    let said = fed(&["pose"], &nowhere.to_string());
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    let said = fed(&["pose"], "\n  \n");
    assert_eq!((said.code, said.out.as_str()), (Some(0), ""), "nothing asked, nothing said: {said:?}");
}

#[test]
fn many_requests_in_one_have_one_line_as_over_http() {
    let mut senseless = square("senseless");
    senseless["camera"]["fx"] = json!(-600);
    let said = fed(&["pose"], &json!({"requests": [square("a"), senseless, square("b")]}).to_string());
    assert_eq!(said.code, Some(2), "{said:?}");
    let [reply] = said.lines().try_into().expect("one line");
    assert_square(&reply["replies"][0]);
    assert_eq!(
        (&reply["replies"][1]["id"], &reply["replies"][1]["error"]["status"]),
        (&json!("senseless"), &json!(422))
    );
    assert_square(&reply["replies"][2]);
}

#[test]
fn a_request_may_be_spread_over_lines_as_people_print_them() {
    let pretty = |id: &str| serde_json::to_string_pretty(&square(id)).expect("JSON");
    let said = fed(&["pose"], &format!("{}\n{}\n{}\n", pretty("one"), square("two"), pretty("three")));
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    let replies = said.lines();
    let ids: Vec<&Value> = replies.iter().map(|reply| &reply["id"]).collect();
    assert_eq!(ids, ["one", "two", "three"]);
    for reply in &replies {
        assert_square(reply);
    }
}

#[test]
fn a_reply_does_not_wait_for_the_next_request() {
    let mut command = skypose(&["pose"]);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("starts");
    let (mut stdin, stdout) = (child.stdin.take().expect("piped"), child.stdout.take().expect("piped"));
    let mut replies = BufReader::new(stdout).lines();
    for id in ["one", "two"] {
        writeln!(stdin, "{}", square(id)).expect("is read");
        let reply: Value = serde_json::from_str(&replies.next().expect("a line").expect("UTF-8")).expect("JSON");
        assert_eq!(reply["id"], id);
    }
    drop(stdin);
    assert!(child.wait().expect("ends").success());
}

#[test]
fn the_example_of_the_help_works_as_printed() {
    let help = run(&["pose", "--help"]);
    let (_, example) = help.out.split_once("Example:\n").expect("an example");
    assert!(example.trim().lines().count() > 1, "{example}");
    let folder = Path::new(SKYPOSE).parent().expect("a folder");
    let mut path = folder.as_os_str().to_owned();
    path.push(":");
    path.push(std::env::var_os("PATH").unwrap_or_default());
    let said = Said::of(Command::new("sh").args(["-c", example]).env("PATH", path).output().expect("a shell"));
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    assert_eq!(said.lines().len(), 1);
    assert_square(&said.lines()[0]);
}

// ---- words ----

#[test]
fn the_api_document_is_the_one_in_the_repository() {
    let said = run(&["openapi"]);
    let file = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("api/openapi.json")).expect("is there");
    assert_eq!(said.code, Some(0));
    assert_eq!(said.out.trim_end(), file.trim_end());
}

#[test]
fn unknown_words_are_bad_input() {
    for arguments in [
        &["fly"][..],
        &[],
        &["detect"],
        &["detect", "--nope", "x.png"],
        &["detect", "--method", "smell", "x.png"],
        &["detect", "--region", "1,2,3", "x.png"],
        &["estimate", "x.png"],
        &["serve", "--listen", "nowhere"],
        &["demo", "--frames", "0"],
        &["grab", "video.mp4"],
        &["grab", "video.mp4", "--out", "frames", "--fps", "0"],
        &["grab", "video.mp4", "--out", "frames", "--input-option", "size"],
        &["replay"],
        &["replay", "video.mp4", "--speed", "0"],
        &["assess"],
        &["assess", "target.json"],
        &["assess", "target.json", "--camera", "camera.json", "--pixel-sigma", "much"],
    ] {
        let said = run(arguments);
        assert_eq!((said.code, said.out.as_str()), (Some(2), ""), "{arguments:?}: {said:?}");
        assert!(!said.err.is_empty(), "{arguments:?}");
        // Nothing at all is answered by the help.
        assert!(arguments.is_empty() || said.err.lines().count() == 1, "{arguments:?}: {said:?}");
    }
}

#[test]
fn help_and_version_are_no_errors() {
    let help = run(&["--help"]);
    for command in ["serve", "detect", "estimate", "grab", "replay", "pose", "assess", "openapi", "demo"] {
        assert!(help.out.contains(command), "{command}");
        assert_eq!(run(&[command, "--help"]).code, Some(0), "{command}");
    }
    assert_eq!(run(&["--version"]).out.trim(), format!("skypose {}", env!("CARGO_PKG_VERSION")));
}

#[test]
fn a_settings_file_is_told_all_its_faults_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("bad.toml");
    let text =
        "[http]\nlisten = \"nowhere\"\nmax_batch = 0\ndeadlin_ms = 3\n[log]\nformat = \"song\"\n[wrong]\nkey = 1\n";
    fs::write(&file, text).expect("writes");
    let faults = ["http.listen", "http.max_batch", "http.deadlin_ms", "log.format", "wrong.key"];
    for command in ["serve", "pose"] {
        run(&[command, "--config", as_text(&file)]).assert_complains(2, &faults);
    }
    run(&["serve", "--config", "not-there.toml"]).assert_complains(2, &["not-there.toml"]);
    let mut command = skypose(&["pose"]);
    Said::of(command.env("SKYPOSE_HTTP_LISTEN", "x").output().expect("starts")).assert_complains(2, &["http.listen"]);
}

// ---- frames ----

fn as_text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

fn truth() -> CameraFromTarget {
    CameraFromTarget::new(rotation::exp(&Vector3::new(0.35, -0.25, 0.6)), Vector3::new(0.4, -0.2, 4.5))
}

fn frame() -> &'static Frame {
    static FRAME: LazyLock<Frame> = LazyLock::new(|| {
        let sky = Sky::fair(3, [0.0; 2]);
        render(&demo_camera(), &truth(), &wing(), &sky, &Optics::default(), &mut random::named("command line"))
    });
    &FRAME
}

/// A folder with a frame in two formats, a text that calls itself a frame, a camera and a target.
struct Desk(TempDir);

impl Desk {
    fn new() -> Self {
        let desk = Self(tempfile::tempdir().expect("a folder"));
        desk.write("a.jpg", &encode::jpeg(frame(), 92).expect("encodes"));
        desk.write("b.png", &encode::png(frame()).expect("encodes"));
        desk.write("camera.json", json!(CameraWire::from(&demo_camera())).to_string().as_bytes());
        desk.write("target.json", json!(TargetWire::from(&wing().target)).to_string().as_bytes());
        desk
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).expect("writes");
    }

    /// With the folder as the current one.
    fn run(&self, arguments: &[&str]) -> Said {
        Said::of(skypose(arguments).current_dir(self.0.path()).output().expect("starts"))
    }

    fn estimate(&self, arguments: &[&str]) -> Said {
        self.run(&[&["estimate", "--camera", "camera.json", "--target", "target.json"], arguments].concat())
    }

    /// Share of pixels that differ strongly from the frame's.
    fn changed(&self, name: &str) -> f64 {
        let picture = image::open(self.path(name)).or_else(|_| {
            // The image library is built without JPEG.
            let bytes = fs::read(self.path(name)).expect("a picture");
            let frame = Frame::decode(&bytes, &skypose::frame::Decoding::default()).expect("decodes");
            let rgb = image::RgbImage::from_raw(frame.width(), frame.height(), frame.rgb().into_owned());
            rgb.map(image::DynamicImage::ImageRgb8).ok_or(())
        });
        let picture = picture.expect("a picture").into_rgb8();
        assert_eq!(picture.dimensions(), (frame().width(), frame().height()), "{name}");
        let rgb = frame().rgb();
        let pairs = picture.as_raw().chunks_exact(3).zip(rgb.chunks_exact(3));
        let strong = pairs.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 60)).count();
        f64::from(u32::try_from(strong).expect("a picture")) / f64::from(frame().width() * frame().height())
    }
}

/// Within a degree and one percent: ten standard deviations of this frame's poses.
fn assert_true_pose(reply: &Value) {
    let target = &reply["targets"][0];
    assert_eq!((&target["name"], &target["detected"]), (&json!("wing-six"), &json!(true)), "{reply}");
    let rows = target["pose"]["rotation"]["matrix"].as_array().expect("rows");
    let rows: Vec<Vec<f64>> = rows.iter().map(numbers).collect();
    let matrix = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|row, column| rows[row][column]));
    let found = CameraFromTarget::new(matrix, Vector3::from_vec(numbers(&target["pose"]["translation_m"])));
    let error = found.difference_to(&truth());
    assert!(error.fixed_rows::<3>(0).norm() < 0.01 * truth().translation.norm(), "{error}");
    assert!(error.fixed_rows::<3>(3).norm() < 1_f64.to_radians(), "{error}");
}

#[test]
fn frames_are_answered_one_a_line_in_both_formats() {
    let desk = Desk::new();
    let said = desk.estimate(&["a.jpg", "b.png"]);
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    let replies = said.lines();
    assert_eq!(replies.len(), 2);
    for (reply, source) in replies.iter().zip(["a.jpg", "b.png"]) {
        assert_eq!((&reply["source"], &reply["frame_index"]), (&json!(source), &Value::Null));
        assert_true_pose(reply);
    }
    let said = desk.run(&["detect", "--sequence", "."]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let replies = said.lines();
    assert_eq!(replies.len(), 2);
    for (index, reply) in replies.iter().enumerate() {
        assert_eq!(reply["frame_index"], index);
        assert_eq!(reply["frame"]["width"], 1280);
        assert!(reply["centroids"].as_array().expect("a list").len() >= 6, "{reply}");
        assert!(reply.get("targets").is_none());
    }
}

#[test]
fn edges_of_a_sequence_are_kept_where_they_last() {
    let desk = Desk::new();
    let black = |x: i32, y: i32| (20..60).contains(&x) && (30..50).contains(&y);
    let picture = |shift: i32| {
        let samples = (0..100).flat_map(|y| (0..160).map(move |x| if black(x - shift, y) { 20 } else { 200 }));
        [b"P5\n160 100\n255\n".to_vec(), samples.collect()].concat()
    };
    // A jump in the fourth.
    for (index, shift) in [0, 4, 8, 80].into_iter().enumerate() {
        desk.write(&format!("{index}.pgm"), &picture(shift));
    }
    let frames = ["0.pgm", "1.pgm", "2.pgm", "3.pgm"];
    let said = desk.run(
        &[
            &["detect", "--method", "edge", "--preset", "thesis", "--sequence", "--persistent", "2"][..],
            &["--median", "3,3", "--min-area", "10"],
            &frames,
        ]
        .concat(),
    );
    assert_eq!(said.code, Some(0), "{said:?}");
    let replies = said.lines();
    let counts: Vec<_> = replies.iter().map(|reply| reply["centroids"].as_array().map(Vec::len)).collect();
    assert_eq!(counts, [Some(0), Some(1), Some(1), Some(0)], "{said:?}");
    assert_eq!(replies[3]["refused"][0]["reason"], "not_persistent");
    assert!((replies[1]["centroids"][0]["u_px"].as_f64().expect("u") - 43.5).abs() < 0.5, "{said:?}");
    let said = desk.run(&["detect", "--method", "edge", "--preset", "thesis", "--min-area", "10", "0.pgm"]);
    assert_eq!(said.lines()[0]["centroids"].as_array().map(Vec::is_empty), Some(false), "{said:?}");
    let said = desk.run(&["detect", "--method", "edge", "--preset", "thesis", "--threshold", "2", "0.pgm"]);
    assert!(said.code == Some(2) && said.err.contains("/detector/threshold"), "{said:?}");
}

#[test]
fn what_flies_keeps_its_number_through_a_folder() {
    let desk = Desk::new();
    fs::create_dir(desk.path("flight")).expect("a folder");
    for index in 0..6 {
        let sample = |u: i32, v: i32| if (u - 40 - 3 * index).abs() <= 2 && (v - 60).abs() <= 1 { 60 } else { 180 };
        let samples = (0..128).flat_map(|v| (0..160).map(move |u| sample(u, v)));
        let picture = [b"P5\n160 128\n255\n".to_vec(), samples.collect()].concat();
        desk.write(&format!("flight/{index}.pgm"), &picture);
    }
    let said = desk.run(&["detect", "--method", "edge", "--sequence", "flight"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let replies = said.lines();
    assert_eq!(replies.len(), 6);
    for (index, reply) in replies.iter().enumerate() {
        assert_eq!(reply["frame_index"], index);
        assert!(reply["centroids"][0]["track_id"].is_u64(), "{reply}");
        assert_eq!(reply["centroids"][0]["track_id"], replies[0]["centroids"][0]["track_id"]);
    }
    let single = desk.run(&["detect", "--method", "edge", "flight"]);
    assert!(single.lines().iter().all(|reply| reply["centroids"][0].get("track_id").is_none()), "{single:?}");
    let said = desk.run(&["detect", "--method", "edge", "--min-score", "7", "flight"]);
    assert!(said.code == Some(2) && said.err.contains("/detector/min_score"), "{said:?}");
}

#[test]
fn a_text_that_calls_itself_a_picture_harms_no_other_frame() {
    let desk = Desk::new();
    desk.write("ab.jpg", b"This is no picture.");
    let said = desk.estimate(&["."]);
    assert_eq!(said.code, Some(2), "{said:?}");
    let replies = said.lines();
    let sources: Vec<&str> = replies.iter().filter_map(|reply| reply["source"].as_str()).collect();
    assert_eq!(sources, ["./a.jpg", "./ab.jpg", "./b.png"]);
    assert_true_pose(&replies[0]);
    assert_eq!(replies[1]["error"]["status"], 415);
    assert_true_pose(&replies[2]);
    assert_eq!(said.err.lines().count(), 1, "{said:?}");
    assert!(said.err.contains("./ab.jpg: "), "{said:?}");
}

#[test]
fn what_is_not_there_is_named_once() {
    let desk = Desk::new();
    let said = desk.run(&["detect", "missing.jpg", "a.jpg"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert_eq!(said.lines()[0]["error"]["status"], 404);
    assert!(said.lines()[1]["centroids"].is_array());
    assert_eq!(said.err.matches("missing.jpg").count(), 1, "{said:?}");
    let estimate =
        |camera: &str, target: &str| desk.run(&["estimate", "--camera", camera, "--target", target, "a.jpg"]);
    estimate("no.json", "target.json").assert_complains(2, &["no.json"]);
    estimate("camera.json", "no.json").assert_complains(2, &["no.json"]);
    estimate("a.jpg", "target.json").assert_complains(2, &["a.jpg", "not JSON"]);
    fs::create_dir(desk.path("empty")).expect("makes a folder");
    desk.run(&["detect", "empty"]).assert_complains(2, &["empty", "without pictures"]);
}

#[test]
fn requests_are_read_from_a_file_and_their_paths_from_where_it_is() {
    let desk = Desk::new();
    let request = |frame: &str| {
        json!({
            "frame": frame, "camera": CameraWire::from(&demo_camera()),
            "targets": [TargetWire::from(&wing().target)], "id": frame, "timestamp_us": 1_700_000_000_000_000_i64
        })
    };
    let mut senseless = request("b.png");
    senseless["region_px"] = json!([0, 0, 5000, 5]);
    let lines =
        [request("a.jpg").to_string(), "{\"id\": 3}".into(), senseless.to_string(), request("b.png").to_string()];
    desk.write("requests.jsonl", lines.join("\n").as_bytes());
    let said = run(&["estimate", "--requests", as_text(&desk.path("requests.jsonl"))]);
    assert_eq!(said.code, Some(2), "{said:?}");
    let replies = said.lines();
    assert_eq!(replies.len(), 4, "{said:?}");
    for (reply, id) in [(&replies[0], "a.jpg"), (&replies[3], "b.png")] {
        assert_eq!((&reply["id"], &reply["frame"]["timestamp_us"]), (&json!(id), &json!(1_700_000_000_000_000_i64)));
        assert_true_pose(reply);
    }
    assert_eq!(replies[1]["error"]["pointer"], "/frame");
    assert_eq!(replies[2]["error"]["pointer"], "/region_px");
    let complaints: Vec<&str> = said.err.lines().collect();
    let file = as_text(&desk.path("requests.jsonl")).to_owned();
    let places = [format!("skypose: {file}:2: /frame: "), format!("skypose: {file}:3: b.png: /region_px: ")];
    assert_eq!(complaints.len(), 2, "{said:?}");
    for (complaint, place) in complaints.iter().zip(&places) {
        assert!(complaint.replace(as_text(&desk.path("b.png")), "b.png").starts_with(place), "{complaint}");
    }
    // On standard input, and without a pose.
    let said = fed(&["detect", "--requests", "-"], &json!({"frame": desk.path("a.jpg")}).to_string());
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.lines()[0]["centroids"].as_array().expect("a list").len() >= 6);
}

#[test]
fn annotated_frames_show_the_frame_with_something_drawn_in() {
    let desk = Desk::new();
    assert_eq!(desk.estimate(&["b.png", "--annotate", "one.png"]).code, Some(0));
    // Rings, axes and a headline: more than nothing, and far less than the picture.
    assert!((0.001..0.2).contains(&desk.changed("one.png")), "{}", desk.changed("one.png"));
    assert!(desk.changed("b.png") < 1e-9, "the frame itself is as it was");
    assert_eq!(desk.estimate(&["a.jpg", "b.png", "--annotate", "many"]).code, Some(0));
    for name in ["many/a.png", "many/b.png"] {
        assert!((0.001..0.2).contains(&desk.changed(name)), "{name}: {}", desk.changed(name));
    }
    assert_eq!(desk.run(&["detect", "b.png", "--annotate", "found.png"]).code, Some(0));
    assert!(desk.changed("found.png") > 0.0002, "{}", desk.changed("found.png"));
}

#[test]
fn annotated_frames_are_jpeg_too_and_what_cannot_be_written_is_told_before_anything_is_lost() {
    let desk = Desk::new();
    assert_eq!(desk.run(&["detect", "b.png", "--annotate", "found.jpg"]).code, Some(0));
    assert!(fs::read(desk.path("found.jpg")).expect("a file").starts_with(&[0xFF, 0xD8]));
    desk.write("kept.gif", b"somebody's");
    desk.run(&["detect", "b.png", "--annotate", "kept.gif"]).assert_complains(2, &["kept.gif", "PNG, JPEG"]);
    assert_eq!(fs::read(desk.path("kept.gif")).expect("a file"), b"somebody's");
}

#[test]
fn a_dash_is_standard_output_and_no_file() {
    let desk = Desk::new();
    let page = desk.run(&["encounter", "--report", "-"]);
    assert_eq!((page.code, page.err.as_str()), (Some(0), ""), "{page:?}");
    assert!(page.out.starts_with("<!doctype html>") && page.out.trim_end().ends_with("</html>"), "{page:?}");
    let description = desk.run(&["pattern", "circles:7x5:0.03", "--description", "-"]);
    assert_eq!(description.lines()[0]["columns"], 7, "{description:?}");
    let table = desk.run(&["evaluate", "thesis-2012", "--runs", "1", "--solvers", "epnp", "--cases", "-"]);
    assert_eq!((table.code, table.out.lines().count()), (Some(0), 2), "{table:?}");
    assert!(table.out.lines().all(|line| line.contains(',')), "{table:?}");
    desk.run(&["encounter", "--json", "-", "--report", "-"]).assert_complains(2, &["--json, --report", "only one"]);
    assert!(!desk.path("-").exists());
}

#[test]
fn options_that_would_do_nothing_are_refused() {
    let desk = Desk::new();
    desk.write("r.jsonl", br#"{"frame": "b.png"}"#);
    desk.run(&["detect", "--requests", "r.jsonl", "--color", "green"]).assert_complains(2, &["--color", "--requests"]);
    desk.run(&["detect", "b.png", "b.png", "--persistent", "2"]).assert_complains(2, &["--persistent", "--sequence"]);
}

#[test]
fn a_sequence_says_where_it_begins() {
    let desk = Desk::new();
    let said = desk.run(&["detect", "--method", "edge", "--sequence", "b.png", "b.png"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(said.lines()[0]["sequence"]["beginning"], "first");
    assert!(said.lines()[1]["sequence"]["beginning"].is_null());
    let said = desk.run(&["detect", "--sequence", "b.png"]);
    assert!(said.lines()[0]["sequence"].is_null(), "colour follows nothing");
}

#[test]
fn annotated_frames_never_replace_frames() {
    let desk = Desk::new();
    desk.estimate(&["b.png", "--annotate", "b.png"]).assert_complains(2, &["b.png", "replace"]);
    // Two frames of one name, and their own folder as the place to write to.
    desk.write("b.jpg", &encode::jpeg(frame(), 92).expect("encodes"));
    assert_eq!(desk.estimate(&["b.jpg", "b.png", "--annotate", "."]).code, Some(0));
    assert!(desk.changed("b.png") < 1e-9, "the frame itself is as it was");
    for name in ["b-2.png", "b-3.png"] {
        assert!(desk.changed(name) > 0.001, "{name}");
    }
}

// ---- serve ----

/// The service in a process of its own; ended with the test.
struct Service {
    child: Child,
    address: String,
}

impl Service {
    fn start(data: &Path) -> Self {
        let mut command = skypose(&["serve", "--listen", "127.0.0.1:0", "--data", as_text(data)]);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().expect("piped")).read_line(&mut line).expect("a line");
        let address = line.trim().strip_prefix("listening on http://").expect("the contract's words").to_owned();
        Self { child, address }
    }

    fn terminate(&self) {
        let status = Command::new("kill").args(["-TERM", &self.child.id().to_string()]).status();
        assert!(status.expect("kill is there").success());
    }

    fn connect(&self) -> TcpStream {
        TcpStream::connect(&self.address).expect("connects")
    }

    /// Its exit code and what it has logged.
    fn ended(mut self) -> (Option<i32>, String) {
        let mut log = String::new();
        self.child.stderr.take().expect("piped").read_to_string(&mut log).expect("UTF-8");
        (self.child.wait().expect("ends").code(), log)
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Head of a request with a body of this length, on a connection for this request alone.
fn head(method: &str, path: &str, length: usize) -> String {
    format!(
        "{method} {path} HTTP/1.1\r\nhost: skypose\r\nconnection: close\r\ncontent-type: application/json\r\n\
         content-length: {length}\r\n\r\n"
    )
}

fn answer(mut stream: TcpStream) -> String {
    let mut text = String::new();
    stream.read_to_string(&mut text).expect("UTF-8");
    text
}

#[test]
fn the_service_says_where_it_listens_and_on_sigterm_answers_what_is_under_way() {
    let folder = tempfile::tempdir().expect("a folder");
    let service = Service::start(&folder.path().join("data"));
    let mut health = service.connect();
    health.write_all(head("GET", "/healthz", 0).as_bytes()).expect("writes");
    assert!(answer(health).starts_with("HTTP/1.1 200"));

    // A request whose first half has come in.
    let body = square("under way").to_string();
    let (first, second) = body.split_at(body.len() / 2);
    let mut open = service.connect();
    open.write_all(format!("{}{first}", head("POST", "/v1/poses", body.len())).as_bytes()).expect("writes");
    // It has been read when another connection, made later, is answered.
    let mut other = service.connect();
    other.write_all(head("GET", "/healthz", 0).as_bytes()).expect("writes");
    assert!(answer(other).starts_with("HTTP/1.1 200"));
    service.terminate();
    // The door is shut, and the request still goes on.
    while let Ok(mut late) = TcpStream::connect(&service.address) {
        // Accepted by the system before the listener was closed: at most it is told that the service is going.
        let _ = late.write_all(head("GET", "/readyz", 0).as_bytes());
        std::thread::yield_now();
    }
    // Time in which a service that does not wait would be gone.
    std::thread::sleep(Duration::from_millis(200));
    open.write_all(second.as_bytes()).expect("is still read");
    let reply = answer(open);
    assert!(reply.starts_with("HTTP/1.1 200") && reply.contains("\"under way\""), "{reply}");
    let (code, log) = service.ended();
    assert_eq!(code, Some(0), "{log}");
    assert!(!log.contains("panicked") && !log.contains("ERROR"), "{log}");
}

#[test]
fn a_port_in_use_is_named() {
    let holder = TcpListener::bind("127.0.0.1:0").expect("binds");
    let address = holder.local_addr().expect("bound").to_string();
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    // Not the caller's mistake, so not 2.
    run(&["serve", "--listen", &address, "--data", as_text(&data)]).assert_complains(1, &[&address, "in use"]);
}

// ---- assess ----

#[test]
fn an_assessment_is_read_by_people_and_by_programs_and_drawn() {
    let desk = Desk::new();
    let assess =
        |arguments: &[&str]| desk.run(&[&["assess", "target.json", "--camera", "camera.json"], arguments].concat());
    let said = assess(&["--json", "a.json", "--plot", "a.svg"]);
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    for words in ["wing-six: 6 markers", "flips, %", "identified, %", "75°", "Warnings", "lie in a plane", "1. move "]
    {
        assert!(said.out.contains(words), "{words:?} is not in {}", said.out);
    }
    assert!(said.out.lines().all(|line| line.chars().count() <= 110), "{}", said.out);
    let svg = fs::read_to_string(desk.path("a.svg")).expect("a plot");
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    let written: Value = serde_json::from_slice(&fs::read(desk.path("a.json")).expect("is there")).expect("JSON");
    assert_eq!(written["cells"].as_array().expect("cells").len(), 60);

    let printed = assess(&["--json", "-", "--pixel-sigma", "1", "--flat", "--other", "target.json"]);
    let [reply] = printed.lines().try_into().expect("one line");
    let sigma = |reply: &Value| reply["cells"][5]["range_sigma_m"].as_f64().expect("a number");
    assert!((sigma(&reply) / sigma(&written) - 1.0 / 0.3).abs() < 1e-6, "errors grow with the noise");
    assert_eq!(reply["warnings"][0]["kind"], "same_as_other");
    for advice in reply["advice"].as_array().expect("a list") {
        assert!(advice["outward_m"].as_f64().expect("a number").abs() < 1e-9, "{advice}");
    }
}

#[test]
fn an_assessment_of_nonsense_is_refused_in_one_line() {
    let desk = Desk::new();
    let assess =
        |target: &str, camera: &str, more: &[&str]| desk.run(&[&["assess", target, "--camera", camera], more].concat());
    assess("none.json", "camera.json", &[]).assert_complains(2, &["none.json"]);
    assess("target.json", "none.json", &[]).assert_complains(2, &["none.json"]);
    assess("camera.json", "camera.json", &[]).assert_complains(2, &["camera.json", "markers"]);
    for sigma in ["0", "-1", "NaN", "inf"] {
        let option = format!("--pixel-sigma={sigma}");
        assess("target.json", "camera.json", &[&option]).assert_complains(2, &["/pixel_sigma"]);
    }
    assess("target.json", "camera.json", &["--plot", "no/such/folder.svg"]).assert_complains(2, &["folder.svg"]);
    desk.write("three.json", br#"{"markers": [{"id": "a", "position_m": [0, 0, 0]}]}"#);
    assess("three.json", "camera.json", &[]).assert_complains(2, &["/target/markers", "1 markers"]);
}

// ---- encounter ----

#[test]
fn an_encounter_is_read_by_people_and_by_programs_and_drawn() {
    let desk = Desk::new();
    let said = desk.run(&["encounter", "--scenario", "head-on", "--bank", "30"]);
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    for words in ["50 kn", "51.4 m/s", "7.75 s", "no certified function"] {
        assert!(said.out.contains(words), "{words:?} is not in {}", said.out);
    }
    let ask = [
        "encounter",
        "--scenario",
        "crossing",
        "--camera",
        "camera.json",
        "--target",
        "target.json",
        "--decision",
        "1",
    ];
    let printed = desk.run(&[&ask[..], &["--json"]].concat());
    let [reply] = printed.lines().try_into().expect("one line");
    let number = |value: &Value| value.as_f64().expect("a number");
    assert!((number(&reply["closing_speed_mps"]) - 36.4).abs() < 0.03, "{reply}");
    assert!((number(&reply["time_to_detect_s"]) - number(&reply["time_to_avoid_s"]) - 1.0).abs() < 1e-9);
    assert_eq!(reply["view"]["in_picture"], false, "45 degrees to the side");
    let said = desk.run(&[&ask[..], &["--camera-azimuth", "45", "--json", "e.json", "--report", "e.html"]].concat());
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    assert!(said.out.contains("Finding its markers cannot be done") && said.out.contains("FAA P-8740-51"), "{said:?}");
    let written: Value = serde_json::from_slice(&fs::read(desk.path("e.json")).expect("is there")).expect("JSON");
    assert_eq!(written["view"]["in_picture"], true);
    let page = fs::read_to_string(desk.path("e.html")).expect("a page");
    assert_eq!(page.matches("<svg").count(), 4, "bank, speed, pixels, coverage");
    for words in ["no standard is claimed", "Encounter: crossing", "Field of regard", "What is assumed"] {
        assert!(page.contains(words), "{words:?}");
    }
    assert!(!page.contains("NaN") && !page.contains("src=") && !page.contains("href="), "it needs nothing else");
}

#[test]
fn an_encounter_of_nonsense_is_refused_in_one_line() {
    let desk = Desk::new();
    let cases = [
        (&["--bank", "90"][..], "/bank_rad"),
        (&["--bank", "NaN"], "/bank_rad"),
        (&["--own-speed", "0"], "/own_speed_mps"),
        (&["--intruder-speed", "-5"], "/intruder_speed_mps"),
        (&["--miss", "0"], "/miss_distance_m"),
        (&["--width", "inf"], "/target_width_m"),
        (&["--decision", "-1"], "/delays/decision_s"),
        (&["--camera", "none.json"], "none.json"),
        (&["--report", "no/such/page.html"], "page.html"),
    ];
    for (options, words) in cases {
        desk.run(&[&["encounter"], options].concat()).assert_complains(2, &[words]);
    }
    // No turn is an answer.
    let said = desk.run(&["encounter", "--course", "0"]);
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    assert!(said.out.contains("they do not come nearer"), "{said:?}");
}

// ---- demo ----

#[test]
fn the_demo_flies_and_leaves_its_frames() {
    let folder = tempfile::tempdir().expect("a folder");
    let said = Said::of(
        skypose(&["demo", "--frames", "2", "--out", "out"]).current_dir(folder.path()).output().expect("starts"),
    );
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    assert!(said.out.contains("4 frames, 4 poses"), "{said:?}");
    for flight in ["head-on", "crossing"] {
        for number in ["000", "001"] {
            let pixels = |name: String| {
                let bytes = fs::read(folder.path().join(name)).expect("a picture");
                let frame = Frame::decode(&bytes, &skypose::frame::Decoding::default()).expect("decodes");
                assert_eq!((frame.width(), frame.height()), (1280, 720));
                frame.rgb().into_owned()
            };
            let annotated = pixels(format!("out/{flight}-{number}.jpg"));
            let posted = pixels(format!("out/frames/{flight}-{number}.jpg"));
            let changed = annotated.iter().zip(&posted).filter(|(a, b)| a.abs_diff(**b) > 60).count();
            assert!(changed > 1000, "{flight} {number}: {changed} samples are drawn in");
        }
    }
    // What it leaves can be tried at once.
    let again = Said::of(
        skypose(&["estimate", "--camera", "camera.json", "--target", "target.json", "frames"])
            .current_dir(folder.path().join("out"))
            .output()
            .expect("starts"),
    );
    assert_eq!(again.code, Some(0), "{again:?}");
    assert!(again.lines().len() == 4 && again.lines().iter().all(|reply| reply["targets"][0]["detected"] == true));
}

// ---- readers that leave ----

#[test]
fn a_reader_that_leaves_early_is_no_error() {
    let desk = Desk::new();
    let many = ["a.jpg"; 12];
    for arguments in [&["openapi"][..], &["demo", "--frames", "2"], &[&["detect"], &many[..]].concat()] {
        let mut command = skypose(arguments);
        let mut child =
            command.current_dir(desk.0.path()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
        let mut first = [0];
        child.stdout.as_mut().expect("piped").read_exact(&mut first).expect("a byte");
        drop(child.stdout.take());
        let said = Said::of(child.wait_with_output().expect("ends"));
        assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{arguments:?}: {said:?}");
    }
}
