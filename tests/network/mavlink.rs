//! MAVLink over real UDP, read by pymavlink.

use std::net::TcpListener;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use nalgebra::{Matrix3, Matrix6, Quaternion, UnitQuaternion, Vector3, Vector6};
use serde_json::{Value, json};
use skypose::geometry::rotation;
use skypose::shell::bus::network::{Role, join};
use skypose::shell::config::{MavlinkMessage, Settings};
use zenoh::bytes::Encoding;

use crate::python::{Peer, python};
use crate::station::{self, Station, jpeg};

/// Ends of the stamps, so that they are known again.
const MICROSECONDS: i64 = 777;

fn now_us() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970");
    i64::try_from(since.as_micros()).expect("this century")
}

/// What the ground station hears while frames fly.
async fn heard(name: &str, change: impl FnOnce(&mut Settings)) -> Option<Value> {
    let python = python("pymavlink.mavutil")?;
    let mut ground = Peer::start(&python, "ground.py", &["60", name, "3"]);
    let port: u16 = ground.line().parse().expect("a port");
    let socket = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let endpoint = format!("tcp/{}", socket.local_addr().expect("bound"));
    drop(socket);
    let station = Station::equipped_with(|settings| {
        settings.zenoh.network.clone_from(&endpoint);
        settings.zenoh.node = "alpha".into();
        settings.streams.max_age_ms = 20_000;
        settings.mavlink.address = format!("127.0.0.1:{port}");
        settings.mavlink.system_id = 42;
        settings.mavlink.heartbeat_ms = 200;
        change(settings);
    })
    .await;
    let stream = json!({"camera": "demo", "targets": ["wing-six"]});
    assert_eq!(station.put("/v1/streams/front", &stream).await.status, 201);
    let client = join(&endpoint, Role::Connect, false).await.expect("connects");
    let flying = tokio::spawn(async move {
        let start = Instant::now();
        while start.elapsed() < Duration::from_mins(1) {
            client
                .put("skypose/v1/default/alpha/camera/front/frame", jpeg())
                .encoding(Encoding::IMAGE_JPEG)
                .attachment(json!({"timestamp_us": now_us() / 1000 * 1000 + MICROSECONDS}).to_string())
                .await
                .expect("sends");
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    });
    let report = tokio::task::spawn_blocking(move || ground.line()).await.expect("no panic");
    flying.abort();
    station.stopper.stop();
    station.mavlink.expect("sends").closed().await;
    Some(serde_json::from_str(&report).expect("a report"))
}

fn numbers(value: &Value, names: &[&str]) -> Vec<f64> {
    names.iter().map(|name| value[name].as_f64().expect("a number")).collect()
}

fn attitude(q: &Value) -> nalgebra::Rotation3<f64> {
    let q: Vec<f64> = q.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect();
    rotation::from_quaternion(&UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3])))
}

/// The truth in the body's axes, written out: forward is the camera's z, right its x, down its y.
fn forward() -> (Vector3<f64>, Matrix3<f64>) {
    let truth = station::truth();
    let axes = Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    let t = truth.translation;
    (Vector3::new(t.z, t.x, t.y), axes * truth.rotation.matrix())
}

fn assert_sent(report: &Value) -> &Vec<Value> {
    let heart = &report["heartbeat"];
    // An onboard controller that is no autopilot.
    assert_eq!((&heart["type"], &heart["autopilot"], &heart["system_status"]), (&json!(18), &json!(8), &json!(4)));
    let found = report["found"].as_array().expect("messages");
    assert_eq!(found.len(), 3, "{report}");
    for message in found.iter().chain([heart]) {
        assert_eq!((&message["system"], &message["component"]), (&json!(42), &json!(191)));
        assert_eq!(message["magic"], 0xfd, "MAVLink 2");
    }
    for message in found {
        let time_us = message["time_usec"].as_i64().expect("a number");
        assert_eq!(time_us % 1000, MICROSECONDS);
        assert!((now_us() - time_us).abs() < 120_000_000, "{time_us}");
    }
    found
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_autopilot_hears_where_a_target_is_seen_ahead() {
    let Some(report) = heard("LANDING_TARGET", |_| {}).await else { return };
    let (place, turn) = forward();
    let seen = station::truth().translation;
    for message in assert_sent(&report) {
        let found = Vector3::from_vec(numbers(message, &["x", "y", "z"]));
        // One percent of the range and a degree, as far as the pose of one frame may be off.
        assert!((found - place).norm() < 0.01 * place.norm(), "{found} {place}");
        assert!((attitude(&message["q"]).matrix() - turn).norm() < 0.03, "{message}");
        let [x, y, distance] = numbers(message, &["angle_x", "angle_y", "distance"])[..] else { panic!("three") };
        assert!((x.tan() - seen.x / seen.z).abs() < 0.01 && (y.tan() - seen.y / seen.z).abs() < 0.01, "{message}");
        assert!((distance - found.norm()).abs() < 1e-5 * distance);
        // MAV_FRAME_BODY_FRD, another visual target, valid, the first.
        let codes = ["frame", "type", "position_valid", "target_num"].map(|name| message[name].clone());
        assert_eq!(codes, [json!(12), json!(3), json!(1), json!(0)]);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_camera_that_looks_down_sees_what_is_below() {
    let changed = |settings: &mut Settings| {
        settings.mavlink.camera_turned_rad = [0.0, -std::f64::consts::FRAC_PI_2, 0.0];
        settings.mavlink.camera_position_m = [0.1, 0.0, 0.05];
    };
    let Some(report) = heard("LANDING_TARGET", changed).await else { return };
    let seen = station::truth().translation;
    // Down in the picture is backward, and the optical axis points down.
    let place = Vector3::new(0.1 - seen.y, seen.x, 0.05 + seen.z);
    for message in assert_sent(&report) {
        let found = Vector3::from_vec(numbers(message, &["x", "y", "z"]));
        assert!((found - place).norm() < 0.01 * place.norm(), "{found} {place}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_ground_station_hears_the_covariance_too() {
    let odometry = |settings: &mut Settings| settings.mavlink.message = MavlinkMessage::Odometry;
    let Some(report) = heard("ODOMETRY", odometry).await else { return };
    let (place, turn) = forward();
    for message in assert_sent(&report) {
        let moved = place - Vector3::from_vec(numbers(message, &["x", "y", "z"]));
        let turned = attitude(&message["q"]);
        let truth = nalgebra::Rotation3::from_matrix_unchecked(turn);
        let turned = rotation::log(&(truth * turned.inverse()));
        let error = Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z);
        let upper: Vec<f64> =
            message["pose_covariance"].as_array().expect("21").iter().map(|x| x.as_f64().expect("a number")).collect();
        assert_eq!(upper.len(), 21);
        let covariance = Matrix6::from_fn(|row, column| {
            let (row, column) = (row.min(column), row.max(column));
            upper[row * 6 + column - row * (row + 1) / 2]
        });
        let nees = error.dot(&covariance.cholesky().expect("positive definite").solve(&error));
        // 99.99 % of chi-square with six degrees of freedom.
        assert!(nees < 27.9, "{nees}: {error}");
        // Along the line of sight, forward, a target's place is known least.
        assert!(covariance[(0, 0)] > 4.0 * covariance[(1, 1)].max(covariance[(2, 2)]), "{covariance}");
        // Speeds are not known.
        assert_eq!((&message["vx"], &message["velocity_covariance"][0]), (&Value::Null, &Value::Null));
        assert_eq!((&message["frame_id"], &message["child_frame_id"]), (&json!(12), &json!(12)));
    }
}

#[tokio::test]
async fn an_address_that_is_none_is_a_fault_of_the_settings() {
    let mut settings = Settings::default();
    assert!(settings.faults().is_empty());
    settings.mavlink.address = "ground:14550".into();
    settings.mavlink.system_id = 0;
    settings.mavlink.camera_turned_rad[1] = f64::NAN;
    let faults: Vec<String> = settings.faults().into_iter().map(|fault| fault.setting).collect();
    assert_eq!(faults, ["mavlink.address", "mavlink.system_id", "mavlink.camera_turned_rad"]);
}
