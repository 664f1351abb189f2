//! Estimates of a Zenoh network.

use serde_json::{Value, json};
use zenoh::handlers::RingChannel;
use zenoh::sample::Sample;

use super::{Watch, compared, lines};
use crate::shell::bus::keys::{BodyKey, BodyTopic, CameraKey, Topic};
use crate::shell::cli::Stop;
use crate::shell::cli::network::{connect, runtime};
use crate::shell::console::{note, print_line};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::relative::AgreementWire;
use crate::shell::wire::swarm::EstimateNote;
use crate::shell::wire::{EstimateReply, from_json};

/// Estimates that wait to be printed; of more the oldest are left out.
const WAITING: usize = 256;

impl Watch {
    pub(super) fn watch_network(&self, network: &str) -> Result<(), Stop> {
        let keys = self.group.keys()?;
        let or_any = |name: &Option<String>| name.clone().unwrap_or_else(|| "*".into());
        let key = keys.camera(&or_any(&self.node), &or_any(&self.camera), Topic::Estimate)?;
        runtime()?.block_on(async {
            let failed = |error: zenoh::Error| Fault::new(FaultKind::Internal, error.to_string());
            let session = connect(network).await?;
            let estimates = session.declare_subscriber(&key).with(RingChannel::new(WAITING)).await.map_err(failed)?;
            let bodies = keys.body(&or_any(&self.node), "*", BodyTopic::Agreement)?;
            let agreements =
                session.declare_subscriber(&bodies).with(RingChannel::new(WAITING)).await.map_err(failed)?;
            note(&format!("watching {key}"));
            let mut left = self.count.unwrap_or(u64::MAX);
            while left > 0 {
                let sample = tokio::select! {
                    sample = estimates.recv_async() => sample.map_err(failed)?,
                    sample = agreements.recv_async() => {
                        let sample = sample.map_err(failed)?;
                        // Of one camera alone there is nothing to compare.
                        if let Some(from) = keys.read_body(sample.key_expr()).filter(|_| self.camera.is_none()) {
                            print_line(&self.agreement_line(&from, &sample))?;
                        }
                        continue;
                    }
                };
                let Some(from) = keys.read_camera(sample.key_expr()) else { continue };
                left -= 1;
                for line in self.network_lines(&from, &sample) {
                    print_line(&line)?;
                }
            }
            session.close().await.map_err(failed)?;
            Ok(())
        })
    }

    fn agreement_line(&self, from: &BodyKey, sample: &Sample) -> String {
        let payload = sample.payload().to_bytes();
        if self.json {
            let agreement = serde_json::from_slice::<Value>(&payload).unwrap_or(Value::Null);
            return json!({"node": from.node, "other": from.other, "agreement": agreement}).to_string();
        }
        let head = format!("{} and {}", from.node, from.other);
        match from_json::<AgreementWire>(&payload) {
            Ok(agreement) => compared(&head, &agreement),
            Err(fault) => format!("{head}  not an agreement: {}", fault.to_string().escape_debug()),
        }
    }

    fn network_lines(&self, from: &CameraKey, sample: &Sample) -> Vec<String> {
        let beside = sample.attachment().map(|attachment| attachment.to_bytes().into_owned()).unwrap_or_default();
        let payload = sample.payload().to_bytes();
        if self.json {
            let value = |bytes: &[u8]| serde_json::from_slice::<Value>(bytes).unwrap_or(Value::Null);
            let line = json!({
                "node": from.node, "camera": from.camera, "note": value(&beside), "estimate": value(&payload),
            });
            return vec![line.to_string()];
        }
        let head = format!("{}/{}", from.node, from.camera);
        match (from_json::<EstimateReply>(&payload), from_json::<EstimateNote>(&beside)) {
            (Ok(reply), Ok(note)) => lines(&head, &reply, Some(&note)),
            (Err(fault), _) | (_, Err(fault)) => {
                vec![format!("{head}  not an estimate: {}", fault.to_string().escape_debug())]
            }
        }
    }
}
