//! A frame with what is said of it: the frame as the body and the rest in the query, or both as parts of a form.

use axum::body::{Body, Bytes};
use axum::extract::{FromRequest, Multipart, Request};

use serde::de::DeserializeOwned;

use super::{FrameQuery, NoteQuery, content_type, read};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::http::App;
use crate::shell::http::error::ApiError;
use crate::shell::wire::swarm::FrameNote;
use crate::shell::wire::{FrameRequest, from_json};

/// The bytes of a frame and what is asked or said of it.
#[derive(Debug)]
pub struct FramePost<R = FrameRequest> {
    /// As they came.
    pub frame: Bytes,
    /// What is asked.
    pub request: R,
}

/// What may come with a frame.
pub trait Beside: DeserializeOwned + Default {
    /// From the query.
    ///
    /// # Errors
    /// Names the parameter.
    fn of_query(query: &str) -> Result<Self, Fault>;
}

impl Beside for FrameRequest {
    fn of_query(query: &str) -> Result<Self, Fault> {
        FrameQuery::read(query)
    }
}

impl Beside for FrameNote {
    fn of_query(query: &str) -> Result<Self, Fault> {
        NoteQuery::read(query)
    }
}

impl<R: Beside> FromRequest<App> for FramePost<R> {
    type Rejection = ApiError;

    async fn from_request(request: Request, app: &App) -> Result<Self, ApiError> {
        let http = &app.service.settings().http;
        let (parts, body) = request.into_parts();
        let essence = content_type(&parts.headers);
        let is_form = essence == "multipart/form-data";
        if !is_form && !essence.starts_with("image/") && essence != "application/octet-stream" {
            let given = if essence.is_empty() { "no content type".into() } else { format!("content type {essence}") };
            let detail = format!(
                "{given}: a frame is posted as image/jpeg, image/png, image/webp, image/bmp, image/tiff, \
                 image/x-portable-pixmap, application/octet-stream, or as part `frame` of multipart/form-data"
            );
            return Err(Fault::new(FaultKind::NotAFrame, detail).into());
        }
        let allowance = if is_form { http.max_json_bytes } else { 0 };
        let bytes = read(&parts.headers, body, http.max_frame_bytes + allowance).await?;
        if is_form {
            // A form is small change beside a frame: it is read whole and taken apart in memory.
            return Self::from_form(Request::from_parts(parts, Body::from(bytes)), app).await;
        }
        let request = R::of_query(parts.uri.query().unwrap_or_default())?;
        Ok(Self { frame: bytes, request })
    }
}

impl<R: Beside> FramePost<R> {
    async fn from_form(request: Request, app: &App) -> Result<Self, ApiError> {
        let unreadable = |detail: String| ApiError(Fault::new(FaultKind::Unreadable, detail));
        let mut form = Multipart::from_request(request, app)
            .await
            .map_err(|error| unreadable(format!("not a form: {}", error.body_text())))?;
        let (mut frame, mut request) = (None, None);
        while let Some(field) =
            form.next_field().await.map_err(|error| unreadable(format!("not a form: {}", error.body_text())))?
        {
            let name = field.name().unwrap_or_default().to_owned();
            let slot = match name.as_str() {
                "frame" => &mut frame,
                "request" => &mut request,
                other => return Err(unreadable(format!("part {other:?}: the parts are `frame` and `request`"))),
            };
            if slot.is_some() {
                return Err(unreadable(format!("part {name:?} comes twice")));
            }
            let bytes =
                field.bytes().await.map_err(|error| unreadable(format!("part {name:?}: {}", error.body_text())))?;
            *slot = Some(bytes);
        }
        let frame = frame.ok_or_else(|| unreadable("the form has no part `frame`".into()))?;
        let request: R = match request {
            Some(bytes) => from_json(&bytes)?,
            None => R::default(),
        };
        Ok(Self { frame, request })
    }
}
