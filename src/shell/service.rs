//! What all doors, HTTP, Zenoh and the command line, ask for: names looked up, work done on the workers, replies made.

pub mod calibration;
pub mod compute;
mod drawing;
pub mod encounters;
pub mod evaluation;
pub mod hub;
pub mod jobs;
pub mod lookup;
pub mod recorded;
pub mod sequences;
pub mod swarm;
pub mod told;
pub mod tracks;
pub mod workers;

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use futures_util::FutureExt;
use futures_util::future::BoxFuture;
use serde_json::json;
use tokio::sync::OwnedMutexGuard;

use super::config::Settings;
use super::fault::Fault;
use super::store::jobs::Job;
use super::store::{Kind as Thing, Store, Stored};
use super::wire::swarm::FrameNote;
use super::wire::{
    AskedEvaluation, AssessmentReply, AssessmentRequest, Cameras, DetectionReply, EncounterReply, EncounterRequest,
    EstimateReply, FrameRequest, NamedCamera, NamedStream, OneOrManyReplies, PoseBatch, PoseReplies, PoseReply,
    PoseRequest, StreamWire, Streams, Targets, from_json, from_value,
};
use calibration::CalibrationKind;
use compute::{Seen, Terms};
use evaluation::{EVALUATION, EvaluationKind};
use hub::{Hub, StreamTask};
use jobs::{Jobs, Kind};
use lookup::{Known, Lookup};
use recorded::job::RecordedTerms;
use sequences::Sequences;
use swarm::Swarm;
use tokio::sync::broadcast;
use told::Told;
use workers::Workers;

use crate::detect::{Watch, Workspace};

/// The service without its doors.
#[derive(Debug)]
pub struct Service {
    settings: Settings,
    store: Store,
    workers: Workers,
    sequences: Sequences,
    hub: Hub,
    /// The name by which others know this node.
    node: String,
    jobs: Jobs,
    known: Arc<Known>,
    told: broadcast::Sender<Arc<Told>>,
    swarm: Swarm,
}

impl Service {
    /// Opens the store and starts the workers.
    ///
    /// # Errors
    /// If the store cannot be opened or a thread cannot be started.
    #[must_use]
    pub fn start(settings: Settings) -> BoxFuture<'static, Result<Self, Fault>> {
        async move {
            let calibrations = CalibrationKind { limits: settings.frames.limits() };
            let recorded =
                RecordedTerms { terms: Terms::of(&settings), max_unpacked_bytes: settings.jobs.max_upload_bytes };
            let evaluations = EvaluationKind { recorded };
            Self::with_kinds(settings, vec![Arc::new(calibrations), Arc::new(evaluations)]).await
        }
        .boxed()
    }

    /// The same with these kinds of jobs.
    ///
    /// # Errors
    /// If the store cannot be opened or a thread cannot be started.
    #[must_use]
    pub fn with_kinds(settings: Settings, kinds: Vec<Arc<dyn Kind>>) -> BoxFuture<'static, Result<Self, Fault>> {
        async move {
            let store = Store::connect(&settings.store).await?;
            let workers = Workers::start(settings.workers.thread_count(), settings.workers.queue)?;
            let sequences =
                Sequences::new(settings.sequences.most, settings.sequences.in_use(), settings.sequences.idle());
            let jobs = Jobs::start(&settings.jobs, &settings.store.data, &store, kinds).await?;
            let (hub, node) = (Hub::new(&settings.streams), settings.zenoh.node_name());
            let told = broadcast::Sender::new(told::MOST_WAITING);
            let swarm = Swarm::new(&settings.swarm);
            Ok(Self { settings, store, workers, sequences, hub, node, jobs, known: Arc::default(), told, swarm })
        }
        .boxed()
    }

    /// The settings.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The name by which others know this node.
    #[must_use]
    pub fn node(&self) -> &str {
        &self.node
    }

    /// The store.
    #[must_use]
    pub const fn store(&self) -> &Store {
        &self.store
    }

    /// Long work.
    #[must_use]
    pub const fn jobs(&self) -> &Jobs {
        &self.jobs
    }

    /// Whether requests can be answered.
    pub async fn is_ready(&self) -> bool {
        self.store.is_ready().await
    }

    /// Waits for the steps of jobs that were begun, and closes the store.
    pub async fn close(&self) {
        self.jobs.drain(Duration::from_millis(self.settings.http.drain_ms)).await;
        self.store.close().await;
    }

    /// Tells all doors what a frame of a camera shows.
    pub fn tell(&self, told: Told) {
        // Nobody has to listen.
        let _ = self.told.send(Arc::new(told));
    }

    /// Hears what frames of cameras show from now on.
    #[must_use]
    pub fn hear(&self) -> broadcast::Receiver<Arc<Told>> {
        self.told.subscribe()
    }

    fn lookup(&self) -> Lookup<'_> {
        Lookup::new(Some(&self.store), self.known.clone())
    }

    /// The stored cameras.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn cameras(&self) -> Result<Cameras, Fault> {
        let named = |s: Stored| Ok(NamedCamera { camera: from_json(s.body.as_bytes())?, name: s.name });
        let cameras: Result<_, Fault> = self.store.list(Thing::Camera).await?.into_iter().map(named).collect();
        Ok(Cameras { cameras: cameras? })
    }

    /// The stored targets.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn targets(&self) -> Result<Targets, Fault> {
        let target = |s: Stored| from_json(s.body.as_bytes());
        let targets: Result<_, Fault> = self.store.list(Thing::Target).await?.into_iter().map(target).collect();
        Ok(Targets { targets: targets? })
    }

    /// The stored streams.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn streams(&self) -> Result<Streams, Fault> {
        let named = |s: Stored| Ok(NamedStream { stream: from_json(s.body.as_bytes())?, name: s.name });
        let streams: Result<_, Fault> = self.store.list(Thing::Stream).await?.into_iter().map(named).collect();
        Ok(Streams { streams: streams? })
    }

    /// What is looked for in the frames of a camera.
    ///
    /// # Errors
    /// If nothing is stored for it, or the store cannot be read.
    pub async fn stream(&self, camera: &str) -> Result<StreamWire, Fault> {
        self.lookup().stream(camera).await
    }

    /// Whether a stream makes sense, and what it names is stored.
    ///
    /// # Errors
    /// Names the field.
    pub async fn check_stream(&self, stream: &StreamWire) -> Result<(), Fault> {
        let note = FrameNote::default();
        StreamTask::checked("checked", stream.clone(), &note, &self.lookup(), &self.settings).await.map(|_| ())
    }

    /// Points to pose.
    ///
    /// # Errors
    /// What is wrong with the request, or that the service is full.
    pub async fn pose(&self, request: PoseRequest, deadline: Instant) -> Result<PoseReply, Fault> {
        let terms = Terms::of(&self.settings);
        let task = compute::PoseTask::checked(request, &self.lookup(), &terms).await?;
        self.workers.run(deadline, move || task.reply(&terms)).await
    }

    /// Points to pose, one request or many as `{"requests": [...]}`.
    ///
    /// # Errors
    /// As [`pose`](Self::pose) or [`poses`](Self::poses).
    pub async fn points(&self, body: serde_json::Value, deadline: Instant) -> Result<OneOrManyReplies, Fault> {
        if body.get("requests").is_some() {
            let batch: PoseBatch = from_value(body)?;
            return Ok(OneOrManyReplies::Many(self.poses(batch.requests, deadline).await?));
        }
        Ok(OneOrManyReplies::One(Box::new(self.pose(from_value(body)?, deadline).await?)))
    }

    /// Many requests at once; a request that fails harms no other.
    ///
    /// # Errors
    /// Too many of them, or that the service is full.
    pub async fn poses(&self, requests: Vec<serde_json::Value>, deadline: Instant) -> Result<PoseReplies, Fault> {
        let limit = self.settings.http.max_batch;
        if requests.len() > limit {
            let detail = format!("{} requests in one body: at most {limit} are accepted", requests.len());
            return Err(Fault::new(super::fault::FaultKind::TooLarge, detail));
        }
        let terms = Terms::of(&self.settings);
        let lookup = self.lookup();
        let mut tasks = Vec::with_capacity(requests.len());
        for request in requests {
            tasks.push(compute::BatchItem::read(request, &lookup, &terms).await);
        }
        self.workers.run(deadline, move || compute::batch(tasks, &terms)).await
    }

    /// What a constellation is good for.
    ///
    /// # Errors
    /// What is wrong with the request, or that the service is full.
    pub async fn assessment(&self, request: AssessmentRequest, deadline: Instant) -> Result<AssessmentReply, Fault> {
        let task = compute::AssessmentTask::checked(request, &self.lookup(), &Terms::of(&self.settings)).await?;
        self.workers.run(deadline, move || task.reply()).await
    }

    /// How early another aircraft must be seen, and whether a camera can do it.
    ///
    /// # Errors
    /// What is wrong with the request, or that the service is full.
    pub async fn encounter(&self, request: EncounterRequest, deadline: Instant) -> Result<EncounterReply, Fault> {
        let task = compute::EncounterTask::checked(request, &self.lookup(), &Terms::of(&self.settings)).await?;
        self.workers.run(deadline, move || task.reply()).await?
    }

    /// Begins an evaluation.
    ///
    /// # Errors
    /// What is wrong with the request, or that the service is full.
    pub async fn evaluation(
        &self,
        request: AskedEvaluation,
        key: Option<String>,
        deadline: Instant,
    ) -> Result<Job, Fault> {
        let request = match request {
            AskedEvaluation::Study(request) => {
                AskedEvaluation::Study(Box::new(evaluation::resolved(*request, &self.lookup()).await?))
            }
            AskedEvaluation::Encounters(request) => {
                AskedEvaluation::Encounters(Box::new(encounters::resolved(*request, &self.lookup()).await?))
            }
        };
        let asked = request.clone();
        let check = move || match asked {
            AskedEvaluation::Study(request) => evaluation::checked(&request).map(|_| ()),
            AskedEvaluation::Encounters(request) => encounters::checked(&request).map(|_| ()),
        };
        self.workers.run(deadline, check).await??;
        let intake = self.jobs.intake().await?;
        self.jobs.make(EVALUATION, json!(request), intake, key).await
    }

    /// Frame to centroids.
    ///
    /// # Errors
    /// What is wrong with the request, or that the service is full.
    pub async fn detection(
        &self,
        frame: Bytes,
        request: FrameRequest,
        deadline: Instant,
    ) -> Result<DetectionReply, Fault> {
        let terms = Terms::of(&self.settings);
        let task = compute::FrameTask::checked(request, &self.lookup()).await?;
        let mut turn = self.turn(&task, deadline).await?;
        let work = move |workspace: &mut Workspace| {
            let (frame, detection, timing) = task.seen(Seen::Bytes(&frame), &terms, turn.as_deref_mut(), workspace)?;
            Ok(task.detection_reply(&frame, &detection, turn.as_deref(), timing))
        };
        self.workers.look(deadline, work).await?
    }

    /// What is known of the sequence that a frame belongs to, for it alone. The turn ends with the work, so that a worker never waits for
    /// another frame.
    async fn turn(
        &self,
        task: &compute::FrameTask,
        deadline: Instant,
    ) -> Result<Option<OwnedMutexGuard<Watch>>, Fault> {
        match task.sequence() {
            Some(name) => Ok(Some(self.sequences.turn(name, deadline).await?)),
            None => Ok(None),
        }
    }

    /// Frame to centroids and poses.
    ///
    /// # Errors
    /// What is wrong with the request, or that the service is full.
    pub async fn estimate(
        &self,
        frame: Bytes,
        request: FrameRequest,
        deadline: Instant,
    ) -> Result<EstimateReply, Fault> {
        let terms = Terms::of(&self.settings);
        let task = compute::FrameTask::for_estimate(request, &self.lookup()).await?;
        let mut turn = self.turn(&task, deadline).await?;
        let work = move |workspace: &mut Workspace| {
            let seen = Seen::Bytes(&frame);
            let (frame, estimate, timing) = task.estimated(seen, &terms, turn.as_deref_mut(), workspace)?;
            Ok(task.estimate_reply(&frame, &estimate, turn.as_deref(), timing))
        };
        self.workers.look(deadline, work).await?
    }
}
