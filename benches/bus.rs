//! What the way over Zenoh adds to the work. Linux only, as `--bench service` is.
//!
//! The real program serves on the network with its defaults; a client in this process publishes JPEG frames of a flight and
//! receives estimates, as a swarm node does.
//!
//! - `latency`: from the publication of a frame to the arrival of its estimate, against the sum of two: the raw round trip of
//!   Zenoh, the same payload to another process (this benchmark, started again) that answers with as many bytes as an estimate has, and
//!   the pipeline's own time, the same frame decoded, detected, identified and solved by the library on one thread of this process. The
//!   three alternate frame by frame; medians over all frames and rounds are printed.
//! - `raw frames`: the same for frames that were not encoded, out of shared memory and without it, one after the other.
//! - `cameras`: four cameras of 640x480 publish 30 frames a second each for ten seconds. Printed is what became of the frames, by
//!   the service's own count and by what arrived here, and the latencies.
//!
//! Run by `cargo bench --bench bus`; it does nothing in a test run.

#![allow(
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a benchmark that cannot measure must stop, and shows its figures"
)]

use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use skypose::camera::{Camera, Distortion};
use skypose::detect::Workspace;
use skypose::frame::Frame;
use skypose::random;
use skypose::scene::encode;
use skypose::scene::flight::Flight;
use skypose::scene::models::{demo_camera, wing};
use skypose::scene::render::{Optics, Sky, render};
use skypose::shell::bus::network::{Role, join};
use skypose::shell::bus::shared::Pool;
use skypose::shell::config::Settings;
use skypose::shell::service::compute::{FrameTask, Seen, Terms};
use skypose::shell::service::lookup::Lookup;
use skypose::shell::wire::{CameraWire, FrameRequest, Ref, TargetWire};
use tempfile::TempDir;
use zenoh::Session;
use zenoh::bytes::{Encoding, ZBytes};
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::Subscriber;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::Sample;

/// Frames of each flight.
const SHOTS: usize = 8;
const WARM_UP: usize = 3;
const ROUNDS: usize = 30;
/// Frames a camera sends, at its rate.
const SENT: u64 = 300;
const RATE_HZ: f64 = 30.0;
const CAMERAS: [&str; 4] = ["front", "left", "right", "aft"];
/// Longer than anything here takes.
const SOON: Duration = Duration::from_secs(10);
const GROUP: &str = "skypose/v1/default/alpha";

type Listener = Subscriber<FifoChannelHandler<Sample>>;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let runtime =
        tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().expect("a runtime");
    if let [_, word, endpoint, size] = &arguments[..]
        && word == "echo"
    {
        return runtime.block_on(echo(endpoint, size.parse().expect("a number")));
    }
    if !arguments.iter().any(|argument| argument == "--bench") {
        return;
    }
    let _ = rustls::crypto::ring::default_provider().install_default();
    runtime.block_on(async {
        latency().await;
        raw_frames().await;
        cameras().await;
    });
}

/// The other end of the raw round trip: answers every frame with `size` bytes until it is killed.
async fn echo(endpoint: &str, size: usize) {
    let session = join(endpoint, Role::Listen, true).await.expect("listens");
    let answer = ZBytes::from(vec![b' '; size]);
    let answers =
        session.declare_publisher("echo/answer").priority(Priority::RealTime).express(true).await.expect("a publisher");
    let frames = session.declare_subscriber("echo/frame").await.expect("a subscriber");
    println!("ready");
    while frames.recv_async().await.is_ok() {
        answers.put(answer.clone()).await.expect("sends");
    }
}

async fn latency() {
    let camera = demo_camera();
    let frames = flown(&camera);
    let kilobytes = frames.iter().map(Vec::len).sum::<usize>() / frames.len() / 1000;
    let station = Station::start(&camera, &CAMERAS[..1]).await;
    let task = task(&camera).await;
    let estimates = station.listen("estimate").await;
    // Its size and that the first frame finds everything declared.
    let size = station.measured(&frames[0], &estimates).await.1;
    let echo_endpoint = free_endpoint();
    let _echo = Kept::start(Command::new(std::env::current_exe().expect("a program")).args([
        "echo",
        &echo_endpoint,
        &size.to_string(),
    ]));
    let client = join(&echo_endpoint, Role::Connect, true).await.expect("connects");
    let answers = client.declare_subscriber("echo/answer").await.expect("listens");
    // Until the declarations have crossed, and answers that came too late are gone.
    while tokio::time::timeout(Duration::from_millis(200), bounced(&client, &answers, &frames[0])).await.is_err() {}
    tokio::time::sleep(Duration::from_millis(200)).await;
    while let Ok(Some(_)) = answers.try_recv() {}
    let mut rounds = Vec::new();
    for round in 0..WARM_UP + ROUNDS {
        for frame in &frames {
            let raw_ms = bounced(&client, &answers, frame).await;
            let own_ms = worked(&task, frame);
            let (whole_ms, _) = station.measured(frame, &estimates).await;
            if round >= WARM_UP {
                rounds.push([raw_ms, own_ms, whole_ms]);
            }
        }
    }
    let of_rounds = |column: usize, share: f64| quantile(rounds.iter().map(|round| round[column]).collect(), share);
    let [raw_ms, own_ms, whole_ms] = [0, 1, 2].map(|column| of_rounds(column, 0.5));
    let ratio = whole_ms / (raw_ms + own_ms);
    println!(
        "{} frames of 1280x720, {kilobytes} kB each, {ROUNDS} times; an estimate has {size} bytes\n",
        frames.len()
    );
    println!("latency    raw round trip ms   pipeline ms   frame to estimate ms    95 %   ratio   (goal: 1.3)");
    let p95 = of_rounds(2, 0.95);
    println!("           {raw_ms:17.3} {own_ms:13.3} {whole_ms:22.3} {p95:7.3} {ratio:7.3}\n");
}

async fn raw_frames() {
    let camera = demo_camera();
    let (width, height) = (camera.width(), camera.height());
    let frame = rendered(&camera, Flight::ALL[0], 0).rgb().into_owned();
    let station = Station::start(&camera, &CAMERAS[..1]).await;
    let apart = join(&station.endpoint, Role::Connect, false).await.expect("connects");
    let estimates = station.listen("estimate").await;
    let statuses = station.listen("status").await;
    let mut pool = Pool::default();
    let mut times_ms = [Vec::new(), Vec::new()];
    for round in 0..WARM_UP + ROUNDS * 3 {
        for ((client, is_shared), times_ms) in [(&station.client, true), (&apart, false)].into_iter().zip(&mut times_ms)
        {
            // What a camera has in its hand is copied into the pool, or by Zenoh; both are measured.
            let taken = frame.clone();
            let start = Instant::now();
            let payload = if is_shared { pool.put(taken) } else { taken.into() };
            client
                .put(format!("{GROUP}/camera/{}/frame", CAMERAS[0]), payload)
                .encoding(Encoding::APPLICATION_OCTET_STREAM)
                .attachment(json!({"width": width, "height": height, "format": "rgb8"}).to_string())
                .congestion_control(CongestionControl::Block)
                .await
                .expect("sends");
            tokio::time::timeout(SOON, estimates.recv_async()).await.expect("in time").expect("an estimate");
            if round >= WARM_UP {
                times_ms.push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
    }
    let mut shared = Value::Null;
    while shared["received"] != (2 * (WARM_UP + ROUNDS * 3)) {
        let sample = tokio::time::timeout(SOON, statuses.recv_async()).await.expect("in time").expect("a status");
        shared = json_of(sample.payload());
    }
    let [shared_ms, copied_ms] = times_ms.map(|times_ms| quantile(times_ms, 0.5));
    println!("raw frames    kB   frame to estimate in shared memory ms   without ms   ratio   in shared memory");
    println!(
        "           {:5} {shared_ms:38.3} {copied_ms:12.3} {:7.3} {:10} of {}\n",
        frame.len() / 1000,
        shared_ms / copied_ms,
        shared["shared"],
        shared["received"],
    );
}

async fn cameras() {
    let lens = Distortion::None;
    let camera = Camera::checked([640, 480], [500.0; 2], [319.5, 239.5], lens).expect("a good camera");
    let frames = flown(&camera);
    let station = Station::start(&camera, &CAMERAS).await;
    let estimates = station.listen("estimate").await;
    let statuses = station.listen("status").await;
    let start = Instant::now();
    let at = |number: u64, place: usize| {
        // Cameras are not in step.
        start + Duration::from_secs_f64((number as f64 + place as f64 / CAMERAS.len() as f64) / RATE_HZ)
    };
    let sending = async {
        for number in 0..SENT {
            for (place, name) in CAMERAS.iter().enumerate() {
                tokio::time::sleep_until(at(number, place).into()).await;
                #[expect(clippy::cast_possible_truncation, reason = "a small number")]
                let frame = &frames[(number as usize + place) % frames.len()];
                station.publish(name, frame, number).await;
            }
        }
    };
    let receiving = async {
        let mut latencies_ms = Vec::new();
        while let Ok(Ok(sample)) = tokio::time::timeout(Duration::from_secs(2), estimates.recv_async()).await {
            let arrived = Instant::now();
            let note: Value = json_of(sample.attachment().expect("a note"));
            let name = sample.key_expr().as_str().split('/').nth(5).expect("a camera").to_owned();
            let place = CAMERAS.iter().position(|camera| *camera == name).expect("one of ours");
            let sent = at(note["sequence"].as_u64().expect("a number"), place);
            latencies_ms.push(arrived.saturating_duration_since(sent).as_secs_f64() * 1e3);
        }
        latencies_ms
    };
    let ((), latencies_ms) = tokio::join!(sending, receiving);
    let mut counts = std::collections::BTreeMap::new();
    let end = Instant::now() + SOON;
    while counts.len() < CAMERAS.len() && Instant::now() < end {
        let Ok(Ok(sample)) = tokio::time::timeout(SOON, statuses.recv_async()).await else { break };
        let status = json_of(sample.payload());
        let number = |word: &str| status[word].as_u64().expect("a number");
        let ended = ["published", "replaced", "too_old", "late", "refused", "failed"].map(number).iter().sum::<u64>();
        if number("received") + number("lost") == SENT && ended == number("received") {
            counts.insert(status["camera"].as_str().expect("a name").to_owned(), status);
        }
    }
    let sum = |word: &str| -> u64 { counts.values().filter_map(|status| status[word].as_u64()).sum() };
    println!("cameras    sent   received   published   arrived   replaced   late   lost   p50 ms   p95 ms   p99 ms");
    let [p50, p95, p99] = [0.5, 0.95, 0.99].map(|share| quantile(latencies_ms.clone(), share));
    println!(
        "{:7} {:7} {:10} {:11} {:9} {:10} {:6} {:6} {p50:8.1} {p95:8.1} {p99:8.1}",
        CAMERAS.len(),
        SENT * CAMERAS.len() as u64,
        sum("received"),
        sum("published"),
        latencies_ms.len(),
        sum("replaced"),
        sum("late") + sum("too_old"),
        sum("lost") + sum("failed") + sum("refused"),
    );
}

/// Milliseconds of one raw round trip.
async fn bounced(client: &Session, answers: &Listener, frame: &[u8]) -> f64 {
    let frame = ZBytes::from(frame.to_vec());
    let start = Instant::now();
    client.put("echo/frame", frame).congestion_control(CongestionControl::Block).await.expect("sends");
    answers.recv_async().await.expect("an answer");
    start.elapsed().as_secs_f64() * 1e3
}

/// Milliseconds of the work alone.
fn worked(task: &FrameTask, frame: &[u8]) -> f64 {
    let start = Instant::now();
    let (terms, mut workspace) = (Terms::of(&Settings::default()), Workspace::default());
    std::hint::black_box(task.estimated(Seen::Bytes(frame), &terms, None, &mut workspace).expect("a frame"));
    start.elapsed().as_secs_f64() * 1e3
}

async fn task(camera: &Camera) -> FrameTask {
    let request = FrameRequest {
        camera: Some(Ref::Object(CameraWire::from(camera))),
        targets: vec![Ref::Object(TargetWire::from(&wing().target))],
        ..FrameRequest::default()
    };
    FrameTask::for_estimate(request, &Lookup::new(None, std::sync::Arc::default())).await.expect("a good request")
}

fn flown(camera: &Camera) -> Vec<Vec<u8>> {
    let shots = Flight::ALL.into_iter().flat_map(|flight| (0..SHOTS).map(move |shot| (flight, shot)));
    shots.map(|(flight, shot)| encode::jpeg(&rendered(camera, flight, shot), 90).expect("fits a JPEG")).collect()
}

fn rendered(camera: &Camera, flight: Flight, shot: usize) -> Frame {
    let pose = flight.pose((flight.len() - 1) * shot / (SHOTS - 1));
    let sky = Sky::fair(1, [0.4 * shot as f64, 0.0]);
    let rng = &mut random::case(flight.name(), shot as u64);
    render(camera, &pose, &wing(), &sky, &Optics::default(), rng)
}

/// A process that is killed when dropped. It has said its first line.
struct Kept(Child, String);

impl Kept {
    fn start(command: &mut Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("a line");
        Self(child, line.trim().to_owned())
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The program serving on a network of its own, and a client there.
struct Station {
    _program: Kept,
    endpoint: String,
    client: Session,
    _data: TempDir,
}

impl Station {
    async fn start(camera: &Camera, streams: &[&str]) -> Self {
        let data = tempfile::tempdir().expect("a folder");
        let endpoint = free_endpoint();
        let mut command = Command::new(env!("CARGO_BIN_EXE_skypose"));
        command.args(["serve", "--listen", "127.0.0.1:0", "--node", "alpha", "--zenoh", &endpoint, "--data"]);
        let program = Kept::start(command.arg(data.path()));
        let base = program.1.strip_prefix("listening on ").expect("an address").to_owned();
        let http = reqwest::Client::new();
        let mut things = vec![
            ("cameras/own".to_owned(), serde_json::to_value(CameraWire::from(camera)).expect("JSON")),
            ("targets/wing-six".to_owned(), serde_json::to_value(TargetWire::from(&wing().target)).expect("JSON")),
        ];
        let stream = json!({"camera": "own", "targets": ["wing-six"]});
        things.extend(streams.iter().map(|name| (format!("streams/{name}"), stream.clone())));
        for (path, body) in things {
            let reply = http.put(format!("{base}/v1/{path}")).json(&body).send().await.expect("an answer");
            assert!(reply.status().is_success(), "{path}: {}", reply.status());
        }
        let client = join(&endpoint, Role::Connect, true).await.expect("connects");
        let station = Self { _program: program, endpoint, client, _data: data };
        let statuses = station.listen("status").await;
        let mut is_listening = vec![false; streams.len()];
        while is_listening.contains(&false) {
            let sample = tokio::time::timeout(SOON, statuses.recv_async()).await.expect("in time").expect("a status");
            let status = json_of(sample.payload());
            if let Some(place) = streams.iter().position(|name| status["camera"] == *name) {
                is_listening[place] |= status["has_stream"] == true;
            }
        }
        station
    }

    async fn listen(&self, topic: &str) -> Listener {
        let (key, room) = (format!("{GROUP}/camera/*/{topic}"), zenoh::handlers::FifoChannel::new(8192));
        self.client.declare_subscriber(key).with(room).await.expect("listens")
    }

    async fn publish(&self, camera: &str, frame: &[u8], sequence: u64) {
        self.client
            .put(format!("{GROUP}/camera/{camera}/frame"), frame.to_vec())
            .encoding(Encoding::IMAGE_JPEG)
            .attachment(json!({"sequence": sequence}).to_string())
            .congestion_control(CongestionControl::Block)
            .await
            .expect("sends");
    }

    /// Milliseconds from a frame's publication to its estimate, and the estimate's size.
    async fn measured(&self, frame: &[u8], estimates: &Listener) -> (f64, usize) {
        let start = Instant::now();
        self.publish(CAMERAS[0], frame, 0).await;
        let sample = tokio::time::timeout(SOON, estimates.recv_async()).await.expect("in time").expect("an estimate");
        let took_ms = start.elapsed().as_secs_f64() * 1e3;
        let estimate = json_of(sample.payload());
        assert!(estimate["centroids"].as_array().is_some_and(|found| found.len() >= 6), "{estimate}");
        (took_ms, sample.payload().len())
    }
}

fn free_endpoint() -> String {
    let socket = TcpListener::bind("127.0.0.1:0").expect("a free port");
    format!("tcp/{}", socket.local_addr().expect("bound"))
}

fn json_of(payload: &ZBytes) -> Value {
    serde_json::from_slice(&payload.to_bytes()).expect("JSON")
}

fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len() - 1;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
    let index = (share * last as f64).round() as usize;
    values[index]
}
