//! One camera on the network: its frames are handed in, what is told of it is published.

use zenoh::Session;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::sample::Sample;

use super::keys::{Keys, Topic};
use super::payload::bytes_of;
use super::shared::is_shared;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::hub::{Answered, Arrival, Heard, Listener};
use crate::shell::wire::from_json;
use crate::shell::wire::swarm::{CameraStatus, FrameNote};

/// Largest attachment that is read, bytes.
const MAX_NOTE: usize = 4096;

/// A frame as the network hands it over. Nothing is copied or computed here.
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
    let (payload, is_shared) = (payload.clone(), is_shared(payload));
    Ok(Arrival::now(note, move || bytes_of(&payload)).shared(is_shared))
}

/// Publishes what is heard of a camera until the service stops.
pub(super) async fn publish(mut listener: Listener, session: Session, keys: Keys, node: String, camera: String) {
    let outlets = match Outlets::declare(&session, &keys, &node, &camera).await {
        Ok(outlets) => outlets,
        Err(fault) => return tracing::error!(%camera, %fault, "cannot publish"),
    };
    while let Some(heard) = listener.next().await {
        let published = match heard {
            Heard::Answer(answered) => outlets.tell(&answered).await,
            Heard::Status(status) => outlets.tell_status(&status).await,
            Heard::Gap(gap) => {
                tracing::warn!(%camera, missed = gap.missed_count, "estimates not published: the network is too slow");
                Ok(())
            }
        };
        if let Err(error) = published {
            tracing::warn!(%camera, %error, "not published");
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

    async fn tell(&self, answered: &Answered) -> Result<(), zenoh::Error> {
        let note = serde_json::to_vec(&answered.note())?;
        self.estimate.put(answered.estimate().1).attachment(note.clone()).await?;
        match answered.tracks() {
            Some((_, tracks)) => self.track.put(tracks).attachment(note).await,
            None => Ok(()),
        }
    }

    async fn tell_status(&self, status: &CameraStatus) -> Result<(), zenoh::Error> {
        self.status.put(serde_json::to_vec(status)?).await
    }
}
