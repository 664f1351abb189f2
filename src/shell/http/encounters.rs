//! `POST /v1/encounters`.

use axum::Extension;
use axum::extract::State;

use super::App;
use super::error::ApiError;
use super::extract::Json;
use super::layers::Deadline;
use crate::shell::wire::{EncounterReply, EncounterRequest, Problem};

/// Says how early another aircraft must be seen, and whether a camera can do it.
#[utoipa::path(
    post,
    path = "/v1/encounters",
    tag = "Encounters",
    description = "Sense-and-avoid geometry: the closing speed, the last moment of a turn that clears the intruder by the miss distance, by the \
        exact arc or the thesis' parabola, from how far it must therefore be seen, how large it is there in the picture of a camera, what of the \
        pipeline that allows, and what the camera covers of the directions in which guidance asks to look.\n\nAn aid to evaluate cameras and \
        detectors with, no certified function of any aircraft. Assumed: both keep their speeds, the intruder keeps its course, still air, a level \
        coordinated turn, straight flight after it.\n\nWhere there is no turn to be told (`never_closing`, `inside_miss_distance`, `not_needed`, \
        `miss_distance_unreachable`), its numbers are null and `reason` says why.",
    request_body = EncounterRequest,
    responses(
        (status = 200, description = "When to act, and what is seen", body = EncounterReply),
        (status = "4XX", description = "What is wrong with the request", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "The service is full; `Retry-After` says when to try again", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn post(
    State(app): State<App>,
    Extension(Deadline(deadline)): Extension<Deadline>,
    Json(request): Json<EncounterRequest>,
) -> Result<axum::Json<EncounterReply>, ApiError> {
    Ok(axum::Json(app.service.encounter(request, deadline).await?))
}
