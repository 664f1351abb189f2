//! Threads that compute for jobs: few, and of the lowest priority, so that frames go first.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use tokio::sync::{Semaphore, oneshot};

use super::kind::Cancel;
use crate::shell::fault::{Fault, FaultKind};

/// As far down as it goes: such a thread gets one part in seventy of a core that another wants.
const NICENESS: i32 = 19;

/// The places for threads.
#[derive(Debug)]
pub(super) struct Threads {
    places: Arc<Semaphore>,
}

impl Threads {
    pub(super) fn new(most: usize) -> Self {
        Self { places: Arc::new(Semaphore::new(most.max(1))) }
    }

    /// Runs `task` on a thread of its own, once there is a place; gives up waiting for its end when `unwanted` comes first, and
    /// then says so with `None`. A task that does not listen keeps its place until its end.
    pub(super) async fn run<T: Send + 'static>(
        &self,
        task: impl FnOnce(&Cancel) -> Result<T, Fault> + Send + 'static,
        unwanted: impl Future<Output = ()>,
    ) -> Result<Option<T>, Fault> {
        let internal = |detail: String| Fault::new(FaultKind::Internal, detail);
        let Ok(place) = Arc::clone(&self.places).acquire_owned().await else { return Ok(None) };
        let (sender, receiver) = oneshot::channel();
        let cancel = Cancel::default();
        let asked = cancel.clone();
        let compute = move || {
            // One that cannot be lowered is run all the same.
            let _ = rustix::process::setpriority_process(Some(rustix::thread::gettid()), NICENESS);
            // The task owns what it works on; nothing half changed outlives it.
            let result = catch_unwind(AssertUnwindSafe(|| task(&asked)));
            drop(place);
            let _ = sender.send(result);
        };
        std::thread::Builder::new()
            .name("job".into())
            .spawn(compute)
            .map_err(|error| internal(format!("no thread for a job: {error}")))?;
        tokio::select! {
            ended = receiver => {
                if let Ok(Ok(result)) = ended {
                    return result.map(Some);
                }
                metrics::counter!("skypose_worker_panics_total").increment(1);
                Err(internal("the computation failed; this is a fault of ours".into()))
            }
            () = unwanted => {
                cancel.cancel();
                Ok(None)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[tokio::test]
    async fn a_panic_is_a_fault_and_frees_its_place() {
        let threads = Threads::new(1);
        let never = std::future::pending::<()>;
        let failed = threads.run(|_| -> Result<(), Fault> { panic!("on purpose") }, never()).await;
        assert_eq!(failed.expect_err("panicked").kind, FaultKind::Internal);
        assert_eq!(threads.run(|_| Ok(7), never()).await, Ok(Some(7)));
    }

    #[tokio::test]
    async fn what_is_unwanted_is_told_so_and_not_waited_for() {
        let threads = Threads::new(1);
        let (told, hears) = oneshot::channel();
        let task = move |cancel: &Cancel| {
            while !cancel.is_cancelled() {
                std::thread::sleep(Duration::from_millis(1));
            }
            let _ = told.send(());
            Ok(())
        };
        assert_eq!(threads.run(task, async {}).await, Ok(None));
        hears.await.expect("it was told");
    }
}
