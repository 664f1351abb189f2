//! The way of a frame through the service.

use std::sync::Arc;
use std::time::Instant;

use tokio::sync::oneshot;
use tokio::time::timeout_at;

use super::arrival::{Answered, Arrival};
use super::camera::{Camera, Outcome, Waiting};
use super::listener::Listener;
use super::now_us;
use super::settings::StreamTask;
use crate::detect::Workspace;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::Service;
use crate::shell::service::compute::Terms;
use crate::shell::service::told::Told;
use crate::shell::wire::swarm::CameraStatus;

impl Service {
    /// The camera that sends under this name; nothing where there is no room for one more.
    #[must_use]
    pub fn sender(&self, name: &str) -> Option<Arc<Camera>> {
        self.hub.camera(name)
    }

    /// The camera of a stream that is stored.
    ///
    /// # Errors
    /// If none is stored under this name, or there is no room for one more.
    pub async fn stored_sender(&self, name: &str) -> Result<Arc<Camera>, Fault> {
        self.stream(name).await?;
        if let Some(camera) = self.sender(name) {
            return Ok(camera);
        }
        let stored: Vec<String> = self.streams().await?.streams.into_iter().map(|stream| stream.name).collect();
        self.forget_senders(&stored);
        self.sender(name).ok_or_else(|| {
            let most = self.settings.streams.max_cameras;
            Fault::new(FaultKind::Overloaded, format!("{most} cameras send already, and no more are accepted"))
        })
    }

    /// Forgets cameras that are not among those stored and that have sent nothing for long.
    pub fn forget_senders(&self, stored: &[String]) {
        self.hub.forget(|name| stored.iter().any(|stored| stored == name));
    }

    /// Takes a frame of a camera in the place of one that still waits, and tells what becomes of it to who wants to know. Nothing is
    /// computed here.
    pub fn take(self: &Arc<Self>, camera: &Arc<Camera>, arrival: Arrival) -> oneshot::Receiver<Outcome> {
        let (told, hears) = oneshot::channel();
        if camera.put(Waiting { arrival, told }) {
            let (service, camera) = (Arc::clone(self), Arc::clone(camera));
            self.hub.runtime.spawn(async move {
                while let Some(Waiting { arrival, told }) = camera.next() {
                    let outcome = service.look(&camera, arrival).await;
                    camera.settle(told, outcome);
                }
            });
        }
        hears
    }

    /// What a frame shows whose turn it is.
    async fn look(&self, camera: &Camera, arrival: Arrival) -> Result<Answered, Fault> {
        let Arrival { frame, place, .. } = arrival;
        let deadline = place.deadline(self.settings.streams.max_age())?;
        let terms = Terms::of(&self.settings);
        let stream = self.stream(camera.name()).await?;
        let task = StreamTask::checked(camera.name(), stream, &place.note, &self.lookup(), &self.settings).await?;
        let taken_us = place.taken_us();
        let late = |detail| Fault::new(FaultKind::DeadlineExceeded, detail);
        // Before the frame is given to a worker: none of them waits for an earlier frame that takes too long.
        let memory = timeout_at(deadline.into(), Arc::clone(&camera.memory).lock_owned()).await;
        let mut memory = memory.map_err(|_| late("the frame was too old before the one before it was done"))?;
        let track = task.track;
        let work = move |workspace: &mut Workspace| {
            // Should the work fail by a fault of ours, nothing half changed is left.
            let mut before = std::mem::take(&mut *memory);
            let seeing = before.see(&frame(), &task, taken_us, &terms, workspace);
            *memory = before;
            seeing
        };
        let mut seeing = match self.workers.look(deadline, work).await {
            Err(fault) if fault.kind == FaultKind::DeadlineExceeded => {
                return Err(late("the frame was too old before its turn on a worker was over"));
            }
            done => done??,
        };
        // A moment that is too old to be answered was seen nevertheless.
        self.saw(camera.name(), taken_us, &std::mem::take(&mut seeing.followed), &track);
        if Instant::now() > deadline {
            return Err(late("the frame was too old when its estimate was there"));
        }
        self.tell(Told {
            camera: camera.name().into(),
            timestamp_us: place.note.timestamp_us,
            received_us: place.at_us,
            targets: std::mem::take(&mut seeing.targets),
        });
        Ok(place.answered(seeing))
    }

    /// What has become of a camera's frames.
    pub async fn sender_status(&self, camera: &Camera) -> CameraStatus {
        CameraStatus {
            node: self.node.clone(),
            has_stream: self.stream(camera.name()).await.is_ok(),
            time_us: now_us(),
            ..camera.counts()
        }
    }

    /// Hears what is told of a camera from now on, or after the number that was heard last.
    #[must_use]
    pub fn listen(self: &Arc<Self>, camera: Arc<Camera>, last: Option<u64>) -> Listener {
        Listener::new(Arc::clone(self), camera, last)
    }

    /// As [`listen`](Self::listen), for somebody outside.
    ///
    /// # Errors
    /// [`FaultKind::Overloaded`] if as many listen as may.
    pub fn listen_outside(self: &Arc<Self>, camera: Arc<Camera>, last: Option<u64>) -> Result<Listener, Fault> {
        let place = self.hub.place().ok_or_else(|| {
            let most = self.settings.streams.max_readers;
            Fault::new(FaultKind::Overloaded, format!("{most} are told already what cameras see, and no more may be"))
        })?;
        Ok(self.listen(camera, last).at(place))
    }
}
