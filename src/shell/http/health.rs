//! `/healthz`, `/readyz` and `/metrics`: they answer however full the service is.

use std::sync::atomic::Ordering;

use axum::Json;
use axum::extract::State;

use super::App;
use super::error::ApiError;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::{Health, Problem};

/// The process lives.
#[utoipa::path(get, path = "/healthz", tag = "Health", responses((status = 200, description = "It lives", body = Health)))]
pub async fn healthz() -> Json<Health> {
    Json(Health::OK)
}

/// The service takes requests.
///
/// # Errors
/// [`FaultKind::Overloaded`] while it is stopping, [`FaultKind::Unreachable`] while its store cannot be read.
#[utoipa::path(
    get, path = "/readyz", tag = "Health",
    responses(
        (status = 200, description = "It takes requests", body = Health),
        (status = 503, description = "It is stopping, or its store cannot be read", body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn readyz(State(app): State<App>) -> Result<Json<Health>, ApiError> {
    if app.stopping.load(Ordering::Relaxed) {
        return Err(Fault::new(FaultKind::Overloaded, "the service is stopping").into());
    }
    if !app.service.is_ready().await {
        return Err(Fault::new(FaultKind::Unreachable, "the store cannot be read").into());
    }
    Ok(Json(Health::OK))
}

/// Metrics in the text format of Prometheus.
#[utoipa::path(
    get, path = "/metrics", tag = "Health",
    responses((status = 200, description = "Metrics", body = String, content_type = "text/plain"))
)]
pub async fn metrics() -> String {
    crate::shell::telemetry::metrics().render()
}
