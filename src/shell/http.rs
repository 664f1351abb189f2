//! The HTTP door: one file for each resource, one list of routes.

pub mod conditional;
pub mod connections;
pub mod docs;
pub mod error;
mod evaluations;
mod events;
pub mod extract;
pub mod health;
pub mod layers;
pub mod server;

mod assessments;
mod bodies;
mod calibrations;
mod detections;
mod encounters;
mod estimates;
mod jobs;
mod live;
mod poses;
mod streams;
mod things;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::middleware::{from_fn, from_fn_with_state};
use tokio::sync::Semaphore;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::service::Service;

/// What every handler sees.
#[derive(Clone, Debug)]
pub struct App {
    /// The service.
    pub service: Arc<Service>,
    /// Places for requests being read or answered.
    pub(crate) places: Arc<Semaphore>,
    /// Set once the service has been told to stop.
    pub(crate) stopping: Arc<AtomicBool>,
}

impl App {
    /// Around a service.
    #[must_use]
    pub fn new(service: Service) -> Self {
        let places = Arc::new(Semaphore::new(service.settings().http.max_in_flight));
        Self { service: Arc::new(service), places, stopping: Arc::default() }
    }
}

/// All routes with their document.
fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::with_openapi(docs::Document::openapi())
        .routes(routes!(poses::post))
        .routes(routes!(detections::post))
        .routes(routes!(estimates::post))
        .routes(routes!(things::list_cameras))
        .routes(routes!(things::get_camera, things::put_camera, things::delete_camera))
        .routes(routes!(assessments::post))
        .routes(routes!(encounters::post))
        .routes(routes!(calibrations::list))
        .routes(routes!(calibrations::get, calibrations::delete))
        .routes(routes!(calibrations::events))
        .routes(routes!(calibrations::report))
        .routes(routes!(evaluations::list))
        .routes(routes!(evaluations::get, evaluations::delete))
        .routes(routes!(evaluations::events))
        .routes(routes!(evaluations::report))
        .routes(routes!(evaluations::cases))
        .routes(routes!(things::list_targets))
        .routes(routes!(things::get_target, things::put_target, things::delete_target))
        .routes(routes!(streams::list))
        .routes(routes!(streams::get, streams::put, streams::delete))
        .routes(routes!(live::post))
        .routes(routes!(live::estimates))
        .routes(routes!(bodies::list))
}

/// Routes that take what comes in its own time.
fn upload_routes() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(calibrations::post)).routes(routes!(evaluations::post))
}

/// Routes that answer however full the service is.
fn watch_routes() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(health::healthz))
        .routes(routes!(health::readyz))
        .routes(routes!(health::metrics))
}

/// The API document.
#[must_use]
pub fn openapi() -> utoipa::openapi::OpenApi {
    let (_, mut document) = routes().merge(upload_routes()).merge(watch_routes()).split_for_parts();
    docs::add_examples(&mut document);
    document
}

/// The whole door as a tower service.
pub fn router(app: App) -> Router {
    let (working, _) = routes().split_for_parts();
    let (uploading, _) = upload_routes().split_for_parts();
    let (watching, _) = watch_routes().split_for_parts();
    Router::new()
        .merge(working.layer(from_fn_with_state(app.clone(), layers::admit)))
        .merge(uploading.layer(from_fn_with_state(app.clone(), layers::admit_upload)))
        .merge(watching)
        .merge(docs::pages(openapi()))
        .fallback(error::no_such_route)
        .method_not_allowed_fallback(error::no_such_method)
        // Bodies are read within limits of our own; that of axum, 2 MB, would refuse a form with a large frame.
        .layer(DefaultBodyLimit::disable())
        .layer(from_fn(layers::observe))
        .layer(layers::catch_panics())
        .with_state(app)
}
