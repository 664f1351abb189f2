//! Long work: jobs that outlive the request, and the process.
//!
//! A job is made of steps: it is prepared, which counts its shards; each shard is computed, its result stored once; and it is
//! finished, which makes one result of all. The steps stand in the queue of a job library, so any process on the store takes them,
//! and what a dead one held is taken by another. What a [`Kind`] computes is a function of the job alone, so a job that was
//! interrupted comes to the same result as one that was not.

mod intake;
mod kind;
mod steps;
mod threads;
mod worker;

#[cfg(test)]
mod tests;

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde_json::Value;
use tokio::sync::{Notify, Semaphore, watch};
use tokio::task::JoinHandle;

use crate::shell::config::JobSettings;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store::files::JobFiles;
use crate::shell::store::jobs::{Ending, Job, JobEvent, JobStatus, JobStore, Made, NewJob};
use crate::shell::store::presence::{Entrance, Presence};
use crate::shell::store::{Store, StoreError};

pub use intake::Intake;
pub use kind::{Attachment, Cancel, Input, JobFolder, Kind, Outcome, REPORT, Shard, Thing};
use threads::Threads;

/// How often it is looked for steps of dead processes and for jobs that have outlived their time.
const TIDY_EVERY: Duration = Duration::from_secs(5);
/// How long a step that is abandoned is waited for, so that it is given back at once.
const ABANDON: Duration = Duration::from_secs(1);

/// The jobs of a service. Clones are the same.
#[derive(Clone, Debug)]
pub struct Jobs {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    settings: JobSettings,
    kinds: Vec<Arc<dyn Kind>>,
    things: Store,
    store: JobStore,
    files: JobFiles,
    presence: Presence,
    /// The worker that runs; those of this process before it have ended.
    worker: AtomicU64,
    threads: Threads,
    uploads: Arc<Semaphore>,
    wake: Arc<Notify>,
    changes: watch::Sender<u64>,
    stopping: watch::Sender<bool>,
    abandoned: watch::Sender<bool>,
    stopped: Mutex<Option<Instant>>,
    work: Mutex<Vec<JoinHandle<()>>>,
}

/// What asking for a job's removal did.
#[derive(Clone, Debug, PartialEq)]
pub enum Deleted {
    /// It had not ended, and has now; it is still there to be looked at.
    Cancelled(Box<Job>),
    /// It had ended, and is gone.
    Removed,
}

impl Jobs {
    /// Sweeps what the dead have left under the data folder, and begins to work.
    ///
    /// # Errors
    /// If the folder cannot be written or the store cannot be read.
    pub async fn start(
        settings: &JobSettings,
        data: &Path,
        store: &Store,
        kinds: Vec<Arc<dyn Kind>>,
    ) -> Result<Self, Fault> {
        let _entrance = Entrance::pass(data).await.map_err(StoreError::from)?;
        let presence = store.jobs().enter(data).await?;
        let files = store.jobs().files(data);
        std::fs::create_dir_all(files.folder()).map_err(StoreError::from)?;
        let shared = Shared {
            settings: settings.clone(),
            kinds,
            things: store.clone(),
            store: store.jobs(),
            files,
            presence,
            worker: AtomicU64::default(),
            threads: Threads::new(settings.thread_count()),
            uploads: Arc::new(Semaphore::new(settings.max_uploads)),
            wake: Arc::default(),
            changes: watch::Sender::new(0),
            stopping: watch::Sender::new(false),
            abandoned: watch::Sender::new(false),
            stopped: Mutex::default(),
            work: Mutex::default(),
        };
        let jobs = Self { shared: Arc::new(shared) };
        // A folder without a job may be an upload of another process.
        if jobs.shared.presence.is_alone().map_err(StoreError::from)? {
            jobs.sweep().await?;
        }
        jobs.tidy().await?;
        let work = vec![tokio::spawn(worker::run(jobs.clone())), tokio::spawn(jobs.clone().keep_tidy())];
        *jobs.shared.work.lock().unwrap_or_else(PoisonError::into_inner) = work;
        Ok(jobs)
    }

    /// Takes the files of a job that is to be.
    ///
    /// # Errors
    /// [`FaultKind::Overloaded`] if too many are being taken or too many jobs wait.
    pub async fn intake(&self) -> Result<Intake, Fault> {
        let full = |detail: String| Fault::new(FaultKind::Overloaded, detail);
        let most = self.settings().queue;
        if self.store().unfinished().await? >= most {
            return Err(full(format!("{most} jobs are not finished: further ones have to wait")));
        }
        let place = Arc::clone(&self.shared.uploads).try_acquire_owned();
        let place = place.map_err(|_| full("as many uploads as the service takes are under way".into()))?;
        Intake::open(self.files().folder(), self.settings(), place).await
    }

    /// Makes a job of what was taken in. The same key names the same job.
    ///
    /// # Errors
    /// [`FaultKind::Overloaded`] if too many jobs wait, [`FaultKind::Conflict`] if the key belongs to another request.
    pub async fn make(
        &self,
        kind: &'static str,
        request: Value,
        mut intake: Intake,
        key: Option<String>,
    ) -> Result<Job, Fault> {
        intake.end().await?;
        let jobs = self.clone();
        // A client that leaves now does not leave a job without its files: it is made to the end, or not at all.
        let made = tokio::spawn(async move { jobs.make_now(kind, request, intake, key).await }).await;
        made.map_err(|error| Fault::new(FaultKind::Internal, format!("the job was not made: {error}")))?
    }

    async fn make_now(
        &self,
        kind: &'static str,
        request: Value,
        mut intake: Intake,
        key: Option<String>,
    ) -> Result<Job, Fault> {
        let new = NewJob {
            id: intake.id.clone(),
            kind,
            fingerprint: intake.fingerprint(&request),
            request,
            files: intake.files.clone(),
            idempotency_key: key,
            uploads: Some(intake.uploads.clone()),
        };
        match self.store().make(&new, self.settings().queue).await? {
            Made::New(job) => {
                if self.files().stay_in_folder() {
                    intake.keep();
                }
                tracing::info!(job = job.id, kind, files = job.files.len(), "job made");
                self.shared.wake.notify_one();
                self.changed().await;
                Ok(job)
            }
            Made::Known(job) => Ok(job),
            Made::OtherRequest(job) => {
                let detail = format!("this Idempotency-Key belongs to another request, that of job {}", job.id);
                Err(Fault::new(FaultKind::Conflict, detail))
            }
            Made::Full { unfinished } => {
                let detail = format!("{unfinished} jobs are not finished: further ones have to wait");
                Err(Fault::new(FaultKind::Overloaded, detail))
            }
        }
    }

    /// The jobs of a kind, the last made first, without their results.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn list(&self, kind: &str) -> Result<Vec<Job>, Fault> {
        Ok(self.store().list(kind).await?)
    }

    /// A job.
    ///
    /// # Errors
    /// [`FaultKind::NotFound`].
    pub async fn get(&self, kind: &str, id: &str) -> Result<Job, Fault> {
        let missing = || Fault::new(FaultKind::NotFound, format!("no {kind} {id:?}"));
        // Ids are letters and digits; what else may stand in a path, a database need not take for text.
        if !id.bytes().all(|byte| byte.is_ascii_alphanumeric()) {
            return Err(missing());
        }
        self.store().get(id).await?.filter(|job| job.kind == kind).ok_or_else(missing)
    }

    /// What is kept beside a job's result under this name, such as [`REPORT`].
    ///
    /// # Errors
    /// [`FaultKind::NotFound`] if there is no such job, or nothing of that name beside its result (yet).
    pub async fn attachment(&self, kind: &str, id: &str, name: &str) -> Result<Vec<u8>, Fault> {
        let job = self.get(kind, id).await?;
        let missing = |detail: String| Fault::new(FaultKind::NotFound, detail);
        let status = job.status.name();
        if !job.status.is_final() {
            return Err(missing(format!("the {kind} is {status}: there is no {name} yet")));
        }
        let found = self.files().attachment(id, name).await?;
        found.ok_or_else(|| missing(format!("the {kind} has {status}: there is no {name} of it")))
    }

    /// What happened to a job after the event of this number.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn events(&self, id: &str, after: i64) -> Result<Vec<JobEvent>, Fault> {
        Ok(self.store().events(id, after).await?)
    }

    /// Cancels a job that has not ended, removes one that has.
    ///
    /// # Errors
    /// [`FaultKind::NotFound`].
    pub async fn delete(&self, kind: &str, id: &str) -> Result<Deleted, Fault> {
        let job = self.get(kind, id).await?;
        if !job.status.is_final() {
            let status = JobStatus::Cancelled;
            let ending = Ending { status, result: None, problem: None, message: status.name().into() };
            steps::end(self, &job, &ending).await?;
            return Ok(Deleted::Cancelled(Box::new(self.get(kind, id).await?)));
        }
        self.remove(id).await?;
        Ok(Deleted::Removed)
    }

    /// Changes whenever something happened to a job in this process; what happened in others is not seen.
    #[must_use]
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.shared.changes.subscribe()
    }

    /// Becomes true when the service is told to stop.
    #[must_use]
    pub fn stopping(&self) -> watch::Receiver<bool> {
        self.shared.stopping.subscribe()
    }

    /// Begins nothing more.
    pub fn stop(&self) {
        self.shared.stopped.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(Instant::now);
        self.shared.stopping.send_replace(true);
    }

    /// Waits for the steps that were begun, no longer than `drain` after [`Jobs::stop`]; what has not ended then is given back, for
    /// the next start or another process.
    pub async fn drain(&self, drain: Duration) {
        self.stop();
        let stopped = *self.shared.stopped.lock().unwrap_or_else(PoisonError::into_inner);
        let deadline = stopped.unwrap_or_else(Instant::now) + drain;
        let work = std::mem::take(&mut *self.shared.work.lock().unwrap_or_else(PoisonError::into_inner));
        for mut task in work {
            if tokio::time::timeout_at(deadline.into(), &mut task).await.is_err() {
                self.shared.abandoned.send_replace(true);
                if tokio::time::timeout(ABANDON, &mut task).await.is_err() {
                    task.abort();
                }
            }
        }
        let own = self.shared.presence.name();
        let others = |worker: &str| !worker.starts_with(own);
        if let Err(error) = self.store().release(others).await {
            tracing::warn!(%error, "steps of jobs are given back only when this process is known to be dead");
        }
    }

    /// Removes a job that has ended, with its folder.
    async fn remove(&self, id: &str) -> Result<(), Fault> {
        if self.store().remove(id).await? {
            self.files().remove(id).await;
            self.changed().await;
        }
        Ok(())
    }

    /// Removes folders that belong to no job, and what came with one that has ended.
    async fn sweep(&self) -> Result<(), Fault> {
        let known = if self.files().stay_in_folder() { self.store().ids().await? } else { Vec::new() };
        for entry in std::fs::read_dir(self.files().folder()).map_err(StoreError::from)?.flatten() {
            match known.iter().find(|id| ***id == *entry.file_name()) {
                None => {
                    let _ = tokio::fs::remove_dir_all(entry.path()).await;
                }
                Some(id) if self.store().status(id).await?.is_some_and(JobStatus::is_final) => {
                    self.files().remove_uploads(id).await;
                }
                Some(_) => {}
            }
        }
        Ok(())
    }

    async fn keep_tidy(self) {
        let mut stopping = self.stopping();
        loop {
            let stops = stopping.wait_for(|is_stopping| *is_stopping);
            if tokio::time::timeout(TIDY_EVERY, stops).await.is_ok() {
                return;
            }
            if let Err(fault) = self.tidy().await {
                tracing::warn!(%fault, "jobs cannot be tidied up; it is tried again");
            }
        }
    }

    /// Gives back what the dead held, removes what has outlived its time.
    async fn tidy(&self) -> Result<(), Fault> {
        let living = self.shared.presence.living().await?;
        let own = self.worker_name(self.shared.worker.load(Ordering::Acquire));
        let is_alive = |worker: &str| match process_of(worker) {
            process if process == self.shared.presence.name() => worker == own,
            process => living.is_alive(process),
        };
        let released = self.store().release(is_alive).await?;
        if released > 0 {
            tracing::info!(released, "steps of the dead are taken again");
            self.shared.wake.notify_one();
        }
        for id in self.store().outlived(self.settings().keep_finished_s, self.settings().max_jobs).await? {
            self.remove(&id).await?;
        }
        self.changed().await;
        Ok(())
    }

    /// Gives back what a worker of this process held that has ended.
    async fn release(&self, dead: &str) {
        if let Err(error) = self.store().release(|worker| worker != dead).await {
            tracing::warn!(%error, "steps of a worker that has ended are taken again later");
        }
    }

    /// Tells everybody that something happened.
    async fn changed(&self) {
        self.shared.changes.send_modify(|count| *count += 1);
        let Ok(counts) = self.store().counts().await else { return };
        for kind in &self.shared.kinds {
            for status in
                [JobStatus::Queued, JobStatus::Running, JobStatus::Succeeded, JobStatus::Failed, JobStatus::Cancelled]
            {
                let count = counts.iter().find(|(of, at, _)| of == kind.name() && *at == status);
                metrics::gauge!("skypose_jobs", "kind" => kind.name(), "status" => status.name())
                    .set(count.map_or(0.0, |(.., count)| f64::from(*count)));
            }
        }
    }

    async fn abandoned(&self) {
        let mut abandoned = self.shared.abandoned.subscribe();
        // The sender lives as long as this.
        let _ = abandoned.wait_for(|is_abandoned| *is_abandoned).await;
    }

    fn is_abandoned(&self) -> bool {
        *self.shared.abandoned.borrow()
    }

    fn kind(&self, name: &str) -> Option<Arc<dyn Kind>> {
        self.shared.kinds.iter().find(|kind| kind.name() == name).map(Arc::clone)
    }

    /// The name of the worker that runs from now on.
    fn begin_worker(&self, number: u64) -> String {
        self.shared.worker.store(number, Ordering::Release);
        self.worker_name(number)
    }

    /// The process, and after the slash the worker.
    fn worker_name(&self, number: u64) -> String {
        format!("{}/{number}", self.shared.presence.name())
    }

    fn settings(&self) -> &JobSettings {
        &self.shared.settings
    }

    fn store(&self) -> &JobStore {
        &self.shared.store
    }

    fn things(&self) -> &Store {
        &self.shared.things
    }

    fn files(&self) -> &JobFiles {
        &self.shared.files
    }

    fn threads(&self) -> &Threads {
        &self.shared.threads
    }

    fn wake(&self) -> Arc<Notify> {
        Arc::clone(&self.shared.wake)
    }
}

fn process_of(worker: &str) -> &str {
    worker.split('/').next().unwrap_or(worker)
}
