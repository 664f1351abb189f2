//! Forms with many pictures, which go to the disk as they come.

use std::io;
use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::extract::multipart::{Field, MultipartError};
use axum::extract::{FromRequest, Multipart, Request};
use futures_util::{Stream, StreamExt, stream};
use serde::de::DeserializeOwned;

use super::{DRAINED, content_type};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::http::App;
use crate::shell::http::error::ApiError;
use crate::shell::service::jobs::Intake;
use crate::shell::wire::from_json;

/// Which parts a form has.
#[derive(Clone, Copy, Debug)]
pub struct FormParts {
    /// Those that are files, any number of each, with the name that stands for one's own.
    pub files: &'static [(&'static str, Option<&'static str>)],
    /// Whether files are found by their names, so that no two may have the same.
    pub by_name: bool,
    /// Whether the part `request` may be left out.
    pub request_is_optional: bool,
}

/// Reads a form of files and one part `request`, in any order; the files go into the intake.
///
/// # Errors
/// What is wrong with it. As much of the rest as is bearable is read before, so that the client hears of it.
pub async fn receive<T: DeserializeOwned>(
    request: Request,
    app: &App,
    expected: FormParts,
    intake: &mut Intake,
) -> Result<T, ApiError> {
    let settings = app.service.settings();
    let essence = content_type(request.headers());
    if essence != "multipart/form-data" {
        let given = if essence.is_empty() { "no content type".into() } else { format!("content type {essence}") };
        let detail = format!("{given}: files are posted as parts {} of multipart/form-data", expected.names());
        return Err(Fault::new(FaultKind::NotAFrame, detail).into());
    }
    let (parts, body) = request.into_parts();
    let limit = usize::try_from(settings.jobs.max_upload_bytes).unwrap_or(usize::MAX).saturating_mul(DRAINED);
    let body = Body::from_stream(bounded(body, limit, settings.http.deadline()));
    let mut form = Multipart::from_request(Request::from_parts(parts, body), app)
        .await
        .map_err(|error| Fault::new(FaultKind::Unreadable, format!("not a form: {}", error.body_text())))?;
    match read(&mut form, expected, intake, settings.http.max_json_bytes).await {
        Ok(bytes) => Ok(from_json(&bytes)?),
        Err(fault) => {
            // Parts that are not asked for their bytes are skipped.
            while let Ok(Some(_)) = form.next_field().await {}
            Err(fault.into())
        }
    }
}

/// The bytes of the part `request`.
async fn read(form: &mut Multipart, expected: FormParts, intake: &mut Intake, most: usize) -> Result<Vec<u8>, Fault> {
    let unreadable = |detail: String| Fault::new(FaultKind::Unreadable, detail);
    let mut request = None;
    while let Some(field) = form.next_field().await.map_err(|error| broken(&error))? {
        let name = field.name().unwrap_or_default();
        if let Some((_, own_name)) = expected.files.iter().find(|(part, _)| *part == name) {
            let name = own_name.or(field.file_name()).map(str::to_owned);
            if let Some(taken) = name.as_deref().filter(|name| expected.by_name && intake.holds(name)) {
                return Err(unreadable(format!("two files are called {taken:?}")));
            }
            file(field, name, intake).await?;
            continue;
        }
        match name {
            "request" if request.is_some() => return Err(unreadable("part \"request\" comes twice".into())),
            "request" => request = Some(small(field, most).await?),
            other => {
                return Err(unreadable(format!("part {other:?}: the parts are {} and `request`", expected.names())));
            }
        }
    }
    if intake.count() == 0 {
        return Err(unreadable(format!("the form has no part {}", expected.names())));
    }
    if expected.request_is_optional && request.is_none() {
        return Ok(b"{}".to_vec());
    }
    request.ok_or_else(|| unreadable("the form has no part `request`".into()))
}

impl FormParts {
    fn names(self) -> String {
        self.files.iter().map(|(name, _)| format!("`{name}`")).collect::<Vec<_>>().join(", ")
    }
}

async fn file(mut field: Field<'_>, name: Option<String>, intake: &mut Intake) -> Result<(), Fault> {
    intake.begin(name.as_deref()).await?;
    while let Some(chunk) = field.chunk().await.map_err(|error| broken(&error))? {
        intake.write(&chunk).await?;
    }
    intake.end().await
}

async fn small(mut field: Field<'_>, most: usize) -> Result<Vec<u8>, Fault> {
    let mut bytes = Vec::new();
    while let Some(chunk) = field.chunk().await.map_err(|error| broken(&error))? {
        if bytes.len() + chunk.len() > most {
            let detail = format!("part \"request\" is larger than the {most} bytes that are accepted");
            return Err(Fault::new(FaultKind::TooLarge, detail));
        }
        bytes.extend_from_slice(&chunk);
    }
    Ok(bytes)
}

fn broken(error: &MultipartError) -> Fault {
    Fault::new(FaultKind::Unreadable, format!("the form cannot be read: {}", error.body_text()))
}

/// The body, cut off after `limit` bytes, or when nothing comes for so long.
fn bounded(body: Body, limit: usize, pause: Duration) -> impl Stream<Item = io::Result<Bytes>> + Send + 'static {
    let source = Box::pin(body.into_data_stream());
    stream::try_unfold((source, 0_usize), move |(mut source, seen)| async move {
        let late = |_| io::Error::new(io::ErrorKind::TimedOut, format!("nothing came for {} ms", pause.as_millis()));
        let Some(chunk) = tokio::time::timeout(pause, source.next()).await.map_err(late)? else { return Ok(None) };
        let chunk = chunk.map_err(io::Error::other)?;
        let seen = seen.saturating_add(chunk.len());
        if seen > limit {
            return Err(io::Error::other(format!("more than {limit} bytes")));
        }
        Ok(Some((chunk, (source, seen))))
    })
}
