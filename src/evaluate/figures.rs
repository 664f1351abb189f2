//! Sums to figures.

use super::compare::{Wins, holm, pairs, sign_test};
use super::resample::{Block, intervals};
use super::row::{ERRORS, OUTCOMES};
use super::shard::{Shard, Step};
use super::study::Study;
use super::tally::{Bin, Consistency, Tally, Times};
use crate::statistics::{Rate, TWO_SIDED_95, chi_square_quantile};

/// Below this probability of chance a difference is called one.
pub const SIGNIFICANT: f64 = 0.05;

/// All figures of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// One for each value of the sweep.
    pub steps: Vec<StepFigures>,
}

/// Figures at one value of the sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct StepFigures {
    /// The value.
    pub value: Option<f64>,
    /// Runs for which no case could be drawn.
    pub undrawn: u64,
    /// One for each method.
    pub methods: Vec<MethodFigures>,
    /// One for each pair of methods.
    pub comparisons: Vec<Comparison>,
}

/// Figures of a method.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodFigures {
    /// Its name.
    pub method: String,
    /// Cases that were put to it.
    pub cases: u64,
    /// Those with a pose.
    pub posed: Rate,
    /// Those with a best pose near the truth: within 20 degrees, and a tenth of the range.
    pub good: Rate,
    /// Those with a best pose turned by more than that.
    pub flips: Rate,
    /// Flips of answers that do not call themselves ambiguous.
    pub silent_flips: Rate,
    /// Answers that call themselves ambiguous.
    pub ambiguous: Rate,
    /// Why there was no pose, and how often; only what occurred.
    pub reasons: Vec<(&'static str, u64)>,
    /// Of the best poses, one for each of [`ERRORS`].
    pub errors: [ErrorFigures; ERRORS.len()],
    /// Root mean square error of the poses that are no flips over the Cramer-Rao bound, where that is sharp: 1 reaches it.
    pub over_bound: Option<Estimate>,
    /// Cases by which that is told.
    pub bounded: u64,
    /// Whether errors are as large as the covariances say, of all poses nearest to the truth.
    pub consistency: Option<ConsistencyFigures>,
    /// Of those whose covariance calls itself reliable.
    pub reliable_consistency: Option<ConsistencyFigures>,
    /// Whether poses are right as often as is stated, by tenths of probability; only tenths that occurred.
    pub calibration: Vec<CalibrationFigures>,
    /// Mean distance between stated probability and share of right poses.
    pub calibration_error: Option<f64>,
    /// Mean squared distance of the stated probability of the best pose from what was the case: 0 is best.
    pub brier_score: Option<f64>,
}

/// Figures of one kind of error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorFigures {
    /// Mean of the best poses, with sign where the error has one.
    pub mean: Option<f64>,
    /// Standard deviation of the same.
    pub deviation: Option<f64>,
    /// Root mean square of the same, with its interval.
    pub root_mean_square: Option<Estimate>,
    /// Of the sizes over all cases, one without a pose counting as the worst; with its interval.
    pub median: Option<Estimate>,
    /// The size that 95 % of all cases stay below, likewise.
    pub percentile_95: Option<f64>,
    /// Of the sizes.
    pub largest: Option<f64>,
}

/// A figure and where the true one lies with a confidence of 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The figure.
    pub value: f64,
    /// `None` where there are too few cases to tell.
    pub interval: Option<[f64; 2]>,
}

/// Whether errors are as large as the covariances say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConsistencyFigures {
    /// Mean normalised error squared: 6 where the covariances are right.
    pub mean: f64,
    /// Where that mean lies with a probability of 95 % if they are.
    pub band: [f64; 2],
    /// Errors within the ellipsoid that is to hold 95 %.
    pub inside_95: Rate,
}

/// Whether poses of about one stated probability are right as often.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationFigures {
    /// Mean of what was stated.
    pub stated: f64,
    /// What was the case.
    pub right: Rate,
}

/// Two methods on the same cases.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Names.
    pub methods: [String; 2],
    /// By what.
    pub by: &'static str,
    /// On how many cases which was better.
    pub wins: Wins,
    /// Probability that equal methods would differ so much, with the number of comparisons taken into account.
    pub probability: f64,
}

impl Comparison {
    /// The one that is better beyond chance.
    #[must_use]
    pub fn better(&self) -> Option<&str> {
        let [first, second] = self.wins;
        let is_told = self.probability < SIGNIFICANT && first != second;
        is_told.then(|| self.methods[usize::from(second > first)].as_str())
    }
}

/// Times of a method.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodTimes {
    /// Its name.
    pub method: String,
    /// Of a case: of the solver alone, or of the service's answer with covariance, alternatives and their probabilities.
    pub time: Option<TimeFigures>,
}

/// Figures of a time, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeFigures {
    /// Mean.
    pub mean_s: f64,
    /// Standard deviation.
    pub deviation_s: Option<f64>,
    /// Median.
    pub median_s: Option<f64>,
    /// What 95 % stay below.
    pub percentile_95_s: Option<f64>,
}

impl Figures {
    /// Of all parts of a study.
    #[must_use]
    pub fn of(study: &Study, sums: &Shard) -> Self {
        let values = study.sweep.as_ref().map(|sweep| &sweep.values);
        let steps = sums.steps.iter().enumerate().map(|(number, step)| StepFigures {
            value: values.and_then(|values| values.get(number).copied()),
            undrawn: step.undrawn,
            methods: study
                .methods
                .iter()
                .zip(&step.tallies)
                .enumerate()
                .map(|(place, (method, tally))| {
                    let name = format!("bootstrap {} {number} {place}", study.seed);
                    method_figures(method.to_string(), tally, &name)
                })
                .collect(),
            comparisons: comparisons(study, step),
        });
        Self { steps: steps.collect() }
    }
}

fn method_figures(method: String, tally: &Tally, name: &str) -> MethodFigures {
    let (cases, poses) = (tally.cases(), tally.poses());
    let rate = |count| Rate { count, of: cases };
    let resampled = intervals(&tally.blocks, name);
    let whole = tally.blocks.iter().fold(Block::default(), |mut sum, block| {
        sum.add(block);
        sum
    });
    let errors = std::array::from_fn(|which| {
        let (moments, sizes) = (&tally.moments[which], &tally.sizes[which]);
        // The median lies between the order statistics that a binomial distribution says.
        let reach = 0.5 * TWO_SIDED_95 / (cases.max(1) as f64).sqrt();
        let shares = [0.5, 0.5 - reach, 0.5 + reach, 0.95];
        let [median, low, high, percentile_95] =
            <[Option<f64>; 4]>::try_from(sizes.at(&shares.map(|share| share.clamp(0.0, 1.0)), cases))
                .unwrap_or_default();
        ErrorFigures {
            mean: (poses > 0).then_some(moments.mean),
            deviation: moments.deviation(),
            root_mean_square: moments
                .root_mean_square()
                .map(|value| Estimate { value, interval: resampled.errors[which] }),
            median: median.map(|value| Estimate {
                value,
                interval: low.zip(high).filter(|_| cases > 5).map(|(low, high)| [low, high]),
            }),
            percentile_95,
            largest: (poses > 0).then_some(moments.largest),
        }
    });
    let bins: Vec<&Bin> = tally.bins.iter().filter(|bin| bin.count > 0).collect();
    let stated_poses: u64 = bins.iter().map(|bin| bin.count).sum();
    let off: f64 = bins.iter().map(|bin| (bin.stated - bin.right as f64).abs()).sum();
    MethodFigures {
        method,
        cases,
        posed: rate(poses),
        good: rate(tally.good),
        flips: rate(tally.flips),
        silent_flips: rate(tally.silent_flips),
        ambiguous: rate(tally.ambiguous),
        reasons: OUTCOMES.into_iter().zip(tally.outcomes).skip(1).filter(|(_, count)| *count > 0).collect(),
        errors,
        over_bound: whole.over_bound_ratio().map(|value| Estimate { value, interval: resampled.over_bound }),
        bounded: whole.bounded,
        consistency: consistency(&tally.all),
        reliable_consistency: consistency(&tally.reliable),
        calibration: bins
            .iter()
            .map(|bin| CalibrationFigures {
                stated: bin.stated / bin.count as f64,
                right: Rate { count: bin.right, of: bin.count },
            })
            .collect(),
        calibration_error: (stated_poses > 0).then(|| off / stated_poses as f64),
        brier_score: (tally.all.count > 0).then(|| tally.brier / tally.all.count as f64),
    }
}

fn consistency(sums: &Consistency) -> Option<ConsistencyFigures> {
    let count = sums.count as f64;
    let edge = |z: f64| chi_square_quantile(6.0 * count, z) / count;
    (sums.count > 0).then(|| ConsistencyFigures {
        mean: sums.sum / count,
        band: [edge(-TWO_SIDED_95), edge(TWO_SIDED_95)],
        inside_95: Rate { count: sums.inside, of: sums.count },
    })
}

fn comparisons(study: &Study, step: &Step) -> Vec<Comparison> {
    let mut found: Vec<Comparison> = pairs(study.methods.len())
        .zip(&step.versus)
        .flat_map(|((first, second), versus)| {
            let by = [
                ("rotation_error", versus.rotation),
                ("translation_error", versus.translation),
                ("good_rate", versus.good),
            ];
            by.map(|(by, wins)| Comparison {
                methods: [first, second].map(|place| study.methods[place].to_string()),
                by,
                wins,
                probability: sign_test(wins),
            })
        })
        .collect();
    let adjusted = holm(&found.iter().map(|comparison| comparison.probability).collect::<Vec<_>>());
    for (comparison, probability) in found.iter_mut().zip(adjusted) {
        comparison.probability = probability;
    }
    found
}

/// Times of the methods, over all steps.
#[must_use]
pub fn times(study: &Study, sums: &Shard) -> Vec<MethodTimes> {
    let of = |(place, method): (usize, &super::Method)| {
        let mut all = Times::default();
        for times in sums.steps.iter().filter_map(|step| step.times.get(place)) {
            all.merge(times);
        }
        let at = all.sizes.at(&[0.5, 0.95], all.moments.count);
        let time = (all.moments.count > 0).then(|| TimeFigures {
            mean_s: all.moments.mean,
            deviation_s: all.moments.deviation(),
            median_s: at[0],
            percentile_95_s: at[1],
        });
        MethodTimes { method: method.to_string(), time }
    };
    study.methods.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::method::Method;
    use crate::evaluate::row::ESTIMATE;
    use crate::evaluate::study::{Disturbance, Layout, Poses};

    fn figures(study: &Study) -> Figures {
        study.check().expect("a study");
        let mut sums = Shard::default();
        for number in 0..study.shards() {
            sums.merge(Shard::run_keeping(study, number, &|| 0.0, &|| true).expect("goes on"));
        }
        Figures::of(study, &sums)
    }

    /// Points of a box seen well: every method that is any good reaches the bound.
    fn easy(runs: u64) -> Study {
        Study {
            points: Layout::Random { count: 12, size_m: [0.8, 0.8, 0.3] },
            poses: Poses::InPicture { range_m: [2.0, 5.0], tilt_rad: [0.0, 3.0] },
            in_view: true,
            disturbance: Disturbance { pixel_sigma_px: 0.5, ..Disturbance::default() },
            methods: ["auto", "epnp", "epnp+refine"].map(|name| Method::named(name).expect("known")).to_vec(),
            ..Study::thesis_2012(runs, 3)
        }
    }

    #[test]
    fn a_refined_answer_reaches_the_bound_and_its_covariance_holds() {
        let found = figures(&easy(2_000));
        let [auto, alone, refined] = &found.steps[0].methods[..] else { panic!("three methods") };
        for method in [auto, refined] {
            assert_eq!((method.posed.count, method.flips.count), (2_000, 0), "{method:?}");
            let bound = method.over_bound.expect("compared");
            let [low, high] = bound.interval.expect("many blocks");
            assert!(low < bound.value && bound.value < high && (bound.value - 1.0).abs() < 0.03, "{bound:?}");
            let consistency = method.consistency.expect("poses");
            assert!((consistency.band[0]..=consistency.band[1]).contains(&consistency.mean), "{consistency:?}");
            let [low, high] = consistency.inside_95.interval();
            assert!(low < 0.955 && high > 0.945, "{consistency:?}");
        }
        assert!(alone.over_bound.expect("compared").value > 1.05);
        let better = |by: &str, first: usize, second: usize| {
            let methods = [first, second].map(|place| found.steps[0].methods[place].method.clone());
            let mut all = found.steps[0].comparisons.iter();
            all.find(|c| c.by == by && c.methods == methods).expect("is there").better().map(str::to_owned)
        };
        assert_eq!(better("rotation_error", 0, 1).as_deref(), Some("auto"));
        assert_eq!(better("rotation_error", 0, 2), None, "they reach the same minimum");
    }

    #[test]
    fn figures_are_those_of_the_rows() {
        let study = Study::thesis_2012(100, 2012);
        let mut sums = Shard::default();
        for number in 0..study.shards() {
            sums.merge(Shard::run_keeping(&study, number, &|| 0.0, &|| true).expect("goes on"));
        }
        let found = Figures::of(&study, &sums);
        for (place, method) in found.steps[0].methods.iter().enumerate() {
            let rows = || sums.rows.iter().filter(|row| row.method == place as u64 && row.outcome == 0);
            for which in 0..ERRORS.len() {
                let mut errors: Vec<f64> = rows().filter_map(|row| row.error(which)).collect();
                let count = errors.len() as f64;
                let mean = errors.iter().sum::<f64>() / count;
                let deviation = (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt();
                let figures = &method.errors[which];
                assert!((figures.mean.expect("poses") - mean).abs() < 1e-9 * deviation.max(1.0));
                assert!((figures.deviation.expect("poses") / deviation - 1.0).abs() < 1e-9);
                let rms = figures.root_mean_square.expect("poses");
                let [low, high] = rms.interval.expect("a hundred blocks");
                assert!(low <= rms.value && rms.value <= high);
                // Those without a pose are the worst.
                for error in &mut errors {
                    *error = error.abs();
                }
                errors.resize(100, f64::INFINITY);
                errors.sort_by(f64::total_cmp);
                let median = f64::midpoint(errors[49], errors[50]);
                match figures.median {
                    Some(found) => assert!((found.value - median).abs() <= 1e-12 * median),
                    None => assert!(median.is_infinite(), "{median}"),
                }
            }
            assert_eq!(method.good.count, rows().filter(|row| row.values[ESTIMATE] == Some(1.0)).count() as u64);
        }
    }

    #[test]
    fn wrong_pairs_are_told_of_as_what_they_do() {
        let methods = ["auto", "auto+robust"].map(|name| Method::named(name).expect("known")).to_vec();
        let disturbance = Disturbance { pixel_sigma_px: 0.5, outlier_ratio: 0.3, ..Disturbance::default() };
        let found = figures(&Study { disturbance, methods, ..easy(200) });
        let [trusting, robust] = &found.steps[0].methods[..] else { panic!("two methods") };
        assert!(robust.good.count >= 195, "{robust:?}");
        assert!(trusting.posed.count < 20 && trusting.reasons[0].0 == "high_residual", "{trusting:?}");
    }
}
