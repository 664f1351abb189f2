//! Two methods on the same cases: which is better, and whether that may be chance.

use super::judge::Judgement;
use super::numbers::Numbers;
use super::row::{ROTATION, TRANSLATION};

/// On how many cases the first was better, and on how many the second; the others are ties.
pub type Wins = [u64; 2];

/// Two methods on the same cases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Versus {
    /// By the angle between the rotations; no pose is the worst.
    pub rotation: Wins,
    /// By the distance between the translations.
    pub translation: Wins,
    /// By which alone was near the truth.
    pub good: Wins,
}

/// Errors that differ by less than this share of them are a tie: two ways to the same minimum.
const TIE_RATIO: f64 = 1e-6;

impl Versus {
    /// One more case.
    pub fn add(&mut self, first: &Judgement, second: &Judgement) {
        for (wins, which) in [(&mut self.rotation, ROTATION), (&mut self.translation, TRANSLATION)] {
            let error =
                |judgement: &Judgement| judgement.pose.as_ref().map_or(f64::INFINITY, |pose| pose.errors[which]);
            let (a, b) = (error(first), error(second));
            if a < b * (1.0 - TIE_RATIO) {
                wins[0] += 1;
            } else if b < a * (1.0 - TIE_RATIO) {
                wins[1] += 1;
            }
        }
        let good = |judgement: &Judgement| judgement.pose.as_ref().is_some_and(|pose| pose.is_good);
        match (good(first), good(second)) {
            (true, false) => self.good[0] += 1,
            (false, true) => self.good[1] += 1,
            _ => {}
        }
    }

    /// The cases of another part.
    pub fn merge(&mut self, other: &Self) {
        for (wins, others) in [
            (&mut self.rotation, other.rotation),
            (&mut self.translation, other.translation),
            (&mut self.good, other.good),
        ] {
            wins[0] += others[0];
            wins[1] += others[1];
        }
    }
}

/// Pairs of so many methods, in their order.
pub fn pairs(methods: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..methods).flat_map(move |first| (first + 1..methods).map(move |second| (first, second)))
}

/// Probability that equal methods would differ at least so much: the sign test, two-sided, exact. On shares of good answers it
/// is McNemar's test.
#[must_use]
pub fn sign_test([first, second]: Wins) -> f64 {
    let (total, fewer) = (first + second, first.min(second));
    if total == 0 {
        return 1.0;
    }
    let n = total as f64;
    if total > 10_000 {
        // The normal distribution, with the correction for what is counted being whole.
        let z = (fewer as f64 + 0.5 - 0.5 * n) / (0.25 * n).sqrt();
        return (2.0 * crate::statistics::normal_share_below(z)).min(1.0);
    }
    // Sum of the binomial's lower tail, each term from the one before, in logarithms.
    let mut ln_term = -n * std::f64::consts::LN_2;
    let mut tail = ln_term.exp();
    for k in 1..=fewer {
        ln_term += ((n - k as f64 + 1.0) / k as f64).ln();
        tail += ln_term.exp();
    }
    (2.0 * tail).min(1.0)
}

/// The same probabilities with the number of tests taken into account, so that among all of them one below 0.05 is chance
/// in at most one study of twenty (Holm 1979).
#[must_use]
pub fn holm(probabilities: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..probabilities.len()).collect();
    order.sort_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]));
    let mut adjusted = vec![1.0; probabilities.len()];
    let mut least: f64 = 0.0;
    for (rank, index) in order.into_iter().enumerate() {
        least = least.max((probabilities[index] * (probabilities.len() - rank) as f64).min(1.0));
        adjusted[index] = least;
    }
    adjusted
}

impl Numbers for Versus {
    fn write(&self, to: &mut Vec<f64>) {
        [self.rotation, self.translation, self.good].write(to);
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let [rotation, translation, good] = <[Wins; 3]>::read(from)?;
        Some(Self { rotation, translation, good })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sign_test_agrees_with_the_tables() {
        // Conover, Practical Nonparametric Statistics, table A3: binomial(10, 1/2) at most 1 is 0.0107, (20, 1/2) at most 5 is 0.0207.
        for (wins, tabulated) in [([1, 9], 0.0215), ([9, 1], 0.0215), ([5, 15], 0.0414), ([5, 5], 1.0), ([0, 0], 1.0)] {
            assert!((sign_test(wins) - tabulated).abs() < 1e-4, "{wins:?}: {}", sign_test(wins));
        }
        let (exact, normal) = (sign_test([4_900, 5_100]), sign_test([4_901, 5_101]));
        assert!((exact - normal).abs() < 2e-3, "{exact} {normal}");
        assert!(sign_test([0, 9_999]) < 1e-300 && sign_test([0, 1_000_000]) < 1e-12);
    }

    #[test]
    fn holm_is_as_in_his_paper() {
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.005]);
        for (found, wanted) in adjusted.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((found - wanted).abs() < 1e-12, "{adjusted:?}");
        }
    }

    #[test]
    fn pairs_are_all_and_each_once() {
        assert_eq!(pairs(3).collect::<Vec<_>>(), [(0, 1), (0, 2), (1, 2)]);
    }
}
