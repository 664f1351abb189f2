//! Threads that compute, and the bounded queue before them.
//!
//! Nothing is computed on the threads that talk to the network. A full queue refuses at once; a request whose deadline has
//! passed, or whose client has gone, is dropped when its turn comes; a panic costs one request, not the thread.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use tokio::sync::oneshot;

use crate::detect::Workspace;
use crate::shell::fault::{Fault, FaultKind};

/// Each thread has memory of its own in which frames are looked at, one after the other.
type Job = Box<dyn FnOnce(&mut Workspace) + Send>;

/// The threads. They end when this is dropped and the queue is empty.
#[derive(Debug)]
pub struct Workers {
    queue: SyncSender<Job>,
}

impl Workers {
    /// Starts `threads` threads with room for `waiting` requests before them.
    ///
    /// # Errors
    /// If the machine gives no thread.
    pub fn start(threads: usize, waiting: usize) -> Result<Self, Fault> {
        let (queue, jobs) = sync_channel::<Job>(waiting);
        let jobs = Arc::new(Mutex::new(jobs));
        for number in 0..threads.max(1) {
            let jobs = Arc::clone(&jobs);
            std::thread::Builder::new()
                .name(format!("worker-{number}"))
                .spawn(move || work(&jobs))
                .map_err(|error| Fault::new(FaultKind::Internal, format!("no thread for a worker: {error}")))?;
        }
        Ok(Self { queue })
    }

    /// Runs `task` on a worker.
    ///
    /// # Errors
    /// [`FaultKind::Overloaded`] if the queue is full, [`FaultKind::DeadlineExceeded`], [`FaultKind::Internal`] if the task
    /// panicked.
    pub async fn run<T: Send + 'static>(
        &self,
        deadline: Instant,
        task: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Fault> {
        self.look(deadline, |_| task()).await
    }

    /// As [`run`](Self::run), of a task that looks at a frame, in the worker's memory for that.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub async fn look<T: Send + 'static>(
        &self,
        deadline: Instant,
        task: impl FnOnce(&mut Workspace) -> T + Send + 'static,
    ) -> Result<T, Fault> {
        let (sender, receiver) = oneshot::channel();
        let job: Job = Box::new(move |workspace| {
            metrics::gauge!("skypose_queue_waiting").decrement(1.0);
            if sender.is_closed() || Instant::now() >= deadline {
                return;
            }
            // The task owns what it works on, and the memory is filled anew each time; nothing half changed outlives it.
            let result = catch_unwind(AssertUnwindSafe(|| task(workspace)));
            let _ = sender.send(result);
        });
        metrics::gauge!("skypose_queue_waiting").increment(1.0);
        if let Err(refused) = self.queue.try_send(job) {
            metrics::gauge!("skypose_queue_waiting").decrement(1.0);
            let detail = match refused {
                TrySendError::Full(_) => "all workers are busy and the queue is full",
                TrySendError::Disconnected(_) => "the workers have stopped",
            };
            return Err(Fault::new(FaultKind::Overloaded, detail));
        }
        let late = || Fault::new(FaultKind::DeadlineExceeded, "the request took longer than it may");
        match tokio::time::timeout_at(deadline.into(), receiver).await {
            Ok(Ok(Ok(value))) => Ok(value),
            Ok(Ok(Err(_panic))) => {
                metrics::counter!("skypose_worker_panics_total").increment(1);
                Err(Fault::new(FaultKind::Internal, "the computation failed; this is a fault of ours"))
            }
            // Dropped unanswered: its deadline had passed when its turn came.
            Ok(Err(_)) | Err(_) => Err(late()),
        }
    }
}

fn work(jobs: &Mutex<Receiver<Job>>) {
    let mut workspace = Workspace::default();
    loop {
        // The lock is held while waiting for a job, never while working.
        let job = jobs.lock().unwrap_or_else(PoisonError::into_inner).recv();
        match job {
            Ok(job) => job(&mut workspace),
            Err(_) => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn soon() -> Instant {
        Instant::now() + Duration::from_secs(20)
    }

    #[tokio::test]
    async fn a_panic_costs_one_request_only() {
        let workers = Workers::start(1, 4).expect("starts");
        let failed = workers.run(soon(), || -> u32 { panic!("on purpose") }).await;
        assert_eq!(failed.expect_err("panicked").kind, FaultKind::Internal);
        assert_eq!(workers.run(soon(), || 7).await, Ok(7));
    }

    #[tokio::test]
    async fn a_full_queue_refuses_at_once_and_recovers() {
        let workers = Workers::start(1, 1).expect("starts");
        let (release, gate) = std::sync::mpsc::channel::<()>();
        let (started, has_started) = oneshot::channel();
        let blocking = workers.run(soon(), move || {
            let _ = started.send(());
            let _ = gate.recv();
        });
        let waiting = async {
            has_started.await.expect("the worker is at it");
            let waiting = workers.run(soon(), || 1);
            let refused = async {
                let refused = workers.run(soon(), || 2).await;
                release.send(()).expect("still blocked");
                refused
            };
            tokio::join!(waiting, refused)
        };
        let (_, (waited, refused)) = tokio::join!(blocking, waiting);
        assert_eq!(waited, Ok(1));
        assert_eq!(refused.expect_err("full").kind, FaultKind::Overloaded);
        assert_eq!(workers.run(soon(), || 3).await, Ok(3));
    }

    #[tokio::test]
    async fn what_is_too_late_is_not_even_begun() {
        let workers = Workers::start(1, 4).expect("starts");
        let late = workers.run(Instant::now(), || panic!("begun")).await;
        assert_eq!(late.expect_err("late").kind, FaultKind::DeadlineExceeded);
    }
}
