//! Evaluations of recorded frames: the truth beside the frames, what a frame came to, and the figures of all.

mod outcome;
mod result;
mod sidecar;

pub use outcome::{FailedWire, FrameOutcome, UnitOutcome};
pub use result::{
    BinWire, ClassWire, ConsistencyWire, CurvePointWire, DetectionFiguresWire, FiguresWire, OperatingPointWire,
    PoseErrorsWire, RecordedWire, SpreadWire, SuiteTimingWire, TargetFiguresWire, TimingFiguresWire,
};
pub use sidecar::{
    BoxWire, FrameTruthWire, MarkerState, MarkerTruthWire, Mode, PoseTruthWire, RecordedRequest, RotationTruthWire,
    Said, SidecarWire, TargetTruthWire, VideoFrameWire, VideoTruthWire,
};
