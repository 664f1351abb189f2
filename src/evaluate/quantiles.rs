//! Quantiles of numbers that come in parts: exact while they are few, within half a percent when they are many, in bounded
//! memory (the logarithmic bins of Masson, Rim and Lee, "DDSketch", VLDB 2019).

use std::collections::BTreeMap;

use super::numbers::Numbers;

/// Up to so many numbers are kept as they are.
const EXACT: usize = 1_000;
/// Width of a bin in logarithms: its middle is at most half of that off.
const BIN: f64 = 0.01;
/// Smaller numbers count as this.
const LEAST: f64 = 1e-12;
/// Larger ones as this.
const MOST: f64 = 1e12;

/// Numbers of zero or more, by size.
#[derive(Clone, Debug, PartialEq)]
pub enum Quantiles {
    /// All of them, as they came.
    Few(Vec<f64>),
    /// How many fell into each bin.
    Many(BTreeMap<i32, u64>),
}

impl Default for Quantiles {
    fn default() -> Self {
        Self::Few(Vec::new())
    }
}

impl Quantiles {
    /// One more.
    pub fn add(&mut self, value: f64) {
        match self {
            Self::Few(values) => {
                values.push(value);
                self.crowd();
            }
            Self::Many(bins) => *bins.entry(bin(value)).or_default() += 1,
        }
    }

    /// Those of another part. The order in which parts are merged does not matter.
    pub fn merge(&mut self, other: &Self) {
        match (&mut *self, other) {
            (Self::Few(values), Self::Few(others)) => {
                values.extend(others);
                self.crowd();
            }
            (Self::Many(bins), Self::Many(others)) => {
                for (bin, count) in others {
                    *bins.entry(*bin).or_default() += count;
                }
            }
            (Self::Many(bins), Self::Few(values)) => {
                for value in values {
                    *bins.entry(bin(*value)).or_default() += 1;
                }
            }
            (Self::Few(values), Self::Many(others)) => {
                let mut bins = others.clone();
                for value in &*values {
                    *bins.entry(bin(*value)).or_default() += 1;
                }
                *self = Self::Many(bins);
            }
        }
    }

    fn crowd(&mut self) {
        if let Self::Few(values) = self
            && values.len() > EXACT
        {
            let mut bins = BTreeMap::new();
            for value in &*values {
                *bins.entry(bin(*value)).or_default() += 1;
            }
            *self = Self::Many(bins);
        }
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> u64 {
        match self {
            Self::Few(values) => values.len() as u64,
            Self::Many(bins) => bins.values().sum(),
        }
    }

    /// The values below which these shares of them lie, `total` of which are counted, the missing ones as the largest; `None` for
    /// one that is missing. Of few, the interpolation of neighbours that statistics programs use by default.
    #[must_use]
    pub fn at(&self, shares: &[f64], total: u64) -> Vec<Option<f64>> {
        match self {
            Self::Few(values) => {
                let mut sorted = values.clone();
                sorted.sort_by(f64::total_cmp);
                shares.iter().map(|share| interpolated(&sorted, share * (total.max(1) - 1) as f64)).collect()
            }
            Self::Many(bins) => shares.iter().map(|share| in_bins(bins, share * (total.max(1) - 1) as f64)).collect(),
        }
    }
}

fn interpolated(sorted: &[f64], place: f64) -> Option<f64> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in a list")]
    let below = place.floor() as usize;
    let low = *sorted.get(below)?;
    let part = place.fract();
    if part > 0.0 { Some(low + part * (sorted.get(below + 1)? - low)) } else { Some(low) }
}

fn in_bins(bins: &BTreeMap<i32, u64>, place: f64) -> Option<f64> {
    let mut passed = 0;
    for (bin, count) in bins {
        passed += count;
        if passed as f64 > place {
            return Some((f64::from(*bin) * BIN).exp());
        }
    }
    None
}

#[expect(clippy::cast_possible_truncation, reason = "logarithms of sane numbers")]
fn bin(value: f64) -> i32 {
    (value.clamp(LEAST, MOST).ln() / BIN).round() as i32
}

impl Numbers for Quantiles {
    fn write(&self, to: &mut Vec<f64>) {
        match self {
            Self::Few(values) => {
                to.push(0.0);
                values.write(to);
            }
            Self::Many(bins) => {
                to.push(1.0);
                (bins.len() as u64).write(to);
                for (bin, count) in bins {
                    to.extend([f64::from(*bin), *count as f64]);
                }
            }
        }
    }

    fn read(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
        if u64::read(from)? == 0 {
            return Some(Self::Few(Vec::read(from)?));
        }
        let pairs = u64::read(from)?;
        let mut bins = BTreeMap::new();
        for _ in 0..pairs {
            let bin = f64::read(from)?;
            #[expect(clippy::cast_possible_truncation, reason = "it was one when it was written")]
            let bin = bin as i32;
            bins.insert(bin, u64::read(from)?);
        }
        Some(Self::Many(bins))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random;

    #[test]
    fn few_are_exact_and_many_within_half_a_percent() {
        let mut rng = random::named("quantiles");
        let values: Vec<f64> = (0..5_000).map(|_| random::normal(&mut rng).exp()).collect();
        for count in [1, 2, 101, 1_000, 5_000] {
            let mut sketch = Quantiles::default();
            for value in &values[..count] {
                sketch.add(*value);
            }
            let mut sorted = values[..count].to_vec();
            sorted.sort_by(f64::total_cmp);
            for share in [0.0, 0.05, 0.5, 0.95, 1.0] {
                let place = share * (count - 1) as f64;
                let truth = interpolated(&sorted, place).expect("inside");
                let found = sketch.at(&[share], count as u64)[0].expect("inside");
                let within = if count > EXACT { 0.5 * BIN + 2e-3 } else { 1e-15 };
                assert!((found / truth - 1.0).abs() <= within, "{count} {share}: {found} {truth}");
            }
        }
    }

    #[test]
    fn parts_merge_to_the_whole_in_any_order() {
        let mut rng = random::named("parts of quantiles");
        let values: Vec<f64> = (0..3_000).map(|_| random::normal(&mut rng).abs()).collect();
        let of = |values: &[f64]| {
            let mut sketch = Quantiles::default();
            for value in values {
                sketch.add(*value);
            }
            sketch
        };
        let whole = of(&values);
        let mut parts: Vec<Quantiles> =
            [0..10, 10..1_500, 1_500..2_900, 2_900..3_000].map(|part| of(&values[part])).into();
        for _ in 0..2 {
            parts.reverse();
            let mut merged = Quantiles::default();
            for part in &parts {
                merged.merge(part);
            }
            assert_eq!(merged, whole);
            let mut numbers = Vec::new();
            merged.write(&mut numbers);
            assert_eq!(Quantiles::read(&mut numbers.into_iter()), Some(merged));
        }
    }

    #[test]
    fn the_missing_are_the_largest() {
        let mut sketch = Quantiles::default();
        for value in &[1.0, 2.0, 3.0] {
            sketch.add(*value);
        }
        assert_eq!(sketch.at(&[0.5, 0.95], 5), [Some(3.0), None]);
        assert_eq!(Quantiles::default().at(&[0.5], 0), [None]);
    }
}
