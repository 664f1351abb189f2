//! How far a figure may be off by chance: the bootstrap (Efron 1979) over blocks of runs. Few runs are a block each; of many,
//! a fixed number of blocks of neighbours, which are as independent as single ones, keeps memory flat.

use rand::RngExt;

use super::numbers::Numbers;
use super::row::ERRORS;
use crate::random;

/// Most blocks.
pub const MAX_BLOCKS: u64 = 200;
/// How often the blocks are drawn anew.
const RESAMPLES: usize = 500;
/// The middle share of the results that is an interval: 95 %.
const TAIL: f64 = 0.025;

/// Sums over the cases of a block.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Block {
    /// Which one.
    pub number: u64,
    /// Poses.
    pub poses: u64,
    /// Squared errors of these.
    pub squares: [f64; ERRORS.len()],
    /// Poses that are compared with the bound.
    pub bounded: u64,
    /// Squared errors of these in units of the bound.
    pub bounded_squares: f64,
}

/// To which block a run belongs.
#[must_use]
pub fn block_of(run: u64, runs: u64) -> u64 {
    let blocks = runs.clamp(1, MAX_BLOCKS);
    #[expect(clippy::cast_possible_truncation, reason = "at most the number of blocks")]
    let block = (u128::from(run) * u128::from(blocks) / u128::from(runs.max(1))) as u64;
    block
}

/// Intervals of root mean squares.
#[derive(Clone, Debug, PartialEq)]
pub struct Intervals {
    /// Of the errors.
    pub errors: [Option<[f64; 2]>; ERRORS.len()],
    /// Of the ratio to the bound.
    pub over_bound: Option<[f64; 2]>,
}

/// The intervals, from the blocks drawn with replacement by the generator of this name.
#[must_use]
pub fn intervals(blocks: &[Block], name: &str) -> Intervals {
    let mut rng = random::named(name);
    let mut ratios: [Vec<f64>; ERRORS.len() + 1] = std::array::from_fn(|_| Vec::with_capacity(RESAMPLES));
    for _ in 0..RESAMPLES {
        let mut sum = Block::default();
        for _ in blocks {
            sum.add(&blocks[rng.random_range(0..blocks.len())]);
        }
        let [errors @ .., over_bound] = &mut ratios;
        if sum.poses > 0 {
            for (ratios, square) in errors.iter_mut().zip(&sum.squares) {
                ratios.push((square / sum.poses as f64).sqrt());
            }
        }
        if let Some(ratio) = sum.over_bound_ratio() {
            over_bound.push(ratio);
        }
    }
    let [errors @ .., over_bound] = ratios;
    Intervals { errors: errors.map(middle), over_bound: middle(over_bound) }
}

/// One block says nothing about chance.
fn middle(mut values: Vec<f64>) -> Option<[f64; 2]> {
    values.sort_by(f64::total_cmp);
    let (first, last) = (values.first()?, values.last()?);
    if values.len() < RESAMPLES / 2 || first >= last {
        return None;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in a list")]
    let at = |share: f64| values[(share * (values.len() - 1) as f64).round() as usize];
    Some([at(TAIL), at(1.0 - TAIL)])
}

impl Block {
    /// Both together.
    pub fn add(&mut self, other: &Self) {
        self.poses += other.poses;
        self.bounded += other.bounded;
        self.bounded_squares += other.bounded_squares;
        for (sum, square) in self.squares.iter_mut().zip(&other.squares) {
            *sum += square;
        }
    }

    /// Root mean square error over the bound: 1 reaches it. A pose has six coordinates.
    #[must_use]
    pub fn over_bound_ratio(&self) -> Option<f64> {
        (self.bounded > 0).then(|| (self.bounded_squares / self.bounded as f64 / 6.0).sqrt())
    }
}

impl Numbers for Block {
    fn write(&self, to: &mut Vec<f64>) {
        [self.number, self.poses, self.bounded].write(to);
        self.squares.write(to);
        self.bounded_squares.write(to);
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let [number, poses, bounded] = <[u64; 3]>::read(from)?;
        Some(Self { number, poses, squares: <[f64; 9]>::read(from)?, bounded, bounded_squares: f64::read(from)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_block_has_its_share_of_the_runs() {
        for runs in [1, 7, 200, 201, 1_000_003] {
            assert_eq!((block_of(0, runs), block_of(runs - 1, runs)), (0, runs.min(MAX_BLOCKS) - 1));
        }
        assert_eq!((0..100).map(|run| block_of(run, 100)).collect::<Vec<_>>(), (0..100).collect::<Vec<_>>());
    }

    #[test]
    fn intervals_hold_the_truth_as_often_as_they_say() {
        // Root mean squares of 100 normal numbers: the truth is 1.
        let mut rng = random::named("intervals");
        let studies = 400;
        let mut inside = 0;
        for study in 0..studies {
            let blocks: Vec<Block> = (0..100)
                .map(|number| {
                    let square = random::normal(&mut rng).powi(2);
                    Block { number, poses: 1, squares: [square; 9], ..Block::default() }
                })
                .collect();
            let [low, high] = intervals(&blocks, &format!("study {study}")).errors[0].expect("an interval");
            inside += u32::from((low..=high).contains(&1.0));
        }
        // The percentile bootstrap of a root mean square is a few percent too narrow at this size.
        let ratio = f64::from(inside) / f64::from(studies);
        assert!((0.89..=0.98).contains(&ratio), "{ratio}");
    }

    #[test]
    fn one_block_has_no_interval() {
        let block = Block { poses: 3, squares: [1.0; 9], ..Block::default() };
        assert_eq!(intervals(&[block], "one").errors[0], None);
        assert_eq!(intervals(&[], "none").over_bound, None);
    }
}
