//! What commands that join a network have in common.

use clap::Args;

use crate::shell::bus::keys::Keys;
use crate::shell::bus::network::{Role, join};
use crate::shell::config::{ZenohSettings, load};
use crate::shell::fault::{Fault, FaultKind};

/// Where the keys are.
#[derive(Args, Clone, Debug)]
pub(super) struct GroupArgs {
    /// Group of nodes, as in the servers' settings.
    #[arg(long, value_name = "NAME", default_value = "default")]
    group: String,
    /// What all keys begin with, as in the servers' settings.
    #[arg(long, value_name = "KEY", default_value = "skypose/v1")]
    prefix: String,
}

impl GroupArgs {
    /// The keys.
    pub(super) fn keys(&self) -> Result<Keys, Fault> {
        let options = [("zenoh.group", self.group.clone()), ("zenoh.prefix", self.prefix.clone())];
        let settings = load(None, [], &options).map_err(|faults| {
            let list: Vec<String> = faults.iter().map(ToString::to_string).collect();
            Fault::new(FaultKind::Senseless, list.join("; "))
        })?;
        Ok(Keys::of(&settings.zenoh))
    }
}

/// Joins a network as one that listens nowhere.
pub(super) async fn connect(network: &str) -> Result<zenoh::Session, Fault> {
    join(network, Role::Connect, ZenohSettings::default().shared_memory).await
}

/// Zenoh does not run on one thread.
pub(super) fn runtime() -> Result<tokio::runtime::Runtime, Fault> {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))
}
