//! Recorded frames with truth: how each answer stands to it, and the figures of many.
//!
//! A frame's walk: its [`Truth`] and what the pipeline found make a [`Verdict`] ([`judge()`]); verdicts in the order of the frames
//! make a [`Tally`], and that gives [`Figures`]. A tally keeps its verdicts and sums them at the end, in their order: however the
//! frames were spread over threads, the figures are the same to the last digit. Times are no part of it; they come in as numbers and
//! are summed up by [`Spread`].

mod calibration;
mod curve;
mod detection;
mod figures;
mod judge;
mod plots;
mod pose;
mod spread;
mod truth;
mod verdict;

pub use calibration::{Bin, bins};
pub use curve::{Curve, CurvePoint};
pub use detection::{ClassCount, DetectionFigures};
pub use figures::{Figures, Tally};
pub use judge::{BOX_GROWTH_PX, MARKER_REACH_PX, RIGHT_RAD, RIGHT_RANGE_RATIO, judge};
pub use plots::{Latencies, Plots, plots};
pub use pose::{CONFIDENT, Consistency, PoseErrors, TargetFigures};
pub use spread::Spread;
pub use truth::{BoxTruth, MarkerTruth, Presence, TargetTruth, Truth};
pub use verdict::{Candidate, DetectionVerdict, FalseAlarm, Hit, Outcome, PoseVerdict, TargetVerdict, Verdict};
