//! How numbers are spread.

/// How numbers are spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// How many there are.
    pub count: usize,
    /// Mean.
    pub mean: f64,
    /// Standard deviation about the mean, of a sample; 0 for a single number.
    pub deviation: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// Half are below.
    pub median: f64,
    /// 95 % are below, or at it.
    pub p95: f64,
    /// The largest.
    pub largest: f64,
}

impl Spread {
    /// Of numbers, summed in their order; `None` of none.
    pub fn of(numbers: impl IntoIterator<Item = f64>) -> Option<Self> {
        let numbers: Vec<f64> = numbers.into_iter().collect();
        let count = numbers.len();
        let total = count as f64;
        let mean = numbers.iter().sum::<f64>() / total;
        let squared: f64 = numbers.iter().map(|number| (number - mean).powi(2)).sum();
        let rms = (numbers.iter().map(|number| number * number).sum::<f64>() / total).sqrt();
        let mut sorted = numbers;
        sorted.sort_by(f64::total_cmp);
        let largest = *sorted.last()?;
        let median = f64::midpoint(sorted[(count - 1) / 2], sorted[count / 2]);
        // The least number that 95 % do not exceed.
        let p95 = sorted[(count * 95).div_ceil(100).max(1) - 1];
        let deviation = if count > 1 { (squared / (total - 1.0)).sqrt() } else { 0.0 };
        Some(Self { count, mean, deviation, rms, median, p95, largest })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_what_its_words_say() {
        let spread = Spread::of((1..=100).rev().map(f64::from)).expect("numbers");
        assert_eq!(
            (spread.count, spread.mean, spread.median, spread.p95, spread.largest),
            (100, 50.5, 50.5, 95.0, 100.0)
        );
        // Sum of squares of 1 to n: n (n + 1) (2 n + 1) / 6; variance of a sample: n (n + 1) / 12.
        assert!((spread.rms - (101.0 * 201.0 / 6.0_f64).sqrt()).abs() < 1e-12);
        assert!((spread.deviation - (100.0 * 101.0 / 12.0_f64).sqrt()).abs() < 1e-12);
        let single = Spread::of([3.0]).expect("a number");
        assert_eq!((single.median, single.p95, single.deviation), (3.0, 3.0, 0.0));
        assert_eq!(Spread::of([]), None);
    }
}
