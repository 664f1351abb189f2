//! Many verdicts and their figures.

use super::detection::DetectionFigures;
use super::pose::TargetFigures;
use super::verdict::{DetectionVerdict, TargetVerdict, Verdict};

/// The verdicts of frames, in the order of the frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    verdicts: Vec<Verdict>,
    /// Frames that could not be looked at.
    failed: u32,
}

/// The figures of many frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// Frames that were looked at.
    pub frames: u32,
    /// Frames that could not be: not decoded, or not of the camera.
    pub failed: u32,
    /// Of the detector, where it is known what it ought to report.
    pub detection: Option<DetectionFigures>,
    /// Of targets, where some were looked for.
    pub targets: Option<TargetFigures>,
}

impl Tally {
    /// The next frame.
    pub fn add(&mut self, verdict: Verdict) {
        self.verdicts.push(verdict);
    }

    /// The next frame, which could not be looked at.
    pub const fn add_failed(&mut self) {
        self.failed += 1;
    }

    /// The frames that come after.
    pub fn append(&mut self, mut later: Self) {
        self.verdicts.append(&mut later.verdicts);
        self.failed += later.failed;
    }

    /// What they come to.
    #[must_use]
    pub fn figures(&self) -> Figures {
        let detections: Vec<&DetectionVerdict> =
            self.verdicts.iter().filter_map(|verdict| verdict.detection.as_ref()).collect();
        let targets: Vec<&TargetVerdict> = self.verdicts.iter().flat_map(|verdict| &verdict.targets).collect();
        Figures {
            frames: u32::try_from(self.verdicts.len()).unwrap_or(u32::MAX),
            failed: self.failed,
            detection: DetectionFigures::of(&detections),
            targets: TargetFigures::of(&targets),
        }
    }
}
