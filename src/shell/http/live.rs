//! `/v1/cameras/{name}/frames` and `/v1/cameras/{name}/estimates`: a camera that sends, and the ground stations that watch it.

use std::convert::Infallible;
use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::sse::Event;
use axum::response::{IntoResponse, Response};
use futures_util::{Stream, StreamExt, stream};
use utoipa::ToSchema;

use super::App;
use super::error::ApiError;
use super::events;
use super::extract::{FramePost, Name, NoteQuery};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::hub::{Arrival, Heard, Listener};
use crate::shell::wire::swarm::FrameNote;
use crate::shell::wire::{EstimateReply, Problem};

/// A frame that a camera sends, with what it says of it, as a form.
#[derive(ToSchema)]
#[expect(dead_code, reason = "read by the document only")]
struct SentFrameForm {
    /// The frame's bytes.
    #[schema(value_type = String, format = Binary)]
    frame: Vec<u8>,
    /// What the camera says of it, as JSON.
    request: FrameNote,
}

/// Takes a frame of a camera's stream.
#[utoipa::path(
    post,
    path = "/v1/cameras/{name}/frames",
    tag = "Streams",
    description = "The next frame of the camera that sends under this name. It goes the way of those that come over Zenoh: the settings are \
        those of `PUT /v1/streams/{name}`, tracks are kept over all frames, whoever listens is told, and the reply is that of \
        `POST /v1/estimates`. Of frames that come faster than they can be looked at the newest wins. The frame is the body, with its \
        number and time in the query, or the part `frame` of a form whose part `request` says them as JSON.",
    params(("name" = String, Path, description = "Name under which the camera sends its frames"), NoteQuery),
    request_body(content(
        (Vec<u8> = "image/jpeg"), (Vec<u8> = "image/png"), (Vec<u8> = "image/webp"), (Vec<u8> = "image/bmp"),
        (Vec<u8> = "image/tiff"), (Vec<u8> = "image/x-portable-pixmap"), (Vec<u8> = "application/octet-stream"),
        (SentFrameForm = "multipart/form-data"),
    )),
    responses(
        (status = 200, description = "The centroids and the poses", body = EstimateReply),
        (status = 404, description = "No stream is stored under this name", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`replaced`: a newer frame came before this one's turn; `too-old`: it was older than `streams.max_age_ms`", body = Problem, content_type = "application/problem+json"),
        (status = "4XX", description = "What is wrong with the request", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`deadline-exceeded`: it became too old while it was looked at; `overloaded`: the service is full", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn post(
    State(app): State<App>,
    Name(name): Name,
    post: Result<FramePost<FrameNote>, ApiError>,
) -> Result<Response, ApiError> {
    let camera = app.service.stored_sender(&name).await?;
    let FramePost { frame, request } = post.inspect_err(|error| camera.refuse(&error.0))?;
    let outcome = app.service.take(&camera, Arrival::now(request, move || frame)).await;
    let answered =
        outcome.map_err(|_| Fault::new(FaultKind::Internal, "the frame was lost; this is a fault of ours"))??;
    let json = [(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))];
    Ok((json, answered.estimate().1.to_owned()).into_response())
}

/// Streams what is seen in the frames of a camera.
#[utoipa::path(
    get,
    path = "/v1/cameras/{name}/estimates",
    tag = "Streams",
    description = "Server-sent events. `estimate`: the reply of `POST /v1/estimates` for a frame, however it came; `track`: what targets do \
        over time, after that frame (Tracks); `status`: what has become of the frames (CameraStatus), at first, now and then, and soon \
        after a loss; `gap`: what is not kept any more of what should come next (EstimatesGap). Estimates and tracks have numbers that \
        rise by one, over a new start of the service too; with `Last-Event-ID` the stream goes on after that number, without it from \
        now on. Who reads slowly is told of a gap too. The stream ends when the service stops.",
    params(
        ("name" = String, Path, description = "Name under which the camera sends its frames"),
        ("Last-Event-ID" = Option<u64>, Header, description = "The event that was seen last"),
    ),
    responses(
        (status = 200, description = "The events", body = EstimateReply, content_type = "text/event-stream"),
        (status = 404, description = "No stream is stored under this name", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "As many are told as may be; `Retry-After` says when to try again", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn estimates(State(app): State<App>, Name(name): Name, headers: HeaderMap) -> Result<Response, ApiError> {
    let camera = app.service.stored_sender(&name).await?;
    // What is no number is none of ours, and the client is told that there is a gap.
    let last = events::last_id(&headers).map(|id| id.parse().unwrap_or(0));
    let listener = Arc::clone(&app.service).listen_outside(camera, last)?;
    Ok(events::response(told(listener, last)))
}

/// What is heard as events.
fn told(listener: Listener, last: Option<u64>) -> impl Stream<Item = Result<Event, Infallible>> + Send + 'static {
    let heard = stream::unfold((listener, last.unwrap_or(0)), |(mut listener, mut last)| async move {
        let events = events_of(&listener.next().await?, &mut last);
        Some((stream::iter(events.into_iter().flatten().map(Ok)), (listener, last)))
    });
    heard.flatten()
}

/// `last` is the number that the client has seen last, be it that of an estimate whose tracks it lacks.
fn events_of(heard: &Heard, last: &mut u64) -> [Option<Event>; 2] {
    let event = |kind: &str| Event::default().event(kind);
    match heard {
        Heard::Answer(answered) => {
            let new = |(id, json): (u64, &str), kind| (id > *last).then(|| event(kind).id(id.to_string()).data(json));
            [new(answered.estimate(), "estimate"), answered.tracks().and_then(|tracks| new(tracks, "track"))]
        }
        Heard::Status(status) => [event("status").json_data(status).ok(), None],
        Heard::Gap(gap) => {
            // With the number before the next: who comes again is not told of this gap twice.
            *last = gap.next_id - 1;
            [event("gap").id(last.to_string()).json_data(gap).ok(), None]
        }
    }
}
