//! The network on which nodes of a swarm speak.

use serde::{Deserialize, Serialize};

use super::NAME;
use crate::shell::store::check_name;

/// The swarm side.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct ZenohSettings {
    /// An endpoint to listen on as a peer, or a Zenoh configuration file; empty is no Zenoh.
    pub network: String,
    /// What all keys begin with.
    pub prefix: String,
    /// The group of nodes that this one belongs to.
    pub group: String,
    /// The node's name; empty takes the machine's.
    pub node: String,
    /// Queries being answered at a time; further ones are refused.
    pub max_queries: usize,
    /// Shared memory with others on this machine, where an endpoint is given and the process may lock it; a file says it itself.
    pub shared_memory: bool,
}

impl Default for ZenohSettings {
    fn default() -> Self {
        Self {
            network: String::new(),
            prefix: "skypose/v1".into(),
            group: "default".into(),
            node: String::new(),
            max_queries: 16,
            shared_memory: true,
        }
    }
}

impl ZenohSettings {
    /// The node's name, or else the machine's.
    #[must_use]
    pub fn node_name(&self) -> String {
        if self.node.is_empty() { machine_name() } else { self.node.clone() }
    }

    pub(super) fn faults(&self, need: &mut impl FnMut(bool, &str, &str)) {
        need((1..=1024).contains(&self.max_queries), "zenoh.max_queries", "must be from 1 to 1024");
        need(check_name(&self.group).is_ok(), "zenoh.group", NAME);
        need(self.node.is_empty() || check_name(&self.node).is_ok(), "zenoh.node", NAME);
        let is_prefix = self.prefix.split('/').all(|part| check_name(part).is_ok());
        need(is_prefix && self.prefix.len() <= 256, "zenoh.prefix", "must be names with slashes between");
    }
}

/// The machine's name as a node's, as far as it can be one.
fn machine_name() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let is_good = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    let name: String = name.trim().chars().map(|c| if is_good(c) { c } else { '-' }).collect();
    let name: String = name.trim_start_matches(|c: char| !c.is_ascii_alphanumeric()).chars().take(64).collect();
    if name.is_empty() { "node".into() } else { name }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_machine_has_a_name() {
        assert!(check_name(&machine_name()).is_ok());
    }
}
