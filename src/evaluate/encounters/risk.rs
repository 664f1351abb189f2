//! The risk ratio: the probability of a near mid-air collision with the system over that without it.

use crate::statistics::TWO_SIDED_95;

/// Near mid-air collisions of the same encounters, flown with the system and without.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RiskRatio {
    /// Encounters.
    pub of: u64,
    /// A collision either way.
    pub both: u64,
    /// One that the system brought about.
    pub induced: u64,
    /// One that the system averted.
    pub averted: u64,
}

impl RiskRatio {
    /// Of encounters, each with whether there was a collision without the system, and whether with it.
    pub fn among(encounters: impl IntoIterator<Item = [bool; 2]>) -> Self {
        let mut risk = Self::default();
        for [without, with] in encounters {
            risk.of += 1;
            risk.both += u64::from(without && with);
            risk.induced += u64::from(!without && with);
            risk.averted += u64::from(without && !with);
        }
        risk
    }

    /// Collisions without the system.
    #[must_use]
    pub const fn without(&self) -> u64 {
        self.both + self.averted
    }

    /// Collisions with it.
    #[must_use]
    pub const fn with(&self) -> u64 {
        self.both + self.induced
    }

    /// The ratio; `None` if there were no collisions without the system.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        (self.without() > 0).then(|| self.with() as f64 / self.without() as f64)
    }

    /// Where the true ratio lies with a confidence of 95 %: the score interval for the ratio of two shares of the same cases (Nam and
    /// Blackwelder, "Analysis of the ratio of marginal probabilities in a matched-pair setting", Statistics in Medicine, 2002). It
    /// holds for no collision left as well. `None` if there were none without the system.
    #[must_use]
    pub fn interval(&self) -> Option<[f64; 2]> {
        let ratio = self.ratio()?;
        let outside = |at: f64| self.score(at).abs() > TWO_SIDED_95;
        // Between a ratio that is inside and one that is not; on a logarithmic scale, as ratios are.
        let edge = |mut inside: f64, mut beyond: f64| {
            for _ in 0..200 {
                let middle = (inside * beyond).sqrt();
                if outside(middle) {
                    beyond = middle;
                } else {
                    inside = middle;
                }
            }
            inside
        };
        let low = if self.with() == 0 { 0.0 } else { edge(ratio, ratio * 1e-9) };
        let high = edge(ratio.max(1e-9), ratio.max(1.0) * 1e9);
        Some([low, high])
    }

    /// By how many of its deviations the difference of the shares is from what it would be if the ratio were `at`.
    fn score(&self, at: f64) -> f64 {
        let n = self.of as f64;
        let share = |count: u64| count as f64 / n;
        let (with, without) = (share(self.with()), share(self.without()));
        let (induced, averted) = (share(self.induced), share(self.averted));
        let any = with + averted;
        // The most likely shares under that ratio.
        let root = (with - at * at * without).powi(2) + 4.0 * at * at * induced * averted;
        let induced = (-with + at * at * (without + 2.0 * induced) + root.sqrt()) / (2.0 * at * (at + 1.0));
        let averted = at * induced - (at - 1.0) * any;
        let difference = with - at * without;
        let variance = at * (induced + averted) / n;
        if difference.abs() < 1e-15 { 0.0 } else { difference / variance.max(1e-300).sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::random::case;

    #[test]
    fn no_collision_left_and_none_averted_have_intervals_in_closed_form() {
        let squared = TWO_SIDED_95 * TWO_SIDED_95;
        let perfect = RiskRatio { of: 500, both: 0, induced: 0, averted: 100 };
        assert_eq!(perfect.ratio(), Some(0.0));
        let [low, high] = perfect.interval().expect("collisions");
        assert!(low.abs() < 1e-12 && (high - squared / 100.0).abs() < 1e-6, "{low} {high}");
        let blind = RiskRatio { of: 500, both: 100, induced: 0, averted: 0 };
        assert_eq!(blind.ratio(), Some(1.0));
        let [low, high] = blind.interval().expect("collisions");
        assert!((low - 100.0 / (100.0 + squared)).abs() < 1e-6, "{low}");
        assert!((high - 1.0 - squared / 100.0).abs() < 1e-6, "{high}");
        assert_eq!(RiskRatio { of: 9, ..RiskRatio::default() }.interval(), None);
    }

    #[test]
    fn the_shares_under_a_ratio_are_the_most_likely_ones() {
        // The slow obvious way: a grid over the two numbers that the ratio leaves free.
        let risk = RiskRatio { of: 200, both: 12, induced: 5, averted: 40 };
        for at in [0.2_f64, 0.7, 1.6] {
            let mut best = (f64::NEG_INFINITY, 0.0);
            for (column, row) in (1..600).flat_map(|column| (1..600).map(move |row| (column, row))) {
                let (both, averted) = (f64::from(column) / 2_000.0, f64::from(row) / 1_000.0);
                let induced = at * (both + averted) - both;
                let neither = 1.0 - both - induced - averted;
                if induced > 0.0 && neither > 0.0 {
                    let ln = 12.0 * both.ln() + 5.0 * induced.ln() + 40.0 * averted.ln() + 143.0 * neither.ln();
                    if ln > best.0 {
                        best = (ln, induced + averted);
                    }
                }
            }
            let difference = 17.0 / 200.0 - at * 52.0 / 200.0;
            let slow = difference / (at * best.1 / 200.0).sqrt();
            assert!((risk.score(at) - slow).abs() < 0.02 * slow.abs().max(1.0), "{at}: {} {slow}", risk.score(at));
        }
    }

    #[test]
    fn the_interval_holds_the_truth_in_about_19_of_20_studies() {
        // A tenth collide without the system; of these 0.3 with it too, and it brings about some where there are none.
        let truth: f64 = (0.1 * 0.3 + 0.9 * 0.01) / 0.1;
        let held = (0..1000)
            .filter(|&study| {
                let mut rng = case("held", study);
                let mut chance = || rng.random_range(0.0..1.0);
                let risk = RiskRatio::among((0..400).map(|_| {
                    let without = chance() < 0.1;
                    [without, chance() < if without { 0.3 } else { 0.01 }]
                }));
                risk.interval().is_some_and(|[low, high]| (low..=high).contains(&truth))
            })
            .count();
        // Four deviations of a thousand are 28.
        assert!((922..=982).contains(&held), "{held}");
    }
}
