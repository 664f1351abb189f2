//! `POST /v1/estimates`.

use axum::extract::State;
use axum::{Extension, Json};

use super::App;
use super::error::ApiError;
use super::extract::{FramePost, FrameQuery};
use super::layers::Deadline;
use crate::shell::wire::{EstimateReply, Problem};

/// Frame to centroids and poses.
#[utoipa::path(
    post,
    path = "/v1/estimates",
    tag = "Frames",
    description = "The targets that a frame shows: which blob is which marker, and the pose with its alternatives. The frame is the \
        body, with the options in the query, or the part `frame` of a form whose part `request` is the JSON request.",
    params(FrameQuery),
    request_body(content(
        (Vec<u8> = "image/jpeg"), (Vec<u8> = "image/png"), (Vec<u8> = "image/webp"), (Vec<u8> = "image/bmp"),
        (Vec<u8> = "image/tiff"), (Vec<u8> = "image/x-portable-pixmap"), (Vec<u8> = "application/octet-stream"),
        (super::docs::FrameForm = "multipart/form-data"),
    )),
    responses(
        (status = 200, description = "The centroids and the poses", body = EstimateReply),
        (status = "4XX", description = "What is wrong with the request", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "The service is full; `Retry-After` says when to try again", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn post(
    State(app): State<App>,
    Extension(Deadline(deadline)): Extension<Deadline>,
    post: FramePost,
) -> Result<Json<EstimateReply>, ApiError> {
    Ok(Json(app.service.estimate(post.frame, post.request, deadline).await?))
}
