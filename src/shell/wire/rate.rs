//! Shares.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::statistics::Rate;

/// A share of the cases.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Rate)]
pub struct RateWire {
    /// Those for which it holds.
    pub count: u64,
    /// All.
    pub of: u64,
    /// The share; null of nothing.
    pub ratio: Option<f64>,
    /// Where the true share lies with a confidence of 95 % (Wilson).
    pub interval: [f64; 2],
}

impl From<Rate> for RateWire {
    fn from(rate: Rate) -> Self {
        Self { count: rate.count, of: rate.of, ratio: rate.ratio(), interval: rate.interval() }
    }
}
