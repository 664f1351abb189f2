//! Who hears what is told of a camera.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{OwnedSemaphorePermit, watch};
use tokio::time::Instant;

use super::arrival::Answered;
use super::camera::Camera;
use crate::shell::service::Service;
use crate::shell::wire::swarm::{CameraStatus, GapWire};

/// Messages about losses come no closer than this.
const TOLD_EVERY: Duration = Duration::from_millis(100);

/// What is heard of a camera.
#[derive(Debug)]
pub enum Heard {
    /// What a frame showed.
    Answer(Arc<Answered>),
    /// What has become of the frames: now and then, and soon after a loss.
    Status(Box<CameraStatus>),
    /// Something was told that is not kept any more.
    Gap(GapWire),
}

/// Hears what is told of a camera, at its own pace: nobody waits for it, and what it misses it is told.
#[derive(Debug)]
pub struct Listener {
    service: Arc<Service>,
    camera: Arc<Camera>,
    /// Number of what was heard last.
    last: u64,
    told: watch::Receiver<u64>,
    news: watch::Receiver<u64>,
    stopping: watch::Receiver<bool>,
    /// When the status was told last.
    status_at: Option<Instant>,
    /// Whether something has been lost since.
    has_news: bool,
    _place: Option<OwnedSemaphorePermit>,
}

impl Listener {
    pub(super) fn new(service: Arc<Service>, camera: Arc<Camera>, last: Option<u64>) -> Self {
        let (told, news) = (camera.told(), camera.news());
        let last = last.unwrap_or_else(|| camera.log().next() - 1);
        let stopping = service.jobs().stopping();
        Self { service, camera, last, told, news, stopping, status_at: None, has_news: false, _place: None }
    }

    pub(super) fn at(self, place: OwnedSemaphorePermit) -> Self {
        Self { _place: Some(place), ..self }
    }

    /// The next that there is to hear, the status first if it is due; nothing once the service stops and all was heard.
    pub async fn next(&mut self) -> Option<Heard> {
        loop {
            let due = self.status_due();
            if due <= Instant::now() {
                (self.status_at, self.has_news) = (Some(Instant::now()), false);
                return Some(Heard::Status(Box::new(self.service.sender_status(&self.camera).await)));
            }
            // Marked before it is looked: what comes in between is not slept over.
            self.told.mark_unchanged();
            let found = self.camera.log().after(self.last);
            match found {
                Some(Ok(answered)) => {
                    self.last = answered.last_id();
                    return Some(Heard::Answer(answered));
                }
                Some(Err(gap)) => {
                    self.last = gap.next_id - 1;
                    return Some(Heard::Gap(gap));
                }
                None if *self.stopping.borrow() => return None,
                None => {}
            }
            tokio::select! {
                _ = self.told.changed() => {}
                _ = self.news.changed() => self.has_news = true,
                _ = self.stopping.changed() => {}
                () = tokio::time::sleep_until(due) => {}
            }
        }
    }

    fn status_due(&mut self) -> Instant {
        let every = self.service.settings().streams.status();
        if self.news.has_changed().unwrap_or(false) {
            self.news.mark_unchanged();
            self.has_news = true;
        }
        self.status_at.map_or_else(Instant::now, |at| at + if self.has_news { TOLD_EVERY.min(every) } else { every })
    }
}
