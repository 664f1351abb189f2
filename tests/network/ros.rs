//! ROS 2 over Zenoh, with messages that rosbags, another implementation of CDR, writes and reads.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use skypose::geometry::{CameraFromTarget, rotation};
use skypose::scene::models::demo_camera;
use skypose::shell::bus::network::{Role, join};
use skypose::shell::bus::ros::messages::{CAMERA_INFO, COMPRESSED_IMAGE, POSE};
use skypose::shell::bus::ros::names::Attachment;
use skypose::shell::config::{RosCamera, RosForm};
use zenoh::sample::Sample;

use crate::free_endpoint;
use crate::python::{Peer, python};
use crate::station::{self, Station, jpeg};

/// Longer than anything here takes.
const SOON: Duration = Duration::from_secs(30);
/// What is imported.
const MODULES: &str = "zenoh, rosbags.typesys";

/// A station that listens to a camera of ROS, with the stream `front`.
async fn station(endpoint: &str, form: RosForm, type_hash: bool) -> Station {
    let station = Station::equipped_with(|settings| {
        endpoint.clone_into(&mut settings.zenoh.network);
        settings.zenoh.node = "alpha".into();
        settings.streams.max_age_ms = 20_000;
        settings.ros.form = form;
        settings.ros.domain = 7;
        settings.ros.type_hash = type_hash;
        settings.ros.cameras = vec![RosCamera {
            camera: "front".into(),
            image: "/front/image_raw/compressed".into(),
            camera_info: "/front/camera_info".into(),
            pose: "/skypose/front/{target}/pose".into(),
            frame_id: String::new(),
        }];
    })
    .await;
    let stream = json!({"camera": "demo", "targets": ["wing-six"]});
    assert_eq!(station.put("/v1/streams/front", &stream).await.status, 201);
    station
}

/// What the client is to do.
fn flight(form: &str, hash: bool, frame: &std::path::Path) -> Value {
    let camera = demo_camera();
    let ([fx, fy], [cx, cy]) = (camera.focal_lengths(), camera.principal_point());
    json!({
        "form": form, "domain": 7, "hash": hash, "image": "/front/image_raw/compressed",
        "camera_info": "/front/camera_info", "pose": "/skypose/front/wing_six/pose", "frame": frame, "count": 3,
        "k": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], "d": camera.distortion().coefficients(),
        "model": match camera.distortion().coefficients().len() { 5 => "plumb_bob", 8 => "rational_polynomial", 4 => "equidistant", _ => "" },
        "size": [camera.width(), camera.height()],
    })
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}

fn of(value: &Value, names: &[&str]) -> Vec<f64> {
    names.iter().map(|name| value[name].as_f64().expect("a number")).collect()
}

/// The pose of a message as rosbags has read it is the truth, within its covariance.
fn assert_true(message: &Value) {
    let pose = &message["pose"]["pose"];
    let translation = Vector3::from_vec(of(&pose["position"], &["x", "y", "z"]));
    let q = of(&pose["orientation"], &["w", "x", "y", "z"]);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
    let found = CameraFromTarget::new(rotation::from_quaternion(&turn), translation);
    let error = found.difference_to(&station::truth());
    let covariance = nalgebra::Matrix6::from_row_slice(&numbers(&message["pose"]["covariance"]));
    let nees = error.dot(&covariance.cholesky().expect("positive definite").solve(&error));
    // 99.99 % of chi-square with six degrees of freedom.
    assert!(nees < 27.9, "{nees}: {error}");
    assert!(error.norm() < 0.1, "{error}");
}

/// The camera that is stored as this, once it is so.
async fn camera_when(station: &Station, is_so: impl Fn(&Value) -> bool) -> Value {
    let start = Instant::now();
    loop {
        let camera = station.get("/v1/cameras/demo").await.json;
        if is_so(&camera) {
            return camera;
        }
        assert!(start.elapsed() < SOON, "{camera}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

async fn flown(form: RosForm, name: &str, hash: bool, change: impl FnOnce(&mut Value)) -> Option<(Value, Value)> {
    let python = python(MODULES)?;
    let endpoint = free_endpoint();
    let station = station(&endpoint, form, hash).await;
    // Somebody has stored another camera; what ROS says of it counts.
    let true_camera = station.get("/v1/cameras/demo").await.json;
    let mut wrong = true_camera.clone();
    wrong["fx"] = json!(true_camera["fx"].as_f64().expect("a number") * 1.3);
    assert!(station.put("/v1/cameras/demo", &wrong).await.status.is_success());
    let folder = tempfile::tempdir().expect("a folder");
    let frame = folder.path().join("frame.jpg");
    std::fs::write(&frame, jpeg()).expect("writes");
    let mut wanted = flight(name, hash, &frame);
    change(&mut wanted);
    let mut client = Peer::start(&python, "ros.py", &["fly", &endpoint, &wanted.to_string()]);
    assert_eq!(client.line(), "informed");
    let told = camera_when(&station, |camera| camera["fx"] == true_camera["fx"]).await;
    assert_eq!((&told["cx"], &told["width"]), (&true_camera["cx"], &true_camera["width"]));
    client.go();
    let report: Value = serde_json::from_str(&client.line()).expect("a report");
    Some((report, wanted))
}

fn assert_flown(report: &Value, count: usize) {
    let poses = report["poses"].as_array().expect("poses");
    assert_eq!(poses.len(), count, "{report}");
    for (pose, stamp) in poses.iter().zip(report["stamps"].as_array().expect("stamps")) {
        assert_true(pose);
        // The picture's own header, to the nanosecond: so messages of one moment are found.
        let found = &pose["header"]["stamp"];
        let stamp_ns =
            found["sec"].as_i64().expect("a number") * 1_000_000_000 + found["nanosec"].as_i64().expect("a number");
        assert_eq!(Some(stamp_ns), stamp.as_i64());
        assert_eq!(pose["header"]["frame_id"], "front_optical");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_on_rmw_zenoh_sends_pictures_and_gets_poses() {
    let Some((report, _)) = flown(RosForm::RmwZenoh, "rmw_zenoh", true, |_| {}).await else { return };
    assert_flown(&report, 3);
    // Each is announced as rmw_zenoh has it, and each message carries the name of its announced publisher.
    let tokens: Vec<&str> = report["tokens"].as_array().expect("tokens").iter().filter_map(Value::as_str).collect();
    println!("{tokens:#?}");
    let one = |wanted: &str| {
        let found: Vec<&&str> = tokens.iter().filter(|token| token.contains(wanted)).collect();
        assert_eq!(found.len(), 1, "{wanted}: {tokens:?}");
        *found[0]
    };
    assert!(one("/NN/").ends_with("/0/0/NN/%/%/skypose"));
    for (topic, of) in [("front%image_raw%compressed", COMPRESSED_IMAGE), ("front%camera_info", CAMERA_INFO)] {
        one(&format!("/MS/%/%/skypose/%{topic}/{}/{}/::,10:,:,:,,", of.dds_name, of.hash));
    }
    let publisher =
        one(&format!("/MP/%/%/skypose/%skypose%front%wing_six%pose/{}/{}/::,10:,:,:,,", POSE.dds_name, POSE.hash));
    let gid = hexadecimal(&Attachment::gid_of(publisher));
    for (sequence, pose) in (1..).zip(report["poses"].as_array().expect("poses")) {
        let note = &pose["attachment"];
        assert_eq!((&note["sequence"], &note["gid"]), (&json!(sequence), &json!(gid)));
        assert_eq!(note["rest"], json!([16, 33]));
        assert!(note["source_ns"].as_i64() >= report["stamps"][0].as_i64());
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn humble_has_no_hashes_and_big_endian_is_read_too() {
    let flown = flown(RosForm::RmwZenoh, "rmw_zenoh", false, |wanted| wanted["big_endian"] = json!(true)).await;
    let Some((report, _)) = flown else { return };
    assert_flown(&report, 3);
    let key = report["poses"][0]["key"].as_str().expect("a key");
    assert_eq!(key, format!("7/skypose/front/wing_six/pose/{}/TypeHashNotSupported", POSE.dds_name));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_behind_the_bridge_sends_pictures_and_gets_poses() {
    let Some((report, _)) = flown(RosForm::Bridge, "bridge", true, |_| {}).await else { return };
    assert_flown(&report, 3);
    assert_eq!(report["poses"][0]["key"], "skypose/front/wing_six/pose");
    assert_eq!(report["poses"][0]["attachment"], Value::Null);
    assert_eq!(report["tokens"], json!([]));
}

#[test]
fn hashes_of_types_are_those_that_another_computes() {
    let Some(python) = python("rosbags.typesys") else { return };
    let told: Value = serde_json::from_str(&Peer::start(&python, "ros.py", &["hashes"]).line()).expect("JSON");
    for (name, of) in [
        ("sensor_msgs/msg/CompressedImage", COMPRESSED_IMAGE),
        ("sensor_msgs/msg/CameraInfo", CAMERA_INFO),
        ("geometry_msgs/msg/PoseWithCovarianceStamped", POSE),
    ] {
        assert_eq!(told[name], json!([of.hash, of.hash, of.hash]), "{name}");
    }
}

/// A header of a picture without a stamp, then no text where one should be.
const BROKEN: [&[u8]; 5] = [
    &[],
    &[0, 1, 0],
    &[0, 3, 0, 0, 0, 0, 0, 0],
    &[0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff, 0xff, 0xff],
    &[0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff, 0xff, 0x7f],
];

/// `CompressedImage` of a moment.
fn picture(stamp_us: i64, data: &[u8]) -> Vec<u8> {
    let mut message = vec![0, 1, 0, 0];
    let part = |number: usize| u32::try_from(number).expect("small").to_le_bytes();
    message.extend(i32::try_from(stamp_us / 1_000_000).expect("this century").to_le_bytes());
    message.extend(part(usize::try_from(stamp_us % 1_000_000).expect("positive") * 1000));
    message.extend([&part(2)[..], b"c\0", &[0, 0], &part(5), b"jpeg\0", &[0, 0, 0], &part(data.len()), data].concat());
    message
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_no_message_harms_nothing_and_what_shows_no_target_has_no_pose() {
    let endpoint = free_endpoint();
    let station = station(&endpoint, RosForm::RmwZenoh, true).await;
    let client = join(&endpoint, Role::Connect, false).await.expect("connects");
    let poses = client.declare_subscriber("7/skypose/**").await.expect("listens");
    let status = client.declare_subscriber("skypose/v1/default/alpha/camera/front/status").await.expect("listens");
    let next = async |is_so: fn(&Value, u64) -> bool, count: u64| {
        let start = Instant::now();
        loop {
            let sample: Sample =
                tokio::time::timeout(SOON, status.recv_async()).await.expect("in time").expect("a status");
            let told: Value = serde_json::from_slice(&sample.payload().to_bytes()).expect("JSON");
            if is_so(&told, count) {
                return told;
            }
            assert!(start.elapsed() < SOON, "no such status of {count}: {told}");
        }
    };
    let base = format!("7/front/image_raw/compressed/{}", COMPRESSED_IMAGE.dds_name);
    let refused = |told: &Value, count: u64| told["refused"] == count;
    next(|told, _| told["has_stream"] == true, 0).await;
    let mut count = 0;
    for message in BROKEN {
        client.put(format!("{base}/{}", COMPRESSED_IMAGE.hash), message).await.expect("sends");
        count += 1;
        let told = next(refused, count).await;
        assert!(told["problem"]["detail"].as_str().expect("told").starts_with("CompressedImage: "), "{told}");
    }
    let now = || {
        let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970");
        i64::try_from(since.as_micros()).expect("this century")
    };
    // Another definition of the type is told of by its hash.
    client.put(format!("{base}/{}", POSE.hash), picture(now(), &jpeg())).await.expect("sends");
    let told = next(refused, count + 1).await;
    assert!(told["problem"]["detail"].as_str().expect("told").starts_with("type hash RIHS01_2643"), "{told}");
    // Broken intrinsics change nothing.
    for message in BROKEN {
        client
            .put(format!("7/front/camera_info/{}/{}", CAMERA_INFO.dds_name, CAMERA_INFO.hash), message)
            .await
            .expect("sends");
    }
    // A grey picture shows nothing, and nothing is published of it; then one that does.
    let grey = skypose::frame::Frame::from_raw(
        skypose::frame::RawFormat::Rgb8,
        demo_camera().width(),
        demo_camera().height(),
        &vec![90; demo_camera().width() as usize * demo_camera().height() as usize * 3],
        skypose::frame::Limits::default(),
    )
    .expect("a frame");
    let grey = skypose::scene::encode::jpeg(&grey, 90).expect("encodes");
    let key = format!("{base}/{}", COMPRESSED_IMAGE.hash);
    client.put(&key, picture(now(), &grey)).await.expect("sends");
    next(|told, _| told["published"] == 1, 0).await;
    assert!(poses.try_recv().expect("open").is_none());
    client.put(&key, picture(now(), &jpeg())).await.expect("sends");
    let pose = tokio::time::timeout(SOON, poses.recv_async()).await.expect("in time").expect("a pose");
    assert!(pose.key_expr().as_str().starts_with("7/skypose/front/wing_six/pose/"));
    assert!(poses.try_recv().expect("open").is_none(), "one alone");
    drop(station);
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}
