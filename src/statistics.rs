//! Shares and quantiles of the distributions by which errors are judged.

/// The share of a normal variable below `z` deviations (Abramowitz and Stegun 26.2.17, within 1e-7).
#[must_use]
pub fn normal_share_below(z: f64) -> f64 {
    let k = 1.0 / (1.0 + 0.231_641_9 * z.abs());
    let series =
        ((((1.330_274_429 * k - 1.821_255_978) * k + 1.781_477_937) * k - 0.356_563_782) * k + 0.319_381_53) * k;
    let tail = series * (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
    if z > 0.0 { 1.0 - tail } else { tail }
}

/// The quantile of chi-square at `z` standard deviations of a normal variable (Wilson and Hilferty 1931; within 3 % from two
/// degrees of freedom on).
#[must_use]
pub fn chi_square_quantile(freedom: f64, z: f64) -> f64 {
    let spread = 2.0 / (9.0 * freedom);
    freedom * (1.0 - spread + z * spread.sqrt()).powi(3)
}

/// The share of chi-square above `value` with twice `pairs` degrees of freedom: exact, as the series ends there (Abramowitz and Stegun
/// 26.4.21). All of it for none.
#[must_use]
pub fn chi_square_share_above(pairs: u32, value: f64) -> f64 {
    let half = 0.5 * value.max(0.0);
    if pairs == 0 || half == 0.0 {
        return 1.0;
    }
    if half > MOST_HALF {
        return 0.0;
    }
    let (mut term, mut sum) = (1.0, 1.0);
    for power in 1..pairs {
        term *= half / f64::from(power);
        sum += term;
    }
    (sum * (-half).exp()).min(1.0)
}

/// Beyond it the exponential is nothing in double precision.
const MOST_HALF: f64 = 700.0;

/// The value above which lies this share of chi-square with twice `pairs` degrees of freedom, `share` between 0 and 1: the inverse of
/// [`chi_square_share_above`], to rounding.
#[must_use]
pub fn chi_square_limit(pairs: u32, share: f64) -> f64 {
    let (mut low, mut high) = (0.0, 2.0 * MOST_HALF);
    // Each step halves what is left: down to rounding.
    for _ in 0..64 {
        let middle = 0.5 * (low + high);
        if chi_square_share_above(pairs, middle) > share {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// A share of cases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rate {
    /// Those for which it holds.
    pub count: u64,
    /// All.
    pub of: u64,
}

impl Rate {
    /// Of a list of answers.
    pub fn among(answers: impl IntoIterator<Item = bool>) -> Self {
        let mut rate = Self::default();
        for holds in answers {
            rate.count += u64::from(holds);
            rate.of += 1;
        }
        rate
    }

    /// The share; `None` of nothing.
    #[must_use]
    pub fn ratio(self) -> Option<f64> {
        (self.of > 0).then(|| self.count as f64 / self.of as f64)
    }

    /// Where the true share lies with a confidence of 95 % (Wilson 1927); anywhere of nothing.
    #[must_use]
    pub fn interval(self) -> [f64; 2] {
        let Some(share) = self.ratio() else { return [0.0, 1.0] };
        let (n, z) = (self.of as f64, TWO_SIDED_95);
        let centre = (share + z * z / (2.0 * n)) / (1.0 + z * z / n);
        let half = z / (1.0 + z * z / n) * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
        // Of none and of all the ends are exact.
        let low = if self.count == 0 { 0.0 } else { centre - half };
        let high = if self.count == self.of { 1.0 } else { centre + half };
        [low, high]
    }
}

/// A normal variable lies within this many deviations with a probability of 95 %.
pub const TWO_SIDED_95: f64 = 1.959_963_984_540_054;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_share_is_that_of_the_tables() {
        for (z, tabulated) in [(0.0, 0.5), (1.0, 0.841_344_746), (-1.96, 0.024_997_895), (3.0, 0.998_650_102)] {
            assert!((normal_share_below(z) - tabulated).abs() < 1e-7, "{z}");
        }
    }

    #[test]
    fn intervals_of_shares_are_wilsons() {
        // Newcombe, "Two-sided confidence intervals for the single proportion", 1998, table I: 81 of 263, 0 of 20.
        for (count, of, low, high) in [(81, 263, 0.2553, 0.3662), (0, 20, 0.0, 0.1611)] {
            let [found_low, found_high] = Rate { count, of }.interval();
            assert!((found_low - low).abs() < 1e-4 && (found_high - high).abs() < 1e-4, "{found_low} {found_high}");
        }
        assert_eq!((Rate::default().ratio(), Rate::default().interval()), (None, [0.0, 1.0]));
    }

    #[test]
    fn shares_of_chi_square_are_those_of_the_tables() {
        // Abramowitz and Stegun, table 26.8: 2, 6 and 12 degrees of freedom.
        for (pairs, share, tabulated) in
            [(1, 0.05, 5.991_46), (3, 0.05, 12.591_6), (3, 0.001, 22.457_7), (6, 0.01, 26.217_0)]
        {
            assert!((chi_square_limit(pairs, share) - tabulated).abs() < 1e-4, "{pairs} {share}");
            assert!((chi_square_share_above(pairs, tabulated) - share).abs() < 1e-6, "{pairs} {share}");
        }
        assert!(chi_square_share_above(3, 0.0) > 1.0 - 1e-15 && chi_square_share_above(3, 1e9) < 1e-300);
    }

    #[test]
    fn quantiles_agree_with_the_tables() {
        // Abramowitz and Stegun, table 26.8, at 0.999. Wilson and Hilferty's cube is 2.3 % off at two degrees and less at more.
        for (freedom, tabulated) in [(2.0, 13.816), (6.0, 22.458), (30.0, 59.703)] {
            let found = chi_square_quantile(freedom, 3.0902);
            assert!((found / tabulated - 1.0).abs() < 0.025, "{freedom}: {found}");
        }
    }
}
