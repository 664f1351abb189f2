//! `skypose replay`: frames posted to a running server at the pace at which they were taken.

mod client;
mod feed;
#[cfg(feature = "zenoh")]
mod outlet;
mod tally;

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use futures_util::StreamExt;
use futures_util::stream::FuturesOrdered;
use serde_json::{Map, Value, json};
use tokio::sync::mpsc::Receiver;
use tokio::time::Instant;

use super::frames::named;
use super::inputs::{bytes_of, given, given_camera};
use super::moving::MovingArgs;
use super::{Failures, Stop};
use crate::shell::console::{Timeline, note, print_line};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::grab::is_interrupted;
#[cfg(feature = "zenoh")]
use crate::shell::store::check_name;
use crate::shell::wire::detector::Method;
use crate::shell::wire::frame::OrientationHandling;
use crate::shell::wire::{TargetWire, from_json};
use client::{Client, Reply};
use feed::{Feed, Shot};
use tally::Tally;

pub(super) const EXAMPLES: &str = "Examples:
  skypose replay flight.mp4 --camera front --target wing-six
  skypose replay flight.mp4 --method edge --server http://192.168.1.5:8080 --speed 0.5
  skypose replay flight.mp4 --camera front --zenoh tcp/127.0.0.1:7447
  skypose replay frames --fps 10 --camera camera.json --target target.json

With a camera and a target, frames go to /v1/estimates, otherwise to /v1/detections. A frame that is due while --in-flight \
others are on their way is dropped, as a camera's would be; with --speed max each waits for its turn. A folder that skypose \
grab has written is played with its own times. Replies are printed in the order of the frames, sums on standard error.";

/// Pictures have no pace of their own.
const PICTURES_PER_SECOND: f64 = 10.0;

#[derive(Args, Debug)]
pub(super) struct Replay {
    /// Videos, streams (rtsp://...), webcams (/dev/video0), pictures, folders of them.
    #[arg(value_name = "SOURCE", required = true)]
    sources: Vec<PathBuf>,
    /// The server.
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:8080")]
    server: String,
    /// The camera: a file (JSON, ROS' YAML, OpenCV's YAML or XML), or the name of one that the server knows.
    #[arg(long, value_name = "NAME|FILE")]
    camera: Option<PathBuf>,
    /// A target to look for: a JSON file, or the name of one that the server knows. May be given several times.
    #[arg(long, value_name = "NAME|FILE")]
    target: Vec<PathBuf>,
    /// Method of detection: color (markers), or edge (anything that stands out from the sky).
    #[arg(long, value_name = "METHOD", value_parser = named::<Method>)]
    method: Option<Method>,
    /// A request as in the API, for everything else: a JSON file. The options go over it.
    #[arg(long, value_name = "FILE")]
    request: Option<PathBuf>,
    /// How fast: 1 is as it was taken, max as fast as the server answers, without dropping a frame.
    #[arg(long, value_name = "X|max", default_value = "1", value_parser = pace)]
    speed: Pace,
    /// Requests that may be on their way at once.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=64))]
    in_flight: u16,
    /// How frames of videos are posted; pictures go as they are.
    #[arg(long, value_enum, default_value_t)]
    post: Posted,
    /// Quality of jpeg.
    #[arg(long, value_name = "1-100", default_value_t = 90, value_parser = clap::value_parser!(u8).range(1..=100))]
    quality: u8,
    /// What to do with an orientation that a video states, as of phones: ignore or apply.
    #[arg(long, default_value = "ignore", value_parser = named::<OrientationHandling>)]
    orientation: OrientationHandling,
    /// Send the frames to a Zenoh network instead, under the camera's name there: an endpoint to connect to, or a Zenoh configuration
    /// file. What is looked for in them is stored with the server (PUT /v1/streams/NAME).
    #[cfg(feature = "zenoh")]
    #[arg(
        long, value_name = "ENDPOINT|FILE", requires = "camera",
        conflicts_with_all = ["server", "target", "method", "request", "in_flight"]
    )]
    zenoh: Option<String>,
    /// With --zenoh: the node that is to look at them [default: the one that listens to the camera].
    #[cfg(feature = "zenoh")]
    #[arg(long, value_name = "NAME", requires = "zenoh")]
    node: Option<String>,
    #[cfg(feature = "zenoh")]
    #[command(flatten)]
    group: super::network::GroupArgs,
    #[command(flatten)]
    moving: MovingArgs,
}

/// How decoded frames travel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Posted {
    /// As from a camera: small, and not quite what was decoded.
    #[default]
    Jpeg,
    /// Exact and slow to encode.
    Png,
    /// Exact and large: 3 bytes a pixel.
    Raw,
}

/// How fast frames are posted.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pace {
    Times(f64),
    Max,
}

fn pace(text: &str) -> Result<Pace, String> {
    if text == "max" {
        return Ok(Pace::Max);
    }
    let times = text.parse().ok().filter(|times| (0.01..=1000.0).contains(times));
    times.map(Pace::Times).ok_or_else(|| "a number from 0.01 to 1000 is expected, or max".into())
}

impl Replay {
    pub(super) fn run(self) -> Result<(), Stop> {
        // Whether or not the server is reached by TLS, the client wants to know whose it would be.
        let _ = rustls::crypto::ring::default_provider().install_default();
        #[cfg(feature = "zenoh")]
        if let Some(network) = &self.zenoh {
            return self.send(network);
        }
        let request = self.request()?;
        let client = Client::of(&self.server, request)?;
        let feed = Feed::of(&self)?;
        let runtime = super::runtime()?;
        let (tally, failures) = runtime.block_on(async {
            client.check().await?;
            self.play(&client, feed.start()?).await
        })?;
        note(&tally.summary());
        if is_interrupted() { Err(Stop::Interrupted) } else { failures.into_result() }
    }

    /// Sends the frames to a network, at their pace; nobody answers.
    #[cfg(feature = "zenoh")]
    fn send(&self, network: &str) -> Result<(), Stop> {
        let camera = self.camera.as_ref().map(|camera| camera.display().to_string()).unwrap_or_default();
        check_name(&camera)?;
        let keys = self.group.keys()?;
        let feed = Feed::of(self)?;
        super::network::runtime()?.block_on(async {
            let mut outlet = outlet::Outlet::open(network, &keys, self.node.as_deref(), &camera).await?;
            let (mut timeline, mut start) = (Timeline::new(None), Start::default());
            let (mut failures, mut sent, began) = (Failures::default(), 0_u64, Instant::now());
            let mut shots = feed.start()?;
            while let Some(fed) = shots.recv().await {
                let shot = match fed {
                    Ok(shot) => shot,
                    Err((source, fault)) => {
                        timeline.suspend(|| failures.add(&source, &fault));
                        continue;
                    }
                };
                tokio::time::sleep_until(start.due(&shot, self.speed)).await;
                timeline.step(shot.time_us);
                outlet.send(shot.body).await?;
                sent += 1;
            }
            drop(timeline);
            note(&format!("{sent} frames in {:.1} s sent to {}.", began.elapsed().as_secs_f64(), outlet.key()));
            outlet.close().await?;
            if is_interrupted() { Err(Stop::Interrupted) } else { failures.into_result() }
        })
    }

    /// What is asked of each frame, as JSON: what the server understands of it is its own business.
    fn request(&self) -> Result<Map<String, Value>, Fault> {
        let internal = |error: serde_json::Error| Fault::new(FaultKind::Internal, error.to_string());
        let mut request: Map<String, Value> = match &self.request {
            Some(file) => from_json(&bytes_of(file)?).map_err(|fault| Fault {
                detail: format!("{}: {fault}", file.display()),
                pointer: None,
                ..fault
            })?,
            None => Map::new(),
        };
        if let Some(camera) = &self.camera {
            let camera = given_camera(camera, true)?;
            request.insert("camera".into(), serde_json::to_value(camera).map_err(internal)?);
        }
        if !self.target.is_empty() {
            let targets: Result<Vec<_>, _> =
                self.target.iter().map(|target| given::<TargetWire>(target, true)).collect();
            request.insert("targets".into(), serde_json::to_value(targets?).map_err(internal)?);
        }
        if let Some(method) = self.method {
            let detector = request.entry("detector").or_insert_with(|| json!({}));
            if let Some(detector) = detector.as_object_mut() {
                detector.insert("method".into(), serde_json::to_value(method).map_err(internal)?);
            }
        }
        Ok(request)
    }

    async fn play(&self, client: &Client, mut shots: Receiver<feed::Fed>) -> Result<(Tally, Failures), Stop> {
        let mut timeline = Timeline::new(None);
        let mut player = Player { tally: Tally::default(), failures: Failures::default(), is_over: false };
        let mut under_way = FuturesOrdered::new();
        let mut start = Start::default();
        while let Some(fed) = shots.recv().await {
            let shot = match fed {
                Ok(shot) => shot,
                Err((source, fault)) => {
                    timeline.suspend(|| player.failures.add(&source, &fault));
                    continue;
                }
            };
            let due = start.due(&shot, self.speed);
            // Replies are printed while we wait for the frame's time.
            loop {
                tokio::select! {
                    () = tokio::time::sleep_until(due) => break,
                    Some(reply) = under_way.next() => timeline.suspend(|| player.hear(&reply))?,
                }
            }
            if player.is_over {
                break;
            }
            timeline.step(shot.time_us);
            player.tally.shown();
            if under_way.len() >= usize::from(self.in_flight) {
                if self.speed != Pace::Max {
                    player.tally.dropped();
                    continue;
                }
                if let Some(reply) = under_way.next().await {
                    timeline.suspend(|| player.hear(&reply))?;
                }
            }
            let interval = start.interval;
            under_way.push_back(client.post(shot, due, interval));
        }
        drop(shots);
        while let Some(reply) = under_way.next().await {
            timeline.suspend(|| player.hear(&reply))?;
        }
        Ok((player.tally, player.failures))
    }
}

/// When the source began for us, and for itself.
#[derive(Default)]
struct Start {
    at: Option<(Instant, i64)>,
    last_us: i64,
    interval: Option<Duration>,
}

impl Start {
    /// When a frame is to be posted. A live one is due as it comes.
    fn due(&mut self, shot: &Shot, speed: Pace) -> Instant {
        let now = Instant::now();
        let (Pace::Times(times), false) = (speed, shot.is_live) else {
            return now;
        };
        let (at, from_us) = match self.at {
            Some(start) if !shot.is_first => start,
            _ => {
                self.interval = None;
                *self.at.insert((now, shot.time_us))
            }
        };
        let span = |us: i64| Duration::from_secs_f64(us.max(0) as f64 * 1e-6 / times);
        if !shot.is_first {
            self.interval = Some(span(shot.time_us - self.last_us));
        }
        self.last_us = shot.time_us;
        at + span(shot.time_us - from_us)
    }
}

/// What comes back.
struct Player {
    tally: Tally,
    failures: Failures,
    /// What is wrong with one frame of a video is wrong with all.
    is_over: bool,
}

impl Player {
    fn hear(&mut self, reply: &Reply) -> Result<(), Stop> {
        self.tally.add(reply);
        if let Err(fault) = &reply.answer {
            self.is_over |= reply.is_video && !fault.kind.is_passing() && fault.kind != FaultKind::Internal;
            if self.tally.is_new(fault) {
                self.failures.add(&format!("{}, frame {}", reply.source, reply.index), fault);
            }
        }
        Ok(print_line(&reply.line())?)
    }
}
