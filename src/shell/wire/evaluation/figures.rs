//! What comes of a study.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::EvaluationRequest;
use crate::evaluate::figures::{
    Comparison, ConsistencyFigures, ErrorFigures, Estimate, Figures, MethodFigures, MethodTimes, StepFigures, times,
};
use crate::evaluate::row::ERRORS;
use crate::evaluate::{Shard, Study};
use crate::shell::wire::rate::RateWire;

/// The figures of a study. All but `timing` is the same to the last digit whenever the same is asked.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Evaluation)]
pub struct EvaluationWire {
    /// What was asked, with what was not said.
    pub request: EvaluationRequest,
    /// One for each solver, where nothing is swept.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub solvers: Vec<SolverFigures>,
    /// Which solver is better beyond chance, where nothing is swept.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub comparisons: Vec<ComparisonWire>,
    /// One for each value of the sweep.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub steps: Vec<StepWire>,
    /// Runs for which no case could be drawn.
    pub undrawn: u64,
    /// Times, which are never the same again.
    pub timing: TimingWire,
}

/// Figures at one value of the sweep.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EvaluationStep)]
pub struct StepWire {
    /// The value.
    pub value: Option<f64>,
    /// One for each solver.
    pub solvers: Vec<SolverFigures>,
    /// Which solver is better beyond chance.
    pub comparisons: Vec<ComparisonWire>,
}

/// Figures of a solver.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct SolverFigures {
    /// Its name, as it was asked for.
    pub solver: String,
    /// Cases that were put to it.
    pub cases: u64,
    /// Cases with a pose.
    pub success_rate: RateWire,
    /// Cases with a pose near the truth: within 20 degrees, and a tenth of the range.
    pub good_rate: RateWire,
    /// Cases with a pose that is turned by more than 20 degrees.
    pub flip_rate: RateWire,
    /// Flips that no alternative warns of.
    pub silent_flip_rate: RateWire,
    /// Answers that call themselves ambiguous.
    pub ambiguous_rate: RateWire,
    /// Why there was no pose, and how often.
    pub reasons: BTreeMap<String, u64>,
    /// By kind of error: `roll_deg`, `pitch_deg`, `yaw_deg`, `x_m`, `y_m`, `z_m` are estimate minus truth, `rotation_deg` is the angle between
    /// the rotations, `translation_m` the distance between the translations, `range_ratio` the difference of the ranges as a share of the true one.
    pub errors: BTreeMap<String, ErrorWire>,
    /// Root mean square error of the poses that are no flips over the Cramer-Rao bound, where that is sharp: 1 reaches it.
    pub over_bound: Option<EstimateWire>,
    /// Cases by which that is told.
    pub over_bound_cases: u64,
    /// Whether errors are as large as the covariances say, of the pose of each answer that is nearest to the truth. Null for a solver
    /// alone, which gives none.
    pub consistency: Option<ConsistencyWire>,
    /// The same of covariances that call themselves reliable.
    pub reliable_consistency: Option<ConsistencyWire>,
    /// Whether poses are right as often as is stated, by tenths of probability.
    pub probabilities: Vec<ProbabilityWire>,
    /// Mean distance between stated probability and share of right poses over these tenths.
    pub calibration_error: Option<f64>,
    /// Mean squared distance of the stated probability of the best pose from what was the case: 0 is best.
    pub brier_score: Option<f64>,
}

/// A figure and where the true one lies with a confidence of 95 %.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Estimate)]
pub struct EstimateWire {
    /// The figure.
    pub value: f64,
    /// Null where there are too few cases to tell.
    pub interval: Option<[f64; 2]>,
}

impl From<Estimate> for EstimateWire {
    fn from(Estimate { value, interval }: Estimate) -> Self {
        Self { value, interval }
    }
}

/// Figures of one kind of error.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = ErrorFigures)]
pub struct ErrorWire {
    /// Of the poses that there are.
    pub mean: Option<f64>,
    /// Standard deviation of the same.
    pub std: Option<f64>,
    /// Root mean square of the same; its interval is a bootstrap.
    pub rmse: Option<EstimateWire>,
    /// Of the sizes of the errors of all cases, one without a pose counting as the worst: null if most have none. Exact up to 1000 poses,
    /// within half a percent above.
    pub median: Option<EstimateWire>,
    /// What 95 % of all cases stay below, likewise.
    pub p95: Option<f64>,
    /// The largest size.
    pub max: Option<f64>,
}

impl From<&ErrorFigures> for ErrorWire {
    fn from(figures: &ErrorFigures) -> Self {
        Self {
            mean: figures.mean,
            std: figures.deviation,
            rmse: figures.root_mean_square.map(Into::into),
            median: figures.median.map(Into::into),
            p95: figures.percentile_95,
            max: figures.largest,
        }
    }
}

/// Whether errors are as large as the covariances say.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Consistency)]
pub struct ConsistencyWire {
    /// Mean normalised error squared: 6 where the covariances are right.
    pub mean_nees: f64,
    /// Where that mean lies with a probability of 95 % if they are (chi-square).
    pub band: [f64; 2],
    /// Errors within the ellipsoid that is to hold 95 %.
    pub inside_95: RateWire,
}

impl From<ConsistencyFigures> for ConsistencyWire {
    fn from(figures: ConsistencyFigures) -> Self {
        Self { mean_nees: figures.mean, band: figures.band, inside_95: figures.inside_95.into() }
    }
}

/// Poses of about one stated probability.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = ProbabilityFigures)]
pub struct ProbabilityWire {
    /// Mean of what was stated.
    pub stated: f64,
    /// How many of them are right.
    pub right: RateWire,
}

/// Two solvers on the same cases.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Comparison)]
pub struct ComparisonWire {
    /// Which.
    pub solvers: [String; 2],
    /// By what: `rotation_error`, `translation_error` (the smaller, case by case) or `good_rate` (which alone is near the truth).
    pub by: String,
    /// On how many cases the first was better, and on how many the second; the rest are ties.
    pub wins: [u64; 2],
    /// Probability that equal solvers would differ so much: the sign test, for good rates McNemar's, with the number of comparisons
    /// taken into account (Holm).
    pub p_value: f64,
    /// The one that is better, if that is not chance (`p_value` below 0.05).
    pub better: Option<String>,
}

impl From<&Comparison> for ComparisonWire {
    fn from(comparison: &Comparison) -> Self {
        Self {
            solvers: comparison.methods.clone(),
            by: comparison.by.into(),
            wins: comparison.wins,
            p_value: comparison.probability,
            better: comparison.better().map(Into::into),
        }
    }
}

/// Times.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = EvaluationTiming)]
pub struct TimingWire {
    /// All computing together, over all threads.
    pub computing_s: f64,
    /// One for each solver.
    pub solvers: Vec<SolverTime>,
}

/// Time that a solver takes for a case: alone, or with covariance, alternatives and their probabilities, as it was asked for.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct SolverTime {
    /// Its name.
    pub solver: String,
    /// Mean, microseconds.
    pub mean_us: Option<f64>,
    /// Standard deviation.
    pub std_us: Option<f64>,
    /// Median.
    pub median_us: Option<f64>,
    /// What 95 % stay below.
    pub p95_us: Option<f64>,
}

impl From<&MethodFigures> for SolverFigures {
    fn from(figures: &MethodFigures) -> Self {
        let errors = ERRORS.iter().zip(&figures.errors).map(|(name, error)| ((*name).into(), error.into()));
        Self {
            solver: figures.method.clone(),
            cases: figures.cases,
            success_rate: figures.posed.into(),
            good_rate: figures.good.into(),
            flip_rate: figures.flips.into(),
            silent_flip_rate: figures.silent_flips.into(),
            ambiguous_rate: figures.ambiguous.into(),
            reasons: figures.reasons.iter().map(|(reason, count)| ((*reason).into(), *count)).collect(),
            errors: errors.collect(),
            over_bound: figures.over_bound.map(Into::into),
            over_bound_cases: figures.bounded,
            consistency: figures.consistency.map(Into::into),
            reliable_consistency: figures.reliable_consistency.map(Into::into),
            probabilities: figures
                .calibration
                .iter()
                .map(|bin| ProbabilityWire { stated: bin.stated, right: bin.right.into() })
                .collect(),
            calibration_error: figures.calibration_error,
            brier_score: figures.brier_score,
        }
    }
}

impl From<&StepFigures> for StepWire {
    fn from(step: &StepFigures) -> Self {
        Self {
            value: step.value,
            solvers: step.methods.iter().map(Into::into).collect(),
            comparisons: step.comparisons.iter().map(Into::into).collect(),
        }
    }
}

fn times_of(study: &Study, sums: &Shard) -> TimingWire {
    let of = |times: MethodTimes| {
        let us = |of: fn(&crate::evaluate::figures::TimeFigures) -> Option<f64>| {
            times.time.as_ref().and_then(of).map(|seconds| seconds * 1e6)
        };
        SolverTime {
            mean_us: us(|time| Some(time.mean_s)),
            std_us: us(|time| time.deviation_s),
            median_us: us(|time| time.median_s),
            p95_us: us(|time| time.percentile_95_s),
            solver: times.method.clone(),
        }
    };
    TimingWire { computing_s: sums.seconds, solvers: times(study, sums).into_iter().map(of).collect() }
}

impl EvaluationWire {
    /// Of all parts of a study.
    #[must_use]
    pub fn new(request: EvaluationRequest, study: &Study, sums: &Shard, figures: &Figures) -> Self {
        let mut steps: Vec<StepWire> = figures.steps.iter().map(Into::into).collect();
        let (mut solvers, mut comparisons) = (Vec::new(), Vec::new());
        if study.sweep.is_none()
            && let Some(only) = steps.pop()
        {
            (solvers, comparisons) = (only.solvers, only.comparisons);
        }
        Self {
            request,
            solvers,
            comparisons,
            steps,
            undrawn: figures.steps.iter().map(|step| step.undrawn).sum(),
            timing: times_of(study, sums),
        }
    }
}
