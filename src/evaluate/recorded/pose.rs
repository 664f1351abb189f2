//! Figures of targets: found, told apart, posed.

use std::collections::BTreeMap;

use super::calibration::{Bin, bins};
use super::spread::Spread;
use super::truth::Presence;
use super::verdict::{Outcome, PoseVerdict, TargetVerdict};
use crate::statistics::{Rate, chi_square_quantile};

/// An answer this probable is one to act on.
pub const CONFIDENT: f64 = 0.95;

/// 95 % of chi-square with six degrees of freedom.
const CHI_SQUARE_6_95: f64 = 12.592;

/// What became of targets, over many frames.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetFigures {
    /// Targets that show their markers and of which four markers or more were found, of all such: the seed's rate.
    pub detected: Rate,
    /// Targets that a pose can be asked for and of which at least four markers are identified and none of them wrongly, of those of
    /// which the markers are known.
    pub identified: Rate,
    /// Targets of which a marker is identified wrongly, of the same.
    pub misidentified: Rate,
    /// Markers identified rightly, of all that are seen.
    pub markers: Rate,
    /// Poses asked for, by what became of them.
    pub right: Rate,
    /// The right one is the stated alternative.
    pub flagged: u32,
    /// No pose.
    pub missed: u32,
    /// A wrong pose without a warning.
    pub wrong: u32,
    /// Of the wrong ones those that are stated with [`CONFIDENT`] probability.
    pub sure_and_wrong: u32,
    /// Poses of targets that are not there or show their backs.
    pub invented: Rate,
    /// Why there are no poses of targets that are seen.
    pub reasons: BTreeMap<String, u32>,
    /// Errors of all best poses.
    pub errors: Option<PoseErrors>,
    /// Errors of the right ones, so that flips do not hide how exact the rest is.
    pub errors_of_right: Option<PoseErrors>,
    /// Whether covariances hold: of the best poses that are the right ones of those given.
    pub consistency: Option<Consistency>,
    /// The same of those that call their covariance reliable.
    pub consistency_of_reliable: Option<Consistency>,
    /// Probabilities of all poses, alternatives too.
    pub probabilities: Vec<Bin>,
    /// Range and error of the position of the best poses, m.
    pub position_against_range: Vec<[f64; 2]>,
    /// Range and angle of the error of the attitude, m and rad.
    pub attitude_against_range: Vec<[f64; 2]>,
}

/// Errors of poses.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseErrors {
    /// Along x, y, z of the camera, true minus estimated, m.
    pub axis_m: [Spread; 3],
    /// Roll, pitch and yaw, true minus estimated, rad.
    pub euler_rad: [Spread; 3],
    /// Length of the error of the position, m.
    pub position_m: Spread,
    /// The same as a share of the range.
    pub position_ratio: Spread,
    /// Angle of the error of the attitude, rad.
    pub attitude_rad: Spread,
}

/// Normalised estimation error squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consistency {
    /// How many poses.
    pub count: u32,
    /// Its mean: 6 where covariances hold.
    pub mean: f64,
    /// Where the mean of so many lies with 95 % if they hold.
    pub band: [f64; 2],
    /// Errors inside their 95 % ellipsoid.
    pub within_95: Rate,
}

impl TargetFigures {
    /// Of verdicts in the order of their frames; `None` of none.
    #[must_use]
    pub fn of(verdicts: &[&TargetVerdict]) -> Option<Self> {
        if verdicts.is_empty() {
            return None;
        }
        let seen = || verdicts.iter().filter(|verdict| verdict.presence == Presence::Seen);
        let solvable = || seen().filter(|verdict| verdict.is_solvable);
        let told = || solvable().filter(|verdict| verdict.visible_markers.is_some());
        let count = |outcome| {
            let such = solvable().filter(|verdict| verdict.outcome == Some(outcome)).count();
            u32::try_from(such).unwrap_or(u32::MAX)
        };
        let least = u32::try_from(crate::target::Target::MIN_MARKERS).unwrap_or(u32::MAX);
        let posed: Vec<&TargetVerdict> = seen().copied().filter(|verdict| verdict.pose.is_some()).collect();
        let right: Vec<&TargetVerdict> =
            posed.iter().copied().filter(|verdict| verdict.outcome == Some(Outcome::Right)).collect();
        let statements: Vec<(f64, bool)> =
            poses(&posed).flat_map(|pose| &pose.candidates).map(|c| (c.probability, c.is_right)).collect();
        let is_best_right = |pose: &&PoseVerdict| pose.candidates.first().is_some_and(|best| best.is_right);
        let against = |of: fn(&PoseVerdict) -> f64| {
            posed.iter().filter_map(|verdict| Some([verdict.range_m?, of(verdict.pose.as_ref()?)])).collect()
        };
        let mut reasons = BTreeMap::new();
        for reason in solvable().filter_map(|verdict| verdict.reason.clone()) {
            *reasons.entry(reason).or_default() += 1;
        }
        let (flagged, missed, wrong) = (count(Outcome::Flagged), count(Outcome::Missed), count(Outcome::Wrong));
        let right_count = count(Outcome::Right);
        let is_sure = |verdict: &&&TargetVerdict| {
            verdict.outcome == Some(Outcome::Wrong)
                && verdict.pose.as_ref().is_some_and(|pose| pose.probability >= CONFIDENT)
        };
        Some(Self {
            detected: Rate::among(seen().map(|verdict| verdict.is_detected)),
            identified: Rate::among(told().map(|verdict| verdict.right_markers >= least && verdict.wrong_markers == 0)),
            misidentified: Rate::among(told().map(|verdict| verdict.wrong_markers > 0)),
            markers: Rate {
                count: told().map(|verdict| u64::from(verdict.right_markers)).sum(),
                of: told().filter_map(|verdict| verdict.visible_markers).map(u64::from).sum(),
            },
            right: Rate { count: right_count.into(), of: (right_count + flagged + missed + wrong).into() },
            flagged,
            missed,
            wrong,
            sure_and_wrong: u32::try_from(solvable().filter(is_sure).count()).unwrap_or(u32::MAX),
            invented: Rate::among(
                verdicts
                    .iter()
                    .filter(|verdict| verdict.presence != Presence::Seen)
                    .map(|verdict| verdict.outcome == Some(Outcome::Invented)),
            ),
            reasons,
            errors: PoseErrors::of(&posed),
            errors_of_right: PoseErrors::of(&right),
            consistency: Consistency::of(poses(&posed).filter(is_best_right)),
            consistency_of_reliable: Consistency::of(poses(&posed).filter(is_best_right).filter(|p| p.is_reliable)),
            probabilities: bins(&statements),
            position_against_range: against(position_m),
            attitude_against_range: against(attitude_rad),
        })
    }
}

fn poses<'a>(verdicts: &'a [&TargetVerdict]) -> impl Iterator<Item = &'a PoseVerdict> {
    verdicts.iter().filter_map(|verdict| verdict.pose.as_ref())
}

fn length([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

fn position_m(pose: &PoseVerdict) -> f64 {
    let [x, y, z, ..] = pose.error;
    length([x, y, z])
}

fn attitude_rad(pose: &PoseVerdict) -> f64 {
    let [.., x, y, z] = pose.error;
    length([x, y, z])
}

impl PoseErrors {
    fn of(verdicts: &[&TargetVerdict]) -> Option<Self> {
        let ratios = verdicts.iter().filter_map(|verdict| {
            let pose = verdict.pose.as_ref()?;
            Some(position_m(pose) / verdict.range_m?)
        });
        let axis = |axis: usize| Spread::of(poses(verdicts).map(|pose| pose.error[axis]));
        let euler = |axis: usize| Spread::of(poses(verdicts).map(|pose| pose.euler_error_rad[axis]));
        Some(Self {
            axis_m: [axis(0)?, axis(1)?, axis(2)?],
            euler_rad: [euler(0)?, euler(1)?, euler(2)?],
            position_m: Spread::of(poses(verdicts).map(position_m))?,
            position_ratio: Spread::of(ratios)?,
            attitude_rad: Spread::of(poses(verdicts).map(attitude_rad))?,
        })
    }
}

impl Consistency {
    fn of<'a>(poses: impl Iterator<Item = &'a PoseVerdict>) -> Option<Self> {
        let errors: Vec<f64> = poses.map(|pose| pose.normalized_squared).collect();
        let count = u32::try_from(errors.len()).ok().filter(|count| *count > 0)?;
        let total = f64::from(count);
        // The sum of so many is chi-square with six times as many degrees of freedom.
        let end = |z: f64| chi_square_quantile(6.0 * total, z) / total;
        Some(Self {
            count,
            mean: errors.iter().sum::<f64>() / total,
            band: [end(-1.959_964), end(1.959_964)],
            within_95: Rate::among(errors.iter().map(|error| *error <= CHI_SQUARE_6_95)),
        })
    }
}
