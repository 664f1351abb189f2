//! Bodies and parameters of requests, with our own words for everything that can be wrong with them.

mod frame;
mod query;
mod upload;

use axum::body::{Body, Bytes};
use axum::extract::{FromRequest, FromRequestParts, Path, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use futures_util::StreamExt;
use serde::de::DeserializeOwned;

pub use frame::FramePost;
pub use query::{FrameQuery, NoteQuery};
pub use upload::{FormParts, receive};

use super::App;
use super::error::ApiError;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store::check_name;
use crate::shell::wire::camera_file::{from_xml, from_yaml};
use crate::shell::wire::{CameraPut, from_json};

/// A JSON body.
#[derive(Debug)]
pub struct Json<T>(pub T);

impl<T: DeserializeOwned> FromRequest<App> for Json<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, app: &App) -> Result<Self, ApiError> {
        let (parts, body) = request.into_parts();
        let essence = content_type(&parts.headers);
        if essence != "application/json" && !essence.ends_with("+json") {
            let given = if essence.is_empty() { "no content type".into() } else { format!("content type {essence}") };
            let detail = format!("{given}: application/json is read here");
            return Err(Fault::new(FaultKind::NotAFrame, detail).into());
        }
        let bytes = read(&parts.headers, body, app.service.settings().http.max_json_bytes).await?;
        Ok(Self(from_json(&bytes)?))
    }
}

/// What a camera is stored from: JSON, or a file of ROS or OpenCV.
#[derive(Debug)]
pub struct CameraBody(pub CameraPut);

impl FromRequest<App> for CameraBody {
    type Rejection = ApiError;

    async fn from_request(request: Request, app: &App) -> Result<Self, ApiError> {
        type Reader = fn(&[u8]) -> Result<CameraPut, Fault>;
        let (parts, body) = request.into_parts();
        let essence = content_type(&parts.headers);
        let read_body: Reader = match essence.as_str() {
            "application/yaml" | "application/x-yaml" | "text/yaml" | "text/x-yaml" => {
                |bytes| from_yaml(bytes).map(CameraPut::Camera)
            }
            "application/xml" | "text/xml" => |bytes| from_xml(bytes).map(CameraPut::Camera),
            json if json == "application/json" || json.ends_with("+json") => CameraPut::read,
            _ => {
                let given =
                    if essence.is_empty() { "no content type".into() } else { format!("content type {essence}") };
                let detail = format!("{given}: application/json, application/yaml and application/xml are read here");
                return Err(Fault::new(FaultKind::NotAFrame, detail).into());
            }
        };
        let bytes = read(&parts.headers, body, app.service.settings().http.max_json_bytes).await?;
        Ok(Self(read_body(&bytes)?))
    }
}

/// The name at the end of a path, checked.
#[derive(Debug)]
pub struct Name(pub String);

impl<S: Send + Sync> FromRequestParts<S> for Name {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let Path(name) = Path::<String>::from_request_parts(parts, state)
            .await
            .map_err(|error| Fault::new(FaultKind::Unreadable, error.to_string()))?;
        check_name(&name)?;
        Ok(Self(name))
    }
}

/// Type and subtype of the content type, lower case; empty if there is none.
fn content_type(headers: &HeaderMap) -> String {
    let value = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    value.split(';').next().unwrap_or_default().trim().to_ascii_lowercase()
}

/// How much of a body that is too large is still read, so that the client hears of it: closing a connection while it is
/// sending would lose the reply.
const DRAINED: usize = 8;

/// The body, up to `limit` bytes.
async fn read(headers: &HeaderMap, body: Body, limit: usize) -> Result<Bytes, ApiError> {
    let too_large = || Fault::new(FaultKind::TooLarge, format!("the body is larger than {limit} bytes"));
    let announced = headers.get(header::CONTENT_LENGTH).and_then(|v| v.to_str().ok()?.parse::<usize>().ok());
    let mut stream = body.into_data_stream();
    let mut kept: Vec<u8> = Vec::new();
    if let Some(length) = announced.filter(|length| *length <= limit) {
        kept.reserve_exact(length);
    }
    let mut seen = 0;
    while let Some(chunk) = stream.next().await {
        let chunk = chunk.map_err(|error| Fault::new(FaultKind::Unreadable, format!("the body broke off: {error}")))?;
        seen += chunk.len();
        if seen <= limit {
            kept.extend_from_slice(&chunk);
        } else {
            kept = Vec::new();
            if seen > limit.saturating_mul(DRAINED) {
                break;
            }
        }
    }
    if seen > limit { Err(too_large().into()) } else { Ok(kept.into()) }
}
