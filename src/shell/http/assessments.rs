//! `POST /v1/targets/assessment`.

use axum::Extension;
use axum::extract::State;

use super::App;
use super::error::ApiError;
use super::extract::Json;
use super::layers::Deadline;
use crate::shell::wire::{AssessmentReply, AssessmentRequest, Problem};

/// Says what a constellation is good for.
#[utoipa::path(
    post,
    path = "/v1/targets/assessment",
    tag = "Targets",
    description = "Before the markers are glued: the expected error in range, bearing and attitude over range and aspect, how \
        often the wrong one of two poses wins, to what range the markers can be told apart, what is wrong with the \
        constellation, and which marker to move. Standard deviations are the Cramer-Rao bound; rates are counted on simulated \
        noise, the same for each request. No target is stored, and none can be stored under the name `assessment`.",
    request_body = AssessmentRequest,
    responses(
        (status = 200, description = "What it is good for", body = AssessmentReply),
        (status = "4XX", description = "What is wrong with the request", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "The service is full; `Retry-After` says when to try again", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn post(
    State(app): State<App>,
    Extension(Deadline(deadline)): Extension<Deadline>,
    Json(request): Json<AssessmentRequest>,
) -> Result<axum::Json<AssessmentReply>, ApiError> {
    Ok(axum::Json(app.service.assessment(request, deadline).await?))
}
