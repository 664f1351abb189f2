//! `/v1/cameras` and `/v1/targets`: stored by name, replaced only by who knows what is there.

use axum::extract::{RawQuery, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde::de::DeserializeOwned;
use utoipa::ToSchema;

use super::App;
use super::conditional::{is_known, precondition};
use super::error::ApiError;
use super::extract::{CameraBody, Json, Name};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store::{Kind, Put, Stored};
use crate::shell::wire::{
    CameraFormat, CameraPut, CameraWire, Cameras, DerivedCameraWire, Problem, TargetWire, Targets, from_json,
    write_camera,
};
use crate::target::Target;

/// A camera, or what it is derived from.
#[derive(ToSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "read by the document only")]
pub enum CameraOrDerived {
    /// The camera itself.
    Camera(CameraWire),
    /// A stored camera, cut out, scaled, or both.
    Derived(DerivedCameraWire),
}

/// Lists the stored cameras.
#[utoipa::path(get, path = "/v1/cameras", tag = "Cameras", responses((status = 200, description = "All cameras, by name", body = Cameras)))]
pub async fn list_cameras(State(app): State<App>) -> Result<axum::Json<Cameras>, ApiError> {
    Ok(axum::Json(app.service.cameras().await?))
}

/// Lists the stored targets.
#[utoipa::path(get, path = "/v1/targets", tag = "Targets", responses((status = 200, description = "All targets, by name", body = Targets)))]
pub async fn list_targets(State(app): State<App>) -> Result<axum::Json<Targets>, ApiError> {
    Ok(axum::Json(app.service.targets().await?))
}

/// Returns a stored camera.
///
/// As JSON, or as a file of ROS or OpenCV, which has no place for the covariance of the parameters.
#[utoipa::path(
    get, path = "/v1/cameras/{name}", tag = "Cameras",
    params(
        ("name" = String, Path, description = "Name of the camera"),
        ("format" = Option<CameraFormat>, Query, description = "The format, whatever `Accept` says"),
        ("Accept" = Option<String>, Header, description = "`application/yaml` for `ros`, `application/xml` for `opencv-xml`, else JSON"),
        ("If-None-Match" = Option<String>, Header, description = "Tag that the client has"),
    ),
    responses(
        (
            status = 200, description = "The camera; its tag in `ETag`",
            content((CameraWire = "application/json"), (String = "application/yaml"), (String = "application/xml")),
            headers(("ETag" = String, description = "Changes with the content"))
        ),
        (status = 304, description = "The client has it"),
        (status = 404, description = "None of that name", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "No such format", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn get_camera(
    State(app): State<App>,
    Name(name): Name,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let vary = [(header::VARY, "accept")];
    let format = camera_format(query.as_deref(), &headers)?;
    if format == CameraFormat::Json {
        return Ok((vary, get::<CameraWire>(&app, Kind::Camera, &name, &headers).await?).into_response());
    }
    let stored =
        app.service.store().get(Kind::Camera, &name).await?.ok_or_else(|| none_of_that_name(Kind::Camera, &name))?;
    // Other bytes than the JSON, whose tag is the strong one.
    let tag = [(header::ETAG, format!("W/{}", stored.etag))];
    if is_known(&headers, &stored.etag)? {
        return Ok((StatusCode::NOT_MODIFIED, vary, tag).into_response());
    }
    let text = write_camera(&content::<CameraWire>(&stored)?, &name, format)?;
    Ok((vary, tag, [(header::CONTENT_TYPE, format.media_type())], text).into_response())
}

/// The format that the query names, or else that the client prefers (RFC 9110, section 12.5.1).
fn camera_format(query: Option<&str>, headers: &HeaderMap) -> Result<CameraFormat, Fault> {
    if let Some((key, value)) = form_urlencoded::parse(query.unwrap_or_default().as_bytes()).next() {
        if key != "format" {
            return Err(Fault::new(FaultKind::Senseless, format!("no such parameter: {key}; there is format")));
        }
        return CameraFormat::of_name(&value);
    }
    let mut best = (0.0, CameraFormat::Json);
    let accepted = headers.get_all(header::ACCEPT).iter().filter_map(|value| value.to_str().ok());
    for range in accepted.flat_map(|value| value.split(',')) {
        let mut parts = range.split(';').map(|part| part.trim().to_ascii_lowercase());
        let format = match parts.next().unwrap_or_default().as_str() {
            "application/json" | "application/*" | "*/*" => CameraFormat::Json,
            "application/yaml" | "application/x-yaml" | "text/yaml" | "text/x-yaml" => CameraFormat::Ros,
            "application/xml" | "text/xml" => CameraFormat::OpencvXml,
            _ => continue,
        };
        let quality = parts.find_map(|part| part.strip_prefix("q=")?.parse::<f64>().ok()).unwrap_or(1.0);
        // Among equals the first.
        if quality > best.0 {
            best = (quality, format);
        }
    }
    Ok(best.1)
}

/// Returns a stored target.
#[utoipa::path(
    get, path = "/v1/targets/{name}", tag = "Targets",
    params(("name" = String, Path, description = "Name of the target"), ("If-None-Match" = Option<String>, Header, description = "Tag that the client has")),
    responses(
        (status = 200, description = "The target; its tag in `ETag`", body = TargetWire, headers(("ETag" = String, description = "Changes with the content"))),
        (status = 304, description = "The client has it"),
        (status = 404, description = "None of that name", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn get_target(State(app): State<App>, Name(name): Name, headers: HeaderMap) -> Result<Response, ApiError> {
    get::<TargetWire>(&app, Kind::Target, &name, &headers).await
}

/// Stores a camera.
///
/// From JSON, from a file of ROS (`camera_calibration`) or OpenCV (`FileStorage`), or derived from a stored camera, cut out, scaled,
/// or both: exact, covariance included.
#[utoipa::path(
    put, path = "/v1/cameras/{name}", tag = "Cameras",
    params(
        ("name" = String, Path, description = "Name of the camera"),
        ("If-Match" = Option<String>, Header, description = "Replace only what has this tag"),
        ("If-None-Match" = Option<String>, Header, description = "`*`: create only"),
    ),
    request_body(content(
        (CameraOrDerived = "application/json"), (String = "application/yaml"), (String = "application/xml"),
    )),
    responses(
        (status = 200, description = "Replaced", body = CameraWire, headers(("ETag" = String, description = "Changes with the content"))),
        (status = 201, description = "Created", body = CameraWire, headers(("ETag" = String, description = "Changes with the content"))),
        (status = 404, description = "None of the name from which to derive", body = Problem, content_type = "application/problem+json"),
        (status = 412, description = "Somebody else was faster", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "Numbers that are no camera", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn put_camera(
    State(app): State<App>,
    Name(name): Name,
    headers: HeaderMap,
    CameraBody(wire): CameraBody,
) -> Result<Response, ApiError> {
    // Stored as what the core understood, not as what was sent.
    let camera = match wire {
        CameraPut::Camera(wire) => wire.checked()?,
        CameraPut::Derived(derived) => {
            let origin = app.service.store().get(Kind::Camera, &derived.derived_from).await?;
            let origin = origin.ok_or_else(|| {
                let detail = format!("no stored camera {:?}", derived.derived_from);
                Fault { kind: FaultKind::NotFound, detail, pointer: Some("/derived_from".into()) }
            })?;
            derived.of(&content(&origin)?)?
        }
    };
    put(&app, Kind::Camera, &name, &headers, &camera).await
}

/// Stores a target.
#[utoipa::path(
    put, path = "/v1/targets/{name}", tag = "Targets",
    params(
        ("name" = String, Path, description = "Name of the target"),
        ("If-Match" = Option<String>, Header, description = "Replace only what has this tag"),
        ("If-None-Match" = Option<String>, Header, description = "`*`: create only"),
    ),
    request_body = TargetWire,
    responses(
        (status = 200, description = "Replaced", body = TargetWire, headers(("ETag" = String, description = "Changes with the content"))),
        (status = 201, description = "Created", body = TargetWire, headers(("ETag" = String, description = "Changes with the content"))),
        (status = 409, description = "The target's own name is another", body = Problem, content_type = "application/problem+json"),
        (status = 412, description = "Somebody else was faster", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "Markers that are no target", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn put_target(
    State(app): State<App>,
    Name(name): Name,
    headers: HeaderMap,
    Json(wire): Json<TargetWire>,
) -> Result<Response, ApiError> {
    let target = TargetWire::from(&Target::try_from(&wire)?);
    let unnamed = TargetWire::unnamed();
    if target.name != name && target.name != unnamed {
        let detail = format!("the target is named {:?} but is to be stored as {name:?}", target.name);
        return Err(Fault { kind: FaultKind::Conflict, detail, pointer: Some("/name".into()) }.into());
    }
    put(&app, Kind::Target, &name, &headers, &TargetWire { name: name.clone(), ..target }).await
}

/// Removes a stored camera.
#[utoipa::path(
    delete, path = "/v1/cameras/{name}", tag = "Cameras",
    params(("name" = String, Path, description = "Name of the camera"), ("If-Match" = Option<String>, Header, description = "Remove only what has this tag")),
    responses(
        (status = 204, description = "Removed"),
        (status = 404, description = "None of that name", body = Problem, content_type = "application/problem+json"),
        (status = 412, description = "It has another tag", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn delete_camera(
    State(app): State<App>,
    Name(name): Name,
    headers: HeaderMap,
) -> Result<StatusCode, ApiError> {
    delete(&app, Kind::Camera, &name, &headers).await
}

/// Removes a stored target.
#[utoipa::path(
    delete, path = "/v1/targets/{name}", tag = "Targets",
    params(("name" = String, Path, description = "Name of the target"), ("If-Match" = Option<String>, Header, description = "Remove only what has this tag")),
    responses(
        (status = 204, description = "Removed"),
        (status = 404, description = "None of that name", body = Problem, content_type = "application/problem+json"),
        (status = 412, description = "It has another tag", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn delete_target(
    State(app): State<App>,
    Name(name): Name,
    headers: HeaderMap,
) -> Result<StatusCode, ApiError> {
    delete(&app, Kind::Target, &name, &headers).await
}

fn content<T: DeserializeOwned>(stored: &Stored) -> Result<T, Fault> {
    from_json(stored.body.as_bytes())
}

fn none_of_that_name(kind: Kind, name: &str) -> ApiError {
    Fault::new(FaultKind::NotFound, format!("no stored {} {name:?}", kind.name())).into()
}

pub(super) async fn get<T: DeserializeOwned + Serialize>(
    app: &App,
    kind: Kind,
    name: &str,
    headers: &HeaderMap,
) -> Result<Response, ApiError> {
    let stored = app.service.store().get(kind, name).await?.ok_or_else(|| none_of_that_name(kind, name))?;
    let tag = [(header::ETAG, stored.etag.clone())];
    if is_known(headers, &stored.etag)? {
        return Ok((StatusCode::NOT_MODIFIED, tag).into_response());
    }
    Ok((tag, axum::Json(content::<T>(&stored)?)).into_response())
}

pub(super) async fn put<T: Serialize>(
    app: &App,
    kind: Kind,
    name: &str,
    headers: &HeaderMap,
    thing: &T,
) -> Result<Response, ApiError> {
    let body = serde_json::to_string(thing).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))?;
    let (put, stored) = app.service.store().put(kind, name, &body, &precondition(headers)?).await?;
    let status = match put {
        Put::Created => StatusCode::CREATED,
        Put::Replaced => StatusCode::OK,
    };
    Ok((status, [(header::ETAG, stored.etag)], axum::Json(thing)).into_response())
}

pub(super) async fn delete(app: &App, kind: Kind, name: &str, headers: &HeaderMap) -> Result<StatusCode, ApiError> {
    if app.service.store().delete(kind, name, &precondition(headers)?).await? {
        Ok(StatusCode::NO_CONTENT)
    } else {
        Err(none_of_that_name(kind, name))
    }
}
