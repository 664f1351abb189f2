//! `skypose watch`: estimates of a network, as they come.

use std::time::{SystemTime, UNIX_EPOCH};

use clap::Args;
use serde_json::{Value, json};
use zenoh::handlers::RingChannel;
use zenoh::sample::Sample;

use super::Stop;
use super::network::{GroupArgs, connect, runtime};
use crate::shell::bus::keys::{CameraKey, Topic};
use crate::shell::console::{note, print_line};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::swarm::EstimateNote;
use crate::shell::wire::{EstimateReply, from_json};

pub(super) const EXAMPLES: &str = "Examples:
  skypose watch --zenoh tcp/127.0.0.1:7447
  skypose watch --zenoh zenoh.json5 --node alpha --camera front --json";

/// Estimates that wait to be printed; of more the oldest are left out.
const WAITING: usize = 256;

#[derive(Args, Debug)]
pub(super) struct Watch {
    /// Where the network is: an endpoint to connect to, or a Zenoh configuration file.
    #[arg(long, value_name = "ENDPOINT|FILE")]
    zenoh: String,
    /// Only what this node tells.
    #[arg(long, value_name = "NAME", default_value = "*")]
    node: String,
    /// Only of this camera.
    #[arg(long, value_name = "NAME", default_value = "*")]
    camera: String,
    /// End after so many estimates.
    #[arg(long, value_name = "N")]
    count: Option<u64>,
    /// For programs: one JSON object a line, with the whole estimate and what stands beside it.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    group: GroupArgs,
}

impl Watch {
    pub(super) fn run(self) -> Result<(), Stop> {
        let keys = self.group.keys()?;
        let key = keys.camera(&self.node, &self.camera, Topic::Estimate)?;
        runtime()?.block_on(async {
            let failed = |error: zenoh::Error| Fault::new(FaultKind::Internal, error.to_string());
            let session = connect(&self.zenoh).await?;
            let estimates = session.declare_subscriber(&key).with(RingChannel::new(WAITING)).await.map_err(failed)?;
            note(&format!("watching {key}"));
            let mut left = self.count.unwrap_or(u64::MAX);
            while left > 0 {
                let sample = estimates.recv_async().await.map_err(failed)?;
                let Some(from) = keys.read_camera(sample.key_expr()) else { continue };
                left -= 1;
                for line in self.lines(&from, &sample) {
                    print_line(&line)?;
                }
            }
            session.close().await.map_err(failed)?;
            Ok(())
        })
    }

    fn lines(&self, from: &CameraKey, sample: &Sample) -> Vec<String> {
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
            (Ok(reply), Ok(note)) => lines(&head, &reply, &note),
            (Err(fault), _) | (_, Err(fault)) => {
                vec![format!("{head}  not an estimate: {}", fault.to_string().escape_debug())]
            }
        }
    }
}

/// For people: one line a target. What comes from the network is printed without what a terminal would obey.
fn lines(head: &str, reply: &EstimateReply, note: &EstimateNote) -> Vec<String> {
    let number = note.sequence.map_or_else(String::new, |sequence| format!(" #{sequence}"));
    let age = note.timestamp_us.map_or_else(String::new, |taken_us| {
        let age_ms = now_us().saturating_sub(taken_us) as f64 / 1e3;
        format!(", {age_ms:.1} ms old")
    });
    let total_ms = note.latency_us.total as f64 / 1e3;
    let line = |target: &crate::shell::wire::sighting::TargetEstimateWire| {
        let name = target.name.escape_debug();
        let Some(pose) = &target.answer.pose else {
            let reason = serde_json::to_string(&target.answer.reason).unwrap_or_default();
            return format!("{head}{number}  {name}  no pose: {}  ({total_ms:.1} ms{age})", reason.trim_matches('"'));
        };
        let degrees = |rad: f64| rad.to_degrees();
        format!(
            "{head}{number}  {name}  {:.3} m  azimuth {:+.1}  elevation {:+.1}  roll {:+.1}  pitch {:+.1}  yaw {:+.1} deg  p {:.2}  \
             ({total_ms:.1} ms{age})",
            pose.range_m,
            degrees(pose.azimuth_rad),
            degrees(pose.elevation_rad),
            degrees(pose.rotation.roll_rad),
            degrees(pose.rotation.pitch_rad),
            degrees(pose.rotation.yaw_rad),
            pose.probability,
        )
    };
    reply.targets.iter().map(line).collect()
}

fn now_us() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_micros()).unwrap_or(i64::MAX)
}
