//! The server's other side.

use std::time::Duration;

use reqwest::multipart::{Form, Part};
use serde::Serialize;
use serde_json::{Map, Value};
use tokio::time::Instant;

use super::feed::{Body, Shot};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::Problem;

/// Longer than a server works on a request.
const TIMEOUT: Duration = Duration::from_secs(30);

/// Where frames are posted, and what is asked of each.
pub(super) struct Client {
    http: reqwest::Client,
    server: String,
    url: String,
    request: Map<String, Value>,
}

/// What has become of a posted frame.
pub(super) struct Reply {
    pub(super) source: String,
    pub(super) index: u64,
    pub(super) is_video: bool,
    time_us: i64,
    /// From posting to reply.
    pub(super) latency: Duration,
    /// The next frame was due before the reply came.
    pub(super) is_late: bool,
    pub(super) answer: Result<Value, Fault>,
}

#[derive(Serialize)]
struct Line<'a> {
    source: &'a str,
    frame_index: u64,
    time_us: i64,
    latency_us: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<Problem>,
    #[serde(flatten)]
    reply: Option<&'a Value>,
}

impl Reply {
    /// For programs.
    pub(super) fn line(&self) -> String {
        let line = Line {
            source: &self.source,
            frame_index: self.index,
            time_us: self.time_us,
            latency_us: u64::try_from(self.latency.as_micros()).unwrap_or(u64::MAX),
            error: self.answer.as_ref().err().map(Problem::from),
            // What is no object cannot be put beside the rest.
            reply: self.answer.as_ref().ok().filter(|reply| reply.is_object()),
        };
        serde_json::to_string(&line).unwrap_or_default()
    }
}

impl Client {
    /// Estimates where camera and targets are known, detections otherwise.
    pub(super) fn of(server: &str, request: Map<String, Value>) -> Result<Self, Fault> {
        let server = server.trim_end_matches('/').to_owned();
        if !server.starts_with("http://") && !server.starts_with("https://") {
            let detail = format!("--server {server}: an address as http://127.0.0.1:8080 is expected");
            return Err(Fault::new(FaultKind::Senseless, detail));
        }
        let has_camera = request.get("camera").is_some_and(|camera| !camera.is_null());
        let has_targets = request.get("targets").and_then(Value::as_array).is_some_and(|targets| !targets.is_empty());
        let resource = if has_camera && has_targets { "estimates" } else { "detections" };
        let url = format!("{server}/v1/{resource}");
        let http = reqwest::Client::builder().timeout(TIMEOUT).build().map_err(|error| unreached(&server, &error))?;
        Ok(Self { http, server, url, request })
    }

    /// Whether somebody is there.
    pub(super) async fn check(&self) -> Result<(), Fault> {
        let reply = self.http.get(format!("{}/healthz", self.server)).send().await;
        let reply = reply.map_err(|error| unreached(&self.server, &error))?;
        if !reply.status().is_success() {
            let detail = format!("{}/healthz answers {}: no Skypose server", self.server, reply.status());
            return Err(Fault::new(FaultKind::NotFound, detail));
        }
        Ok(())
    }

    /// Posts a frame that was due at this time, the next one an interval later.
    pub(super) async fn post(&self, shot: Shot, due: Instant, interval: Option<Duration>) -> Reply {
        let Shot { source, index, is_video, time_us, .. } = shot;
        let start = Instant::now();
        let answer = self.answer(shot.timestamp_us, shot.body).await;
        let is_late = interval.is_some_and(|interval| due.elapsed() > interval);
        Reply { source, index, is_video, time_us, latency: start.elapsed(), is_late, answer }
    }

    async fn answer(&self, timestamp_us: Option<i64>, body: Body) -> Result<Value, Fault> {
        let mut request = self.request.clone();
        if let Some(timestamp_us) = timestamp_us {
            request.insert("timestamp_us".into(), timestamp_us.into());
        }
        let bytes = match body {
            Body::Encoded(bytes) => bytes,
            Body::Rgb { width, height, bytes } => {
                request.insert("width".into(), width.into());
                request.insert("height".into(), height.into());
                request.insert("format".into(), "rgb8".into());
                bytes
            }
        };
        let form = Form::new().text("request", Value::Object(request).to_string()).part("frame", Part::bytes(bytes));
        let reply = self.http.post(&self.url).multipart(form).send().await;
        let reply = reply.map_err(|error| unreached(&self.server, &error))?;
        let status = reply.status();
        let body = reply.bytes().await.map_err(|error| unreached(&self.server, &error))?;
        if status.is_success() {
            let unclear =
                |error| Fault::new(FaultKind::Internal, format!("{}: a reply that is no JSON: {error}", self.url));
            return serde_json::from_slice(&body).map_err(unclear);
        }
        let problem: Option<Problem> = serde_json::from_slice(&body).ok();
        let kind = match status.as_u16() {
            404 => FaultKind::NotFound,
            413 => FaultKind::TooLarge,
            415 => FaultKind::NotAFrame,
            400..=499 if status.as_u16() != 429 => FaultKind::Senseless,
            429 | 503 => FaultKind::Overloaded,
            _ => FaultKind::Internal,
        };
        Err(match problem {
            Some(problem) => Fault { kind, detail: problem.detail, pointer: problem.pointer },
            None => Fault::new(kind, format!("{} answers {status}", self.url)),
        })
    }
}

/// With the reason behind the reason: the first only says that something failed.
fn unreached(server: &str, error: &reqwest::Error) -> Fault {
    let mut last: &dyn std::error::Error = error;
    while let Some(source) = last.source() {
        last = source;
    }
    Fault::new(FaultKind::Internal, format!("{server} cannot be reached: {last}"))
}
