//! `/v1/calibrations`: pictures of a board in, a camera out, by and by.

use axum::extract::{Request, State};
use axum::http::HeaderMap;
use axum::response::Response;
use serde::Serialize;
use serde_json::json;
use utoipa::ToSchema;

use super::App;
use super::error::ApiError;
use super::extract::{FormParts, receive};
use super::jobs::{self, JobId};
use crate::shell::service::calibration::CALIBRATION;
use crate::shell::wire::{CalibrationRequest, JobEventWire, JobWire, Problem};

const PARTS: FormParts = FormParts { files: &[("image", None)], by_name: false, request_is_optional: false };

/// Pictures and what is asked of them as a form.
#[derive(ToSchema)]
#[expect(dead_code, reason = "read by the document only")]
struct CalibrationForm {
    /// The pictures, each with its file name: JPEG, PNG, WebP, BMP, TIFF or PNM.
    #[schema(value_type = Vec<String>, format = Binary)]
    image: Vec<Vec<u8>>,
    /// What is asked, as JSON.
    request: CalibrationRequest,
}

/// The calibrations.
#[derive(Debug, Serialize, ToSchema)]
pub struct Calibrations {
    /// The last made first, without their results.
    pub calibrations: Vec<JobWire>,
}

/// Starts a calibration.
#[utoipa::path(
    post, path = "/v1/calibrations", tag = "Calibrations",
    description = "Takes pictures of a board, parts `image`, and `request`, before, between or after them. The reply comes once they \
        are stored; the work is done afterwards. A picture that cannot be used is named in the result with its reason, and the \
        others are used. Pictures are removed when the calibration has ended.",
    params(("Idempotency-Key" = Option<String>, Header, description = "The client's name for this request: sent again, it names the same job")),
    request_body(content = CalibrationForm, content_type = "multipart/form-data"),
    responses(
        (status = 202, description = "Taken on", body = JobWire, headers(("Location" = String, description = "Where the job is"))),
        (status = 409, description = "The `Idempotency-Key` belongs to another request", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "A picture, or all together, or their number is more than accepted", body = Problem, content_type = "application/problem+json"),
        (status = "4XX", description = "What is wrong with the request", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "Too many jobs or uploads; `Retry-After` says when to try again", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn post(State(app): State<App>, request: Request) -> Result<Response, ApiError> {
    let key = jobs::idempotency_key(request.headers())?;
    let mut intake = app.service.jobs().intake().await?;
    let request: CalibrationRequest = receive(request, &app, PARTS, &mut intake).await?;
    request.check()?;
    let job = app.service.jobs().make(CALIBRATION, json!(request), intake, key).await?;
    Ok(jobs::accepted("/v1/calibrations", job))
}

/// Lists the calibrations.
#[utoipa::path(get, path = "/v1/calibrations", tag = "Calibrations", responses((status = 200, description = "All calibrations, the last made first", body = Calibrations)))]
pub async fn list(State(app): State<App>) -> Result<axum::Json<Calibrations>, ApiError> {
    Ok(axum::Json(Calibrations { calibrations: jobs::list(&app, CALIBRATION).await? }))
}

/// Returns a calibration.
#[utoipa::path(
    get, path = "/v1/calibrations/{id}", tag = "Calibrations",
    params(("id" = String, Path, description = "Id of the calibration")),
    responses(
        (status = 200, description = "Where it stands, and its result when it has ended", body = JobWire),
        (status = 404, description = "None of that id", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn get(State(app): State<App>, JobId(id): JobId) -> Result<axum::Json<JobWire>, ApiError> {
    Ok(jobs::get(&app, CALIBRATION, &id).await?)
}

/// Streams what happens to a calibration.
#[utoipa::path(
    get, path = "/v1/calibrations/{id}/events", tag = "Calibrations",
    description = "Server-sent events: `progress` with what was found in each picture (a JobEventWire), and at last `finished` with the \
        job. All from the beginning, or those after `Last-Event-ID`. The stream ends with `finished`, or when the service stops.",
    params(
        ("id" = String, Path, description = "Id of the calibration"),
        ("Last-Event-ID" = Option<i64>, Header, description = "The event that was seen last"),
    ),
    responses(
        (status = 200, description = "The events", body = JobEventWire, content_type = "text/event-stream"),
        (status = 204, description = "It has ended and all was seen: do not come again"),
        (status = 404, description = "None of that id", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn events(State(app): State<App>, JobId(id): JobId, headers: HeaderMap) -> Result<Response, ApiError> {
    Ok(jobs::events(&app, CALIBRATION, &id, &headers).await?)
}

/// Returns the report of a calibration, for people.
#[utoipa::path(
    get, path = "/v1/calibrations/{id}/report", tag = "Calibrations",
    params(("id" = String, Path, description = "Id of the calibration")),
    responses(
        (status = 200, description = "A page that loads nothing from elsewhere", body = String, content_type = "text/html"),
        (status = 404, description = "None of that id, or no report of it (yet)", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn report(State(app): State<App>, JobId(id): JobId) -> Result<Response, ApiError> {
    Ok(jobs::report(&app, CALIBRATION, &id).await?)
}

/// Cancels or removes a calibration.
#[utoipa::path(
    delete, path = "/v1/calibrations/{id}", tag = "Calibrations",
    params(("id" = String, Path, description = "Id of the calibration")),
    responses(
        (status = 202, description = "It had not ended, and is cancelled now", body = JobWire),
        (status = 204, description = "It had ended, and is removed with its report"),
        (status = 404, description = "None of that id", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn delete(State(app): State<App>, JobId(id): JobId) -> Result<Response, ApiError> {
    Ok(jobs::delete(&app, CALIBRATION, &id).await?)
}
