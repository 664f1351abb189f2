//! `skypose serve`.

use std::net::SocketAddr;

use clap::Args;

use super::{SettingsArgs, Stop};
use crate::shell::config::Storage;
use crate::shell::console::print_line;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::http::App;
use crate::shell::http::server::{Server, take};
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
}

impl Serve {
    pub(super) fn run(self) -> Result<(), Stop> {
        let listen = self.listen.map(|address| ("http.listen", address.to_string()));
        let storage = self.storage.map(|address| ("store.storage", address.expose().to_owned()));
        let settings = self.settings.load(listen.into_iter().chain(storage).collect())?;
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
            let server = Server::on(listener, App::new(Service::start(settings).await?));
            server.stopper().stop_on_signal()?;
            print_line(&format!("listening on http://{}", server.address()?))?;
            server.run().await?;
            tracing::info!("stopped");
            Ok(())
        })
    }
}
