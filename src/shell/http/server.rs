//! The life of the process on one screen: bind, serve, drain, stop.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::Ordering;
use std::time::Duration;

use axum_server::Handle;
use futures_util::FutureExt;
use futures_util::future::BoxFuture;
use hyper_util::rt::TokioTimer;

use super::connections::BoundedAcceptor;
use super::{App, router};

/// A bound door, not yet open.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    app: App,
    handle: Handle<SocketAddr>,
}

/// Stops a server from elsewhere.
#[derive(Clone, Debug)]
pub struct Stopper {
    app: App,
    handle: Handle<SocketAddr>,
}

/// Takes an address; who connects waits until a server is on it.
///
/// # Errors
/// If it is taken already or not ours.
pub fn take(address: SocketAddr) -> io::Result<TcpListener> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

impl Server {
    /// Takes the address of the settings.
    ///
    /// # Errors
    /// If it is taken or not ours.
    pub fn bind(app: App) -> io::Result<Self> {
        let listener = take(app.service.settings().http.listen)?;
        Ok(Self::on(listener, app))
    }

    /// On an address that was taken before the service was started.
    #[must_use]
    pub fn on(listener: TcpListener, app: App) -> Self {
        Self { listener, app, handle: Handle::new() }
    }

    /// The address, with the port that was taken.
    ///
    /// # Errors
    /// If the system does not tell.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// What stops it.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        Stopper { app: self.app.clone(), handle: self.handle.clone() }
    }

    /// Serves until stopped, and until the requests under way then are answered.
    ///
    /// # Errors
    /// If the listener fails.
    #[must_use]
    pub fn run(self) -> BoxFuture<'static, io::Result<()>> {
        async move {
            let http = &self.app.service.settings().http;
            let mut server = axum_server::from_tcp(self.listener)?.handle(self.handle);
            let header_timeout = Duration::from_millis(http.header_timeout_ms);
            server.http_builder().http1().timer(TokioTimer::new()).header_read_timeout(header_timeout);
            let acceptor = BoundedAcceptor::new(http.max_connections);
            let service = router(self.app.clone()).into_make_service();
            let result = server.acceptor(acceptor).serve(service).await;
            self.app.service.close().await;
            result
        }
        .boxed()
    }
}

impl Stopper {
    /// Takes no more connections, answers what is under way, and ends; no later than the settings allow.
    pub fn stop(&self) {
        self.app.stopping.store(true, Ordering::Relaxed);
        self.app.service.jobs().stop();
        let drain = Duration::from_millis(self.app.service.settings().http.drain_ms);
        self.handle.graceful_shutdown(Some(drain));
    }

    /// Stops on SIGTERM or SIGINT.
    ///
    /// # Errors
    /// If the signals cannot be listened to.
    pub fn stop_on_signal(self) -> io::Result<()> {
        use tokio::signal::unix::{SignalKind, signal};
        let mut terminate = signal(SignalKind::terminate())?;
        let mut interrupt = signal(SignalKind::interrupt())?;
        tokio::spawn(async move {
            tokio::select! {
                _ = terminate.recv() => {}
                _ = interrupt.recv() => {}
            }
            tracing::info!("stopping: requests under way are answered");
            self.stop();
        });
        Ok(())
    }
}
