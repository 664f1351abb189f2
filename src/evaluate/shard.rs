//! A contiguous part of a study's runs, with all steps and methods, and the sums over it.

use std::ops::Range;

use super::compare::{Versus, pairs};
use super::draw::{self, Drawn};
use super::judge::{Judgement, judge};
use super::method::Method;
use super::numbers::Numbers;
use super::resample::block_of;
use super::row::Row;
use super::study::Study;
use super::tally::{Tally, Times};
use crate::geometry::PoseCovariance;
use crate::refine::Correspondence;
use crate::scene::verdict::sharp_bound;
use crate::solve::Pair;

/// Most shards of a study.
const MAX_SHARDS: u64 = 64;
/// A shard is worth so many solves: a tenth of a second.
const MIN_SOLVES: u64 = 4_000;
/// A study keeps its rows if there are no more than this.
pub const MAX_ROWS: u64 = 100_000;

/// Seconds since some moment; only differences count.
pub type Clock<'a> = &'a dyn Fn() -> f64;

/// The sums over a part of the runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shard {
    /// One for each value of the sweep.
    pub steps: Vec<Step>,
    /// What each method said of each case, where the study keeps it.
    pub rows: Vec<Row>,
    /// What it took to compute, s.
    pub seconds: f64,
}

/// The sums over a part of the runs at one value of the sweep.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Step {
    /// Runs for which no case could be drawn.
    pub undrawn: u64,
    /// One for each method.
    pub tallies: Vec<Tally>,
    /// One for each method.
    pub times: Vec<Times>,
    /// One for each pair of methods, in the order of [`pairs`].
    pub versus: Vec<Versus>,
}

impl Study {
    /// How many solves it takes.
    #[must_use]
    pub fn solves(&self) -> u64 {
        self.runs.saturating_mul((self.steps() * self.methods.len()) as u64)
    }

    /// Into how many parts it is cut.
    #[must_use]
    pub fn shards(&self) -> u64 {
        (self.solves() / MIN_SOLVES).clamp(1, MAX_SHARDS).min(self.runs.max(1))
    }

    /// The runs of part number `shard`.
    #[must_use]
    pub fn runs_of(&self, shard: u64) -> Range<u64> {
        let shards = u128::from(self.shards());
        #[expect(clippy::cast_possible_truncation, reason = "at most the number of runs")]
        let start = |shard: u64| (u128::from(self.runs) * u128::from(shard) / shards) as u64;
        start(shard)..start(shard + 1)
    }

    /// Whether it keeps what every method said of every case.
    #[must_use]
    pub fn keeps_rows(&self) -> bool {
        self.solves() <= MAX_ROWS
    }
}

impl Shard {
    /// Computes part number `shard` of a study. `each` is told of every row and says whether to go on; `None` if it did not.
    pub fn run(study: &Study, shard: u64, clock: Clock<'_>, each: &mut dyn FnMut(Row) -> bool) -> Option<Self> {
        let start = clock();
        let at: Vec<Study> = (0..study.steps()).map(|step| study.at(step)).collect();
        let mut sums = Self { steps: vec![Step::of(study.methods.len()); at.len()], ..Self::default() };
        let mut judgements = Vec::with_capacity(study.methods.len());
        for run in study.runs_of(shard) {
            let block = block_of(run, study.runs);
            for (number, (study, step)) in at.iter().zip(&mut sums.steps).enumerate() {
                let Some(drawn) = draw::case(study, run) else {
                    step.undrawn += 1;
                    continue;
                };
                let asked = Asked::of(&drawn);
                judgements.clear();
                for (place, method) in study.methods.iter().enumerate() {
                    let (judgement, seconds) = asked.put_to(*method, clock);
                    step.tallies[place].add(block, &judgement);
                    step.times[place].add(seconds);
                    let truth = &drawn.trial.case.camera_from_target;
                    if !each(judgement.row([number as u64, run, place as u64], truth, seconds)) {
                        return None;
                    }
                    judgements.push(judgement);
                }
                for (versus, (first, second)) in step.versus.iter_mut().zip(pairs(judgements.len())) {
                    versus.add(&judgements[first], &judgements[second]);
                }
            }
        }
        sums.seconds = clock() - start;
        Some(sums)
    }

    /// The same with the rows, if the study keeps them.
    pub fn run_keeping(study: &Study, shard: u64, clock: Clock<'_>, goes_on: &dyn Fn() -> bool) -> Option<Self> {
        let keeps = study.keeps_rows();
        let mut rows = Vec::new();
        let mut each = |row| {
            if keeps {
                rows.push(row);
            }
            goes_on()
        };
        let sums = Self::run(study, shard, clock, &mut each)?;
        Some(Self { rows, ..sums })
    }

    /// The sums of the next part with these.
    pub fn merge(&mut self, next: Self) {
        if self.steps.is_empty() {
            *self = next;
            return;
        }
        for (step, other) in self.steps.iter_mut().zip(&next.steps) {
            step.undrawn += other.undrawn;
            for (tally, others) in step.tallies.iter_mut().zip(&other.tallies) {
                tally.merge(others);
            }
            for (times, others) in step.times.iter_mut().zip(&other.times) {
                times.merge(others);
            }
            for (versus, others) in step.versus.iter_mut().zip(&other.versus) {
                versus.merge(others);
            }
        }
        self.rows.extend(next.rows);
        self.seconds += next.seconds;
    }
}

impl Step {
    fn of(methods: usize) -> Self {
        Self {
            undrawn: 0,
            tallies: vec![Tally::default(); methods],
            times: vec![Times::default(); methods],
            versus: vec![Versus::default(); pairs(methods).count()],
        }
    }
}

/// A case as it is put to every method.
struct Asked<'a> {
    drawn: &'a Drawn,
    seen: Vec<Correspondence>,
    rays: Vec<Pair>,
    bound: Option<PoseCovariance>,
}

impl<'a> Asked<'a> {
    fn of(drawn: &'a Drawn) -> Self {
        let seen = drawn.trial.correspondences();
        // A pixel without a ray lies outside the lens model; a solver gets those that have one.
        let on_ray = |seen: &Correspondence| Some(Pair { point: seen.point, ray: drawn.told.unproject(&seen.pixel)? });
        let rays = seen.iter().filter_map(on_ray).collect();
        Self { drawn, seen, rays, bound: sharp_bound(&drawn.trial) }
    }

    /// What is found of what the method says, and the time that it took, s.
    fn put_to(&self, method: Method, clock: Clock<'_>) -> (Judgement, f64) {
        let start = clock();
        let said = method.ask(&self.drawn.told, &self.seen, &self.rays);
        let seconds = clock() - start;
        (judge(&self.drawn.trial, self.bound.as_ref(), &said), seconds)
    }
}

impl Numbers for Step {
    fn write(&self, to: &mut Vec<f64>) {
        self.undrawn.write(to);
        self.tallies.write(to);
        self.times.write(to);
        self.versus.write(to);
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        Some(Self {
            undrawn: u64::read(from)?,
            tallies: Vec::read(from)?,
            times: Vec::read(from)?,
            versus: Vec::read(from)?,
        })
    }
}

impl Numbers for Shard {
    fn write(&self, to: &mut Vec<f64>) {
        self.steps.write(to);
        self.rows.write(to);
        self.seconds.write(to);
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        Some(Self { steps: Vec::read(from)?, rows: Vec::read(from)?, seconds: f64::read(from)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::study::{Parameter, Sweep};

    fn study() -> Study {
        let sweep = Some(Sweep { parameter: Parameter::PixelSigmaPx, values: vec![0.2, 1.0] });
        Study { sweep, ..Study::thesis_2012(1_700, 7) }
    }

    fn whole(study: &Study, through_numbers: bool) -> Shard {
        let mut sums = Shard::default();
        for number in 0..study.shards() {
            let part = Shard::run_keeping(study, number, &|| 0.0, &|| true).expect("goes on");
            let mut numbers = Vec::new();
            part.write(&mut numbers);
            sums.merge(if through_numbers { Shard::read(&mut numbers.into_iter()).expect("reads") } else { part });
        }
        sums
    }

    #[test]
    fn every_run_is_in_one_part() {
        for runs in [1, 100, 4_001, 1_000_000, 123_456_789] {
            let study = Study::thesis_2012(runs, 1);
            let mut next = 0;
            for shard in 0..study.shards() {
                assert_eq!(study.runs_of(shard).start, next);
                next = study.runs_of(shard).end;
            }
            assert_eq!(next, runs);
        }
    }

    #[test]
    fn sums_are_the_same_each_time_and_by_way_of_numbers() {
        let study = study();
        assert!(study.shards() > 1);
        let sums = whole(&study, false);
        assert_eq!(sums, whole(&study, true));
        assert_eq!(sums.rows.len() as u64, study.solves());
        assert!(sums.steps.iter().all(|step| step.tallies.iter().all(|tally| tally.cases() == study.runs)));
    }

    #[test]
    fn who_does_not_want_more_gets_nothing() {
        assert_eq!(Shard::run_keeping(&study(), 0, &|| 0.0, &|| false), None);
    }
}
