//! `/v1/evaluations`: a study, recorded frames or encounters in, figures out, by and by.

use std::time::Instant;

use axum::extract::rejection::QueryRejection;
use axum::extract::{FromRequest, Query, Request, State};
use axum::http::{HeaderMap, header};
use axum::response::Response;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use utoipa::ToSchema;

use super::App;
use super::error::ApiError;
use super::extract::{FormParts, Json, receive};
use super::jobs::{self, JobId};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::evaluation::{CASES_CSV, CASES_JSON, EVALUATION};
use crate::shell::wire::recorded::{RecordedRequest, SidecarWire};
use crate::shell::wire::{AskedEvaluation, JobEventWire, JobWire, Problem};

/// The evaluations.
#[derive(Debug, Serialize, ToSchema)]
pub struct Evaluations {
    /// The last made first, without their results.
    pub evaluations: Vec<JobWire>,
}

/// Frames with their truth as a form.
#[derive(ToSchema)]
#[expect(dead_code, reason = "read by the document only")]
struct RecordedForm {
    /// The frames, each with the file name by which the truth names it: JPEG, PNG, WebP, BMP, TIFF or PNM.
    #[schema(value_type = Vec<String>, format = Binary)]
    frame: Vec<Vec<u8>>,
    /// What they show.
    truth: SidecarWire,
    /// All of it in a zip or a tar instead, the truth as `truth.json`.
    #[schema(value_type = Option<String>, format = Binary)]
    archive: Option<Vec<u8>>,
    /// What is asked, as JSON; may be left out.
    request: Option<RecordedRequest>,
}

const PARTS: FormParts = FormParts {
    files: &[("frame", None), ("truth", Some("truth.json")), ("archive", Some("archive"))],
    by_name: true,
    request_is_optional: true,
};

/// Starts an evaluation.
#[utoipa::path(
    post, path = "/v1/evaluations", tag = "Evaluations",
    description = "JSON: puts solvers to many simulated cases with known truth; the result in the job is an `Evaluation`. With `\"kind\": \"encounters\"`: flies random encounters of two aircraft through detector, \
        identification, solver and tracker, and tells ranges, alarms and the risk ratio; the result is an `EncountersEvaluation`. A form: puts recorded \
        frames through the whole pipeline and holds what is found against their truth; the result is a `RecordedEvaluation`. The work is done \
        afterwards, on as many threads and processes as there are; figures are the same to the last digit whenever the same is asked, but for \
        times. Frames are removed when the evaluation has ended.",
    params(("Idempotency-Key" = Option<String>, Header, description = "The client's name for this request: sent again, it names the same job")),
    request_body(content((AskedEvaluation = "application/json"), (RecordedForm = "multipart/form-data"))),
    responses(
        (status = 202, description = "Taken on", body = JobWire, headers(("Location" = String, description = "Where the job is"))),
        (status = 409, description = "The `Idempotency-Key` belongs to another request", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "A frame, or all together, or their number is more than accepted", body = Problem, content_type = "application/problem+json"),
        (status = "4XX", description = "What is wrong with the request", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "Too many jobs or uploads; `Retry-After` says when to try again", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn post(State(app): State<App>, request: Request) -> Result<Response, ApiError> {
    let key = jobs::idempotency_key(request.headers())?;
    let is_form =
        request.headers().get(header::CONTENT_TYPE).is_some_and(|of| of.as_bytes().starts_with(b"multipart/"));
    let job = if is_form {
        let mut intake = app.service.jobs().intake().await?;
        let asked: RecordedRequest = receive(request, &app, PARTS, &mut intake).await?;
        app.service.jobs().make(EVALUATION, json!({"recorded": asked}), intake, key).await?
    } else {
        let Json(asked) = Json::<Value>::from_request(request, &app).await?;
        let asked = AskedEvaluation::read(asked)?;
        let deadline = Instant::now() + app.service.settings().http.deadline();
        app.service.evaluation(asked, key, deadline).await?
    };
    Ok(jobs::accepted("/v1/evaluations", job))
}

/// Lists the evaluations.
#[utoipa::path(get, path = "/v1/evaluations", tag = "Evaluations", responses((status = 200, description = "All evaluations, the last made first", body = Evaluations)))]
pub async fn list(State(app): State<App>) -> Result<axum::Json<Evaluations>, ApiError> {
    Ok(axum::Json(Evaluations { evaluations: jobs::list(&app, EVALUATION).await? }))
}

/// Returns an evaluation.
#[utoipa::path(
    get, path = "/v1/evaluations/{id}", tag = "Evaluations",
    params(("id" = String, Path, description = "Id of the evaluation")),
    responses(
        (status = 200, description = "Where it stands, and its result when it has ended", body = JobWire),
        (status = 404, description = "None of that id", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn get(State(app): State<App>, JobId(id): JobId) -> Result<axum::Json<JobWire>, ApiError> {
    Ok(jobs::get(&app, EVALUATION, &id).await?)
}

/// Streams what happens to an evaluation.
#[utoipa::path(
    get, path = "/v1/evaluations/{id}/events", tag = "Evaluations",
    description = "Server-sent events: `progress` with the runs that are done (a JobEventWire), and at last `finished` with the \
        job. All from the beginning, or those after `Last-Event-ID`. The stream ends with `finished`, or when the service stops.",
    params(
        ("id" = String, Path, description = "Id of the evaluation"),
        ("Last-Event-ID" = Option<i64>, Header, description = "The event that was seen last"),
    ),
    responses(
        (status = 200, description = "The events", body = JobEventWire, content_type = "text/event-stream"),
        (status = 204, description = "It has ended and all was seen: do not come again"),
        (status = 404, description = "None of that id", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn events(State(app): State<App>, JobId(id): JobId, headers: HeaderMap) -> Result<Response, ApiError> {
    Ok(jobs::events(&app, EVALUATION, &id, &headers).await?)
}

/// Returns the report of an evaluation, for people.
#[utoipa::path(
    get, path = "/v1/evaluations/{id}/report", tag = "Evaluations",
    params(("id" = String, Path, description = "Id of the evaluation")),
    responses(
        (status = 200, description = "A page that loads nothing from elsewhere", body = String, content_type = "text/html"),
        (status = 404, description = "None of that id, or no report of it (yet)", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn report(State(app): State<App>, JobId(id): JobId) -> Result<Response, ApiError> {
    Ok(jobs::report(&app, EVALUATION, &id).await?)
}

/// How cases are wanted.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CasesQuery {
    /// `csv` (usual) or `json`.
    #[serde(default)]
    format: CasesFormat,
}

/// As what cases are returned.
#[derive(Clone, Copy, Debug, Default, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CasesFormat {
    /// A line for each, the first with the names.
    #[default]
    Csv,
    /// An array with an object for each.
    Json,
}

/// Returns every case of an evaluation.
#[utoipa::path(
    get, path = "/v1/evaluations/{id}/cases", tag = "Evaluations",
    description = "What every solver said of every case, for those who plot themselves. Kept of evaluations of up to 100,000 solves; the command line \
        writes those of larger ones.",
    params(("id" = String, Path, description = "Id of the evaluation"), ("format" = Option<CasesFormat>, Query, description = "As what; CSV if it is not said")),
    responses(
        (status = 200, description = "The cases", body = String, content_type = "text/csv"),
        (status = 404, description = "None of that id, or no cases of it (yet)", body = Problem, content_type = "application/problem+json"),
        (status = "4XX", description = "What is wrong with the request", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn cases(
    State(app): State<App>,
    JobId(id): JobId,
    query: Result<Query<CasesQuery>, QueryRejection>,
) -> Result<Response, ApiError> {
    let Query(CasesQuery { format }) =
        query.map_err(|rejection| Fault::new(FaultKind::Senseless, rejection.body_text()))?;
    let (name, media) = match format {
        CasesFormat::Csv => (CASES_CSV, "text/csv; charset=utf-8"),
        CasesFormat::Json => (CASES_JSON, "application/json"),
    };
    Ok(jobs::attachment(&app, EVALUATION, &id, name, media).await?)
}

/// Cancels or removes an evaluation.
#[utoipa::path(
    delete, path = "/v1/evaluations/{id}", tag = "Evaluations",
    params(("id" = String, Path, description = "Id of the evaluation")),
    responses(
        (status = 202, description = "It had not ended, and is cancelled now", body = JobWire),
        (status = 204, description = "It had ended, and is removed with its report"),
        (status = 404, description = "None of that id", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn delete(State(app): State<App>, JobId(id): JobId) -> Result<Response, ApiError> {
    Ok(jobs::delete(&app, EVALUATION, &id).await?)
}
