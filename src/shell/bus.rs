//! The Zenoh door: frames in, estimates out, queries answered, presence told.
//!
//! Zenoh's threads only put what comes into its place; everything is computed on the service's workers. Nothing here waits for a
//! reader: what cannot be sent at once is dropped, as the next estimate is worth more.

pub mod asyncapi;
mod bodies;
mod camera;
pub mod keys;
pub mod network;
mod payload;
mod queries;
pub mod ros;
pub mod shared;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use futures_util::FutureExt;
use futures_util::future::BoxFuture;
use tokio::runtime::Handle;
use tokio::task::JoinHandle;
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::query::Queryable;

use super::fault::{Fault, FaultKind};
use super::service::Service;
use super::service::hub::{Arrival, Camera};
use camera::{arrival, publish};
use keys::{Keys, Topic};
use network::{Role, join};

/// How often it is looked whether this process has changed a stream.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// How often it is looked whether another has.
const READ_EVERY: Duration = Duration::from_secs(1);
/// A camera for which no stream is stored is listened to no more after this time without a frame.
const FORGOTTEN_AFTER: Duration = Duration::from_mins(1);

/// The service on the network.
#[derive(Debug)]
pub struct Bus {
    session: Session,
    node: String,
    living: JoinHandle<()>,
}

impl Bus {
    /// Joins the network of the settings; nothing where they name none.
    ///
    /// # Errors
    /// If that is not possible.
    #[must_use]
    pub fn open(service: Arc<Service>) -> BoxFuture<'static, Result<Option<Self>, Fault>> {
        async move {
            let settings = &service.settings().zenoh;
            if settings.network.is_empty() {
                return Ok(None);
            }
            let session = join(&settings.network, Role::Listen, settings.shared_memory).await?;
            Self::on(session, service).await.map(Some)
        }
        .boxed()
    }

    /// On a session that is open.
    ///
    /// # Errors
    /// If something cannot be declared.
    pub async fn on(session: Session, service: Arc<Service>) -> Result<Self, Fault> {
        let settings = &service.settings().zenoh;
        let node = service.node().to_owned();
        let house = Arc::new(House {
            session: session.clone(),
            service: Arc::clone(&service),
            keys: Keys::of(settings),
            node: node.clone(),
            cameras: Mutex::default(),
            runtime: Handle::current(),
        });
        let open = Open::declare(&house).await?;
        tracing::info!(network = %settings.network, %node, zid = %session.zid(), "on the network");
        let living = tokio::spawn(house.live(open));
        Ok(Self { session, node, living })
    }

    /// The node's name.
    #[must_use]
    pub fn node(&self) -> &str {
        &self.node
    }

    /// Waits until the service is told to stop and what is declared is taken back; then leaves the network.
    #[must_use]
    pub fn closed(self) -> BoxFuture<'static, ()> {
        async move {
            let _ = self.living.await;
            if let Err(error) = self.session.close().await {
                tracing::debug!(%error, "the network was not left in order");
            }
        }
        .boxed()
    }
}

/// What is declared as long as it is kept.
struct Open {
    _frames: Subscriber<()>,
    _queries: Vec<Queryable<()>>,
    _token: LivelinessToken,
    _ros: ros::Ros,
    _bodies: bodies::Bodies,
}

impl Open {
    async fn declare(house: &Arc<House>) -> Result<Self, Fault> {
        let queries = queries::answer_all(&house.session, &house.service, &house.keys, &house.node).await?;
        let frames = house.keys.camera(&house.node, "*", Topic::Frame)?;
        let listener = Arc::downgrade(house);
        let frames = house
            .session
            .declare_subscriber(frames)
            .callback(move |sample| {
                if let Some(house) = Weak::upgrade(&listener) {
                    house.take(&sample);
                }
            })
            .await
            .map_err(failed)?;
        let token = house.session.liveliness().declare_token(house.keys.alive_node(&house.node)?).await;
        let token = token.map_err(failed)?;
        let ros = ros::Ros::open(house).await?;
        let bodies = bodies::Bodies::open(house).await?;
        Ok(Self { _frames: frames, _queries: queries, _token: token, _ros: ros, _bodies: bodies })
    }
}

/// All cameras of the node.
struct House {
    session: Session,
    service: Arc<Service>,
    keys: Keys,
    node: String,
    cameras: Mutex<HashMap<String, Listened>>,
    runtime: Handle,
}

/// A camera, and what lives as long as it is listened to.
struct Listened {
    camera: Arc<Camera>,
    publishing: JoinHandle<()>,
    token: Option<LivelinessToken>,
}

impl Drop for Listened {
    fn drop(&mut self) {
        self.publishing.abort();
    }
}

impl House {
    /// A frame, on the network's thread.
    fn take(self: &Arc<Self>, sample: &zenoh::sample::Sample) {
        let Some(key) = self.keys.read_camera(sample.key_expr()) else { return };
        self.bring(&key.camera, arrival(sample, self.service.settings().http.max_frame_bytes));
    }

    /// A frame of a camera, on the network's thread.
    fn bring(self: &Arc<Self>, camera: &str, arrival: Result<Arrival, Fault>) {
        let Some(camera) = self.camera(camera) else { return };
        match arrival {
            // Estimates are told to all; nobody waits for this one.
            Ok(arrival) => drop(self.service.take(&camera, arrival)),
            Err(fault) => camera.refuse(&fault),
        }
    }

    /// The camera of this name; nothing where there is no room for one more.
    fn camera(self: &Arc<Self>, name: &str) -> Option<Arc<Camera>> {
        let mut cameras = self.cameras.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(listened) = cameras.get(name) {
            return Some(Arc::clone(&listened.camera));
        }
        let camera = self.service.sender(name)?;
        let listener = self.service.listen(Arc::clone(&camera), None);
        let publishing = publish(listener, self.session.clone(), self.keys.clone(), self.node.clone(), name.into());
        let publishing = self.runtime.spawn(publishing);
        cameras.insert(name.into(), Listened { camera: Arc::clone(&camera), publishing, token: None });
        Some(camera)
    }

    /// Follows the streams that are stored, until the service stops.
    async fn live(self: Arc<Self>, open: Open) {
        let mut stopping = self.service.jobs().stopping();
        let mut changes = None;
        let mut read = Instant::now();
        loop {
            let now = self.service.store().changes();
            if changes != Some(now) || read.elapsed() >= READ_EVERY {
                (changes, read) = (Some(now), Instant::now());
                match self.service.streams().await {
                    Ok(streams) => {
                        self.follow(streams.streams.into_iter().map(|stream| stream.name).collect()).await;
                    }
                    Err(fault) => tracing::warn!(%fault, "the streams cannot be read"),
                }
            }
            tokio::select! {
                () = tokio::time::sleep(LOOK_EVERY) => {}
                _ = stopping.wait_for(|is_stopping| *is_stopping) => break,
            }
        }
        drop(open);
        let ended = std::mem::take(&mut *self.cameras.lock().unwrap_or_else(PoisonError::into_inner));
        drop(ended);
    }

    /// Listens to the cameras of these streams, and says so.
    async fn follow(self: &Arc<Self>, names: Vec<String>) {
        for name in &names {
            let Some(camera) = self.camera(name) else {
                tracing::warn!(camera = %name, "more streams are stored than streams.max_cameras");
                continue;
            };
            if self.has_token(name) {
                continue;
            }
            match self.token(name).await {
                Ok(token) => {
                    let mut cameras = self.cameras.lock().unwrap_or_else(PoisonError::into_inner);
                    if let Some(listened) = cameras.get_mut(name) {
                        listened.token = Some(token);
                        camera.has_news();
                    }
                }
                Err(fault) => tracing::warn!(camera = %name, %fault, "its presence cannot be told"),
            }
        }
        // Taken back after the lock is free: the network's thread may be waiting for it.
        let mut ended = Vec::new();
        let mut cameras = self.cameras.lock().unwrap_or_else(PoisonError::into_inner);
        cameras.retain(|name, listened| {
            if names.contains(name) {
                return true;
            }
            if let Some(token) = listened.token.take() {
                ended.push(token);
                listened.camera.has_news();
            }
            listened.camera.heard().elapsed() < FORGOTTEN_AFTER
        });
        drop(cameras);
        drop(ended);
        self.service.forget_senders(&names);
    }

    fn has_token(&self, name: &str) -> bool {
        let cameras = self.cameras.lock().unwrap_or_else(PoisonError::into_inner);
        cameras.get(name).is_some_and(|listened| listened.token.is_some())
    }

    async fn token(&self, camera: &str) -> Result<LivelinessToken, Fault> {
        let key = self.keys.alive_camera(&self.node, camera)?;
        self.session.liveliness().declare_token(key).await.map_err(failed)
    }
}

#[expect(clippy::needless_pass_by_value, reason = "as a failed call hands it over")]
fn failed(error: zenoh::Error) -> Fault {
    Fault::new(FaultKind::Internal, error.to_string())
}
