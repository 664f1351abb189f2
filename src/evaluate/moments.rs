//! Count, mean and spread of numbers that come one by one or in parts.

use super::numbers::Numbers;

/// Welford's running moments; parts are merged as Chan, Golub and LeVeque have it (1979).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// How many.
    pub count: u64,
    /// Their mean.
    pub mean: f64,
    /// Sum of squared distances from the mean.
    squares: f64,
    /// The largest absolute value.
    pub largest: f64,
}

impl Moments {
    /// One more.
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        let from_old = value - self.mean;
        self.mean += from_old / self.count as f64;
        self.squares += from_old * (value - self.mean);
        self.largest = self.largest.max(value.abs());
    }

    /// Those of another part.
    pub fn merge(&mut self, other: &Self) {
        let total = self.count + other.count;
        if total == 0 {
            return;
        }
        let apart = other.mean - self.mean;
        let share = other.count as f64 / total as f64;
        self.squares += other.squares + apart * apart * self.count as f64 * share;
        self.mean += apart * share;
        self.count = total;
        self.largest = self.largest.max(other.largest);
    }

    /// Standard deviation about the mean, with n - 1; `None` below two.
    #[must_use]
    pub fn deviation(&self) -> Option<f64> {
        (self.count > 1).then(|| (self.squares / (self.count - 1) as f64).sqrt())
    }

    /// Root mean square; `None` of nothing.
    #[must_use]
    pub fn root_mean_square(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.squares / self.count as f64 + self.mean * self.mean).sqrt())
    }
}

impl Numbers for Moments {
    fn write(&self, to: &mut Vec<f64>) {
        self.count.write(to);
        to.extend([self.mean, self.squares, self.largest]);
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let (count, [mean, squares, largest]) = (u64::read(from)?, <[f64; 3]>::read(from)?);
        Some(Self { count, mean, squares, largest })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64]) -> Moments {
        let mut moments = Moments::default();
        for value in values {
            moments.add(*value);
        }
        moments
    }

    #[test]
    fn parts_merge_to_the_whole() {
        let values: Vec<f64> = (0..100).map(|i| 1e6 + f64::from(i * i % 37)).collect();
        let (whole, mut parts) = (of(&values), of(&values[..13]));
        parts.merge(&of(&values[13..80]));
        parts.merge(&Moments::default());
        parts.merge(&of(&values[80..]));
        let mean = values.iter().sum::<f64>() / 100.0;
        let deviation = (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 99.0).sqrt();
        for moments in [whole, parts] {
            assert!((moments.mean - mean).abs() < 1e-9);
            assert!((moments.deviation().expect("many") / deviation - 1.0).abs() < 1e-12);
            assert_eq!((moments.count, moments.largest), (100, 1_000_036.0));
        }
        assert_eq!((of(&[]).deviation(), of(&[3.0]).deviation(), of(&[]).root_mean_square()), (None, None, None));
        assert_eq!(of(&[3.0, -4.0]).root_mean_square(), Some(12.5_f64.sqrt()));
    }
}
