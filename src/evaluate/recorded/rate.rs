//! A share of so many, with its interval.

/// A share of so many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rate {
    /// For which it is so.
    pub count: u32,
    /// Of how many.
    pub total: u32,
}

/// 95 % of a normal variable lie within so many deviations.
const Z: f64 = 1.959_964;

impl Rate {
    /// Of a list of answers.
    pub fn of(answers: impl IntoIterator<Item = bool>) -> Self {
        let mut rate = Self::default();
        for is_so in answers {
            rate.count += u32::from(is_so);
            rate.total += 1;
        }
        rate
    }

    /// The share; `None` of none.
    #[must_use]
    pub fn share(&self) -> Option<f64> {
        (self.total > 0).then(|| f64::from(self.count) / f64::from(self.total))
    }

    /// The interval that holds the share behind it with 95 % (E. B. Wilson, "Probable inference, the law of succession, and
    /// statistical inference", J. Am. Stat. Assoc. 1927); everything of none.
    #[must_use]
    pub fn interval(&self) -> [f64; 2] {
        let Some(share) = self.share() else { return [0.0, 1.0] };
        let total = f64::from(self.total);
        let grown = 1.0 + Z * Z / total;
        let middle = (share + Z * Z / (2.0 * total)) / grown;
        let reach = Z / grown * (share * (1.0 - share) / total + Z * Z / (4.0 * total * total)).sqrt();
        // Of none and of all the ends are exact.
        let low = if self.count == 0 { 0.0 } else { middle - reach };
        let high = if self.count == self.total { 1.0 } else { middle + reach };
        [low, high]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_that_of_the_textbooks() {
        // R's prop.test(15, 50, correct = FALSE) gives 0.1910 to 0.4375, prop.test(0, 10, correct = FALSE) 0 to 0.2775.
        for (count, total, low, high) in [(15, 50, 0.1910, 0.4375), (0, 10, 0.0, 0.2775), (10, 10, 0.7225, 1.0)] {
            let found = Rate { count, total }.interval();
            assert!((found[0] - low).abs() < 6e-5 && (found[1] - high).abs() < 6e-5, "{count}/{total}: {found:?}");
        }
        assert_eq!(Rate::default().interval(), [0.0, 1.0]);
    }
}
