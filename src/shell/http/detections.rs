//! `POST /v1/detections`.

use axum::extract::State;
use axum::{Extension, Json};

use super::App;
use super::error::ApiError;
use super::extract::{FramePost, FrameQuery};
use super::layers::Deadline;
use crate::shell::wire::{DetectionReply, Problem};

/// Frame to centroids.
#[utoipa::path(
    post,
    path = "/v1/detections",
    tag = "Frames",
    description = "The blobs of a frame that may be markers, and those that were refused with the reason. The frame is the \
        body, with the options in the query, or the part `frame` of a form whose part `request` is the JSON request.",
    params(FrameQuery),
    request_body(content(
        (Vec<u8> = "image/jpeg"), (Vec<u8> = "image/png"), (Vec<u8> = "image/webp"), (Vec<u8> = "image/bmp"),
        (Vec<u8> = "image/tiff"), (Vec<u8> = "image/x-portable-pixmap"), (Vec<u8> = "application/octet-stream"),
        (super::docs::FrameForm = "multipart/form-data"),
    )),
    responses(
        (status = 200, description = "The centroids", body = DetectionReply),
        (status = "4XX", description = "What is wrong with the request", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "The service is full; `Retry-After` says when to try again", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn post(
    State(app): State<App>,
    Extension(Deadline(deadline)): Extension<Deadline>,
    post: FramePost,
) -> Result<Json<DetectionReply>, ApiError> {
    Ok(Json(app.service.detection(post.frame, post.request, deadline).await?))
}
