//! What came of all cases of one method at one step, in sums that can be merged.

use super::judge::{Judgement, PoseJudgement};
use super::moments::Moments;
use super::numbers::Numbers;
use super::quantiles::Quantiles;
use super::resample::Block;
use super::row::{ERRORS, OUTCOMES};

/// Tenths of stated probability.
pub const BINS: usize = 10;
/// 95 % of chi-square with six degrees of freedom.
const CHI_SQUARE_6_95: f64 = 12.592;

/// Sums over cases.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// How each case ended, by the place in [`OUTCOMES`].
    pub outcomes: [u64; OUTCOMES.len()],
    /// Answers near the truth.
    pub good: u64,
    /// Best poses with the wrong attitude.
    pub flips: u64,
    /// Flips that the answer does not warn of by an alternative.
    pub silent_flips: u64,
    /// Answers that call themselves ambiguous.
    pub ambiguous: u64,
    /// Of the errors.
    pub moments: [Moments; ERRORS.len()],
    /// Of the sizes of the errors.
    pub sizes: [Quantiles; ERRORS.len()],
    /// For intervals.
    pub blocks: Vec<Block>,
    /// Normalised errors squared of all poses nearest to the truth.
    pub all: Consistency,
    /// Of those whose covariance calls itself reliable.
    pub reliable: Consistency,
    /// Stated probabilities of all poses.
    pub bins: [Bin; BINS],
    /// Sum of squared distances of the stated probability of the best pose from what was the case (Brier 1950).
    pub brier: f64,
}

/// Whether errors are as large as their covariances say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Consistency {
    /// How many.
    pub count: u64,
    /// Sum of normalised errors squared.
    pub sum: f64,
    /// Errors within the ellipsoid that is to hold 95 %.
    pub inside: u64,
}

/// Poses of about the same stated probability.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// How many.
    pub count: u64,
    /// Those that are right.
    pub right: u64,
    /// Sum of the stated probabilities.
    pub stated: f64,
}

/// Times of a method: they differ from run to run and are kept apart from what does not.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Times {
    /// Of a case, s.
    pub moments: Moments,
    /// The same by size.
    pub sizes: Quantiles,
}

impl Tally {
    /// One more case, of this block.
    pub fn add(&mut self, block: u64, judgement: &Judgement) {
        self.outcomes[judgement.outcome] += 1;
        if self.blocks.last().is_none_or(|last| last.number != block) {
            self.blocks.push(Block { number: block, ..Block::default() });
        }
        if let Some(pose) = &judgement.pose {
            self.add_pose(pose);
        }
    }

    fn add_pose(&mut self, pose: &PoseJudgement) {
        self.good += u64::from(pose.is_good);
        self.flips += u64::from(pose.is_flip);
        self.silent_flips += u64::from(pose.is_flip && !pose.is_ambiguous);
        self.ambiguous += u64::from(pose.is_ambiguous);
        for ((error, moments), sizes) in pose.errors.iter().zip(&mut self.moments).zip(&mut self.sizes) {
            moments.add(*error);
            sizes.add(error.abs());
        }
        if let Some(block) = self.blocks.last_mut() {
            block.poses += 1;
            for (sum, error) in block.squares.iter_mut().zip(&pose.errors) {
                *sum += error * error;
            }
            if let Some(squared) = pose.over_bound_squared {
                block.bounded += 1;
                block.bounded_squares += squared;
            }
        }
        let Some(claims) = &pose.claims else { return };
        self.all.add(claims.nearest_squared);
        if claims.is_reliable {
            self.reliable.add(claims.nearest_squared);
        }
        for (probability, is_right) in &claims.stated {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a tenth of 0 to 1")]
            let bin = &mut self.bins[((probability * BINS as f64) as usize).min(BINS - 1)];
            bin.count += 1;
            bin.right += u64::from(*is_right);
            bin.stated += probability;
        }
        if let Some((probability, is_right)) = claims.stated.first() {
            self.brier += (probability - f64::from(u8::from(*is_right))).powi(2);
        }
    }

    /// The cases of another part, which come after these.
    pub fn merge(&mut self, other: &Self) {
        for (sum, count) in self.outcomes.iter_mut().zip(&other.outcomes) {
            *sum += count;
        }
        self.good += other.good;
        self.flips += other.flips;
        self.silent_flips += other.silent_flips;
        self.ambiguous += other.ambiguous;
        for (moments, others) in self.moments.iter_mut().zip(&other.moments) {
            moments.merge(others);
        }
        for (sizes, others) in self.sizes.iter_mut().zip(&other.sizes) {
            sizes.merge(others);
        }
        for block in &other.blocks {
            match self.blocks.last_mut() {
                Some(last) if last.number == block.number => last.add(block),
                _ => self.blocks.push(block.clone()),
            }
        }
        self.all.merge(&other.all);
        self.reliable.merge(&other.reliable);
        for (bin, others) in self.bins.iter_mut().zip(&other.bins) {
            bin.count += others.count;
            bin.right += others.right;
            bin.stated += others.stated;
        }
        self.brier += other.brier;
    }

    /// Cases.
    #[must_use]
    pub fn cases(&self) -> u64 {
        self.outcomes.iter().sum()
    }

    /// Cases with a pose.
    #[must_use]
    pub const fn poses(&self) -> u64 {
        self.outcomes[0]
    }
}

impl Consistency {
    fn add(&mut self, squared: f64) {
        self.count += 1;
        self.sum += squared;
        self.inside += u64::from(squared <= CHI_SQUARE_6_95);
    }

    fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.inside += other.inside;
    }
}

impl Times {
    /// One more case.
    pub fn add(&mut self, seconds: f64) {
        self.moments.add(seconds);
        self.sizes.add(seconds);
    }

    /// The cases of another part.
    pub fn merge(&mut self, other: &Self) {
        self.moments.merge(&other.moments);
        self.sizes.merge(&other.sizes);
    }
}

impl Numbers for Tally {
    fn write(&self, to: &mut Vec<f64>) {
        self.outcomes.write(to);
        [self.good, self.flips, self.silent_flips, self.ambiguous].write(to);
        self.moments.write(to);
        self.sizes.write(to);
        self.blocks.write(to);
        for part in [&self.all, &self.reliable] {
            [part.count, part.inside].write(to);
            part.sum.write(to);
        }
        for bin in &self.bins {
            [bin.count, bin.right].write(to);
            bin.stated.write(to);
        }
        self.brier.write(to);
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let outcomes = <[u64; OUTCOMES.len()]>::read(from)?;
        let [good, flips, silent_flips, ambiguous] = <[u64; 4]>::read(from)?;
        let (moments, sizes, blocks) = (<[Moments; 9]>::read(from)?, <[Quantiles; 9]>::read(from)?, Vec::read(from)?);
        let mut consistency = || {
            let [count, inside] = <[u64; 2]>::read(from)?;
            Some(Consistency { count, sum: f64::read(from)?, inside })
        };
        let (all, reliable) = (consistency()?, consistency()?);
        let mut bins = [Bin::default(); BINS];
        for bin in &mut bins {
            let [count, right] = <[u64; 2]>::read(from)?;
            *bin = Bin { count, right, stated: f64::read(from)? };
        }
        let brier = f64::read(from)?;
        Some(Self {
            outcomes,
            good,
            flips,
            silent_flips,
            ambiguous,
            moments,
            sizes,
            blocks,
            all,
            reliable,
            bins,
            brier,
        })
    }
}

impl Numbers for Times {
    fn write(&self, to: &mut Vec<f64>) {
        self.moments.write(to);
        self.sizes.write(to);
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        Some(Self { moments: Moments::read(from)?, sizes: Quantiles::read(from)? })
    }
}
