//! What nodes tell each other of their bodies.

use std::sync::Arc;

use tokio::sync::broadcast::error::RecvError;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use zenoh::Session;
use zenoh::bytes::{Encoding, ZBytes};
use zenoh::pubsub::Subscriber;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::SampleKind;

use super::keys::{BodyTopic, Keys};
use super::{House, failed};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::Service;
use crate::shell::service::swarm::SwarmTold;
use crate::shell::wire::from_json;
use crate::shell::wire::relative::RelativeWire;

/// Largest message that is read, bytes: 64 poses of 4 kB.
const MAX_RELATIVE: usize = 256 << 10;
/// Messages that wait to be compared; of more the newest are dropped, as they would be too old when their turn came.
const WAITING: usize = 64;

/// Hears and tells as long as it is kept.
pub(super) struct Bodies {
    _relatives: Subscriber<()>,
    hearing: JoinHandle<()>,
    telling: JoinHandle<()>,
}

impl Drop for Bodies {
    fn drop(&mut self) {
        self.hearing.abort();
        self.telling.abort();
    }
}

impl Bodies {
    /// Listens to what others say of this node, and tells what this node says of others.
    ///
    /// # Errors
    /// If something cannot be declared.
    pub(super) async fn open(house: &Arc<House>) -> Result<Self, Fault> {
        let (put, take) = mpsc::channel(WAITING);
        let key = house.keys.body("*", &house.node, BodyTopic::Relative)?;
        let keys = house.keys.clone();
        let relatives = house.session.declare_subscriber(key).callback(move |sample| {
            let Some(from) = keys.read_body(sample.key_expr()).filter(|_| sample.kind() == SampleKind::Put) else {
                return;
            };
            if put.try_send((from.node, sample.payload().clone())).is_err() {
                metrics::counter!("skypose_relatives_dropped_total").increment(1);
            }
        });
        let relatives = relatives.await.map_err(failed)?;
        let hearing = tokio::spawn(hear(Arc::clone(&house.service), take));
        let told = tell(house.service.hear_of_others(), house.session.clone(), house.keys.clone());
        Ok(Self { _relatives: relatives, hearing, telling: tokio::spawn(told) })
    }
}

/// A comparison takes some tens of microseconds, so it needs no worker.
async fn hear(service: Arc<Service>, mut take: mpsc::Receiver<(String, ZBytes)>) {
    while let Some((node, payload)) = take.recv().await {
        if let Err(fault) = heard(&service, &node, &payload) {
            metrics::counter!("skypose_relatives_refused_total").increment(1);
            tracing::debug!(%node, %fault, "what it says of us is not taken");
        }
    }
}

fn heard(service: &Service, node: &str, payload: &ZBytes) -> Result<(), Fault> {
    if payload.len() > MAX_RELATIVE {
        let detail = format!("a message of {} bytes: at most {MAX_RELATIVE} are accepted", payload.len());
        return Err(Fault::new(FaultKind::TooLarge, detail));
    }
    let relative: RelativeWire = from_json(&payload.to_bytes())?;
    // Who may speak on a key is a matter of access control; in whose name, of the key.
    if relative.node != node {
        return Err(Fault::senseless("/node", format!("{} on the key of {node}", relative.node)));
    }
    service.heard_of_us(&relative)
}

async fn tell(mut told: tokio::sync::broadcast::Receiver<Arc<SwarmTold>>, session: Session, keys: Keys) {
    loop {
        let sent = match told.recv().await {
            Ok(told) => send(&told, &session, &keys).await,
            Err(RecvError::Lagged(missed)) => {
                tracing::warn!(missed, "not told of other nodes: the network is too slow");
                continue;
            }
            Err(RecvError::Closed) => return,
        };
        if let Err(fault) = sent {
            tracing::warn!(%fault, "not told of another node");
        }
    }
}

async fn send(told: &SwarmTold, session: &Session, keys: &Keys) -> Result<(), Fault> {
    let written = |error: serde_json::Error| Fault::new(FaultKind::Internal, error.to_string());
    let (key, json) = match told {
        SwarmTold::Relative(told) => {
            (keys.body(&told.node, &told.other, BodyTopic::Relative)?, serde_json::to_vec(told).map_err(written)?)
        }
        SwarmTold::Agreement(told) => {
            (keys.body(&told.node, &told.other, BodyTopic::Agreement)?, serde_json::to_vec(told).map_err(written)?)
        }
    };
    // As estimates are: before everything else, and rather dropped than waited for.
    session
        .put(key, json)
        .encoding(Encoding::APPLICATION_JSON)
        .priority(Priority::RealTime)
        .express(true)
        .congestion_control(CongestionControl::Drop)
        .await
        .map_err(failed)
}
