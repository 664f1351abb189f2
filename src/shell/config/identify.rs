//! How markers are told apart.

use serde::{Deserialize, Serialize};

use crate::identify::IdentifyOptions;
use crate::pipeline;

/// How markers are told apart, and what is assumed of camera and target.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct IdentifySettings {
    /// Error of camera and target model when markers are told apart, px.
    pub model_sigma_px: f64,
    /// The same when the pose is computed from markers already told apart, px.
    pub pose_model_sigma_px: f64,
    /// How often a marker that faces the camera is not seen.
    pub miss_probability: f64,
    /// Assignments less probable than this together are refused.
    pub min_probability: f64,
    /// Blobs considered in one frame; the work grows with their third power.
    pub max_blobs: usize,
    /// Nearest range expected, m.
    pub min_range_m: f64,
    /// Farthest range expected, m.
    pub max_range_m: f64,
}

impl Default for IdentifySettings {
    fn default() -> Self {
        let core = IdentifyOptions::default();
        Self {
            model_sigma_px: core.model_sigma_px,
            pose_model_sigma_px: pipeline::Options::default().model_sigma_px,
            miss_probability: core.miss_probability,
            min_probability: core.min_probability,
            max_blobs: core.max_blobs,
            min_range_m: core.range_m[0],
            max_range_m: core.range_m[1],
        }
    }
}

impl IdentifySettings {
    /// For the core.
    #[must_use]
    pub fn options(&self) -> IdentifyOptions {
        IdentifyOptions {
            model_sigma_px: self.model_sigma_px,
            miss_probability: self.miss_probability,
            min_probability: self.min_probability,
            max_blobs: self.max_blobs,
            range_m: [self.min_range_m, self.max_range_m],
            ..IdentifyOptions::default()
        }
    }

    /// What makes no sense in them.
    pub(super) fn faults(&self, need: &mut impl FnMut(bool, &str, &str)) {
        for (setting, value) in [
            ("identify.model_sigma_px", self.model_sigma_px),
            ("identify.pose_model_sigma_px", self.pose_model_sigma_px),
        ] {
            need((0.0..=100.0).contains(&value), setting, "must be from 0 to 100");
        }
        for (setting, value) in
            [("identify.miss_probability", self.miss_probability), ("identify.min_probability", self.min_probability)]
        {
            need(value > 0.0 && value < 1.0, setting, "must be between 0 and 1");
        }
        need((4..=128).contains(&self.max_blobs), "identify.max_blobs", "must be from 4 to 128");
        need(
            self.min_range_m > 0.0 && self.min_range_m < self.max_range_m && self.max_range_m <= 1e6,
            "identify.min_range_m",
            "must be positive and below identify.max_range_m, which is at most 1000000",
        );
    }
}
