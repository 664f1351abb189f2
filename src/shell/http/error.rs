//! Faults as `application/problem+json`.

use axum::Json;
use axum::extract::OriginalUri;
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};

use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::Problem;

/// Seconds after which a client may try again: a queue of frames is worked off well within one.
const RETRY_AFTER_S: HeaderValue = HeaderValue::from_static("1");

/// A fault on its way to the client.
#[derive(Debug)]
pub struct ApiError(pub Fault);

impl<T: Into<Fault>> From<T> for ApiError {
    fn from(fault: T) -> Self {
        Self(fault.into())
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let problem = Problem::from(&self.0);
        let status = StatusCode::from_u16(problem.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        if status.is_server_error() && !self.0.kind.is_passing() {
            tracing::error!(detail = %self.0.detail, "request failed");
        }
        let mut response = (status, Json(problem)).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        if self.0.kind.is_passing() {
            headers.insert(header::RETRY_AFTER, RETRY_AFTER_S);
        }
        response
    }
}

/// Answer for a path that is not there.
pub async fn no_such_route(OriginalUri(uri): OriginalUri) -> ApiError {
    let detail = format!("there is nothing at {}; the paths are listed at /docs", uri.path());
    Fault::new(FaultKind::NotFound, detail).into()
}

/// Answer for a method that a path does not have.
pub async fn no_such_method(method: Method, OriginalUri(uri): OriginalUri) -> ApiError {
    Fault::new(FaultKind::MethodNotAllowed, format!("{method} is not answered at {}", uri.path())).into()
}
