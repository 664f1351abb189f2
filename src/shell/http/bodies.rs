//! `/v1/bodies`: other nodes that this one sees.

use axum::Json;
use axum::extract::State;

use super::App;
use crate::shell::wire::relative::BodiesWire;

/// Lists the other nodes of the settings, as they were seen last.
#[utoipa::path(
    get, path = "/v1/bodies", tag = "Streams",
    description = "The nodes in `[[swarm.bodies]]` of the settings: where this node's cameras saw each of them last, and how that agreed with \
        what it said of this one. The same is told over Zenoh as it comes.",
    responses((status = 200, description = "All of them, by name", body = BodiesWire))
)]
pub async fn list(State(app): State<App>) -> Json<BodiesWire> {
    Json(app.service.bodies())
}
