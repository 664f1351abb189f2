//! Two services on one network that see each other.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3};
use serde_json::{Value, json};
use skypose::encounter::{Manoeuvre, RelativeState, time_left};
use skypose::geometry::space::{Body, Peer as Other, Target};
use skypose::geometry::{EulerAngles, PoseCovariance, Transform, mount, rotation};
use skypose::random;
use skypose::scene::encode;
use skypose::scene::models::{demo_camera, wing};
use skypose::scene::render::{Optics, Sky, render};
use skypose::shell::bus::network::{Role, join};
use skypose::shell::config::{Settings, SwarmBody, SwarmCamera};
use tempfile::TempDir;
use zenoh::Session;
use zenoh::bytes::Encoding;
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::Subscriber;

use crate::free_endpoint;
use crate::python::{self, Peer};
use crate::station::Station;

/// Longer than anything here takes.
const SOON: Duration = Duration::from_secs(20);
/// Where both carry their camera, and how they wear the wing: facing forward, its nose down, a little turned.
const CAMERA_AT_M: [f64; 3] = [0.2, 0.0, 0.1];
const WORN_TURNED_RAD: [f64; 3] = [0.15, -1.35, 0.25];
const WORN_AT_M: [f64; 3] = [0.1, 0.05, -0.1];
/// Time between two frames of one, and how much later those of the other are.
const FRAME_US: i64 = 50_000;
const LATE_US: i64 = 10_000;
const FRAMES: i64 = 12;

fn now_us() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970");
    i64::try_from(since.as_micros()).expect("this century")
}

fn angles([roll_rad, pitch_rad, yaw_rad]: [f64; 3]) -> EulerAngles {
    EulerAngles { roll_rad, pitch_rad, yaw_rad }
}

/// Beta before alpha, face to face: it comes at a metre a second.
fn alpha_from_beta(after_us: i64) -> Transform<Body, Other> {
    let facing = angles([0.05, -0.06, std::f64::consts::PI + 0.08]).to_rotation();
    let time_s = after_us as f64 / 1e6;
    Transform::new(facing, Vector3::new(5.5 - time_s, 0.3, -0.2 + 0.2 * time_s))
}

/// What is seen of the other's wing from a body that has the other there.
fn frame(body_from_other: &Transform<Body, Other>, seed: &str) -> Vec<u8> {
    let body_from_camera = mount::body_from_camera(angles([0.0; 3]), CAMERA_AT_M);
    let worn = Transform::<Other, Target>::new(angles(WORN_TURNED_RAD).to_rotation(), Vector3::from(WORN_AT_M));
    let camera_from_target = body_from_camera.inverse() * (*body_from_other * worn);
    let sky = Sky::fair(3, [0.0; 2]);
    let optics = Optics::default();
    let frame = render(&demo_camera(), &camera_from_target, &wing(), &sky, &optics, &mut random::named(seed));
    encode::jpeg(&frame, 92).expect("encodes")
}

fn mounted(settings: &mut Settings, node: &str, other: &str, network: String) {
    settings.zenoh.network = network;
    settings.zenoh.node = node.into();
    settings.streams.max_age_ms = 60_000;
    settings.swarm.cameras =
        vec![SwarmCamera { camera: "front".into(), position_m: CAMERA_AT_M, ..SwarmCamera::default() }];
    settings.swarm.bodies = vec![SwarmBody {
        node: other.into(),
        target: "wing-six".into(),
        turned_rad: WORN_TURNED_RAD,
        position_m: WORN_AT_M,
        ..SwarmBody::default()
    }];
}

/// Alpha and beta, and somebody who listens.
struct Pair {
    alpha: Station,
    beta: Station,
    client: Session,
    endpoint: String,
    _folder: TempDir,
}

type Listener = Subscriber<FifoChannelHandler<zenoh::sample::Sample>>;

impl Pair {
    async fn start() -> Self {
        let endpoint = free_endpoint();
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("beta.json5");
        let text = format!(
            "{{mode: 'peer', connect: {{endpoints: ['{endpoint}']}}, scouting: {{multicast: {{enabled: false}}}}}}"
        );
        std::fs::write(&file, text).expect("writes");
        let alpha = Station::equipped_with(|settings| mounted(settings, "alpha", "beta", endpoint.clone())).await;
        let network = file.display().to_string();
        let beta = Station::equipped_with(|settings| mounted(settings, "beta", "alpha", network)).await;
        for station in [&alpha, &beta] {
            let stream = json!({
                "camera": "demo", "targets": ["wing-six"],
                "track": {"acceleration_mps2_per_rthz": 0.2, "angular_acceleration_radps2_per_rthz": 0.1},
                "encounter": {"own_speed_mps": 2, "miss_distance_m": 2, "decision_s": 0.25, "link_s": 0.25},
            });
            assert_eq!(station.put("/v1/streams/front", &stream).await.status, 201);
        }
        let client = join(&endpoint, Role::Connect, false).await.expect("connects");
        Self { alpha, beta, client, endpoint, _folder: folder }
    }

    async fn listen(&self, key: &str) -> Listener {
        self.client.declare_subscriber(format!("skypose/v1/default/{key}")).await.expect("listens")
    }

    /// A frame by HTTP, which answers when it has been looked at.
    async fn see(station: &Station, frame: Vec<u8>, taken_us: i64) {
        let path = format!("/v1/cameras/front/frames?timestamp_us={taken_us}");
        let reply = station.post_bytes(&path, "image/jpeg", frame).await;
        assert_eq!(reply.status, 200, "{reply:?}");
        assert!(reply.json["targets"][0]["pose"].is_object(), "{reply:?}");
    }

    /// Both see each other for a while from this time on.
    async fn fly(&self, begun_us: i64) {
        for step in 0..FRAMES {
            let after_us = step * FRAME_US;
            let seen = alpha_from_beta(after_us);
            Self::see(&self.alpha, frame(&seen, &format!("alpha {step}")), begun_us + after_us).await;
            let late_us = after_us + LATE_US;
            let back = alpha_from_beta(late_us).inverse();
            let seen = Transform::<Body, Other>::new(back.rotation, back.translation);
            Self::see(&self.beta, frame(&seen, &format!("beta {step}")), begun_us + late_us).await;
        }
    }
}

fn json_of(sample: &zenoh::sample::Sample) -> Value {
    serde_json::from_slice(&sample.payload().to_bytes()).expect("JSON")
}

async fn next(listener: &Listener) -> Value {
    json_of(&tokio::time::timeout(SOON, listener.recv_async()).await.expect("in time").expect("a sample"))
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|place| value[place].as_f64().expect("a number"))
}

fn pose_of(value: &Value) -> (Transform<Body, Other>, PoseCovariance) {
    let rows: [[f64; 3]; 3] = std::array::from_fn(|row| numbers(&value["rotation"]["matrix"][row]));
    let matrix = Matrix3::from_fn(|row, column| rows[row][column]);
    let place: [f64; 3] = numbers(&value["translation_m"]);
    let rows: [[f64; 6]; 6] = std::array::from_fn(|row| numbers(&value["covariance"][row]));
    let covariance = PoseCovariance::checked(Matrix6::from_fn(|row, column| rows[row][column]));
    let pose = Transform::new(Rotation3::from_matrix_unchecked(matrix), Vector3::from(place));
    (pose, covariance.expect("positive definite"))
}

/// Both views and the pose that follows, against the truth.
fn assert_agreed(told: &Value, begun_us: i64) {
    assert_eq!(told["verdict"], "agreed", "{told}");
    let truth = alpha_from_beta(told["timestamp_us"].as_i64().expect("a time") - begun_us);
    let off_deg = |pose: &Transform<Body, Other>| pose.difference_to(&truth).fixed_rows::<3>(3).norm().to_degrees();
    let (fused, covariance) = pose_of(&told["fused"]);
    let squared = covariance.normalized_error_squared(&fused, &truth);
    let off_m = (fused.translation - truth.translation).norm();
    let views = [0, 1].map(|view| off_deg(&pose_of(&told["views"][view]["pose"]).0));
    println!(
        "off by {off_m:.4} m, {:.3} deg, views {views:.3?} deg; {squared:.1}, distance {}",
        off_deg(&fused),
        told["distance_squared"]
    );
    // 99.99 % of chi-square with six degrees of freedom.
    assert!(squared < 27.9 && off_m < 0.03 && off_deg(&fused) < 0.5, "{told}");
    assert_eq!((&told["frame_age_us"], &told["freedom"]), (&json!(LATE_US), &json!(6)));
    assert_eq!((&told["views"][0]["node"], &told["views"][1]["node"]), (&json!("alpha"), &json!("beta")));
}

/// What is left to do about beta, against the truth: it flies straight on.
fn assert_to_act(told: &Value, begun_us: i64) {
    let track = &told["tracks"][0];
    let body_from_camera = mount::body_from_camera(angles([0.0; 3]), CAMERA_AT_M);
    let worn = Transform::<Other, Target>::new(angles(WORN_TURNED_RAD).to_rotation(), Vector3::from(WORN_AT_M));
    let at = |after_us: i64| (alpha_from_beta(after_us) * worn).translation - body_from_camera.translation;
    let after_us = told["timestamp_us"].as_i64().expect("a time") - begun_us;
    let velocity = at(after_us + 1_000_000) - at(after_us);
    let state = RelativeState::checked(at(after_us), velocity).expect("an encounter");
    let turn = Manoeuvre::checked(std::f64::consts::FRAC_PI_4, 2.0).expect("a turn");
    let truth = time_left(&state, &Matrix6::zeros(), 2.0, &turn).expect("a last moment").time_s.value - 0.5;
    let [value, sigma] =
        ["value", "sigma"].map(|part| track["to_act"]["time_left_s"][part].as_f64().unwrap_or(f64::NAN));
    println!("time left {value:.3} +- {sigma:.3} s, in truth {truth:.3} s");
    assert!((value - truth).abs() < 4.0 * sigma && sigma < 1.0, "{track}");
    assert_eq!(track["to_act"]["verdict"], if value < 0.0 { "too_late" } else { "in_time" });
    assert_eq!(track["to_act"]["delay_s"], 0.5);
}

/// All that waits.
async fn heard(listener: &Listener) -> Vec<Value> {
    let mut heard = Vec::new();
    while let Ok(Ok(sample)) = tokio::time::timeout(Duration::from_secs(2), listener.recv_async()).await {
        heard.push(json_of(&sample));
    }
    heard
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_nodes_that_see_each_other_agree_and_who_lies_is_told() {
    let pair = Pair::start().await;
    let agreements = pair.listen("alpha/body/beta/agreement").await;
    let of_beta = pair.listen("beta/body/alpha/agreement").await;
    let relatives = pair.listen("beta/body/alpha/relative").await;
    let tracks = pair.listen("alpha/camera/front/track").await;
    let python = python::python("zenoh");
    let mut client = python.map(|python| {
        let mut client = Peer::start(&python, "swarm.py", &["compared", &pair.endpoint, "alpha", "beta", "3"]);
        assert_eq!(client.line(), "listening");
        client
    });
    // Who has only just joined may not be known to all yet.
    tokio::time::sleep(Duration::from_secs(1)).await;
    let begun_us = now_us();
    pair.fly(begun_us).await;

    let told = heard(&agreements).await;
    for told in &told {
        assert_agreed(told, begun_us);
    }
    // Tracks are believed from the third frame on.
    assert!(told.len() >= 9, "{}", told.len());
    let theirs = next(&of_beta).await;
    assert_eq!((&theirs["verdict"], &theirs["node"]), (&json!("agreed"), &json!("beta")));
    if let Some(client) = &mut client {
        let line: Value = serde_json::from_str(&client.line()).expect("JSON");
        assert_eq!((&line["verdict"], &line["encoding"]), (&json!("agreed"), &json!("application/json")));
        assert!(line["fused"][0].as_f64().is_some_and(|forward| (4.0..6.0).contains(&forward)), "{line}");
    }
    let known = pair.alpha.get("/v1/bodies").await.json;
    let body = &known["bodies"][0];
    assert_eq!((&body["node"], &body["target"]), (&json!("beta"), &json!("wing-six")));
    assert_eq!(Some(&body["agreement"]), told.last());
    assert_eq!(body["relative"]["cameras"], json!(["front"]));

    assert_to_act(heard(&tracks).await.last().expect("told"), begun_us);

    let last = heard(&relatives).await.pop().expect("told");
    let told = lied(&pair, &agreements, last, begun_us).await;
    assert_eq!(pair.alpha.get("/v1/bodies").await.json["bodies"][0]["agreement"], told);
}

/// Somebody says in beta's name that it is elsewhere, at the moment of what it said last; and other things, which change nothing.
async fn lied(pair: &Pair, agreements: &Listener, last: Value, begun_us: i64) -> Value {
    let mut lie = last;
    for candidate in lie["candidates"].as_array_mut().expect("poses") {
        let side = candidate["translation_m"][1].as_f64().expect("a number");
        candidate["translation_m"][1] = json!(side + 0.5);
    }
    let changed = |pointer: &str, value: Value| {
        let mut changed = lie.clone();
        *changed.pointer_mut(pointer).expect("there") = value;
        changed.to_string()
    };
    let say = async |node: &str, text: String| {
        let key = format!("skypose/v1/default/{node}/body/alpha/relative");
        pair.client.put(key, text).encoding(Encoding::APPLICATION_JSON).await.expect("sends");
    };
    for (node, text) in [
        ("beta", "{".to_owned()),
        ("beta", "x".repeat(300_000)),
        ("beta", changed("/node", json!("gamma"))),
        ("gamma", changed("/node", json!("gamma"))),
        ("beta", changed("/other", json!("gamma"))),
        ("beta", changed("/candidates/0/covariance/0/0", json!(-1))),
        // When alpha saw nothing.
        ("beta", changed("/timestamp_us", json!(begun_us + 60_000_000))),
    ] {
        say(node, text).await;
    }
    say("beta", lie.to_string()).await;
    let told = next(agreements).await;
    assert_eq!((&told["verdict"], &told["fused"]), (&json!("disagreed"), &Value::Null), "{told}");
    let [distance, limit, apart_m] =
        ["distance_squared", "limit", "apart_m"].map(|name| told[name].as_f64().expect("a number"));
    println!("the lie: {distance:.0} of {limit:.1}, {apart_m:.3} m");
    assert!(distance > limit && (apart_m - 0.5).abs() < 0.2, "{told}");
    let attitudes = [0, 1].map(|view| pose_of(&told["views"][view]["pose"]).0.rotation);
    assert!(rotation::angle_between_rad(&attitudes[0], &attitudes[1]) < 0.1);
    told
}
