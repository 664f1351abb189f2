//! `skypose watch`: what cameras see, as it comes, of a Zenoh network or of a server.

#[cfg(feature = "zenoh")]
mod network;
mod server;

use std::time::{SystemTime, UNIX_EPOCH};

use clap::Args;

use super::Stop;
#[cfg(feature = "zenoh")]
use super::network::GroupArgs;
use crate::shell::wire::EstimateReply;
#[cfg(feature = "zenoh")]
use crate::shell::wire::relative::AgreementWire;
use crate::shell::wire::swarm::EstimateNote;

pub(super) const EXAMPLES: &str = "Examples:
  skypose watch --server http://127.0.0.1:8080 --camera front
  skypose watch --zenoh tcp/127.0.0.1:7447
  skypose watch --zenoh zenoh.json5 --node alpha --camera front --json

A server that goes away is looked for until it is there again, and what was missed meanwhile is printed as far as it has kept it.";

#[derive(Args, Debug)]
pub(super) struct Watch {
    /// A server that looks at the frames of the camera.
    #[arg(long, value_name = "URL", requires = "camera")]
    #[cfg_attr(feature = "zenoh", arg(required_unless_present = "zenoh", conflicts_with_all = ["zenoh", "node"]))]
    #[cfg_attr(not(feature = "zenoh"), arg(required = true))]
    server: Option<String>,
    /// Where the network is: an endpoint to connect to, or a Zenoh configuration file.
    #[cfg(feature = "zenoh")]
    #[arg(long, value_name = "ENDPOINT|FILE")]
    zenoh: Option<String>,
    /// With --zenoh: only what this node tells.
    #[cfg(feature = "zenoh")]
    #[arg(long, value_name = "NAME", requires = "zenoh")]
    node: Option<String>,
    /// The camera, by the name under which it sends; with --zenoh all of them, if left out.
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// End after so many estimates.
    #[arg(long, value_name = "N")]
    count: Option<u64>,
    /// For programs: one JSON object a line, with the whole estimate and what stands beside it.
    #[arg(long)]
    json: bool,
    #[cfg(feature = "zenoh")]
    #[command(flatten)]
    group: GroupArgs,
}

impl Watch {
    pub(super) fn run(self) -> Result<(), Stop> {
        #[cfg(feature = "zenoh")]
        if let Some(network) = &self.zenoh {
            return self.watch_network(network);
        }
        let server = self.server.as_deref().unwrap_or_default();
        self.watch_server(server, self.camera.as_deref().unwrap_or_default())
    }
}

/// For people: one line a target. What comes from elsewhere is printed without what a terminal would obey.
fn lines(head: &str, reply: &EstimateReply, note: Option<&EstimateNote>) -> Vec<String> {
    let number = note.and_then(|note| note.sequence).map_or_else(String::new, |sequence| format!(" #{sequence}"));
    let age = reply.frame.timestamp_us.map_or_else(String::new, |taken_us| {
        let age_ms = now_us().saturating_sub(taken_us) as f64 / 1e3;
        format!(", {age_ms:.1} ms old")
    });
    let total_ms = note.map_or(reply.timing_us.total, |note| note.latency_us.total) as f64 / 1e3;
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

/// For people: how two nodes agree, and where the one has the other.
#[cfg(feature = "zenoh")]
fn compared(head: &str, agreement: &AgreementWire) -> String {
    let AgreementWire { verdict, distance_squared, limit, apart_m, apart_rad, .. } = agreement;
    let verdict = verdict.name().replace('_', " ");
    let place = agreement.fused.as_ref().map_or_else(
        || format!("{apart_m:.3} m and {:.1} deg apart", apart_rad.to_degrees()),
        |fused| {
            let [forward, right, down] = fused.translation_m;
            let degrees = [fused.rotation.roll_rad, fused.rotation.pitch_rad, fused.rotation.yaw_rad].map(f64::to_degrees);
            let [roll, pitch, yaw] = degrees;
            format!(
                "forward {forward:+.3}  right {right:+.3}  down {down:+.3} m  roll {roll:+.1}  pitch {pitch:+.1}  yaw {yaw:+.1} deg  \
                 p {:.2}",
                fused.probability
            )
        },
    );
    format!("{head}  {verdict}  {place}  (distance {distance_squared:.1} of {limit:.1})")
}

fn now_us() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_micros()).unwrap_or(i64::MAX)
}
