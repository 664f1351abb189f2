//! Requests to replies: checked first, then computed on one thread.

mod assessment;
pub(in crate::shell) mod encounter;
mod frame;
mod points;

pub use assessment::AssessmentTask;
pub use encounter::EncounterTask;
pub use frame::{FrameTask, Seen};
pub use points::{BatchItem, PoseTask, batch};

use crate::frame::Limits;
use crate::identify::IdentifyOptions;
use crate::shell::config::Settings;

/// What the settings say about a computation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terms {
    /// Limits of a frame.
    pub limits: Limits,
    /// Identification.
    pub identify: IdentifyOptions,
    /// Error of camera and target model in the pose, px.
    pub model_sigma_px: f64,
    /// Most points in one pose request.
    pub max_points: usize,
}

impl Terms {
    /// Of the settings.
    #[must_use]
    pub fn of(settings: &Settings) -> Self {
        Self {
            limits: settings.frames.limits(),
            identify: settings.identify.options(),
            model_sigma_px: settings.identify.pose_model_sigma_px,
            max_points: settings.http.max_points,
        }
    }
}
