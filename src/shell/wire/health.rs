//! State of the service.

use serde::Serialize;
use utoipa::ToSchema;

/// State of the service.
#[derive(Debug, Serialize, ToSchema)]
pub struct Health {
    /// `ok`.
    pub status: &'static str,
    /// Version of the program.
    pub version: &'static str,
}

impl Health {
    /// All is well.
    pub const OK: Self = Self { status: "ok", version: env!("CARGO_PKG_VERSION") };
}
