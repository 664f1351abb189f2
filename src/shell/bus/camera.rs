//! One camera: room for its newest frame, its turn on a worker, what is told of it.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use tokio::sync::{Notify, watch};
use tokio::time::MissedTickBehavior;
use zenoh::Session;
use bytes::Bytes;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::sample::Sample;

use super::keys::{Keys, Topic};
use super::payload::bytes_of;
use crate::shell::config::ZenohSettings;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::Service;
use crate::shell::service::told::Told;
use crate::shell::service::tracks::Tracks;
use crate::shell::wire::swarm::{CameraStatus, EstimateNote, FrameNote, Ledger};
use crate::shell::wire::track::TracksWire;
use crate::shell::wire::{EstimateReply, FrameRequest, Problem, from_json};

/// Largest attachment that is read, bytes.
const MAX_NOTE: usize = 4096;
/// Messages about losses come no closer than this.
const TOLD_EVERY: Duration = Duration::from_millis(100);

/// A frame as it came.
pub(super) struct Arrival {
    payload: Bytes,
    note: FrameNote,
    at: Instant,
    at_us: i64,
}

impl Arrival {
    /// One that comes now.
    pub(super) fn now(note: FrameNote, payload: Bytes) -> Self {
        Self { payload, note, at: Instant::now(), at_us: now_us() }
    }
}

/// A camera that is listened to.
pub(super) struct Camera {
    name: String,
    /// The newest frame that has not had its turn.
    slot: Mutex<Option<Arrival>>,
    has_frame: Notify,
    status: Mutex<CameraStatus>,
    has_news: Notify,
    heard: Mutex<Instant>,
    tracks: Arc<Mutex<Tracks>>,
}

/// What became of a frame that had its turn.
enum Outcome {
    Published,
    TooOld,
    Late,
}

impl Camera {
    pub(super) fn new(node: &str, name: &str) -> Self {
        let status = CameraStatus { node: node.into(), camera: name.into(), ..CameraStatus::default() };
        Self {
            name: name.into(),
            slot: Mutex::default(),
            has_frame: Notify::new(),
            status: Mutex::new(status),
            has_news: Notify::new(),
            heard: Mutex::new(Instant::now()),
            tracks: Arc::default(),
        }
    }

    /// When the last frame came.
    pub(super) fn heard(&self) -> Instant {
        *self.heard.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether it is stored what is looked for in its frames.
    pub(super) fn set_stream(&self, has_stream: bool) {
        let before = std::mem::replace(&mut self.open().has_stream, has_stream);
        if before != has_stream {
            self.has_news.notify_one();
        }
    }

    fn open(&self) -> std::sync::MutexGuard<'_, CameraStatus> {
        self.status.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a frame from the network's thread: puts it in the place of one that still waits. Nothing is computed here.
    pub(super) fn take(&self, arrival: Result<Arrival, Fault>) {
        *self.heard.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
        match arrival {
            Ok(arrival) => {
                let sequence = arrival.note.sequence;
                let before = self.slot.lock().unwrap_or_else(PoisonError::into_inner).replace(arrival);
                let mut status = self.open();
                let losses = status.losses();
                status.arrived(sequence);
                status.replaced += u64::from(before.is_some());
                let is_news = status.losses() != losses;
                drop(status);
                if is_news {
                    self.has_news.notify_one();
                }
                self.has_frame.notify_one();
            }
            Err(fault) => {
                self.open().arrived(None);
                self.failed(&fault);
            }
        }
    }

    fn failed(&self, fault: &Fault) {
        let mut status = self.open();
        if fault.kind.is_passing() || fault.kind == FaultKind::Internal {
            status.failed += 1;
        } else {
            status.refused += 1;
        }
        status.problem = Some(Problem::from(fault));
        drop(status);
        self.has_news.notify_one();
    }

    /// Works and tells until the service stops.
    pub(super) async fn live(
        self: Arc<Self>,
        session: Session,
        service: Arc<Service>,
        keys: Keys,
        mut stopping: watch::Receiver<bool>,
    ) {
        let node = self.open().node.clone();
        let outlets = match Outlets::declare(&session, &keys, &node, &self.name).await {
            Ok(outlets) => outlets,
            Err(fault) => return tracing::error!(camera = %self.name, %fault, "cannot publish"),
        };
        let settings = service.settings().zenoh.clone();
        tokio::select! {
            () = self.work(&service, &settings, &outlets) => {}
            () = self.tell(&settings, &outlets.status) => {}
            _ = stopping.wait_for(|is_stopping| *is_stopping) => {}
        }
    }

    async fn work(&self, service: &Arc<Service>, settings: &ZenohSettings, outlets: &Outlets) {
        loop {
            self.has_frame.notified().await;
            let Some(arrival) = self.slot.lock().unwrap_or_else(PoisonError::into_inner).take() else { continue };
            let outcome = self.answer(arrival, service, settings.max_age(), outlets).await;
            let mut status = self.open();
            match outcome {
                Ok(Outcome::Published) => {
                    status.published += 1;
                    status.problem = None;
                    continue;
                }
                Ok(Outcome::TooOld) => status.too_old += 1,
                Ok(Outcome::Late) => status.late += 1,
                Err(fault) => {
                    drop(status);
                    self.failed(&fault);
                    continue;
                }
            }
            drop(status);
            self.has_news.notify_one();
        }
    }

    async fn answer(
        &self,
        arrival: Arrival,
        service: &Arc<Service>,
        max_age: Duration,
        outlets: &Outlets,
    ) -> Result<Outcome, Fault> {
        // Its age when it came, by the clocks of two machines, and since then by our own.
        let before = arrival.note.timestamp_us.map_or(Duration::ZERO, |taken_us| {
            Duration::from_micros(u64::try_from(arrival.at_us.saturating_sub(taken_us)).unwrap_or(0))
        });
        let Some(left) = max_age.checked_sub(before.saturating_add(arrival.at.elapsed())) else {
            return Ok(Outcome::TooOld);
        };
        let note = &arrival.note;
        let request = FrameRequest {
            timestamp_us: note.timestamp_us,
            width: note.width,
            height: note.height,
            format: note.format,
            ..service.stream(&self.name).await?.into()
        };
        let deadline = Instant::now() + left;
        let taken_us = note.timestamp_us.unwrap_or(arrival.at_us);
        let tracks = Arc::clone(&self.tracks);
        let followed = service.estimate_followed(arrival.payload.clone(), request, deadline, tracks, taken_us).await;
        let (reply, tracks) = match followed {
            Err(fault) if fault.kind == FaultKind::DeadlineExceeded => return Ok(Outcome::Late),
            followed => followed?,
        };
        if Instant::now() > deadline {
            return Ok(Outcome::Late);
        }
        let answered = micros(arrival.at.elapsed());
        self.publish(&arrival, &reply, tracks.as_ref(), answered, outlets).await?;
        service.tell(Told {
            camera: self.name.clone(),
            timestamp_us: arrival.note.timestamp_us,
            received_us: arrival.at_us,
            reply,
        });
        Ok(Outcome::Published)
    }

    async fn publish(
        &self,
        arrival: &Arrival,
        reply: &EstimateReply,
        tracks: Option<&TracksWire>,
        answered: u64,
        outlets: &Outlets,
    ) -> Result<(), Fault> {
        let internal = |error: &dyn std::fmt::Display| Fault::new(FaultKind::Internal, error.to_string());
        let payload = serde_json::to_vec(reply).map_err(|error| internal(&error))?;
        let note = EstimateNote {
            sequence: arrival.note.sequence,
            timestamp_us: arrival.note.timestamp_us,
            received_us: arrival.at_us,
            latency_us: Ledger::of(&reply.timing_us, answered, micros(arrival.at.elapsed())),
        };
        let note = serde_json::to_vec(&note).map_err(|error| internal(&error))?;
        outlets.estimate.put(payload).attachment(note.clone()).await.map_err(|error| internal(&error))?;
        let Some(tracks) = tracks else { return Ok(()) };
        let payload = serde_json::to_vec(tracks).map_err(|error| internal(&error))?;
        outlets.track.put(payload).attachment(note).await.map_err(|error| internal(&error))
    }

    async fn tell(&self, settings: &ZenohSettings, outlet: &Publisher<'static>) {
        let mut clock = tokio::time::interval(settings.status());
        clock.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                _ = clock.tick() => {}
                () = self.has_news.notified() => {}
            }
            let status = {
                let mut status = self.open();
                status.time_us = now_us();
                status.clone()
            };
            if let Ok(payload) = serde_json::to_vec(&status)
                && let Err(error) = outlet.put(payload).await
            {
                tracing::debug!(camera = %self.name, %error, "status not published");
            }
            tokio::time::sleep(TOLD_EVERY.min(settings.status())).await;
        }
    }
}

/// Where is published.
struct Outlets {
    estimate: Publisher<'static>,
    track: Publisher<'static>,
    status: Publisher<'static>,
}

impl Outlets {
    async fn declare(session: &Session, keys: &Keys, node: &str, camera: &str) -> Result<Self, Fault> {
        let failed = |error: zenoh::Error| Fault::new(FaultKind::Internal, error.to_string());
        // Before everything else, at once, and on a link that loses nothing; but rather dropped than waited for.
        let for_control = async |topic| {
            let publisher = session
                .declare_publisher(keys.camera(node, camera, topic)?)
                .encoding(Encoding::APPLICATION_JSON)
                .priority(Priority::RealTime)
                .express(true)
                .congestion_control(CongestionControl::Drop)
                .reliability(Reliability::Reliable);
            publisher.await.map_err(failed)
        };
        let (estimate, track) = (for_control(Topic::Estimate).await?, for_control(Topic::Track).await?);
        let status = session
            .declare_publisher(keys.camera(node, camera, Topic::Status)?)
            .encoding(Encoding::APPLICATION_JSON)
            .priority(Priority::DataLow)
            .congestion_control(CongestionControl::Drop)
            .await
            .map_err(failed)?;
        Ok(Self { estimate, track, status })
    }
}

/// A frame as the network hands it over.
pub(super) fn arrival(sample: &Sample, max_bytes: usize) -> Result<Arrival, Fault> {
    let payload = sample.payload();
    if payload.len() > max_bytes {
        let detail = format!("a frame of {} bytes: at most {max_bytes} are accepted", payload.len());
        return Err(Fault::new(FaultKind::TooLarge, detail));
    }
    let encoding = sample.encoding().to_string();
    let essence = encoding.split(';').next().unwrap_or_default();
    if !essence.starts_with("image/") && !matches!(essence, "application/octet-stream" | "zenoh/bytes") {
        let shown: String = essence.chars().take(64).collect();
        let detail =
            format!("encoding {shown}: a frame comes as image/jpeg, image/png, ... or application/octet-stream");
        return Err(Fault::new(FaultKind::NotAFrame, detail));
    }
    let note = match sample.attachment() {
        Some(note) if note.len() > MAX_NOTE => {
            let detail = format!("an attachment of {} bytes: at most {MAX_NOTE} are read", note.len());
            return Err(Fault::new(FaultKind::TooLarge, detail));
        }
        Some(note) => from_json(&note.to_bytes())
            .map_err(|fault| Fault { detail: format!("the attachment: {}", fault.detail), ..fault })?,
        None => FrameNote::default(),
    };
    Ok(Arrival::now(note, bytes_of(payload)))
}

fn now_us() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_micros()).unwrap_or(i64::MAX)
}

fn micros(span: Duration) -> u64 {
    u64::try_from(span.as_micros()).unwrap_or(u64::MAX)
}
