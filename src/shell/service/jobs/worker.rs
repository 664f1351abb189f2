//! Who takes steps out of the queue: a worker of the job library, and the next one when it has ended, which it does at any
//! error of the store.

use std::sync::Arc;
use std::time::Duration;

use apalis_core::backend::ext::BackendExt;
use apalis_core::error::BoxDynError;
use apalis_core::task::attempt::Attempt;
use apalis_core::task::data::Data;
use apalis_core::worker::builder::WorkerBuilder;
use apalis_core::worker::context::WorkerContext;
use futures_util::stream::{self, Stream};
use tokio::sync::{Notify, watch};
use tokio::task::JoinSet;
use tower::limit::ConcurrencyLimitLayer;

use super::Jobs;
use super::steps::{self, Undone};
use crate::shell::store::queue::{Step, Steps};

/// How often the queue is looked into when nobody in this process has put something into it.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Before another worker is started.
const PAUSE: Duration = Duration::from_secs(1);

/// Takes steps until the service stops, and then ends those that were begun.
pub(super) async fn run(jobs: Jobs) {
    let mut stop = jobs.stopping();
    for number in 0_u64.. {
        if *stop.borrow() {
            return;
        }
        let name = jobs.begin_worker(number);
        let context = WorkerContext::new(&name);
        // A task of its own, which ends with this one: the library may panic, and the queue is to be read all the same.
        let mut running = JoinSet::new();
        // The same worker on either queue.
        macro_rules! spawn {
            ($steps:expr) => {
                running.spawn(
                    WorkerBuilder::new(context.clone())
                        .backend($steps.poll_with_stream(looks(jobs.wake())))
                        .layer(ConcurrencyLimitLayer::new(jobs.settings().thread_count()))
                        .data(jobs.clone())
                        .build(take)
                        .run(),
                )
            };
        }
        match jobs.store().steps() {
            Steps::Sqlite(steps) => spawn!(steps),
            Steps::Postgres(steps) => spawn!(steps),
        };
        let ended = tokio::select! {
            ended = running.join_next() => Some(ended),
            () = stopped(&mut stop) => None,
        };
        let Some(ended) = ended else {
            if context.stop().is_ok() {
                let _ = running.join_next().await;
            }
            return;
        };
        // The runtime is going, and the process with it.
        if matches!(&ended, Some(Err(error)) if error.is_cancelled()) {
            return;
        }
        tracing::warn!(?ended, "the queue of jobs cannot be read; it is tried again");
        tokio::time::sleep(PAUSE).await;
        jobs.release(&name).await;
    }
}

async fn stopped(stop: &mut watch::Receiver<bool>) {
    // The sender lives as long as the jobs.
    let _ = stop.wait_for(|is_stopping| *is_stopping).await;
}

/// A look now and then, and one when there is something new.
fn looks(wake: Arc<Notify>) -> impl Stream<Item = ()> + Unpin + Send + 'static {
    Box::pin(stream::unfold(wake, |wake| async move {
        let _ = tokio::time::timeout(LOOK_EVERY, wake.notified()).await;
        Some(((), wake))
    }))
}

/// A step as the library hands it out. An error has it handed out again.
async fn take(step: Step, attempt: Attempt, jobs: Data<Jobs>) -> Result<(), BoxDynError> {
    let attempt = attempt.current();
    let Data(jobs) = jobs;
    // On its own, so that it goes on should the worker end.
    let taken = tokio::spawn(async move {
        let taken = steps::take(&jobs, &step, attempt).await;
        if let Err(Undone::Passing(fault)) = &taken {
            tracing::error!(job = step.job, part = ?step.part, %fault, "a step of a job failed; it is tried again");
            tokio::time::sleep(PAUSE).await;
        }
        taken
    });
    match taken.await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(Undone::Stopping)) => Err("the service stops".into()),
        Ok(Err(Undone::Passing(fault))) => Err(fault.into()),
        Err(error) => Err(error.into()),
    }
}
