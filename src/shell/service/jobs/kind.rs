//! What a kind of job has to say: how many shards it has, what one of them gives, and what is made of all.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::Value;
use tokio::sync::watch;

use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store;
use crate::shell::store::files::JobFiles;
use crate::shell::store::jobs::{Job, JobFile};

/// A kind of job. Each method is a function of its arguments alone, as it may be called again after a restart, elsewhere, or twice
/// at once; all are called on threads of their own that may be kept busy.
pub trait Kind: fmt::Debug + Send + Sync + 'static {
    /// In a word, as it stands in the store.
    fn name(&self) -> &'static str;

    /// How many shards the job has.
    ///
    /// # Errors
    /// Why the job fails.
    fn shard_count(&self, input: &Input) -> Result<u32, Fault>;

    /// As how many shards it counts to make the result of all of them, where there are so many.
    fn finish_shards(&self, _shards: u32) -> u32 {
        1
    }

    /// Computes one shard, `number` from 0. What is wrong with a part of the input is a result too, where the rest can go on
    /// without it.
    ///
    /// # Errors
    /// Why the job fails.
    fn run_shard(&self, input: &Input, number: u32, cancel: &Cancel) -> Result<Shard, Fault>;

    /// Makes the result of those of all shards, which come in their order.
    ///
    /// # Errors
    /// Why the job fails, where there is nothing else to be said.
    fn finish(&self, input: &Input, shards: Vec<Value>, cancel: &Cancel) -> Result<Outcome, Fault>;
}

/// What a job is about.
#[derive(Clone, Debug)]
pub struct Input {
    /// What was asked, checked when the job was made.
    pub request: Value,
    /// The files that came with it.
    pub files: JobFolder,
}

impl Input {
    pub(super) fn of(job: &Job, store: &JobFiles) -> Self {
        Self {
            request: job.request.clone(),
            files: JobFolder { job: job.id.clone(), files: job.files.clone(), store: store.clone() },
        }
    }
}

/// The files that came with a job.
#[derive(Clone, Debug)]
pub struct JobFolder {
    job: String,
    files: Vec<JobFile>,
    store: JobFiles,
}

impl JobFolder {
    /// Their names with who sent them, in the order in which they came.
    #[must_use]
    pub fn names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.files.iter().map(|file| file.name.as_str())
    }

    /// The bytes of one of them. Blocks.
    ///
    /// # Errors
    /// If it is not there any more.
    pub fn read(&self, number: u32) -> Result<Vec<u8>, Fault> {
        self.store
            .read_upload(&self.job, number as usize)
            .map_err(|error| Fault::new(FaultKind::Internal, format!("uploaded file {number}: {error}")))
    }
}

/// What a shard gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Shard {
    /// For [`Kind::finish`].
    pub result: Value,
    /// For those who watch: `left03.jpg: 54 points`.
    pub message: String,
}

/// What a job gives.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// For the client.
    pub result: Value,
    /// Why the job failed all the same.
    pub problem: Option<Fault>,
    /// What is kept beside the result, such as a page for people.
    pub attachments: Vec<Attachment>,
    /// What is to be stored: only where there is no problem.
    pub things: Vec<Thing>,
}

/// Name of the attachment that is a page for people, HTML.
pub const REPORT: &str = "report.html";

/// Something that is kept beside a job's result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Its name, with an ending that tells what it is.
    pub name: &'static str,
    /// Its bytes.
    pub content: Vec<u8>,
}

/// Something to be stored by name.
#[derive(Clone, Debug)]
pub struct Thing {
    /// What it is.
    pub kind: store::Kind,
    /// Its name.
    pub name: String,
    /// Its content, JSON.
    pub body: String,
}

/// Whether work is still wanted. What takes long asks now and then, and tells how far it is.
#[derive(Clone, Debug, Default)]
pub struct Cancel {
    is_cancelled: Arc<AtomicBool>,
    heard: Option<Arc<watch::Sender<f64>>>,
}

impl Cancel {
    /// Whether to give up.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }

    /// This share of it is done, 0 to 1. Only of what makes the result of all shards anybody hears.
    pub fn done(&self, share: f64) {
        if let Some(heard) = &self.heard {
            heard.send_replace(share);
        }
    }

    /// The same, and it is heard how far it is.
    pub(super) fn heard(&self, by: watch::Sender<f64>) -> Self {
        Self { heard: Some(Arc::new(by)), ..self.clone() }
    }

    pub(super) fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }
}
