//! The figures of recorded frames. Numbers of one unit share the name in which it stands: all of `centroid_error_px` are px.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::outcome::FailedWire;
use crate::evaluate::recorded::{
    Bin, Consistency, Curve, CurvePoint, DetectionFigures, Figures, PoseErrors, Spread, TargetFigures,
};
use crate::shell::wire::rate::RateWire;

/// What an evaluation of recorded frames gives.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedEvaluation)]
pub struct RecordedWire {
    /// Figures of each suite, in the order in which they come.
    pub suites: Vec<FiguresWire>,
    /// Figures of all frames.
    pub all: FiguresWire,
    /// What could not be looked at.
    pub failed: Vec<FailedWire>,
    /// Times taken, which are others each time.
    pub timing: TimingFiguresWire,
}

/// Figures of a suite.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedFigures)]
pub struct FiguresWire {
    /// Its name; `all` for those of all.
    pub suite: String,
    /// Frames with truth that were looked at.
    pub frames: u32,
    /// Frames that could not be.
    pub failed: u32,
    /// Of the detector.
    pub detection: Option<DetectionFiguresWire>,
    /// Of targets.
    pub targets: Option<TargetFiguresWire>,
}

/// How numbers are spread.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedSpread)]
#[expect(missing_docs, reason = "statistics by their names")]
pub struct SpreadWire {
    pub count: usize,
    pub mean: f64,
    pub standard_deviation: f64,
    pub rms: f64,
    pub median: f64,
    pub p95: f64,
    pub max: f64,
}

/// What a detector finds.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedDetection)]
pub struct DetectionFiguresWire {
    /// Frames of which it is known what ought to be reported.
    pub frames: u32,
    /// Things found, of all.
    pub found: RateWire,
    /// Frames in which something was found, of those in which there is something.
    pub frames_found: RateWire,
    /// Reports of nothing, and further reports of a thing.
    pub false_alarms: u32,
    /// The same for each frame.
    pub false_alarms_per_frame: f64,
    /// Distances of hits from the true places; of boxes from their middles.
    pub centroid_error_px: Option<SpreadWire>,
    /// Root mean square error of centroids per axis.
    pub axis_rms_px: Option<f64>,
    /// Mean of the squared errors of centroids per axis over their stated variances.
    pub normalized_mean_square: Option<f64>,
    /// Centroids off by more than four stated deviations.
    pub beyond_four_sigma: Option<RateWire>,
    /// What is found at 0.01, 0.1 and 1 false alarms a frame.
    pub operating_points: Vec<OperatingPointWire>,
    /// The receiver curve by about 200 points.
    pub receiver_curve: Vec<CurvePointWire>,
    /// Scores as probabilities.
    pub scores: Vec<BinWire>,
    /// What hits are called and are, where the truth says so.
    pub classes: Vec<ClassWire>,
}

/// What is found at so many false alarms.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedOperatingPoint)]
pub struct OperatingPointWire {
    /// False alarms a frame that are allowed.
    pub allowed_false_alarms_per_frame: f64,
    /// The lowest threshold that keeps to them; null if none does.
    pub reached: Option<CurvePointWire>,
}

/// A point of a receiver curve.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedCurvePoint)]
pub struct CurvePointWire {
    /// Reports of this score and above count.
    pub min_score: f64,
    /// False alarms a frame.
    pub false_alarms_per_frame: f64,
    /// Share of the things that are found.
    pub found_share: f64,
}

/// Statements of a like probability.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedBin)]
pub struct BinWire {
    /// From this probability on.
    pub from: f64,
    /// To below this one.
    pub to: f64,
    /// Mean of what was stated.
    pub stated: f64,
    /// How often it was so.
    pub right: RateWire,
}

/// Hits that were called so and are so.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[schema(as = RecordedClass)]
pub struct ClassWire {
    /// The detector's word; null where it says nothing.
    pub stated: Option<String>,
    /// The truth's word.
    pub truth: String,
    /// How many.
    pub count: u32,
}

/// What became of targets.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedTargets)]
pub struct TargetFiguresWire {
    /// At least four markers found, of targets that show them.
    pub detected: RateWire,
    /// At least four markers identified and none wrongly, of targets of which four are seen.
    pub identified: RateWire,
    /// Some marker identified wrongly, of the same.
    pub misidentified: RateWire,
    /// Markers identified rightly, of all that are seen.
    pub markers_identified: RateWire,
    /// The best pose is right: within 5 degrees and 5 % of the range.
    pub right: RateWire,
    /// The right one is the stated alternative.
    pub flagged: u32,
    /// No pose.
    pub missed: u32,
    /// A wrong pose without a warning.
    pub wrong: u32,
    /// Of those, with a stated probability of 0.95 and more.
    pub sure_and_wrong: u32,
    /// Poses of targets that are not there or show their backs.
    pub invented: RateWire,
    /// Why there are no poses.
    pub reasons: BTreeMap<String, u32>,
    /// Errors of all best poses.
    pub errors: Option<PoseErrorsWire>,
    /// Errors of the right ones.
    pub errors_of_right: Option<PoseErrorsWire>,
    /// Normalised estimation error squared of the best poses, where they are the right ones of those given.
    pub normalized_error_squared: Option<ConsistencyWire>,
    /// The same of those with `covariance_reliable`.
    pub normalized_error_squared_of_reliable: Option<ConsistencyWire>,
    /// Probabilities of all poses, alternatives too.
    pub probabilities: Vec<BinWire>,
}

/// Errors of poses, true minus estimated.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedPoseErrors)]
#[expect(missing_docs, reason = "the contract's words")]
pub struct PoseErrorsWire {
    pub x_m: SpreadWire,
    pub y_m: SpreadWire,
    pub z_m: SpreadWire,
    pub roll_rad: SpreadWire,
    pub pitch_rad: SpreadWire,
    pub yaw_rad: SpreadWire,
    /// Length of the error of the position.
    pub position_m: SpreadWire,
    /// The same as a share of the range.
    pub position_ratio: SpreadWire,
    /// Angle of the error of the attitude.
    pub attitude_rad: SpreadWire,
}

/// Normalised estimation error squared: chi-square with six degrees of freedom where covariances hold.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedConsistency)]
pub struct ConsistencyWire {
    /// How many poses.
    pub count: u32,
    /// Its mean.
    pub mean: f64,
    /// Where the mean lies with 95 % if covariances hold.
    pub band_95: [f64; 2],
    /// Errors inside their 95 % ellipsoid.
    pub within_95: RateWire,
}

/// Times taken.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedTiming)]
pub struct TimingFiguresWire {
    /// Of each stage: `decode`, `detect`, `identify`, `solve`, `total`; microseconds.
    pub stages_us: BTreeMap<String, SpreadWire>,
    /// Of each suite.
    pub suites: Vec<SuiteTimingWire>,
}

/// Times of a suite.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RecordedSuiteTiming)]
pub struct SuiteTimingWire {
    /// Its name.
    pub suite: String,
    /// From a frame's bytes to its answer; microseconds.
    pub total_us: SpreadWire,
}

impl From<&Spread> for SpreadWire {
    fn from(spread: &Spread) -> Self {
        Self {
            count: spread.count,
            mean: spread.mean,
            standard_deviation: spread.deviation,
            rms: spread.rms,
            median: spread.median,
            p95: spread.p95,
            max: spread.largest,
        }
    }
}

impl From<&CurvePoint> for CurvePointWire {
    fn from(point: &CurvePoint) -> Self {
        Self { min_score: point.threshold, false_alarms_per_frame: point.false_alarms, found_share: point.probability }
    }
}

impl From<&Bin> for BinWire {
    fn from(bin: &Bin) -> Self {
        Self { from: bin.from, to: bin.to, stated: bin.stated, right: bin.rate.into() }
    }
}

impl From<&PoseErrors> for PoseErrorsWire {
    fn from(errors: &PoseErrors) -> Self {
        let [x, y, z] = &errors.axis_m;
        let [roll, pitch, yaw] = &errors.euler_rad;
        Self {
            x_m: x.into(),
            y_m: y.into(),
            z_m: z.into(),
            roll_rad: roll.into(),
            pitch_rad: pitch.into(),
            yaw_rad: yaw.into(),
            position_m: (&errors.position_m).into(),
            position_ratio: (&errors.position_ratio).into(),
            attitude_rad: (&errors.attitude_rad).into(),
        }
    }
}

impl From<&Consistency> for ConsistencyWire {
    fn from(found: &Consistency) -> Self {
        Self { count: found.count, mean: found.mean, band_95: found.band, within_95: found.within_95.into() }
    }
}

/// Points of a curve that are written.
const MOST_POINTS: usize = 200;

fn points(curve: &Curve) -> Vec<CurvePointWire> {
    curve.thinned(MOST_POINTS).points.iter().map(CurvePointWire::from).collect()
}

impl From<&DetectionFigures> for DetectionFiguresWire {
    fn from(found: &DetectionFigures) -> Self {
        let operating = |(allowed, point): &(f64, Option<CurvePoint>)| OperatingPointWire {
            allowed_false_alarms_per_frame: *allowed,
            reached: point.as_ref().map(CurvePointWire::from),
        };
        let classes = found.classes.iter().map(|class| ClassWire {
            stated: class.stated.map(str::to_owned),
            truth: class.truth.clone(),
            count: class.count,
        });
        Self {
            frames: found.frames,
            found: found.found.into(),
            frames_found: found.frames_found.into(),
            false_alarms: found.false_alarms,
            false_alarms_per_frame: found.false_alarms_per_frame(),
            centroid_error_px: found.centroid_error_px.as_ref().map(SpreadWire::from),
            axis_rms_px: found.axis_rms_px,
            normalized_mean_square: found.normalized_mean_square,
            beyond_four_sigma: found.beyond_four_sigma.map(RateWire::from),
            operating_points: found.at.iter().map(operating).collect(),
            receiver_curve: points(&found.curve),
            scores: found.scores.iter().map(BinWire::from).collect(),
            classes: classes.collect(),
        }
    }
}

impl From<&TargetFigures> for TargetFiguresWire {
    fn from(found: &TargetFigures) -> Self {
        Self {
            detected: found.detected.into(),
            identified: found.identified.into(),
            misidentified: found.misidentified.into(),
            markers_identified: found.markers.into(),
            right: found.right.into(),
            flagged: found.flagged,
            missed: found.missed,
            wrong: found.wrong,
            sure_and_wrong: found.sure_and_wrong,
            invented: found.invented.into(),
            reasons: found.reasons.clone(),
            errors: found.errors.as_ref().map(PoseErrorsWire::from),
            errors_of_right: found.errors_of_right.as_ref().map(PoseErrorsWire::from),
            normalized_error_squared: found.consistency.as_ref().map(ConsistencyWire::from),
            normalized_error_squared_of_reliable: found.consistency_of_reliable.as_ref().map(ConsistencyWire::from),
            probabilities: found.probabilities.iter().map(BinWire::from).collect(),
        }
    }
}

impl FiguresWire {
    /// Of a suite.
    #[must_use]
    pub fn of(suite: &str, figures: &Figures) -> Self {
        Self {
            suite: suite.into(),
            frames: figures.frames,
            failed: figures.failed,
            detection: figures.detection.as_ref().map(DetectionFiguresWire::from),
            targets: figures.targets.as_ref().map(TargetFiguresWire::from),
        }
    }
}
