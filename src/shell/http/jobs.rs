//! What all kinds of jobs have in common at the door: the job, its events, its report, its end.

use std::convert::Infallible;
use std::time::Duration;

use axum::extract::{FromRequestParts, Path};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::sse::Event;
use axum::response::{IntoResponse, Response};
use futures_util::{Stream, stream};

use super::App;
use super::error::ApiError;
use super::events;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::jobs::{Deleted, Jobs, REPORT};
use crate::shell::store::jobs::Job;
use crate::shell::wire::{JobEventWire, JobWire};

/// How often it is looked for events that happened in another process.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Longest `Idempotency-Key`.
const MAX_KEY: usize = 255;

/// The id of a job at its place in a path.
#[derive(Debug)]
pub struct JobId(pub String);

impl<S: Send + Sync> FromRequestParts<S> for JobId {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let Path(id) = Path::<String>::from_request_parts(parts, state)
            .await
            .map_err(|error| Fault::new(FaultKind::Unreadable, error.to_string()))?;
        Ok(Self(id))
    }
}

/// The client's name for its request.
///
/// # Errors
/// If it is empty, too long or not printable.
pub fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, Fault> {
    let Some(value) = headers.get("idempotency-key") else { return Ok(None) };
    match value.to_str() {
        Ok(key) if (1..=MAX_KEY).contains(&key.len()) => Ok(Some(key.into())),
        _ => Err(Fault::new(
            FaultKind::Unreadable,
            format!("Idempotency-Key holds 1 to {MAX_KEY} printable ASCII characters"),
        )),
    }
}

/// 202: it has been taken on, and is at `place`.
pub fn accepted(place: &str, job: Job) -> Response {
    let location = HeaderValue::from_str(&format!("{place}/{}", job.id));
    let mut response = (StatusCode::ACCEPTED, axum::Json(JobWire::from(job))).into_response();
    if let Ok(location) = location {
        response.headers_mut().insert(header::LOCATION, location);
    }
    response
}

/// The jobs of a kind, the last made first.
pub async fn list(app: &App, kind: &str) -> Result<Vec<JobWire>, Fault> {
    Ok(app.service.jobs().list(kind).await?.into_iter().map(JobWire::from).collect())
}

/// A job.
pub async fn get(app: &App, kind: &str, id: &str) -> Result<axum::Json<JobWire>, Fault> {
    Ok(axum::Json(app.service.jobs().get(kind, id).await?.into()))
}

/// Its page for people. It comes with pictures and words of strangers, so it runs no scripts and loads nothing.
pub async fn report(app: &App, kind: &str, id: &str) -> Result<Response, Fault> {
    let page = app.service.jobs().attachment(kind, id, REPORT).await?;
    let policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; frame-ancestors 'self'";
    Ok(([(header::CONTENT_SECURITY_POLICY, policy)], axum::response::Html(page)).into_response())
}

/// Something that is kept beside its result, as it is.
pub async fn attachment(app: &App, kind: &str, id: &str, name: &str, media: &'static str) -> Result<Response, Fault> {
    let content = app.service.jobs().attachment(kind, id, name).await?;
    Ok(([(header::CONTENT_TYPE, media)], content).into_response())
}

/// Cancels it, or removes it if it has ended.
pub async fn delete(app: &App, kind: &str, id: &str) -> Result<Response, Fault> {
    Ok(match app.service.jobs().delete(kind, id).await? {
        Deleted::Cancelled(job) => (StatusCode::ACCEPTED, axum::Json(JobWire::from(*job))).into_response(),
        Deleted::Removed => StatusCode::NO_CONTENT.into_response(),
    })
}

/// What happens to it, after the event that the client has seen last. The last event is `finished` with the whole job; who has
/// seen it is told by 204 not to come again.
pub async fn events(app: &App, kind: &str, id: &str, headers: &HeaderMap) -> Result<Response, Fault> {
    let jobs = app.service.jobs();
    let job = jobs.get(kind, id).await?;
    let last = events::last_id(headers).and_then(|id| id.parse().ok()).unwrap_or(0);
    if job.status.is_final() && jobs.events(id, last).await?.is_empty() {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    Ok(events::response(stream_of(jobs.clone(), job.kind, job.id, last)))
}

fn stream_of(
    jobs: Jobs,
    kind: String,
    id: String,
    last: i64,
) -> impl Stream<Item = Result<Event, Infallible>> + Send + 'static {
    struct Watch {
        jobs: Jobs,
        kind: String,
        id: String,
        last: i64,
        is_over: bool,
    }
    let watch = Watch { jobs, kind, id, last, is_over: false };
    let batches = stream::unfold(watch, |mut watch| async move {
        if watch.is_over {
            return None;
        }
        let mut changes = watch.jobs.changes();
        let mut stopping = watch.jobs.stopping();
        loop {
            // A client that is told nothing more comes again and says what it has seen last.
            let found = watch.jobs.events(&watch.id, watch.last).await.ok()?;
            if !found.is_empty() {
                let mut events = Vec::with_capacity(found.len());
                for event in found {
                    watch.last = event.number;
                    let number = event.number.to_string();
                    let told = if event.status.is_final() {
                        watch.is_over = true;
                        let job: JobWire = watch.jobs.get(&watch.kind, &watch.id).await.ok()?.into();
                        Event::default().event("finished").json_data(job)
                    } else {
                        Event::default().event("progress").json_data(JobEventWire::from(event))
                    };
                    events.push(Ok(told.ok()?.id(number)));
                }
                return Some((stream::iter(events), watch));
            }
            let is_there = watch.jobs.get(&watch.kind, &watch.id).await.is_ok();
            if !is_there || *stopping.borrow() {
                return None;
            }
            tokio::select! {
                _ = changes.changed() => {}
                _ = stopping.changed() => {}
                () = tokio::time::sleep(LOOK_EVERY) => {}
            }
        }
    });
    futures_util::StreamExt::flatten(batches)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_short_and_print() {
        let key = |value: &[u8]| {
            let value = HeaderValue::from_bytes(value).expect("a value");
            idempotency_key(&HeaderMap::from_iter([(header::HeaderName::from_static("idempotency-key"), value)]))
        };
        assert_eq!(idempotency_key(&HeaderMap::new()), Ok(None));
        assert_eq!(key(b"\"8e03978e\""), Ok(Some("\"8e03978e\"".into())));
        assert!(key(b"").is_err() && key(&[b'x'; 256]).is_err() && key(b"\xff").is_err());
    }
}
