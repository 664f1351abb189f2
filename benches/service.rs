//! What the service adds to the work: processor time, memory, latency. Linux only: figures come from `/proc`.
//!
//! The real program serves with its defaults on a free port; clients in this process post 1280x720 JPEG frames of a flight
//! to `/v1/estimates` over connections that stay open.
//!
//! - `overhead`: processor time (user and system, all threads) that the service spends on a frame, against the same frames
//!   decoded, detected, identified and solved by the library in a loop on one thread of this process. Short rounds of the
//!   two alternate; medians over the rounds are printed. With one client the service sleeps between frames, which costs too:
//!   wake-ups, and caches that others have used meanwhile; with four it is always busy.
//! - `memory`: of a fresh service, resident when idle and at its peak with 4 clients.
//! - `load`: what clients see. They run on the same cores as the service, so take latencies as upper bounds; `frames per
//!   core-second` counts the service's own processor time only.
//!
//! Run by `cargo bench --bench service`; it does nothing in a test run.

#![allow(
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a benchmark that cannot measure must stop, and shows its figures"
)]

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use futures_util::future::join_all;
use skypose::detect::Workspace;
use skypose::random;
use skypose::scene::encode;
use skypose::scene::flight::Flight;
use skypose::scene::models::{demo_camera, wing};
use skypose::scene::render::{Optics, Sky, render};
use skypose::shell::config::Settings;
use skypose::shell::service::compute::{FrameTask, Seen, Terms};
use skypose::shell::service::lookup::Lookup;
use skypose::shell::wire::{CameraWire, EstimateReply, FrameRequest, Ref, TargetWire};
use tempfile::TempDir;

/// Frames of each flight.
const SHOTS: usize = 8;
/// Rounds of the overhead: short and many, so that whatever else the machine does meets both sides alike.
const ROUNDS: usize = 120;
const WARM_UP: usize = 10;
/// How long clients post.
const SPAN: Duration = Duration::from_secs(6);

type Runtime = tokio::runtime::Runtime;

fn main() {
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let _ = rustls::crypto::ring::default_provider().install_default();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let frames = flown();
    let kilobytes = frames.iter().map(Vec::len).sum::<usize>() / frames.len() / 1000;
    println!("{} JPEG frames of 1280x720, {kilobytes} kB each on average\n", frames.len());
    println!("overhead  served ms   in process ms   ratio   half of {ROUNDS} rounds   (goal: 1.15)");
    for clients in [1, 4] {
        overhead(&runtime, &frames, clients);
    }
    memory(&runtime, &frames);
    println!("load       fps   p50 ms   p95 ms   p99 ms   frames per core-second");
    for clients in [1, 4] {
        load(&runtime, &frames, clients);
    }
}

fn overhead(runtime: &Runtime, frames: &[Vec<u8>], clients: usize) {
    let station = Station::equipped(runtime);
    let posters: Vec<Client> = (0..clients).map(|_| station.client()).collect();
    let (task, own, mut workspace) = (task(runtime), std::process::id(), Workspace::default());
    let mut rounds = Vec::new();
    for round in 0..WARM_UP + ROUNDS {
        let before = cpu_ms(station.child.id());
        runtime.block_on(join_all(posters.iter().enumerate().map(|(number, client)| async move {
            for frame in frames.iter().skip(number).step_by(clients) {
                client.post(frame).await;
            }
        })));
        let served = cpu_ms(station.child.id()) - before;
        let before = cpu_ms(own);
        for frame in frames {
            work(&task, frame, &mut workspace);
        }
        let in_process = cpu_ms(own) - before;
        if round >= WARM_UP {
            let count = frames.len() as f64;
            rounds.push([served / count, in_process / count, served / in_process]);
        }
    }
    let of_rounds = |column: usize, share: f64| quantile(rounds.iter().map(|round| round[column]).collect(), share);
    let [served_ms, in_process_ms, ratio] = [0, 1, 2].map(|column| of_rounds(column, 0.5));
    let (low, high) = (of_rounds(2, 0.25), of_rounds(2, 0.75));
    println!("{clients} clients {served_ms:10.2} {in_process_ms:13.2} {ratio:12.3} {low:11.3} to {high:.3}");
}

fn memory(runtime: &Runtime, frames: &[Vec<u8>]) {
    let station = Station::equipped(runtime);
    let idle = status_mb(station.child.id(), "VmRSS:");
    post_for(runtime, &station, frames, 4);
    let peak = status_mb(station.child.id(), "VmHWM:");
    println!("\nmemory     idle {idle:.1} MB, peak with 4 clients {peak:.1} MB; goal 80 MB\n");
}

fn load(runtime: &Runtime, frames: &[Vec<u8>], clients: usize) {
    let station = Station::equipped(runtime);
    post_for(runtime, &station, frames, clients);
    let (start, before) = (Instant::now(), cpu_ms(station.child.id()));
    let latencies_ms = post_for(runtime, &station, frames, clients);
    let (span_s, busy_ms) = (start.elapsed().as_secs_f64(), cpu_ms(station.child.id()) - before);
    let count = latencies_ms.len() as f64;
    let [p50, p95, p99] = [0.5, 0.95, 0.99].map(|share| quantile(latencies_ms.clone(), share));
    println!("{clients} clients {:5.0} {p50:8.1} {p95:8.1} {p99:8.1} {:24.0}", count / span_s, count * 1e3 / busy_ms);
}

/// Latencies in ms of all posts of `clients` clients over [`SPAN`].
fn post_for(runtime: &Runtime, station: &Station, frames: &[Vec<u8>], clients: usize) -> Vec<f64> {
    let end = Instant::now() + SPAN;
    let posting = (0..clients).map(|number| async move {
        let client = station.client();
        let mut latencies_ms = Vec::new();
        for frame in frames.iter().cycle().skip(number * frames.len() / clients) {
            let start = Instant::now();
            if start >= end {
                break;
            }
            client.post(frame).await;
            latencies_ms.push(start.elapsed().as_secs_f64() * 1e3);
        }
        latencies_ms
    });
    runtime.block_on(join_all(posting)).concat()
}

/// The request of the clients, as the service holds it when it begins to work.
fn task(runtime: &Runtime) -> FrameTask {
    let request = FrameRequest {
        camera: Some(Ref::Object(CameraWire::from(&demo_camera()))),
        targets: vec![Ref::Object(TargetWire::from(&wing().target))],
        ..FrameRequest::default()
    };
    runtime
        .block_on(FrameTask::for_estimate(request, &Lookup::new(None, std::sync::Arc::default())))
        .expect("a good request")
}

fn work(task: &FrameTask, frame: &[u8], workspace: &mut Workspace) {
    let terms = Terms::of(&Settings::default());
    let estimated = task.estimated(Seen::Bytes(frame), &terms, None, workspace).expect("a frame");
    std::hint::black_box(estimated);
}

fn flown() -> Vec<Vec<u8>> {
    let shots = Flight::ALL.into_iter().flat_map(|flight| (0..SHOTS).map(move |shot| (flight, shot)));
    shots
        .map(|(flight, shot)| {
            let pose = flight.pose((flight.len() - 1) * shot / (SHOTS - 1));
            let sky = Sky::fair(1, [0.4 * shot as f64, 0.0]);
            let rng = &mut random::case(flight.name(), shot as u64);
            let frame = render(&demo_camera(), &pose, &wing(), &sky, &Optics::default(), rng);
            encode::jpeg(&frame, 90).expect("fits a JPEG")
        })
        .collect()
}

/// The program serving, with the demo's camera and target stored.
struct Station {
    child: Child,
    base: String,
    _data: TempDir,
}

impl Station {
    fn equipped(runtime: &Runtime) -> Self {
        let data = tempfile::tempdir().expect("a folder");
        let mut child = Command::new(env!("CARGO_BIN_EXE_skypose"))
            .args(["serve", "--listen", "127.0.0.1:0", "--data"])
            .arg(data.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("a line");
        let base = line.trim().strip_prefix("listening on ").expect("an address").to_owned();
        let station = Self { child, base, _data: data };
        let camera = serde_json::to_value(CameraWire::from(&demo_camera())).expect("JSON");
        let target = serde_json::to_value(TargetWire::from(&wing().target)).expect("JSON");
        for (path, body) in [("cameras/demo", camera), ("targets/wing-six", target)] {
            let put = reqwest::Client::new().put(format!("{}/v1/{path}", station.base)).json(&body);
            let reply = runtime.block_on(put.send()).expect("an answer");
            assert!(reply.status().is_success(), "{path}: {}", reply.status());
        }
        station
    }

    /// With a connection of its own.
    fn client(&self) -> Client {
        let url = format!("{}/v1/estimates?camera=demo&target=wing-six", self.base);
        Client { url, http: reqwest::Client::new() }
    }
}

impl Drop for Station {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

struct Client {
    url: String,
    http: reqwest::Client,
}

impl Client {
    /// Posts a frame and reads the reply, which must have a pose.
    async fn post(&self, frame: &[u8]) {
        let post = self.http.post(&self.url).header("content-type", "image/jpeg").body(frame.to_vec());
        let reply = post.send().await.and_then(reqwest::Response::error_for_status).expect("an answer");
        let reply: EstimateReply = reply.json().await.expect("a whole answer");
        assert!(reply.centroids.len() >= 6, "{reply:?}");
    }
}

/// Processor time of a process so far: user and system, of all threads that live.
fn cpu_ms(pid: u32) -> f64 {
    let threads = std::fs::read_dir(format!("/proc/{pid}/task")).expect("a process");
    let nanoseconds = threads.map(|thread| {
        let path = thread.expect("a thread").path().join("schedstat");
        // A thread may end between the list and the look.
        let text = std::fs::read_to_string(path).unwrap_or_default();
        text.split(' ').next().and_then(|first| first.parse::<f64>().ok()).unwrap_or(0.0)
    });
    nanoseconds.sum::<f64>() * 1e-6
}

fn status_mb(pid: u32, field: &str) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).expect("a process");
    let value = status.lines().find_map(|line| line.strip_prefix(field)).expect("a field");
    value.trim().trim_end_matches(" kB").parse::<f64>().expect("a number") * 1024e-6
}

fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len() - 1;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
    let index = (share * last as f64).round() as usize;
    values[index]
}
