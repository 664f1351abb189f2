//! One camera: room for its newest frame, what has become of the others, what is told of it.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use tokio::sync::{oneshot, watch};

use super::arrival::{Answered, Arrival};
use super::log::Log;
use super::memory::Memory;
use super::now_us;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::Problem;
use crate::shell::wire::swarm::CameraStatus;

/// What became of a frame.
pub(super) type Outcome = Result<Arc<Answered>, Fault>;

/// A camera whose frames are taken.
#[derive(Debug)]
pub struct Camera {
    name: String,
    slot: Mutex<Slot>,
    status: Mutex<CameraStatus>,
    log: Mutex<Log>,
    /// Number of what is told next.
    told: watch::Sender<u64>,
    /// Rises with everything that its status should tell soon.
    news: watch::Sender<u64>,
    heard: Mutex<Instant>,
    /// What is remembered from frame to frame; held by the frame in work, even if nobody waits for it any more.
    pub(super) memory: Arc<tokio::sync::Mutex<Memory>>,
}

/// The newest frame that has not had its turn, and whether somebody is at work and will take it.
#[derive(Debug, Default)]
struct Slot {
    waiting: Option<Waiting>,
    is_at_work: bool,
}

/// A frame, and who wants to know what becomes of it.
pub(super) struct Waiting {
    pub(super) arrival: Arrival,
    pub(super) told: oneshot::Sender<Outcome>,
}

impl std::fmt::Debug for Waiting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Waiting").field("place", &self.arrival.place).finish_non_exhaustive()
    }
}

impl Camera {
    pub(super) fn new(name: &str, kept_bytes: usize) -> Self {
        let first = u64::try_from(now_us()).unwrap_or(0).max(1);
        Self {
            name: name.into(),
            slot: Mutex::default(),
            status: Mutex::new(CameraStatus { camera: name.into(), ..CameraStatus::default() }),
            log: Mutex::new(Log::new(first, kept_bytes)),
            told: watch::Sender::new(first),
            news: watch::Sender::default(),
            heard: Mutex::new(Instant::now()),
            memory: Arc::default(),
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// When the last frame came.
    #[must_use]
    pub fn heard(&self) -> Instant {
        *self.heard.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What has become of its frames so far.
    pub(super) fn counts(&self) -> CameraStatus {
        self.status().clone()
    }

    /// Its status has changed, and is told soon.
    pub fn has_news(&self) {
        self.news.send_modify(|count| *count = count.wrapping_add(1));
    }

    pub(super) fn news(&self) -> watch::Receiver<u64> {
        self.news.subscribe()
    }

    pub(super) fn told(&self) -> watch::Receiver<u64> {
        self.told.subscribe()
    }

    pub(super) fn log(&self) -> MutexGuard<'_, Log> {
        self.log.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn status(&self) -> MutexGuard<'_, CameraStatus> {
        self.status.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn slot(&self) -> MutexGuard<'_, Slot> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a frame in the place of one that still waits. True if nobody is at work: then the caller has to see to it.
    pub(super) fn put(&self, waiting: Waiting) -> bool {
        *self.heard.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
        self.counted(|status| {
            status.arrived(waiting.arrival.place.note.sequence);
            status.shared += u64::from(waiting.arrival.is_shared);
        });
        let (before, was_at_work) = {
            let mut slot = self.slot();
            (slot.waiting.replace(waiting), std::mem::replace(&mut slot.is_at_work, true))
        };
        if let Some(before) = before {
            let fault = Fault::new(FaultKind::Replaced, "a newer frame of the camera came before this one's turn");
            self.settle(before.told, Err(fault));
        }
        !was_at_work
    }

    /// The frame whose turn it is. Nothing if none waits: then nobody is at work any more.
    pub(super) fn next(&self) -> Option<Waiting> {
        let mut slot = self.slot();
        let next = slot.waiting.take();
        slot.is_at_work = next.is_some();
        next
    }

    /// A frame came that is none.
    pub fn refuse(&self, fault: &Fault) {
        *self.heard.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
        self.counted(|status| {
            status.arrived(None);
            status.lost_to(fault);
        });
    }

    /// Counts what became of a frame, and tells who has brought it.
    pub(super) fn settle(&self, told: oneshot::Sender<Outcome>, outcome: Result<Answered, Fault>) {
        let outcome = outcome.map(|answered| {
            let mut log = self.log();
            let answered = log.push(answered);
            let next = log.next();
            drop(log);
            self.counted(|status| {
                status.published += 1;
                status.problem = None;
            });
            self.told.send_replace(next);
            answered
        });
        if let Err(fault) = &outcome {
            self.counted(|status| status.lost_to(fault));
        }
        // Who has brought it may not care.
        let _ = told.send(outcome);
    }

    /// Counts; what it says of losses is told soon.
    fn counted(&self, change: impl FnOnce(&mut CameraStatus)) {
        let mut status = self.status();
        let losses = status.losses();
        change(&mut status);
        let is_news = status.losses() != losses;
        drop(status);
        if is_news {
            self.has_news();
        }
    }

    #[cfg(test)]
    pub(super) fn silent_for(&self, span: std::time::Duration) {
        *self.heard.lock().expect("whole") = Instant::now().checked_sub(span).expect("the machine runs for longer");
    }
}

impl CameraStatus {
    /// A frame of which nothing comes, for this reason.
    fn lost_to(&mut self, fault: &Fault) {
        match fault.kind {
            FaultKind::Replaced => self.replaced += 1,
            FaultKind::TooOld => self.too_old += 1,
            FaultKind::DeadlineExceeded => self.late += 1,
            kind => {
                if kind.is_passing() || kind == FaultKind::Internal {
                    self.failed += 1;
                } else {
                    self.refused += 1;
                }
                self.problem = Some(Problem::from(fault));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::service::hub::memory::Seeing;
    use crate::shell::wire::swarm::FrameNote;

    fn waiting(sequence: u64) -> (Waiting, oneshot::Receiver<Outcome>) {
        let (told, hears) = oneshot::channel();
        let note = FrameNote { sequence: Some(sequence), ..FrameNote::default() };
        (Waiting { arrival: Arrival::now(note, bytes::Bytes::new), told }, hears)
    }

    #[test]
    fn the_newest_wins_and_the_others_hear_of_it() {
        let camera = Camera::new("front", 1 << 20);
        let (first, mut first_hears) = waiting(1);
        let (second, mut second_hears) = waiting(3);
        assert!(camera.put(first), "nobody is at work");
        assert!(!camera.put(second), "somebody is");
        let heard = first_hears.try_recv().expect("told").expect_err("replaced");
        assert_eq!(heard.kind, FaultKind::Replaced);
        let turn = camera.next().expect("one waits");
        assert_eq!(turn.arrival.place.note.sequence, Some(3));
        camera
            .settle(turn.told, Ok(turn.arrival.place.answered(Seeing { estimate: "{}".into(), ..Seeing::default() })));
        assert_eq!(second_hears.try_recv().expect("told").expect("answered").estimate().1, "{}");
        assert!(camera.next().is_none());
        assert!(camera.put(waiting(4).0), "nobody is at work again");
        let status = camera.counts();
        assert_eq!((status.received, status.published, status.replaced, status.lost), (3, 1, 1, 1));
    }

    #[test]
    fn frames_in_shared_memory_are_counted_beside() {
        let camera = Camera::new("front", 1 << 20);
        for (sequence, is_shared) in [(1, true), (2, false), (3, true)] {
            let (frame, _) = waiting(sequence);
            camera.put(Waiting { arrival: frame.arrival.shared(is_shared), ..frame });
        }
        let status = camera.counts();
        assert_eq!((status.received, status.shared), (3, 2));
    }

    #[test]
    fn every_frame_is_counted_once() {
        let camera = Camera::new("front", 1 << 20);
        let news = camera.news();
        for kind in [
            FaultKind::TooOld,
            FaultKind::DeadlineExceeded,
            FaultKind::Overloaded,
            FaultKind::Internal,
            FaultKind::NotAFrame,
        ] {
            camera.put(waiting(0).0);
            let turn = camera.next().expect("one waits");
            camera.settle(turn.told, Err(Fault::new(kind, "so")));
        }
        camera.refuse(&Fault::new(FaultKind::TooLarge, "so"));
        let status = camera.counts();
        assert_eq!(
            (status.received, status.too_old, status.late, status.failed, status.refused, status.losses()),
            (6, 1, 1, 2, 2, 6)
        );
        assert_eq!(status.problem.map(|problem| problem.status), Some(413));
        assert_eq!(*news.borrow(), 6);
    }
}
