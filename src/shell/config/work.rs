//! Who computes: requests, and jobs behind them.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Who computes.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct WorkerSettings {
    /// Threads that compute; 0 takes one for each core.
    pub threads: usize,
    /// Requests that wait for a worker; further ones are refused with 503.
    pub queue: usize,
}

impl Default for WorkerSettings {
    fn default() -> Self {
        Self { threads: 0, queue: 32 }
    }
}

impl WorkerSettings {
    /// The number of threads, cores counted.
    #[must_use]
    pub fn thread_count(&self) -> usize {
        match self.threads {
            0 => std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            threads => threads,
        }
    }

    /// What makes no sense in them.
    pub(super) fn faults(&self, need: &mut impl FnMut(bool, &str, &str)) {
        need(self.threads <= 1024, "workers.threads", "must be at most 1024");
    }
}

/// Calibrations and other long work.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct JobSettings {
    /// Threads that compute, at low priority; 0 takes half the cores.
    pub threads: usize,
    /// Jobs that are not finished; further ones are refused with 503.
    pub queue: usize,
    /// Uploads being received at a time; further ones are refused with 503.
    pub max_uploads: usize,
    /// Longest time for an upload.
    pub upload_s: u64,
    /// Most bytes of all pictures of a job.
    pub max_upload_bytes: u64,
    /// Most bytes of one picture of a job.
    pub max_picture_bytes: u64,
    /// Most pictures of a job.
    pub max_pictures: usize,
    /// Time after its end at which a job is removed.
    pub keep_finished_s: u64,
    /// Most jobs that are stored; those that ended first make room.
    pub max_jobs: usize,
}

impl Default for JobSettings {
    fn default() -> Self {
        Self {
            threads: 0,
            queue: 16,
            max_uploads: 4,
            upload_s: 600,
            max_upload_bytes: 1 << 30,
            max_picture_bytes: 64 << 20,
            max_pictures: 500,
            keep_finished_s: 30 * 24 * 3600,
            max_jobs: 1000,
        }
    }
}

impl JobSettings {
    /// The number of threads, cores counted.
    #[must_use]
    pub fn thread_count(&self) -> usize {
        match self.threads {
            0 => std::thread::available_parallelism().map_or(1, |cores| cores.get().div_ceil(2)),
            threads => threads,
        }
    }

    /// Longest time for an upload.
    #[must_use]
    pub const fn upload(&self) -> Duration {
        Duration::from_secs(self.upload_s)
    }

    /// What makes no sense in them.
    pub(super) fn faults(&self, need: &mut impl FnMut(bool, &str, &str)) {
        need(self.threads <= 1024, "jobs.threads", "must be at most 1024");
        need(self.queue > 0, "jobs.queue", "must be at least 1");
        need(self.max_uploads > 0, "jobs.max_uploads", "must be at least 1");
        need((1..=86_400).contains(&self.upload_s), "jobs.upload_s", "must be from 1 to 86400");
        need(self.max_upload_bytes >= 1024, "jobs.max_upload_bytes", "must be at least 1024");
        need(self.max_picture_bytes >= 1024, "jobs.max_picture_bytes", "must be at least 1024");
        need((1..=100_000).contains(&self.max_pictures), "jobs.max_pictures", "must be from 1 to 100000");
        need(self.max_jobs > self.queue, "jobs.max_jobs", "must be more than jobs.queue");
    }
}
