//! `POST /v1/poses`.

use axum::Extension;
use axum::extract::State;
use serde_json::Value;

use super::App;
use super::error::ApiError;
use super::extract::Json;
use super::layers::Deadline;
use crate::shell::wire::{OneOrManyReplies, PoseReplies, PoseReply, PoseRequest, Problem};

/// Points to pose, one request or many.
#[utoipa::path(
    post,
    path = "/v1/poses",
    tag = "Poses",
    description = "The pose of a target from points of it and where a calibrated camera sees them. One request as an object, \
        or many as `{\"requests\": [...]}`: then the reply is `{\"replies\": [...]}` in the same order, a request that fails \
        carrying its own `error`, the others unharmed. That there is no pose to be had is no error: `pose` is null and \
        `reason` says why.",
    request_body(content = OneOrMany),
    responses(
        (status = 200, description = "The pose or poses", body = ReplyOrReplies),
        (status = "4XX", description = "What is wrong with the request", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "The service is full; `Retry-After` says when to try again", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn post(
    State(app): State<App>,
    Extension(Deadline(deadline)): Extension<Deadline>,
    Json(body): Json<Value>,
) -> Result<axum::Json<OneOrManyReplies>, ApiError> {
    Ok(axum::Json(app.service.points(body, deadline).await?))
}

/// The body, for the document.
#[derive(utoipa::ToSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "read by the document only")]
enum OneOrMany {
    One(Box<PoseRequest>),
    Many { requests: Vec<PoseRequest> },
}

/// The reply, for the document.
#[derive(utoipa::ToSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "read by the document only")]
enum ReplyOrReplies {
    One(Box<PoseReply>),
    Many(PoseReplies),
}
