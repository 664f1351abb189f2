//! From what centroids come.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::scene::encounters::Disturbance;

/// From what centroids come.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = Sensing)]
pub enum SensingName {
    /// Simulated, found as often and as far off as those of rendered frames were measured to be; a hundred times faster.
    #[default]
    Centroids,
    /// Found in rendered frames.
    Frames,
}

/// What disturbs simulated centroids.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = SimulatedCentroids)]
pub struct CentroidsWire {
    /// Probability of a marker not to be found that would be; 0 if left out.
    pub missing_ratio: f64,
    /// False blobs in a frame, on average; 0 if left out.
    pub clutter: f64,
    /// Errors in multiples of the measured ones, what is stated of them unchanged; 1 if left out.
    pub error_ratio: f64,
}

impl Default for CentroidsWire {
    fn default() -> Self {
        let Disturbance { missing_ratio, clutter, error_ratio } = Disturbance::default();
        Self { missing_ratio, clutter, error_ratio }
    }
}
