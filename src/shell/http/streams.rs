//! `/v1/streams`: what is looked for in the frames that cameras send.

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;

use super::error::ApiError;
use super::extract::{Json, Name};
use super::{App, things};
use crate::shell::store::Kind;
use crate::shell::wire::{Problem, StreamWire, Streams};

/// Lists the stored streams.
#[utoipa::path(get, path = "/v1/streams", tag = "Streams", responses((status = 200, description = "All streams, by name", body = Streams)))]
pub async fn list(State(app): State<App>) -> Result<axum::Json<Streams>, ApiError> {
    Ok(axum::Json(app.service.streams().await?))
}

/// Returns a stored stream.
#[utoipa::path(
    get, path = "/v1/streams/{camera}", tag = "Streams",
    params(
        ("camera" = String, Path, description = "Name under which the camera sends its frames"),
        ("If-None-Match" = Option<String>, Header, description = "Tag that the client has"),
    ),
    responses(
        (status = 200, description = "The stream; its tag in `ETag`", body = StreamWire, headers(("ETag" = String, description = "Changes with the content"))),
        (status = 304, description = "The client has it"),
        (status = 404, description = "None of that name", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn get(State(app): State<App>, Name(name): Name, headers: HeaderMap) -> Result<Response, ApiError> {
    things::get::<StreamWire>(&app, Kind::Stream, &name, &headers).await
}

/// Stores a stream.
///
/// From the next frame on that a camera of this name sends, over Zenoh or HTTP, these targets are looked for in it.
#[utoipa::path(
    put, path = "/v1/streams/{camera}", tag = "Streams",
    params(
        ("camera" = String, Path, description = "Name under which the camera sends its frames"),
        ("If-Match" = Option<String>, Header, description = "Replace only what has this tag"),
        ("If-None-Match" = Option<String>, Header, description = "`*`: create only"),
    ),
    request_body = StreamWire,
    responses(
        (status = 200, description = "Replaced", body = StreamWire, headers(("ETag" = String, description = "Changes with the content"))),
        (status = 201, description = "Created", body = StreamWire, headers(("ETag" = String, description = "Changes with the content"))),
        (status = 404, description = "No stored camera or target of a name that it gives", body = Problem, content_type = "application/problem+json"),
        (status = 412, description = "Somebody else was faster", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "It makes no sense", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn put(
    State(app): State<App>,
    Name(name): Name,
    headers: HeaderMap,
    Json(stream): Json<StreamWire>,
) -> Result<Response, ApiError> {
    app.service.check_stream(&stream).await?;
    things::put(&app, Kind::Stream, &name, &headers, &stream).await
}

/// Removes a stored stream.
#[utoipa::path(
    delete, path = "/v1/streams/{camera}", tag = "Streams",
    params(
        ("camera" = String, Path, description = "Name under which the camera sends its frames"),
        ("If-Match" = Option<String>, Header, description = "Remove only what has this tag"),
    ),
    responses(
        (status = 204, description = "Removed"),
        (status = 404, description = "None of that name", body = Problem, content_type = "application/problem+json"),
        (status = 412, description = "It has another tag", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn delete(State(app): State<App>, Name(name): Name, headers: HeaderMap) -> Result<StatusCode, ApiError> {
    things::delete(&app, Kind::Stream, &name, &headers).await
}
