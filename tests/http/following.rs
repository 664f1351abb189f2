//! What a stream remembers from frame to frame: where it looks next, and what moves in the sky.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use nalgebra::Vector3;
use reqwest::StatusCode;
use serde_json::{Value, json};
use skypose::camera::{Camera, Distortion};
use skypose::frame::Frame;
use skypose::geometry::CameraFromTarget;
use skypose::random;
use skypose::scene::flight::Flight;
use skypose::scene::models::wing;
use skypose::scene::render::{Optics, Sky, render};
use skypose::shell::wire::CameraWire;

use crate::station::{Reply, Station, without_timing};

const SIZE: [u32; 2] = [640, 360];
/// Every so many frames of a stream all is searched.
const SCHEDULE: usize = 10;

fn camera() -> Camera {
    let lens = Distortion::PlumbBob([-0.12, 0.05, 4e-4, -3e-4, 0.0]);
    Camera::checked(SIZE, [500.0, 501.0], [318.0, 178.0], lens).expect("a good camera")
}

/// The last stretch of a head-on flight, 4 to 3 m away.
fn one(step: usize) -> CameraFromTarget {
    Flight::HeadOn.pose(155 + step)
}

/// Another one beside it, further away.
fn other(step: usize) -> CameraFromTarget {
    let one = one(step);
    CameraFromTarget::new(one.rotation, one.translation + Vector3::new(1.7, 0.6, 1.5))
}

fn seen(pose: &CameraFromTarget, step: usize) -> Frame {
    let sky = Sky::fair(3, [0.0; 2]);
    render(&camera(), pose, &wing(), &sky, &Optics::default(), &mut random::named(&format!("following {step}")))
}

fn one_alone(step: usize) -> Vec<u8> {
    seen(&one(step), step).rgb().into_owned()
}

/// Both: what is around the other one is cut from a frame of it under the same sky.
fn both(step: usize) -> Vec<u8> {
    let (mut rgb, beside) = (one_alone(step), seen(&other(step), step).rgb().into_owned());
    let camera = camera();
    let pixels: Vec<_> =
        wing().target.markers().iter().map(|m| camera.project(&(other(step) * m.position)).expect("in view")).collect();
    let least = |of: fn(&skypose::camera::Pixel) -> f64| pixels.iter().map(of).fold(f64::INFINITY, f64::min) - 10.0;
    let most = |of: fn(&skypose::camera::Pixel) -> f64| pixels.iter().map(of).fold(0.0, f64::max) + 10.0;
    let (left, right, top, bottom) = (least(|p| p.x), most(|p| p.x), least(|p| p.y), most(|p| p.y));
    let [width, height] = SIZE.map(|side| side as usize);
    for v in 0..height {
        for u in 0..width {
            if (left..right).contains(&(u as f64)) && (top..bottom).contains(&(v as f64)) {
                let at = 3 * (v * width + u);
                rgb[at..at + 3].copy_from_slice(&beside[at..at + 3]);
            }
        }
    }
    rgb
}

/// A station with two streams of the same camera: `whole`, and `part` that looks where the tracks predict.
async fn flying() -> Station {
    // Longer than it takes to render them all.
    let station = Station::equipped_with(|settings| settings.streams.max_age_ms = 3_600_000).await;
    assert!(station.put("/v1/cameras/small", &json!(CameraWire::from(&camera()))).await.status.is_success());
    for (name, search) in [("whole", "full"), ("part", "predicted")] {
        let track = json!({"full_search_every": SCHEDULE});
        let stream =
            json!({"camera": "small", "targets": ["wing-six"], "max_instances": 2, "search": search, "track": track});
        let stored = station.put(&format!("/v1/streams/{name}"), &stream).await;
        assert_eq!(stored.status, StatusCode::CREATED, "{stored:?}");
    }
    station
}

fn now_us() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970");
    i64::try_from(since.as_micros()).expect("this century")
}

/// The frame of a step by this path, as the reply came.
async fn post(station: &Station, path: &str, query: &str, rgb: &[u8]) -> Vec<u8> {
    let [width, height] = SIZE;
    let path = format!("{path}?width={width}&height={height}&format=rgb8&{query}");
    let request = station.request(reqwest::Method::POST, &path).header("content-type", "application/octet-stream");
    let response = request.body(rgb.to_vec()).send().await.expect("an answer");
    let (status, reply) = (response.status(), response.bytes().await.expect("a whole answer"));
    assert_eq!(status, StatusCode::OK, "{}", String::from_utf8_lossy(&reply));
    reply.into()
}

/// The poses of a reply, by distance.
fn poses(reply: &Value) -> Vec<&Value> {
    let found = reply["targets"].as_array().expect("targets").iter().filter_map(|target| target.get("pose"));
    let mut poses: Vec<&Value> = found.filter(|pose| !pose.is_null()).collect();
    let range = |pose: &Value| pose["range_m"].as_f64().expect("a range");
    poses.sort_by(|a, b| range(a).total_cmp(&range(b)));
    poses
}

/// Both see the same markers in the same pixels: what differs is small against what the noise does to each.
fn assert_same_pose(one: &Value, other: &Value) {
    for axis in 0..3 {
        let place = |pose: &Value| pose["translation_m"][axis].as_f64().expect("a number");
        let sigma = one["covariance"][axis][axis].as_f64().expect("a variance").sqrt();
        assert!((place(one) - place(other)).abs() < 0.5 * sigma, "{one} {other}");
    }
}

#[tokio::test]
async fn where_only_a_part_is_searched_nothing_is_lost() {
    const COMES_AT: usize = 14;
    let station = flying().await;
    let start = now_us();
    let (mut parts, mut found_at) = (0, None);
    for step in 0..COMES_AT + SCHEDULE + 3 {
        let rgb = if step < COMES_AT { one_alone(step) } else { both(step) };
        let taken = start + 50_000 * i64::try_from(step).expect("small");
        let place = format!("sequence={step}&timestamp_us={taken}");
        let whole = post(&station, "/v1/cameras/whole/frames", &place, &rgb).await;
        let part = post(&station, "/v1/cameras/part/frames", &place, &rgb).await;
        let [whole_json, part_json]: [Value; 2] = [&whole, &part].map(|r| serde_json::from_slice(r).expect("JSON"));
        assert_eq!(poses(&whole_json).len(), if step < COMES_AT { 1 } else { 2 }, "step {step}: {whole_json}");
        let region = &part_json["frame"]["region_px"];
        parts += usize::from(!region.is_null());
        // The reply is that of a single frame of which this part is asked for.
        let numbers: Vec<String> = region.as_array().into_iter().flatten().map(Value::to_string).collect();
        let region = if numbers.is_empty() { String::new() } else { format!("&region_px={}", numbers.join(",")) };
        let query =
            format!("camera=small&target=wing-six&max_instances=2&timestamp_us={taken}&frame_index={step}{region}");
        let single = post(&station, "/v1/estimates", &query, &rgb).await;
        assert_eq!(String::from_utf8_lossy(without_timing(&part)), String::from_utf8_lossy(without_timing(&single)));
        let (in_whole, in_part) = (poses(&whole_json), poses(&part_json));
        assert!(!in_part.is_empty(), "step {step}: the one that was there is lost: {part_json}");
        for (whole, part) in in_whole.iter().zip(&in_part) {
            assert_same_pose(whole, part);
        }
        match found_at {
            None if in_part.len() == 2 => found_at = Some(step),
            None => {}
            Some(at) => assert_eq!(in_part.len(), 2, "found at {at} and lost at {step}: {part_json}"),
        }
    }
    let found_at = found_at.expect("the new one is found");
    assert!(found_at < COMES_AT + SCHEDULE, "found at {found_at}");
    println!("{parts} frames searched in part, the new target found {} frames after it came", found_at - COMES_AT);
    assert!(parts >= 10, "{parts}");
}

#[tokio::test]
async fn what_is_not_where_it_should_be_is_found_elsewhere_in_the_same_frame() {
    let station = flying().await;
    let start = now_us();
    let mut was_part = false;
    for step in 0..8 {
        let place = format!("timestamp_us={}", start + 50_000 * step);
        let reply =
            post(&station, "/v1/cameras/part/frames", &place, &one_alone(usize::try_from(step).expect("small"))).await;
        let reply: Value = serde_json::from_slice(&reply).expect("JSON");
        was_part = !reply["frame"]["region_px"].is_null();
    }
    assert!(was_part, "the last frame before the jump was searched in part");
    let gone = seen(&other(8), 8).rgb().into_owned();
    let reply = post(&station, "/v1/cameras/part/frames", &format!("timestamp_us={}", start + 400_000), &gone).await;
    let reply: Value = serde_json::from_slice(&reply).expect("JSON");
    assert!(reply["frame"].get("region_px").is_none(), "{reply}");
    let found = poses(&reply);
    let truth = other(8).translation;
    for axis in 0..3 {
        let place = found[0]["translation_m"][axis].as_f64().expect("a number");
        // Five percent of the distance tells this one from the other.
        assert!((place - truth[axis]).abs() < 0.05 * truth.norm(), "{reply}");
    }
}

#[tokio::test]
async fn what_makes_no_sense_of_tracks_and_searches_is_told_where() {
    let station = Station::equipped().await;
    for (change, pointer) in [
        (json!({"track": {"gate_z": 11}}), "/track/gate_z"),
        (json!({"track": {"confirm_hits": "two"}}), "/track/confirm_hits"),
        (json!({"track": {"unheard_of": 1}}), "/track/unheard_of"),
        (json!({"search": "everywhere"}), "/search"),
        (json!({"search": "predicted", "detector": {"method": "edge"}}), "/search"),
    ] {
        let mut stream = json!({"camera": "demo", "targets": ["wing-six"]});
        for (name, value) in change.as_object().expect("an object") {
            stream[name] = value.clone();
        }
        let reply = station.put("/v1/streams/front", &stream).await;
        assert_eq!(reply.assert_problem(422).pointer(), pointer, "{stream}");
    }
    station.get("/v1/streams/front").await.assert_problem(404);
}

/// A dark dot in a sky of this size, as PGM; its ground tells one scene from another.
fn dot([width, height]: [i32; 2], x: i32, sky: impl Fn(i32, i32) -> u8) -> Vec<u8> {
    let sample = |u: i32, v: i32| if (u - x).abs() <= 2 && (v - 60).abs() <= 1 { 60 } else { sky(u, v) };
    let samples = (0..height).flat_map(|v| (0..width).map(move |u| (u, v))).map(|(u, v)| sample(u, v));
    [format!("P5\n{width} {height}\n255\n").into_bytes(), samples.collect()].concat()
}

const fn gray(_: i32, _: i32) -> u8 {
    180
}

fn squares(u: i32, v: i32) -> u8 {
    if (u / 9 + v / 7) % 2 == 0 { 40 } else { 230 }
}

/// A station with the stream `front` of a camera of this size.
async fn sky_station(size: [i32; 2]) -> Station {
    let station = Station::with(|settings| settings.streams.max_age_ms = 60_000).await;
    resize(&station, size).await;
    let stored = station.put("/v1/streams/front", &json!({"camera": "sky", "detector": {"method": "edge"}})).await;
    assert_eq!(stored.status, StatusCode::CREATED, "{stored:?}");
    station
}

async fn resize(station: &Station, [width, height]: [i32; 2]) {
    let camera = json!({
        "width": width, "height": height, "fx": 150.0, "fy": 150.0,
        "cx": f64::from(width) / 2.0, "cy": f64::from(height) / 2.0,
    });
    let stored = station.put("/v1/cameras/sky", &camera).await;
    assert!(stored.status.is_success(), "{stored:?}");
}

#[tokio::test]
async fn a_stream_of_edges_follows_them_as_a_sequence_and_a_folder_do() {
    const SMALL: [i32; 2] = [160, 128];
    let station = sky_station(SMALL).await;
    let folder = tempfile::tempdir().expect("a folder");
    let start = now_us();
    let mut streamed = Vec::new();
    for index in 0..6_i32 {
        let frame = dot(SMALL, 40 + 3 * index, gray);
        std::fs::write(folder.path().join(format!("{index}.pgm")), &frame).expect("writes");
        let taken = start + i64::from(index) * 40_000;
        let path = format!("/v1/cameras/front/frames?sequence={index}&timestamp_us={taken}");
        let by_stream = station.request(reqwest::Method::POST, &path).header("content-type", "image/x-portable-pixmap");
        let by_stream = by_stream.body(frame.clone()).send().await.expect("an answer");
        assert_eq!(by_stream.status(), StatusCode::OK);
        let by_stream = by_stream.bytes().await.expect("a whole answer");
        // A session of the same name over HTTP is another sequence, and sees the same.
        let path =
            format!("/v1/estimates?camera=sky&method=edge&sequence=front&frame_index={index}&timestamp_us={taken}");
        let by_session =
            station.request(reqwest::Method::POST, &path).header("content-type", "image/x-portable-pixmap");
        let by_session = by_session.body(frame).send().await.expect("an answer").bytes().await.expect("a whole answer");
        assert_eq!(
            String::from_utf8_lossy(without_timing(&by_stream)),
            String::from_utf8_lossy(without_timing(&by_session))
        );
        streamed.push(serde_json::from_slice::<Value>(&by_stream).expect("JSON"));
    }
    assert_eq!(streamed[0]["sequence"], json!({"name": "front", "beginning": "first"}));
    let id = &streamed[0]["centroids"][0]["track_id"];
    assert!(id.is_u64(), "{}", streamed[0]);
    assert!(streamed.iter().all(|reply| reply["centroids"][0]["track_id"] == *id));
    assert!(streamed[1..].iter().all(|reply| reply["sequence"]["beginning"].is_null()));
    // And so does the command line, of the folder.
    let said = std::process::Command::new(env!("CARGO_BIN_EXE_skypose"))
        .args(["detect", "--method", "edge", "--sequence"])
        .arg(folder.path())
        .output()
        .expect("starts");
    let lines = String::from_utf8(said.stdout).expect("text");
    let by_folder: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(by_folder.len(), streamed.len(), "{lines}");
    for (folder, stream) in by_folder.iter().zip(&streamed) {
        assert_eq!(folder["centroids"], stream["centroids"]);
    }
}

#[tokio::test]
async fn a_gap_a_cut_and_another_size_begin_anew_and_the_reply_says_so() {
    const SMALL: [i32; 2] = [160, 128];
    const LARGE: [i32; 2] = [192, 128];
    let station = sky_station(SMALL).await;
    let start = now_us();
    let post = async |number: i64, taken_ms: i64, frame: Vec<u8>| -> Reply {
        let path = format!("/v1/cameras/front/frames?sequence={number}&timestamp_us={}", start + 1000 * taken_ms);
        let reply = station.post_bytes(&path, "image/x-portable-pixmap", frame).await;
        assert_eq!(reply.status, StatusCode::OK, "{reply:?}");
        reply
    };
    let beginning = |reply: &Reply| reply.json["sequence"]["beginning"].clone();
    assert_eq!(beginning(&post(0, 0, dot(SMALL, 40, gray)).await), "first");
    assert_eq!(beginning(&post(1, 40, dot(SMALL, 43, gray)).await), Value::Null);
    assert_eq!(beginning(&post(40, 1600, dot(SMALL, 46, gray)).await), "gap");
    assert_eq!(beginning(&post(41, 1640, dot(SMALL, 49, gray)).await), Value::Null);
    assert_eq!(beginning(&post(42, 1680, dot(SMALL, 52, squares)).await), "cut");
    resize(&station, LARGE).await;
    assert_eq!(beginning(&post(43, 1720, dot(LARGE, 55, gray)).await), "resized");
    let after = post(44, 1760, dot(LARGE, 58, gray)).await;
    assert_eq!(beginning(&after), Value::Null);
    // A frame that is none of the camera leaves the sequence as it was.
    let path = format!("/v1/cameras/front/frames?sequence=45&timestamp_us={}", start + 1_800_000);
    let foreign = station.post_bytes(&path, "image/x-portable-pixmap", dot(SMALL, 61, gray)).await;
    foreign.assert_problem(422);
    assert_eq!(beginning(&post(46, 1840, dot(LARGE, 64, gray)).await), Value::Null);
}

#[tokio::test]
async fn the_command_line_watches_a_server() {
    let station = Station::equipped_with(|settings| settings.streams.max_age_ms = 60_000).await;
    let stream = json!({"camera": "demo", "targets": ["wing-six"]});
    station.put("/v1/streams/front", &stream).await;
    let watch = async |arguments: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_skypose"));
        command.args(["watch", "--server", &station.base]).args(arguments);
        tokio::task::spawn_blocking(move || command.output()).await.expect("no panic").expect("starts")
    };
    let feed = async {
        loop {
            station.post_bytes("/v1/cameras/front/frames", "image/jpeg", crate::station::jpeg()).await;
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    let said = tokio::select! {
        said = watch(&["--camera", "front", "--count", "2", "--json"]) => said,
        () = feed => unreachable!("it never ends"),
    };
    assert!(said.status.success(), "{said:?}");
    let lines = String::from_utf8(said.stdout).expect("text");
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(lines.len(), 2, "{lines:?}");
    for line in &lines {
        assert_eq!(line["camera"], "front");
        crate::station::assert_true_pose(&line["estimate"]["targets"][0]["pose"]);
    }
    let id = |line: &Value| line["id"].as_str().expect("an id").parse::<u64>().expect("a number");
    assert_eq!(id(&lines[1]), id(&lines[0]) + 2, "the tracks stand between");
    // Of a stream that is not there it says so.
    let said = watch(&["--camera", "aft"]).await;
    assert!(!said.status.success() && String::from_utf8_lossy(&said.stderr).contains("stream"), "{said:?}");
}
