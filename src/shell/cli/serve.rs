//! `skypose serve`.

use std::net::SocketAddr;
use std::sync::Arc;

use clap::Args;

use super::{SettingsArgs, Stop};
#[cfg(feature = "zenoh")]
use crate::shell::bus::Bus;
use crate::shell::config::Storage;
use crate::shell::console::print_line;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::http::App;
use crate::shell::http::server::{Server, take};
#[cfg(feature = "mavlink")]
use crate::shell::mavlink::Mavlink;
use crate::shell::service::Service;
use crate::shell::telemetry;

#[derive(Args, Debug)]
pub(super) struct Serve {
    #[command(flatten)]
    settings: SettingsArgs,
    /// Address and port to listen on; port 0 takes a free one [default: 127.0.0.1:8080].
    #[arg(long, value_name = "ADDRESS")]
    listen: Option<SocketAddr>,
    /// Database that several servers share, as `postgres://user@host/database` [default: a file under the data folder].
    #[arg(long, value_name = "ADDRESS")]
    storage: Option<Storage>,
    /// Name of this node on the network [default: the machine's].
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
    /// Join a Zenoh network: an endpoint as `tcp/127.0.0.1:7447` to listen on, or a Zenoh configuration file [default: none].
    #[arg(long, value_name = "ENDPOINT|FILE")]
    zenoh: Option<String>,
}

/// Built without Zenoh.
#[cfg(not(feature = "zenoh"))]
struct Bus;

#[cfg(not(feature = "zenoh"))]
impl Bus {
    #[expect(clippy::unused_async, reason = "stands for what waits")]
    async fn open(service: Arc<Service>) -> Result<Option<Self>, Fault> {
        if service.settings().zenoh.network.is_empty() {
            return Ok(None);
        }
        Err(Fault::new(FaultKind::Senseless, "zenoh.network: this program was built without Zenoh"))
    }

    #[expect(clippy::unused_async, reason = "stands for what waits")]
    async fn closed(self) {}
}

/// Built without MAVLink.
#[cfg(not(feature = "mavlink"))]
struct Mavlink;

#[cfg(not(feature = "mavlink"))]
impl Mavlink {
    #[expect(clippy::unused_async, reason = "stands for what waits")]
    async fn open(service: &Arc<Service>) -> Result<Option<Self>, Fault> {
        if service.settings().mavlink.address.is_empty() {
            return Ok(None);
        }
        Err(Fault::new(FaultKind::Senseless, "mavlink.address: this program was built without MAVLink"))
    }

    #[expect(clippy::unused_async, reason = "stands for what waits")]
    async fn closed(self) {}
}

impl Serve {
    pub(super) fn run(self) -> Result<(), Stop> {
        let listen = self.listen.map(|address| ("http.listen", address.to_string()));
        let storage = self.storage.map(|address| ("store.storage", address.expose().to_owned()));
        let node = self.node.map(|node| ("zenoh.node", node));
        let network = self.zenoh.map(|network| ("zenoh.network", network));
        let settings = self.settings.load(listen.into_iter().chain(storage).chain(node).chain(network).collect())?;
        telemetry::start_logging(&settings.log);
        telemetry::metrics();
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))?;
        runtime.block_on(async {
            let listen = settings.http.listen;
            // First the address: a service that cannot be reached must not begin with the jobs that are left.
            let listener = take(listen)
                .map_err(|error| Fault::new(FaultKind::Internal, format!("cannot listen on {listen}: {error}")))?;
            let app = App::new(Service::start(settings).await?);
            let bus = Bus::open(Arc::clone(&app.service)).await?;
            let mavlink = Mavlink::open(&app.service).await?;
            let server = Server::on(listener, app);
            server.stopper().stop_on_signal()?;
            print_line(&format!("listening on http://{}", server.address()?))?;
            server.run().await?;
            if let Some(bus) = bus {
                bus.closed().await;
            }
            if let Some(mavlink) = mavlink {
                mavlink.closed().await;
            }
            tracing::info!("stopped");
            Ok(())
        })
    }
}
