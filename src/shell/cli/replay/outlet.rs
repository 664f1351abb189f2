//! Frames on a Zenoh network, as a camera would send them.

use std::collections::BTreeSet;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use zenoh::Session;
use zenoh::bytes::{Encoding, ZBytes};
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;

use super::feed::Body;
use crate::shell::bus::keys::{Keys, Topic};
use crate::shell::bus::shared::Pool;
use crate::shell::cli::network::connect;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::frame::RawFormatName;
use crate::shell::wire::swarm::FrameNote;

/// Time that somebody has to say that he listens.
const FOUND_WITHIN: Duration = Duration::from_secs(5);

/// Where a camera's frames go.
pub(super) struct Outlet {
    session: Session,
    frames: Publisher<'static>,
    sequence: u64,
    pool: Pool,
}

impl Outlet {
    /// Joins the network and finds who listens to the camera.
    pub(super) async fn open(network: &str, keys: &Keys, node: Option<&str>, camera: &str) -> Result<Self, Fault> {
        let session = connect(network).await?;
        let node = match node {
            Some(node) => node.to_owned(),
            None => listener(&session, keys, camera).await?,
        };
        let key = keys.camera(&node, camera, Topic::Frame)?;
        // Who plays a recording rather waits than loses a part of it.
        let frames = session
            .declare_publisher(key.clone())
            .congestion_control(CongestionControl::Block)
            .await
            .map_err(failed)?;
        let start = tokio::time::Instant::now();
        while !frames.matching_status().await.map_err(failed)?.matching() {
            if start.elapsed() > FOUND_WITHIN {
                return Err(Fault::new(FaultKind::Unreachable, format!("nobody listens to {key}")));
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        Ok(Self { session, frames, sequence: 0, pool: Pool::default() })
    }

    /// The key.
    pub(super) fn key(&self) -> String {
        self.frames.key_expr().to_string()
    }

    /// Sends a frame as one that is taken now.
    pub(super) async fn send(&mut self, body: Body) -> Result<(), Fault> {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let mut note = FrameNote {
            sequence: Some(self.sequence),
            timestamp_us: i64::try_from(since.as_micros()).ok(),
            ..FrameNote::default()
        };
        self.sequence += 1;
        let (bytes, encoding) = match body {
            Body::Encoded(bytes) => {
                let encoding = encoding_of(&bytes);
                (ZBytes::from(bytes), encoding)
            }
            Body::Rgb { width, height, bytes } => {
                (note.width, note.height, note.format) = (Some(width), Some(height), Some(RawFormatName::Rgb8));
                (self.pool.put(bytes), Encoding::APPLICATION_OCTET_STREAM)
            }
        };
        let note = serde_json::to_vec(&note).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))?;
        self.frames.put(bytes).encoding(encoding).attachment(note).await.map_err(failed)
    }

    /// Leaves the network when everything is on its way.
    pub(super) async fn close(self) -> Result<(), Fault> {
        drop(self.frames);
        self.session.close().await.map_err(failed)
    }
}

/// The one node that says that it listens to the camera.
async fn listener(session: &Session, keys: &Keys, camera: &str) -> Result<String, Fault> {
    let tokens = session.liveliness().get(keys.alive_camera("*", camera)?).timeout(FOUND_WITHIN).await;
    let tokens = tokens.map_err(failed)?;
    let mut nodes = BTreeSet::new();
    while let Ok(reply) = tokens.recv_async().await {
        nodes
            .extend(reply.result().ok().and_then(|token| keys.read_alive_camera(token.key_expr())).map(|key| key.node));
    }
    let mut found = nodes.into_iter();
    match (found.next(), found.next()) {
        (Some(node), None) => Ok(node),
        (None, _) => Err(Fault::new(
            FaultKind::NotFound,
            format!("no node listens to a camera {camera:?}: store what is looked for with PUT /v1/streams/{camera}"),
        )),
        (Some(one), Some(other)) => Err(Fault::new(
            FaultKind::Senseless,
            format!("several nodes listen to a camera {camera:?}, {one} and {other} among them: give --node"),
        )),
    }
}

/// By the first bytes.
fn encoding_of(bytes: &[u8]) -> Encoding {
    if bytes.starts_with(&[0xff, 0xd8]) {
        Encoding::IMAGE_JPEG
    } else if bytes.starts_with(b"\x89PNG") {
        Encoding::IMAGE_PNG
    } else {
        Encoding::APPLICATION_OCTET_STREAM
    }
}

#[expect(clippy::needless_pass_by_value, reason = "as a failed call hands it over")]
fn failed(error: zenoh::Error) -> Fault {
    Fault::new(FaultKind::Internal, error.to_string())
}
