//! What happens to every request: counted, admitted or refused, given a deadline.

use std::any::Any;
use std::time::Instant;

use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use tower_http::catch_panic::CatchPanicLayer;

use super::App;
use super::error::ApiError;
use crate::shell::fault::{Fault, FaultKind};

/// When a request must be answered; an extension of every admitted request.
#[derive(Clone, Copy, Debug)]
pub struct Deadline(pub Instant);

/// Refuses at once what is too much, before its body is read, and answers what takes too long.
pub async fn admit(State(app): State<App>, mut request: Request, next: Next) -> Response {
    let Ok(_place) = app.places.try_acquire() else {
        metrics::counter!("skypose_shed_total").increment(1);
        let detail = "as many requests as the service takes are under way";
        return ApiError(Fault::new(FaultKind::Overloaded, detail)).into_response();
    };
    let _under_way = UnderWay::new();
    let deadline = Instant::now() + app.service.settings().http.deadline();
    request.extensions_mut().insert(Deadline(deadline));
    within(deadline, next.run(request)).await
}

/// The same for uploads, which take longer, and have places of their own with those who keep them.
pub async fn admit_upload(State(app): State<App>, request: Request, next: Next) -> Response {
    let _under_way = UnderWay::new();
    within(Instant::now() + app.service.settings().jobs.upload(), next.run(request)).await
}

async fn within(deadline: Instant, response: impl Future<Output = Response>) -> Response {
    let response = tokio::time::timeout_at(deadline.into(), response).await;
    response.unwrap_or_else(|_| {
        let detail = "the request took longer than it may";
        ApiError(Fault::new(FaultKind::DeadlineExceeded, detail)).into_response()
    })
}

/// Counts a request as under way while it lives: one whose client has gone is dropped where it stands.
struct UnderWay;

impl UnderWay {
    fn new() -> Self {
        metrics::gauge!("skypose_in_flight").increment(1.0);
        Self
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        metrics::gauge!("skypose_in_flight").decrement(1.0);
    }
}

/// Counts, times and logs; gives every reply the id under which it stands in the log.
pub async fn observe(request: Request, next: Next) -> Response {
    let start = Instant::now();
    let method = request.method().clone();
    let route = request.extensions().get::<MatchedPath>().map_or("none", MatchedPath::as_str).to_owned();
    let name = HeaderName::from_static("x-request-id");
    let id = request.headers().get(&name).cloned().unwrap_or_else(new_id);
    let mut response = next.run(request).await;
    let elapsed = start.elapsed();
    let status = response.status().as_u16();
    metrics::counter!(
        "skypose_requests_total",
        "route" => route.clone(), "method" => method.to_string(), "status" => status.to_string()
    )
    .increment(1);
    metrics::histogram!("skypose_request_seconds", "route" => route.clone()).record(elapsed.as_secs_f64());
    tracing::info!(id = ?id, %method, route, status, elapsed_us = elapsed.as_micros(), "answered");
    response.headers_mut().insert(name, id);
    response
}

/// Unique in this process, and between processes by the time of start.
fn new_id() -> HeaderValue {
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::time::{SystemTime, UNIX_EPOCH};
    static NEXT: AtomicU64 = AtomicU64::new(0);
    static START: std::sync::LazyLock<u64> = std::sync::LazyLock::new(|| {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        u64::try_from(since.as_micros()).unwrap_or_default()
    });
    let text = format!("{:x}-{}", *START, NEXT.fetch_add(1, Ordering::Relaxed));
    HeaderValue::from_str(&text).unwrap_or(HeaderValue::from_static("unknown"))
}

/// A panic in a handler becomes a problem; the connection and all others live on.
#[must_use]
pub fn catch_panics() -> CatchPanicLayer<fn(Box<dyn Any + Send>) -> Response> {
    CatchPanicLayer::custom(|_: Box<dyn Any + Send>| {
        let detail = "the handler failed; this is a fault of ours";
        ApiError(Fault::new(FaultKind::Internal, detail)).into_response()
    })
}
