//! Jobs in a store of their own, of either kind.

use serde_json::json;

use super::*;
use crate::shell::store::trial::places;

fn job(id: &str, key: Option<&str>, fingerprint: &str) -> NewJob {
    NewJob {
        id: id.into(),
        kind: "calibration",
        request: json!({"a": 1}),
        files: vec![JobFile { name: "left.jpg".into(), bytes: 7 }],
        fingerprint: fingerprint.into(),
        idempotency_key: key.map(Into::into),
        uploads: None,
    }
}

async fn waiting(store: &JobStore) -> i64 {
    match &store.database {
        Database::Sqlite(database) => {
            sqlx::query_scalar("SELECT COUNT(*) FROM Jobs").fetch_one(&database.pool).await.expect("counts")
        }
        Database::Postgres(database) => {
            sqlx::query_scalar("SELECT COUNT(*) FROM apalis.jobs").fetch_one(&database.pool).await.expect("counts")
        }
    }
}

fn ending(status: JobStatus) -> Ending {
    Ending { status, result: Some(json!(5)), problem: None, message: status.name().into() }
}

#[tokio::test]
async fn a_key_names_one_job() {
    for place in places().await {
        let store = place.open().await.jobs();
        let made = store.make(&job("1", Some("k"), "x"), 9).await.expect("makes");
        assert!(
            matches!(&made, Made::New(job) if job.status == JobStatus::Queued && job.files[0].bytes == 7),
            "{made:?}"
        );
        assert!(matches!(store.make(&job("2", Some("k"), "x"), 9).await, Ok(Made::Known(job)) if job.id == "1"));
        assert!(matches!(store.make(&job("2", Some("k"), "y"), 9).await, Ok(Made::OtherRequest(_))));
        assert!(matches!(store.make(&job("2", None, "x"), 1).await, Ok(Made::Full { unfinished: 1 })));
        assert!(matches!(store.make(&job("2", None, "x"), 2).await, Ok(Made::New(_))));
    }
}

#[tokio::test]
async fn a_shard_counts_once_and_a_job_ends_once() {
    for place in places().await {
        let store = place.open().await.jobs();
        store.make(&job("1", None, "x"), 9).await.expect("makes");
        assert!(!store.put_shard("1", 0, &json!(1), "early").await.expect("looks"), "it is not running");
        assert!(store.prepared("1", 2, 1).await.expect("stores"));
        assert!(!store.prepared("1", 3, 1).await.expect("looks"), "twice");
        assert_eq!(waiting(&store).await, 3);
        assert!(store.put_shard("1", 1, &json!("b"), "second").await.expect("stores"));
        assert!(!store.put_shard("1", 1, &json!("c"), "again").await.expect("looks"));
        assert_eq!(waiting(&store).await, 3, "it is not to be finished yet");
        assert!(store.put_shard("1", 0, &json!("a"), "first").await.expect("stores"));
        assert_eq!(waiting(&store).await, 4);
        assert_eq!(store.shards("1").await.expect("reads"), [json!("a"), json!("b")]);
        assert!(store.end("1", &ending(JobStatus::Succeeded)).await.expect("stores"));
        assert!(!store.end("1", &ending(JobStatus::Cancelled)).await.expect("looks"));
        assert_eq!(waiting(&store).await, 0);
        let told: Vec<String> =
            store.events("1", 1).await.expect("reads").into_iter().map(|event| event.message).collect();
        assert_eq!(told, ["running", "second", "first", "succeeded"]);
        let job = store.get("1").await.expect("reads").expect("is there");
        assert_eq!((job.status, job.done, job.result), (JobStatus::Succeeded, 2, Some(json!(5))));
    }
}

#[tokio::test]
async fn what_is_old_or_too_many_is_outlived() {
    for place in places().await {
        let store = place.open().await.jobs();
        for id in ["1", "2", "3", "4"] {
            store.make(&job(id, None, "x"), 9).await.expect("makes");
        }
        for id in ["1", "2", "3"] {
            store.end(id, &ending(JobStatus::Cancelled)).await.expect("ends");
            tokio::time::sleep(std::time::Duration::from_millis(2)).await;
        }
        assert!(!store.remove("4").await.expect("looks"), "it has not ended");
        assert_eq!(store.outlived(60, 9).await.expect("reads"), Vec::<String>::new());
        assert_eq!(store.outlived(60, 3).await.expect("reads"), ["1"], "the unfinished stays, whatever its age");
        assert_eq!(store.outlived(0, 9).await.expect("reads").len(), 3);
        assert!(store.remove("1").await.expect("removes"));
        assert_eq!(store.events("1", 0).await.expect("reads"), []);
    }
}

#[tokio::test]
async fn one_shard_stored_by_many_at_once_counts_once() {
    for place in places().await {
        let store = place.open().await.jobs();
        store.make(&job("1", None, "x"), 9).await.expect("makes");
        store.prepared("1", 3, 1).await.expect("stores");
        let all = (0..12).map(|n| {
            let store = store.clone();
            tokio::spawn(async move { store.put_shard("1", n % 3, &json!(n % 3), "told").await.expect("stores") })
        });
        let mut counted = 0;
        for stored in all.collect::<Vec<_>>() {
            counted += usize::from(stored.await.expect("ends"));
        }
        let job = store.get("1").await.expect("reads").expect("is there");
        assert_eq!((counted, job.done), (3, 3));
        assert_eq!(waiting(&store).await, 1 + 3 + 1, "it is to be finished once");
        let events = store.events("1", 0).await.expect("reads");
        assert_eq!(events.iter().map(|event| event.number).collect::<Vec<_>>(), [1, 2, 3, 4, 5]);
    }
}

#[tokio::test]
async fn many_that_make_jobs_at_once_keep_the_limit() {
    for place in places().await {
        let store = place.open().await.jobs();
        let all = (0..12).map(|n| {
            let store = store.clone();
            let key = (n < 4).then_some("k");
            let new = job(&format!("{n}"), key, "x");
            tokio::spawn(async move { store.make(&new, 5).await.expect("makes") })
        });
        let mut made = Vec::new();
        for one in all.collect::<Vec<_>>() {
            made.push(one.await.expect("ends"));
        }
        assert_eq!(made.iter().filter(|made| matches!(made, Made::New(_))).count(), 5, "{made:?}");
        assert_eq!(store.unfinished().await.expect("counts"), 5);
    }
}
