//! The machinery, with a kind of job that sleeps.

use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::json;

use super::*;
use crate::shell::store::trial::{Place, places};
use crate::shell::wire::JobEventWire;

/// Squares of the numbers below `shards`, each after `sleep_ms`.
#[derive(Debug, Default)]
struct Squares {
    begun: AtomicUsize,
    told: AtomicUsize,
}

const SQUARES: &str = "squares";

impl Kind for Squares {
    fn name(&self) -> &'static str {
        SQUARES
    }

    fn shard_count(&self, input: &Input) -> Result<u32, Fault> {
        let shards = input.request["shards"].as_u64().and_then(|shards| u32::try_from(shards).ok());
        shards.ok_or_else(|| Fault::senseless("/shards", "no number"))
    }

    fn run_shard(&self, input: &Input, number: u32, cancel: &Cancel) -> Result<Shard, Fault> {
        self.begun.fetch_add(1, Ordering::SeqCst);
        assert!(input.request["panic_at"] != number, "on purpose");
        let end = Instant::now() + Duration::from_millis(input.request["sleep_ms"].as_u64().unwrap_or_default());
        while Instant::now() < end {
            if cancel.is_cancelled() {
                self.told.fetch_add(1, Ordering::SeqCst);
                return Err(Fault::new(FaultKind::Internal, "cancelled"));
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        Ok(Shard { result: json!(number * number), message: format!("{number} squared") })
    }

    fn finish_shards(&self, shards: u32) -> u32 {
        shards
    }

    fn finish(&self, input: &Input, shards: Vec<Value>, cancel: &Cancel) -> Result<Outcome, Fault> {
        let steps = input.request["finish_steps"].as_u64().unwrap_or_default();
        for step in 0..steps {
            if cancel.is_cancelled() {
                self.told.fetch_add(1, Ordering::SeqCst);
                return Err(Fault::new(FaultKind::Internal, "cancelled"));
            }
            std::thread::sleep(Duration::from_millis(5));
            cancel.done((step + 1) as f64 / steps as f64);
        }
        let files: Vec<&str> = input.files.names().collect();
        let attachments = vec![Attachment { name: REPORT, content: format!("<p>{}</p>", shards.len()).into_bytes() }];
        Ok(Outcome { result: json!({"squares": shards, "files": files}), attachments, ..Outcome::default() })
    }
}

fn received(place: &Place) -> PathBuf {
    place.data.path().join(if place.is_folder() { "jobs" } else { "received" })
}

/// A process, as far as jobs go.
struct Process {
    store: Store,
    jobs: Jobs,
    kind: Arc<Squares>,
}

impl Process {
    async fn start(place: &Place) -> Self {
        Self::with(place, JobSettings { threads: 2, ..JobSettings::default() }).await
    }

    async fn with(place: &Place, settings: JobSettings) -> Self {
        let store = place.open().await;
        let kind = Arc::<Squares>::default();
        let jobs = Jobs::start(&settings, place.data.path(), &store, vec![kind.clone()]).await.expect("starts");
        Self { store, jobs, kind }
    }

    async fn make(&self, request: Value) -> Job {
        let mut intake = self.jobs.intake().await.expect("takes");
        intake.begin(Some("a.jpg")).await.expect("takes");
        intake.write(b"bytes").await.expect("takes");
        self.jobs.make(SQUARES, request, intake, None).await.expect("makes")
    }

    /// The job as soon as this holds of it.
    async fn when(&self, id: &str, holds: impl Fn(&Job) -> bool) -> Job {
        for _ in 0..3_000 {
            let job = self.jobs.get(SQUARES, id).await.expect("is there");
            if holds(&job) {
                return job;
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        panic!("it never came: {:?}", self.jobs.get(SQUARES, id).await);
    }

    async fn ended(&self, id: &str) -> Job {
        self.when(id, |job| job.status.is_final()).await
    }

    async fn stop(self, drain: Duration) {
        self.jobs.drain(drain).await;
        self.store.close().await;
    }
}

fn squares(count: u32) -> Value {
    json!({"squares": (0..count).map(|number| number * number).collect::<Vec<_>>(), "files": ["a.jpg"]})
}

const LONG: Duration = Duration::from_secs(20);

#[tokio::test]
async fn a_job_is_prepared_computed_and_finished() {
    for place in places().await {
        let process = Process::start(&place).await;
        let job = process.make(json!({"shards": 7})).await;
        let stays = received(&place).join(&job.id).join("uploads/000000").exists();
        assert!(stays || !place.is_folder(), "the job's files are not there");
        let ended = process.ended(&job.id).await;
        assert_eq!((ended.status, ended.result, ended.done), (JobStatus::Succeeded, Some(squares(7)), 7));
        assert_eq!(process.jobs.attachment(SQUARES, &job.id, REPORT).await.as_deref(), Ok(&b"<p>7</p>"[..]));
        let told = process.jobs.events(&job.id, 0).await.expect("reads");
        assert_eq!(told.len(), 2 + 7 + 1);
        assert_eq!((told[0].status, told[9].status), (JobStatus::Queued, JobStatus::Succeeded));
        assert!(told.iter().any(|event| event.message == "3 squared"));
        assert_eq!(process.kind.begun.load(Ordering::SeqCst), 7);
        let empty = process.make(json!({"shards": 0})).await;
        assert_eq!(process.ended(&empty.id).await.result, Some(squares(0)));
        process.stop(LONG).await;
        assert!(!received(&place).join(&job.id).join("uploads").exists(), "uploads are kept");
    }
}

#[tokio::test]
async fn how_far_a_result_is_is_told_and_it_is_given_up_when_the_job_is_cancelled() {
    for place in places().await {
        let process = Process::with(&place, JobSettings { threads: 1, ..JobSettings::default() }).await;
        let job = process.make(json!({"shards": 3, "finish_steps": 300})).await;
        process.ended(&job.id).await;
        let told = process.jobs.events(&job.id, 0).await.expect("reads");
        let finishing: Vec<u32> = told.iter().map(|event| event.finishing.permille).collect();
        assert!(finishing.is_sorted() && finishing.iter().filter(|permille| **permille > 0).count() > 1, "{told:?}");
        let shares: Vec<f64> = told.into_iter().map(|event| JobEventWire::from(event).progress).collect();
        assert!(shares.is_sorted() && shares.iter().any(|share| (0.55..0.95).contains(share)), "{shares:?}");

        let endless = process.make(json!({"shards": 3, "finish_steps": 1_000_000})).await;
        process.when(&endless.id, |job| job.finishing.permille > 0 || job.done == 3).await;
        assert!(matches!(process.jobs.delete(SQUARES, &endless.id).await, Ok(Deleted::Cancelled(_))));
        // The only thread is free for the next.
        let next = process.make(json!({"shards": 1})).await;
        assert_eq!(process.ended(&next.id).await.status, JobStatus::Succeeded);
        assert_eq!(process.kind.told.load(Ordering::SeqCst), 1);
        process.stop(LONG).await;
    }
}

#[tokio::test]
async fn what_fails_says_why_and_the_next_goes_on() {
    for place in places().await {
        let process = Process::start(&place).await;
        let senseless = process.make(json!({})).await;
        let panics = process.make(json!({"shards": 3, "panic_at": 1})).await;
        let fine = process.make(json!({"shards": 3})).await;
        let problem = |job: Job| (job.status, job.problem.expect("a problem"));
        let (status, problem_found) = problem(process.ended(&senseless.id).await);
        assert_eq!((status, &problem_found["pointer"]), (JobStatus::Failed, &json!("/shards")));
        let (status, problem_found) = problem(process.ended(&panics.id).await);
        assert_eq!((status, &problem_found["status"]), (JobStatus::Failed, &json!(500)));
        assert_eq!(process.ended(&fine.id).await.status, JobStatus::Succeeded);
        process.stop(LONG).await;
    }
}

#[tokio::test]
async fn a_job_that_was_interrupted_comes_to_the_same_result() {
    for place in places().await {
        let first = Process::start(&place).await;
        let job = first.make(json!({"shards": 24, "sleep_ms": 40})).await;
        first.when(&job.id, |job| job.done >= 3).await;
        let kind = first.kind.clone();
        first.stop(Duration::ZERO).await;
        let begun = kind.begun.load(Ordering::SeqCst);
        let second = Process::start(&place).await;
        let found = second.jobs.get(SQUARES, &job.id).await.expect("is there");
        assert!(found.done >= 3 && found.done < 24, "{found:?}");
        let ended = second.ended(&job.id).await;
        assert_eq!((ended.status, ended.result), (JobStatus::Succeeded, Some(squares(24))));
        let again = begun + second.kind.begun.load(Ordering::SeqCst) - 24;
        assert!(again <= 2, "{again} shards were computed twice; only those under way may be");
        second.stop(LONG).await;
    }
}

#[tokio::test]
async fn told_to_stop_it_ends_what_it_has_begun() {
    for place in places().await {
        let process = Process::start(&place).await;
        let job = process.make(json!({"shards": 4, "sleep_ms": 300})).await;
        process.when(&job.id, |_| process.kind.begun.load(Ordering::SeqCst) == 2).await;
        let (kind, store) = (process.kind.clone(), process.store.clone());
        process.jobs.drain(LONG).await;
        assert_eq!((kind.begun.load(Ordering::SeqCst), kind.told.load(Ordering::SeqCst)), (2, 0));
        assert_eq!(store.jobs().get(&job.id).await.expect("reads").map(|job| job.done), Some(2));
    }
}

#[tokio::test]
async fn two_processes_share_the_shards_of_a_job() {
    for place in places().await {
        let (first, second) = (Process::start(&place).await, Process::start(&place).await);
        let job = first.make(json!({"shards": 60, "sleep_ms": 50})).await;
        let ended = first.ended(&job.id).await;
        assert_eq!(ended.result, Some(squares(60)));
        let (by_first, by_second) = (first.kind.begun.load(Ordering::SeqCst), second.kind.begun.load(Ordering::SeqCst));
        assert_eq!(by_first + by_second, 60, "a shard was computed twice");
        assert!(by_first > 0 && by_second > 0, "{by_first} and {by_second}");
        first.stop(LONG).await;
        second.stop(LONG).await;
    }
}

#[tokio::test]
async fn a_job_cancelled_by_another_process_is_given_up() {
    for place in places().await {
        let (first, second) = (Process::start(&place).await, Process::start(&place).await);
        let job = first.make(json!({"shards": 2, "sleep_ms": 60_000})).await;
        let begun = || first.kind.begun.load(Ordering::SeqCst) + second.kind.begun.load(Ordering::SeqCst);
        first.when(&job.id, |_| begun() >= 1).await;
        let deleted = second.jobs.delete(SQUARES, &job.id).await.expect("cancels");
        assert!(matches!(&deleted, Deleted::Cancelled(job) if job.status == JobStatus::Cancelled), "{deleted:?}");
        let told = || first.kind.told.load(Ordering::SeqCst) + second.kind.told.load(Ordering::SeqCst);
        first.when(&job.id, |_| told() == begun()).await;
        assert_eq!(first.jobs.get(SQUARES, &job.id).await.expect("is there").status, JobStatus::Cancelled);
        assert_eq!(first.jobs.delete(SQUARES, &job.id).await, Ok(Deleted::Removed));
        assert!(first.jobs.get(SQUARES, &job.id).await.is_err());
        assert!(!received(&place).join(&job.id).exists());
        let next = second.make(json!({"shards": 2})).await;
        assert_eq!(second.ended(&next.id).await.status, JobStatus::Succeeded, "the threads are free again");
        first.stop(LONG).await;
        second.stop(LONG).await;
    }
}

#[tokio::test]
async fn what_the_dead_have_left_is_swept() {
    for place in places().await {
        let settings = JobSettings { queue: 1, max_jobs: 2, ..JobSettings::default() };
        let process = Process::with(&place, settings.clone()).await;
        let kept = process.make(json!({"shards": 1})).await;
        process.ended(&kept.id).await;
        process.stop(LONG).await;
        let (left, late) = (received(&place).join("left"), received(&place).join(&kept.id).join("uploads"));
        // One was killed as it received, one between the end of a job and the removal of what had come with it.
        std::fs::create_dir_all(left.join("uploads")).expect("makes");
        std::fs::create_dir_all(&late).expect("makes");
        let process = Process::with(&place, settings.clone()).await;
        assert!(!left.exists() && !late.exists());
        assert_eq!(received(&place).join(&kept.id).exists(), place.is_folder());
        // Another that starts while this lives takes no folder for left over.
        let intake = process.jobs.intake().await.expect("takes");
        let other = Process::with(&place, settings).await;
        assert!(received(&place).join(&intake.id).exists());
        for _ in 0..3 {
            let job = process.make(json!({"shards": 1})).await;
            process.ended(&job.id).await;
        }
        process.jobs.tidy().await.expect("tidies");
        assert_eq!(process.jobs.list(SQUARES).await.expect("lists").len(), 2);
        other.stop(LONG).await;
        process.stop(LONG).await;
    }
}
