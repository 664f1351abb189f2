//! Joining a network: an endpoint, or a whole configuration of Zenoh.

use std::path::Path;

use futures_util::FutureExt;
use futures_util::future::BoxFuture;
use zenoh::Session;
use zenoh::config::{Config, EndPoint};

use super::shared;
use crate::shell::fault::{Fault, FaultKind};

/// Protocols of endpoints; a text that begins otherwise is a path.
const PROTOCOLS: [&str; 6] = ["tcp", "udp", "tls", "quic", "unixsock-stream", "serial"];

/// Whether others are asked to share memory.
const SHARED_MEMORY: &str = "transport/shared_memory/enabled";

/// How an endpoint is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// To listen there, as a peer.
    Listen,
    /// To connect there, as a client.
    Connect,
}

/// Joins the network. Shared memory is used where both the caller, or the file, and the limits of the process allow it.
///
/// # Errors
/// A file that is no configuration; an endpoint that is none, is taken or does not answer.
#[must_use]
pub fn join(network: &str, role: Role, shared_memory: bool) -> BoxFuture<'_, Result<Session, Fault>> {
    async move {
        let config = within_limits(config(network, role, shared_memory)?, shared::is_allowed())?;
        zenoh::open(config).with_shm_clients(shared::storage()).await.map_err(|error| {
            let kind = if role == Role::Listen { FaultKind::Internal } else { FaultKind::Unreachable };
            // Without the place in its source that Zenoh tells.
            let text = error.to_string();
            let text = text.split(" at /").next().unwrap_or_default().trim();
            Fault::new(kind, format!("Zenoh at {network}: {text}"))
        })
    }
    .boxed()
}

fn config(network: &str, role: Role, shared_memory: bool) -> Result<Config, Fault> {
    let senseless =
        |error: &dyn std::fmt::Display| Fault::new(FaultKind::Senseless, format!("Zenoh at {network:?}: {error}"));
    if !is_endpoint(network) {
        if !Path::new(network).is_file() {
            let what = "neither an endpoint as tcp/127.0.0.1:7447 nor a configuration file that there is";
            return Err(senseless(&what));
        }
        return Config::from_file(network).map_err(|error| senseless(&error));
    }
    let endpoint: EndPoint = network.parse().map_err(|error| senseless(&error))?;
    let list = serde_json::json!([endpoint.to_string()]).to_string();
    let (mode, place) = match role {
        Role::Listen => ("\"peer\"", "listen/endpoints"),
        Role::Connect => ("\"client\"", "connect/endpoints"),
    };
    let mut config = Config::default();
    // Who gives one endpoint means that one, and nobody whom a multicast finds.
    for (key, value) in [
        ("mode", mode),
        (place, list.as_str()),
        ("scouting/multicast/enabled", "false"),
        (SHARED_MEMORY, if shared_memory { "true" } else { "false" }),
    ] {
        config.insert_json5(key, value).map_err(|error| senseless(&error))?;
    }
    Ok(config)
}

/// Without shared memory where the process may not lock it, whatever was asked for.
fn within_limits(mut config: Config, is_allowed: bool) -> Result<Config, Fault> {
    let failed = |error: zenoh::Error| Fault::new(FaultKind::Internal, error.to_string());
    if !is_allowed && config.get_json(SHARED_MEMORY).map_err(failed)? == "true" {
        tracing::info!(
            "no shared memory with others: the process may lock too little (ulimit -l), payloads are copied"
        );
        config.insert_json5(SHARED_MEMORY, "false").map_err(failed)?;
    }
    Ok(config)
}

fn is_endpoint(network: &str) -> bool {
    network.split_once('/').is_some_and(|(protocol, _)| PROTOCOLS.contains(&protocol))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_endpoint_is_no_path() {
        for endpoint in ["tcp/127.0.0.1:7447", "tls/host:1", "udp/[::1]:7447"] {
            assert!(is_endpoint(endpoint), "{endpoint}");
        }
        for path in ["./tcp/here", "/etc/zenoh.json5", "zenoh.json5", "tcp", ""] {
            assert!(!is_endpoint(path), "{path}");
        }
    }

    #[test]
    fn what_is_neither_is_told() {
        for wrong in ["nowhere.json5", "tcp/"] {
            let fault = config(wrong, Role::Listen, true).expect_err(wrong);
            assert_eq!(fault.kind, FaultKind::Senseless, "{fault}");
        }
        assert!(config("tcp/127.0.0.1:0", Role::Connect, false).is_ok());
    }

    #[test]
    fn memory_is_shared_where_it_is_wanted_and_allowed() {
        for (wanted, allowed) in [(true, true), (true, false), (false, true), (false, false)] {
            let config = config("tcp/127.0.0.1:0", Role::Listen, wanted).expect("well formed");
            let config = within_limits(config, allowed).expect("known");
            assert_eq!(config.get_json(SHARED_MEMORY).expect("known"), (wanted && allowed).to_string());
        }
        // A file that says nothing of it wants it.
        let config = within_limits(Config::default(), false).expect("known");
        assert_eq!(config.get_json(SHARED_MEMORY).expect("known"), "false");
    }
}
