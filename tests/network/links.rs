//! Two hosts with a link between them that delays and loses: what is lost is counted, what comes late is not answered, and a link that
//! was away is there again.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

use serde_json::{Value, json};
use skypose::scene::encode;
use tempfile::TempDir;

use crate::hosts::{Hosts, SERVER};
use crate::station::Station;
use crate::{python, station};

const DELAY: Duration = Duration::from_millis(50);
const LOSS_PERCENT: u32 = 5;
/// Older frames are of no use. The default is half of it; a lost packet alone costs 200 ms.
const MAX_AGE: Duration = Duration::from_secs(1);
/// A link that is silent for so long is given up.
const LEASE_MS: u32 = 3000;
const FRAMES_HZ: u32 = 5;

/// The program on the second host.
struct Service {
    program: Child,
    _output: BufReader<std::process::ChildStdout>,
    _folder: TempDir,
}

impl Service {
    /// With the stream `front`, at this endpoint.
    async fn start(hosts: &Hosts, endpoint: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let data = folder.path().join("data");
        // What is stored is stored by the same program where we can reach it.
        let station = Station::equipped_with(|settings| settings.store.data.clone_from(&data)).await;
        let stream = json!({"camera": "demo", "targets": ["wing-six"]});
        assert_eq!(station.put("/v1/streams/front", &stream).await.status, 201);
        station.stopper.stop();
        station.serving.await.expect("no panic").expect("stops");
        let network = folder.path().join("zenoh.json5");
        let text = format!(
            "{{mode: 'peer', listen: {{endpoints: ['{endpoint}']}}, scouting: {{multicast: {{enabled: false}}}},
              transport: {{link: {{tx: {{lease: {LEASE_MS}}}}}}}}}"
        );
        fs::write(&network, text).expect("writes");
        let mut command = hosts.on_server(env!("CARGO_BIN_EXE_skypose"));
        command.args(["serve", "--listen", "127.0.0.1:0", "--node", "alpha", "--zenoh"]).arg(&network);
        command.arg("--data").arg(&data).env("SKYPOSE_STREAMS_MAX_AGE_MS", MAX_AGE.as_millis().to_string());
        let mut program = command.stdout(Stdio::piped()).spawn().expect("starts");
        let mut output = BufReader::new(program.stdout.take().expect("piped"));
        let mut line = String::new();
        output.read_line(&mut line).expect("a line");
        assert!(line.starts_with("listening on "), "{line}");
        Self { program, _output: output, _folder: folder }
    }

    /// Open files and threads.
    fn holdings(&self) -> [usize; 2] {
        let process = Path::new("/proc").join(self.program.id().to_string());
        ["fd", "task"].map(|list| fs::read_dir(process.join(list)).expect("it runs").count())
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

/// A flight of the Python client on the first host.
struct Flight {
    peer: python::Peer,
    _folder: TempDir,
}

impl Flight {
    fn start(hosts: &Hosts, python: &Path, endpoint: &str, frames: u32) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let frame = folder.path().join("frame.jpg");
        // As a radio would have it: small.
        fs::write(&frame, encode::jpeg(station::frame(), 40).expect("encodes")).expect("writes");
        println!("frames of {} bytes", fs::metadata(&frame).expect("written").len());
        let [frames, rate, lease] = [frames, FRAMES_HZ, LEASE_MS].map(|number| number.to_string());
        let frame = frame.display().to_string();
        let arguments = ["fly", endpoint, "alpha", "front", &frames, &rate, &frame, &lease];
        let mut peer = python::Peer::of(hosts.on_client(&python.display().to_string()), "swarm.py", &arguments);
        assert_eq!(peer.line(), "flying");
        Self { peer, _folder: folder }
    }

    /// What it tells at its end.
    fn report(mut self) -> Value {
        serde_json::from_str(&self.peer.line()).expect("a report")
    }
}

/// What must hold of every flight, whatever is lost. The sequences that were answered.
fn assert_all_is_accounted_for(report: &Value) -> Vec<u64> {
    let status = &report["status"];
    let number = |word: &str| status[word].as_u64().expect(word);
    println!("sent {}, status {status}", report["sent"]);
    assert_eq!(number("received") + number("lost"), number("last_sequence") + 1, "{status}");
    let ours: u64 = ["published", "replaced", "too_old", "late", "refused", "failed"].map(number).iter().sum();
    assert_eq!(ours, number("received"), "{status}");
    assert_eq!(number("refused") + number("failed") + number("restarts") + number("shared"), 0, "{status}");
    let estimates = report["estimates"].as_array().expect("estimates");
    let micros = |note: &Value, word: &str| note[word].as_i64().expect(word);
    let (delay_us, max_age_us) = [DELAY, MAX_AGE].map(|span| i64::try_from(span.as_micros()).expect("small")).into();
    let mut ages_ms = Vec::new();
    for note in estimates {
        // One clock for both hosts, so ages are what they are said to be.
        let on_the_way_us = micros(note, "received_us") - micros(note, "timestamp_us");
        assert!(on_the_way_us >= delay_us, "faster than the link: {note}");
        assert!(on_the_way_us + micros(&note["latency_us"], "total") <= max_age_us + 20_000, "answered late: {note}");
        assert!(micros(note, "age_us") >= 2 * delay_us, "faster than the link: {note}");
        ages_ms.push(micros(note, "age_us") / 1000);
        let range_m = note["range_m"][0].as_f64().expect("a range");
        assert!((range_m - station::truth().translation.norm()).abs() < 0.1, "{range_m}");
    }
    let sequences: Vec<u64> = estimates.iter().map(|note| note["sequence"].as_u64().expect("a number")).collect();
    assert!(sequences.is_sorted_by(|a, b| a < b), "{sequences:?}");
    assert!(sequences.len() as u64 <= number("published"), "{status}");
    ages_ms.sort_unstable();
    println!("{} estimates arrived, ages {:?} ms (median)", ages_ms.len(), ages_ms.get(ages_ms.len() / 2));
    sequences
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn over_a_link_that_loses_and_is_cut_every_frame_is_accounted_for() {
    let Some(python) = python::python("zenoh") else { return };
    let Some(mut hosts) = Hosts::linked(DELAY, LOSS_PERCENT) else { return };
    let endpoint = format!("tcp/{SERVER}:7447");
    let service = Service::start(&hosts, &endpoint).await;
    let flight = Flight::start(&hosts, &python, &endpoint, 35 * FRAMES_HZ);
    let pause = async |ms| tokio::time::sleep(Duration::from_millis(ms)).await;
    pause(5000).await;
    let before = service.holdings();
    // Shorter than the lease: what is under way comes late.
    hosts.lose(100);
    pause(1500).await;
    hosts.lose(LOSS_PERCENT);
    pause(7000).await;
    // Longer: the link is given up by both, and made anew.
    hosts.lose(100);
    pause(8000).await;
    hosts.lose(LOSS_PERCENT);
    pause(12_000).await;
    let after = service.holdings();
    let report = flight.report();
    let sequences = assert_all_is_accounted_for(&report);
    println!("open files and threads: {before:?}, after {after:?}; {sequences:?}");
    assert!(report["status"]["lost"].as_u64() > Some(0), "the link was away");
    for (part, range) in [("before", 0..25), ("between the cuts", 35..67), ("after", 110..175)] {
        assert!(sequences.iter().any(|sequence| range.contains(sequence)), "nothing {part}: {sequences:?}");
    }
    // The store opens a file or two when it is first needed; a link that is kept would hold its sockets and its threads.
    assert!(after[0] <= before[0] + 2 && after[1] <= before[1] + 1, "{before:?}, {after:?}");
}
