//! One step of a job after the other: prepare, each shard, finish. Each may be tried again at any time, and by two at once: what
//! counts is what the store takes first.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::watch;

use super::Jobs;
use super::kind::{Input, Kind, Outcome};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store::Precondition;
use crate::shell::store::jobs::{Ending, Job, JobStatus};
use crate::shell::store::queue::{Part, Step};
use crate::shell::wire::Problem;

/// A step that was begun so often and never ended takes the process with it, so its job is given up.
const MAX_ATTEMPTS: usize = 10;
/// How often somebody who computes looks whether the job is still wanted, should another process have cancelled it.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// How often it is told how far a result is.
const TELL_EVERY: Duration = Duration::from_millis(250);

/// Why a step is not done.
#[derive(Debug)]
pub(super) enum Undone {
    /// The process stops: somebody is to take the step again.
    Stopping,
    /// The store cannot be reached, or the like.
    Passing(Fault),
}

impl From<Fault> for Undone {
    fn from(fault: Fault) -> Self {
        Self::Passing(fault)
    }
}

/// Takes one step; that it comes late, for a job that has ended or is not there any more, is no error.
pub(super) async fn take(jobs: &Jobs, step: &Step, attempt: usize) -> Result<(), Undone> {
    let Some(job) = jobs.store().get(&step.job).await.map_err(Fault::from)? else { return Ok(()) };
    if job.status.is_final() {
        return Ok(());
    }
    let Some(kind) = jobs.kind(&job.kind) else {
        let detail = format!("this program knows no jobs of kind {:?}", job.kind);
        return Ok(fail(jobs, &job, &Fault::new(FaultKind::Internal, detail)).await?);
    };
    if attempt > MAX_ATTEMPTS {
        let detail = format!("{:?} was begun {MAX_ATTEMPTS} times and never came to an end", step.part);
        return Ok(fail(jobs, &job, &Fault::new(FaultKind::Internal, detail)).await?);
    }
    let done = match step.part {
        Part::Prepare => prepare(jobs, &job, kind).await,
        Part::Shard(number) => shard(jobs, &job, kind, number).await,
        Part::Finish => finish(jobs, &job, kind).await,
    };
    match done {
        Err(Broken::Job(fault)) => Ok(fail(jobs, &job, &fault).await?),
        Err(Broken::Step(undone)) => Err(undone),
        Ok(()) => Ok(()),
    }
}

/// Why a step came to no good end.
enum Broken {
    /// The job fails.
    Job(Fault),
    /// The step is to be taken again.
    Step(Undone),
}

impl<T: Into<Fault>> From<T> for Broken {
    fn from(error: T) -> Self {
        Self::Step(Undone::Passing(error.into()))
    }
}

async fn prepare(jobs: &Jobs, job: &Job, kind: Arc<dyn Kind>) -> Result<(), Broken> {
    let input = Input::of(job, jobs.files());
    let counted = move |_: &super::Cancel| {
        let shards = kind.shard_count(&input)?;
        Ok((shards, kind.finish_shards(shards)))
    };
    let Some((shards, finish_shards)) = compute(jobs, job, counted).await? else { return Ok(()) };
    jobs.store().prepared(&job.id, shards, finish_shards).await?;
    jobs.changed().await;
    Ok(())
}

async fn shard(jobs: &Jobs, job: &Job, kind: Arc<dyn Kind>, number: u32) -> Result<(), Broken> {
    if jobs.store().has_shard(&job.id, number).await? {
        return Ok(());
    }
    let input = Input::of(job, jobs.files());
    let start = Instant::now();
    let Some(shard) = compute(jobs, job, move |cancel| kind.run_shard(&input, number, cancel)).await? else {
        return Ok(());
    };
    metrics::histogram!("skypose_shard_seconds", "kind" => job.kind.clone()).record(start.elapsed().as_secs_f64());
    jobs.store().put_shard(&job.id, number, &shard.result, &shard.message).await?;
    jobs.changed().await;
    Ok(())
}

async fn finish(jobs: &Jobs, job: &Job, kind: Arc<dyn Kind>) -> Result<(), Broken> {
    let input = Input::of(job, jobs.files());
    let shards = jobs.store().shards(&job.id).await?;
    let (heard, share) = watch::channel(0.0);
    let computed = compute(jobs, job, move |cancel| kind.finish(&input, shards, &cancel.heard(heard)));
    let computed = tokio::select! {
        computed = computed => computed?,
        never = pass_on(jobs, &job.id, share) => match never {},
    };
    let Some(outcome) = computed else { return Ok(()) };
    let Outcome { result, problem, attachments, things } = outcome;
    for attachment in attachments {
        jobs.files().attach(&job.id, attachment.name, attachment.content).await?;
    }
    if let Some(fault) = problem {
        let ending = Ending { result: Some(result), ..failure(&fault) };
        return Ok(end(jobs, job, &ending).await?);
    }
    for thing in things {
        jobs.things().put(thing.kind, &thing.name, &thing.body, &Precondition::None).await?;
    }
    let message = JobStatus::Succeeded.name().into();
    let ending = Ending { status: JobStatus::Succeeded, result: Some(result), problem: None, message };
    Ok(end(jobs, job, &ending).await?)
}

/// Tells those who watch how far the result of all shards is, now and then, for as long as it is asked to.
async fn pass_on(jobs: &Jobs, id: &str, mut share: watch::Receiver<f64>) -> Infallible {
    while share.changed().await.is_ok() {
        tokio::time::sleep(TELL_EVERY).await;
        let share = share.borrow_and_update().clamp(0.0, 1.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a thousand")]
        let permille = (1000.0 * share) as u32;
        // One that cannot be told is followed by others.
        let message = format!("{:.0} % of the result of all parts", 100.0 * share);
        if jobs.store().finishing(id, permille, &message).await.unwrap_or(false) {
            jobs.changed().await;
        }
    }
    std::future::pending().await
}

/// On a thread for jobs; `None` if the job has ended in the meantime.
async fn compute<T: Send + 'static>(
    jobs: &Jobs,
    job: &Job,
    task: impl FnOnce(&super::Cancel) -> Result<T, Fault> + Send + 'static,
) -> Result<Option<T>, Broken> {
    let unwanted = async {
        tokio::select! {
            () = ended(jobs, &job.id) => {}
            () = jobs.abandoned() => {}
        }
    };
    match jobs.threads().run(task, unwanted).await {
        Ok(Some(value)) => Ok(Some(value)),
        Ok(None) if jobs.is_abandoned() => Err(Broken::Step(Undone::Stopping)),
        Ok(None) => Ok(None),
        Err(fault) => Err(Broken::Job(fault)),
    }
}

/// Returns when the job has ended or is not there any more.
async fn ended(jobs: &Jobs, id: &str) {
    let mut changes = jobs.changes();
    loop {
        // A store that cannot be read says nothing about the job.
        if jobs.store().status(id).await.is_ok_and(|status| status.is_none_or(JobStatus::is_final)) {
            return;
        }
        let _ = tokio::time::timeout(LOOK_EVERY, changes.changed()).await;
    }
}

fn failure(fault: &Fault) -> Ending {
    let problem = serde_json::to_value(Problem::from(fault)).ok();
    Ending { status: JobStatus::Failed, result: None, problem, message: fault.to_string() }
}

async fn fail(jobs: &Jobs, job: &Job, fault: &Fault) -> Result<(), Fault> {
    end(jobs, job, &failure(fault)).await
}

/// Ends a job, unless it has ended before, and removes what was uploaded for it.
pub(super) async fn end(jobs: &Jobs, job: &Job, ending: &Ending) -> Result<(), Fault> {
    if jobs.store().end(&job.id, ending).await? {
        let status = ending.status.name();
        metrics::counter!("skypose_jobs_ended_total", "kind" => job.kind.clone(), "status" => status).increment(1);
        tracing::info!(job = job.id, kind = job.kind, status, message = ending.message, "job ended");
        jobs.changed().await;
    }
    jobs.files().remove_uploads(&job.id).await;
    Ok(())
}
