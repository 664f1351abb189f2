//! How a number is spread over encounters. Of ranges and margins the low end is what counts.

/// Order statistics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantiles {
    /// How many there are.
    pub count: u64,
    /// The least.
    pub least: f64,
    /// 5 % are below, or at it.
    pub p05: f64,
    /// Half are.
    pub median: f64,
    /// 95 % are.
    pub p95: f64,
    /// The largest.
    pub largest: f64,
}

impl Quantiles {
    /// Of numbers in any order; `None` of none.
    pub fn of(numbers: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = numbers.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let (least, largest) = (*sorted.first()?, *sorted.last()?);
        // The least number that this share does not exceed.
        let at = |percent: usize| sorted[(sorted.len() * percent).div_ceil(100).max(1) - 1];
        Some(Self { count: sorted.len() as u64, least, p05: at(5), median: at(50), p95: at(95), largest })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_what_their_names_say() {
        let found = Quantiles::of((1..=100).rev().map(f64::from)).expect("numbers");
        let wanted = Quantiles { count: 100, least: 1.0, p05: 5.0, median: 50.0, p95: 95.0, largest: 100.0 };
        assert_eq!(found, wanted);
        assert_eq!(Quantiles::of([7.0]).map(|one| (one.p05, one.p95)), Some((7.0, 7.0)));
        assert_eq!(Quantiles::of([]), None);
    }
}
