//! Robots that speak ROS 2: their pictures and intrinsics in, poses out.
//!
//! A picture of a topic goes the way of every frame of its camera, so what it shows is told on the camera's own keys too. A pose is
//! published where it is right to say one: there is one, and no other explains the frame as well, since a message of ROS cannot hold two.

pub mod cdr;
pub mod messages;
pub mod names;

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use tokio::sync::broadcast::error::RecvError;
use tokio::sync::watch;
use tokio::task::JoinHandle;
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::sample::{Sample, SampleKind};

use super::payload::bytes_of;
use super::shared::is_shared;
use super::{House, failed};
use crate::camera::Camera;
use crate::shell::config::{RosCamera, RosForm, RosSettings};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::hub::Arrival;
use crate::shell::service::told::Told;
use crate::shell::store::{Kind, Precondition};
use crate::shell::wire::camera::DistortionWire;
use crate::shell::wire::swarm::FrameNote;
use crate::shell::wire::{CameraWire, PoseWire};
use messages::{CAMERA_INFO, COMPRESSED_IMAGE, CameraInfo, CompressedImage, Header, MessageType, POSE, pose_message};
use names::{Attachment, Node};

/// How often it is looked which targets are stored for a camera, and whether its intrinsics have changed.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Pictures whose stamps are remembered until their poses are there: more than are ever on their way.
const MOST_HEADERS: usize = 64;
/// Largest message with intrinsics, bytes.
const MAX_INFO: usize = 65_536;

/// The cameras of ROS, as long as it is kept.
pub(super) struct Ros {
    _node: Option<LivelinessToken>,
    _cameras: Vec<Open>,
}

/// What is declared of one camera.
struct Open {
    _subscribers: Vec<Subscriber<()>>,
    _tokens: Vec<LivelinessToken>,
    publishing: JoinHandle<()>,
}

impl Drop for Open {
    fn drop(&mut self) {
        self.publishing.abort();
    }
}

/// Our node on the session.
struct Graph {
    session: Session,
    settings: RosSettings,
    node: Node,
    /// Number of the next publisher or subscription; the node itself is 0.
    next: AtomicU32,
}

impl Graph {
    /// Tells others of us, where they listen for it.
    async fn token(&self, key: String) -> Result<Option<LivelinessToken>, Fault> {
        match self.settings.form {
            RosForm::RmwZenoh => self.session.liveliness().declare_token(key).await.map(Some).map_err(failed),
            RosForm::Bridge => Ok(None),
        }
    }

    fn entity(&self) -> u32 {
        self.next.fetch_add(1, Ordering::Relaxed)
    }

    async fn subscribe(
        &self,
        topic: &str,
        of: MessageType,
        take: impl Fn(&Sample) + Send + Sync + 'static,
    ) -> Result<(Subscriber<()>, Option<LivelinessToken>), Fault> {
        let key = names::heard_on(&self.settings, topic, of);
        let callback = move |sample: Sample| {
            if sample.kind() == SampleKind::Put {
                take(&sample);
            }
        };
        let subscriber = self.session.declare_subscriber(key).callback(callback).await.map_err(failed)?;
        let token = self.token(self.node.subscription_token(self.entity(), topic, of)).await?;
        Ok((subscriber, token))
    }
}

impl Ros {
    /// Listens to the cameras of the settings.
    ///
    /// # Errors
    /// If something cannot be declared.
    pub(super) async fn open(house: &Arc<House>) -> Result<Self, Fault> {
        let settings = house.service.settings().ros.clone();
        if settings.cameras.is_empty() {
            return Ok(Self { _node: None, _cameras: Vec::new() });
        }
        let node = Node::new(&settings, &house.session.zid().to_string());
        let graph = Graph { session: house.session.clone(), settings, node, next: AtomicU32::new(1) };
        let graph = Arc::new(graph);
        let node = graph.token(graph.node.token()).await?;
        let mut cameras = Vec::new();
        for camera in &graph.settings.cameras {
            cameras.push(Intake::open(house, &graph, camera).await?);
        }
        Ok(Self { _node: node, _cameras: cameras })
    }
}

/// What comes of one camera.
struct Intake {
    house: Weak<House>,
    settings: RosSettings,
    camera: RosCamera,
    /// Of the pictures that came last, by the stamps that their estimates have.
    headers: Mutex<VecDeque<(Option<i64>, Header)>>,
    intrinsics: watch::Sender<Option<CameraWire>>,
}

impl Intake {
    async fn open(house: &Arc<House>, graph: &Arc<Graph>, camera: &RosCamera) -> Result<Open, Fault> {
        let intake = Arc::new(Self {
            house: Arc::downgrade(house),
            settings: graph.settings.clone(),
            camera: camera.clone(),
            headers: Mutex::default(),
            intrinsics: watch::Sender::new(None),
        });
        let (mut subscribers, mut tokens) = (Vec::new(), Vec::new());
        let taking = Arc::clone(&intake);
        let picture =
            graph.subscribe(&camera.image, COMPRESSED_IMAGE, move |sample| taking.take_picture(sample)).await?;
        let informed = Arc::clone(&intake);
        let info = match camera.camera_info.as_str() {
            "" => None,
            topic => Some(graph.subscribe(topic, CAMERA_INFO, move |sample| informed.take_info(sample)).await?),
        };
        for (subscriber, token) in std::iter::once(picture).chain(info) {
            subscribers.push(subscriber);
            tokens.extend(token);
        }
        let outlets = Outlets { graph: Arc::clone(graph), open: BTreeMap::new() };
        let publishing = house.runtime.spawn(Arc::clone(&intake).live(outlets));
        Ok(Open { _subscribers: subscribers, _tokens: tokens, publishing })
    }

    /// A picture, on the network's thread.
    fn take_picture(&self, sample: &Sample) {
        if let Some(house) = self.house.upgrade() {
            let max_bytes = house.service.settings().http.max_frame_bytes;
            house.bring(&self.camera.camera, self.picture(sample, max_bytes));
        }
    }

    fn picture(&self, sample: &Sample, max_bytes: usize) -> Result<Arrival, Fault> {
        names::check_hash(&self.settings, sample.key_expr().as_str(), COMPRESSED_IMAGE)?;
        let length = sample.payload().len();
        if length > max_bytes {
            let detail = format!("a frame of {length} bytes: at most {max_bytes} are accepted");
            return Err(Fault::new(FaultKind::TooLarge, detail));
        }
        let message = bytes_of(sample.payload());
        let image = CompressedImage::read(&message)?;
        let timestamp_us = image.header.timestamp_us()?;
        let attachment = sample.attachment().and_then(|bytes| Attachment::read(&bytes.to_bytes()));
        let sequence = attachment.and_then(|attachment| u64::try_from(attachment.sequence).ok());
        let data = message.slice_ref(image.data);
        let mut headers = self.headers.lock().unwrap_or_else(PoisonError::into_inner);
        if headers.len() >= MOST_HEADERS {
            headers.pop_front();
        }
        headers.push_back((timestamp_us, image.header));
        drop(headers);
        let note = FrameNote { sequence, timestamp_us, ..FrameNote::default() };
        Ok(Arrival::now(note, move || data).shared(is_shared(sample.payload())))
    }

    /// The header of the picture that an estimate is of.
    fn header(&self, timestamp_us: Option<i64>) -> Option<Header> {
        let headers = self.headers.lock().unwrap_or_else(PoisonError::into_inner);
        headers.iter().rev().find(|(stamp, _)| *stamp == timestamp_us).map(|(_, header)| header.clone())
    }

    /// Intrinsics, on the network's thread.
    fn take_info(&self, sample: &Sample) {
        let read = || {
            names::check_hash(&self.settings, sample.key_expr().as_str(), CAMERA_INFO)?;
            let length = sample.payload().len();
            if length > MAX_INFO {
                let detail = format!("a CameraInfo of {length} bytes: at most {MAX_INFO} are read");
                return Err(Fault::new(FaultKind::TooLarge, detail));
            }
            CameraInfo::read(&bytes_of(sample.payload()))?.camera()
        };
        match read() {
            Ok(camera) => {
                self.intrinsics.send_if_modified(|known| {
                    let is_new = known.as_ref() != Some(&camera);
                    *known = Some(camera);
                    is_new
                });
            }
            Err(fault) => {
                metrics::counter!("skypose_ros_infos_refused_total").increment(1);
                tracing::debug!(topic = %self.camera.camera_info, %fault, "no intrinsics");
            }
        }
    }

    /// Publishes poses and keeps the camera that is stored as ROS tells it, until it is aborted.
    async fn live(self: Arc<Self>, mut outlets: Outlets) {
        let Some(mut told) = self.house.upgrade().map(|house| house.service.hear()) else { return };
        let mut intrinsics = self.intrinsics.subscribe();
        let mut clock = tokio::time::interval(LOOK_EVERY);
        loop {
            let done = tokio::select! {
                heard = told.recv() => match heard {
                    Ok(told) if told.camera == self.camera.camera => self.publish(&told, &mut outlets).await,
                    Ok(_) => Ok(()),
                    Err(RecvError::Lagged(count)) => {
                        tracing::warn!(camera = %self.camera.camera, count, "poses not published: too slow");
                        Ok(())
                    }
                    Err(RecvError::Closed) => return,
                },
                _ = clock.tick() => self.look(&mut outlets).await,
                _ = intrinsics.changed() => self.look(&mut outlets).await,
            };
            if let Err(fault) = done {
                tracing::warn!(camera = %self.camera.camera, %fault, "ROS");
            }
        }
    }

    /// Which targets are stored for the camera, and whether its intrinsics are those that ROS tells.
    async fn look(&self, outlets: &mut Outlets) -> Result<(), Fault> {
        let Some(house) = self.house.upgrade() else { return Ok(()) };
        let stream = match house.service.stream(&self.camera.camera).await {
            Ok(stream) => Some(stream),
            Err(fault) if fault.kind == FaultKind::NotFound => None,
            Err(fault) => return Err(fault),
        };
        let targets: Vec<String> = stream.iter().flat_map(|stream| stream.targets.clone()).collect();
        outlets.keep(targets.iter().map(|target| self.topic(target)).collect()).await?;
        let told = self.intrinsics.borrow().clone();
        let Some(told) = told else { return Ok(()) };
        let name = stream.map_or_else(|| self.camera.camera.clone(), |stream| stream.camera);
        let stored = house.service.store().get(Kind::Camera, &name).await?;
        let known =
            stored.map(|stored| crate::shell::wire::from_json::<CameraWire>(stored.body.as_bytes())).transpose()?;
        // The same numbers may be stored with their covariance, which a CameraInfo does not have: that stays.
        if known.as_ref().is_some_and(|known| numbers(known).as_ref() == Some(&told)) {
            return Ok(());
        }
        let body = serde_json::to_string(&told).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))?;
        house.service.store().put(Kind::Camera, &name, &body, &Precondition::None).await?;
        let was = known.map(|known| [known.fx, known.fy, known.cx, known.cy]);
        let now = [told.fx, told.fy, told.cx, told.cy];
        tracing::info!(camera = %name, topic = %self.camera.camera_info, ?was, ?now, "stored as CameraInfo tells it");
        Ok(())
    }

    fn topic(&self, target: &str) -> String {
        self.camera.pose.replace("{target}", &names::as_part(target))
    }

    async fn publish(&self, told: &Told, outlets: &mut Outlets) -> Result<(), Fault> {
        // What has come another way has no header, and is none of ROS' frames.
        let Some(mut header) = self.header(told.timestamp_us) else { return Ok(()) };
        if !self.camera.frame_id.is_empty() {
            header.frame_id.clone_from(&self.camera.frame_id);
        }
        for target in &told.targets {
            let Some(pose) = target.answer.pose.as_ref().filter(|_| !target.answer.ambiguous) else { continue };
            outlets.send(self.topic(&target.name), &header, pose).await?;
        }
        Ok(())
    }
}

/// Where is published.
struct Outlets {
    graph: Arc<Graph>,
    open: BTreeMap<String, Outlet>,
}

struct Outlet {
    publisher: Publisher<'static>,
    _token: Option<LivelinessToken>,
    gid: [u8; 16],
    /// Number of the message before.
    sequence: i64,
}

impl Outlets {
    /// Has these topics and no others.
    async fn keep(&mut self, topics: Vec<String>) -> Result<(), Fault> {
        self.open.retain(|topic, _| topics.contains(topic));
        for topic in topics {
            if !self.open.contains_key(&topic) {
                let outlet = self.declare(&topic).await?;
                self.open.insert(topic, outlet);
            }
        }
        Ok(())
    }

    async fn declare(&self, topic: &str) -> Result<Outlet, Fault> {
        // As other poses of this service: first, on a link that loses nothing, rather dropped than waited for.
        let publisher = self
            .graph
            .session
            .declare_publisher(names::sent_on(&self.graph.settings, topic, POSE))
            .priority(Priority::RealTime)
            .express(true)
            .congestion_control(CongestionControl::Drop)
            .reliability(Reliability::Reliable)
            .await
            .map_err(failed)?;
        let token = self.graph.node.publisher_token(self.graph.entity(), topic, POSE);
        let gid = Attachment::gid_of(&token);
        Ok(Outlet { publisher, _token: self.graph.token(token).await?, gid, sequence: 0 })
    }

    async fn send(&mut self, topic: String, header: &Header, pose: &PoseWire) -> Result<(), Fault> {
        let form = self.graph.settings.form;
        if !self.open.contains_key(&topic) {
            let outlet = self.declare(&topic).await?;
            self.open.insert(topic.clone(), outlet);
        }
        let Some(outlet) = self.open.get_mut(&topic) else { return Ok(()) };
        outlet.sequence += 1;
        let mut put = outlet.publisher.put(pose_message(header, pose));
        if form == RosForm::RmwZenoh {
            let attachment = Attachment { sequence: outlet.sequence, source_ns: now_ns(), gid: outlet.gid };
            put = put.attachment(attachment.bytes());
        }
        put.await.map_err(failed)
    }
}

/// A camera as a CameraInfo would tell it; nothing if it is none.
fn numbers(camera: &CameraWire) -> Option<CameraWire> {
    let mut plain = CameraWire::from(&Camera::try_from(camera).ok()?);
    plain.parameter_covariance = None;
    if plain.distortion.coefficients.iter().all(|coefficient| *coefficient == 0.0) {
        plain.distortion = DistortionWire::default();
    }
    Some(plain)
}

fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
