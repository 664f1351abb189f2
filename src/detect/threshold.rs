//! Histograms and Otsu's threshold.

/// Counts of the 256 levels.
pub type Histogram = [u64; 256];

/// The histogram of some samples.
#[must_use]
pub fn histogram(samples: impl IntoIterator<Item = u8>) -> Histogram {
    let mut counts = [0; 256];
    for sample in samples {
        counts[usize::from(sample)] += 1;
    }
    counts
}

/// The level of the sample of that rank, counted from zero at the lowest.
pub(super) fn level_at(histogram: &Histogram, rank: usize) -> usize {
    let mut up_to = 0;
    let is_beyond = |count: &u64| {
        up_to += count;
        up_to > rank as u64
    };
    histogram.iter().position(is_beyond).unwrap_or(255)
}

/// How far the sample of that rank lies from a level, samples being ranked by that.
pub(super) fn distance_at(histogram: &Histogram, level: usize, rank: usize) -> usize {
    let mut up_to = histogram[level];
    let mut distance = 0;
    while up_to <= rank as u64 && distance < 255 {
        distance += 1;
        let beside = [level.checked_sub(distance), Some(level + distance)];
        up_to += beside.into_iter().flatten().filter_map(|level| histogram.get(level)).sum::<u64>();
    }
    distance
}

/// The mean of the samples from that rank on; 0 of none.
pub(super) fn mean_from(histogram: &Histogram, rank: usize) -> f64 {
    let (mut below, mut count, mut total) = (rank as u64, 0, 0);
    for (samples, level) in histogram.iter().zip(0_u64..) {
        let counted = samples.saturating_sub(below);
        below = below.saturating_sub(*samples);
        count += counted;
        total += counted * level;
    }
    total as f64 / count.max(1) as f64
}

/// The level that splits a histogram into two classes with the largest variance between them: N. Otsu 1979, "A threshold
/// selection method from gray-level histograms". Levels up to it are the lower class. Where several do equally well, their
/// mean, rounded; 0 for a histogram of a single level. This is what the seed's `graythresh` returns, times 255.
#[must_use]
pub fn otsu(histogram: &Histogram) -> u8 {
    let total: u64 = histogram.iter().sum();
    let all: u64 = histogram.iter().zip(0_u64..).map(|(count, level)| count * level).sum();
    let (mut below, mut sum_below) = (0_u64, 0_u64);
    let mut best = 0.0;
    // Levels that do equally well: how many, and their sum.
    let (mut winners, mut winners_total) = (0_u64, 0_u64);
    for (count, level) in histogram.iter().zip(0_u64..) {
        below += count;
        sum_below += count * level;
        if below == 0 || below == total {
            continue;
        }
        let share = below as f64 / total as f64;
        let mean_below = sum_below as f64 / below as f64;
        let mean_above = (all - sum_below) as f64 / (total - below) as f64;
        let between = share * (1.0 - share) * (mean_above - mean_below).powi(2);
        if between > best * (1.0 + 1e-12) {
            best = between;
            (winners, winners_total) = (0, 0);
        }
        if between >= best * (1.0 - 1e-12) && between > 0.0 {
            winners += 1;
            winners_total += level;
        }
    }
    let mean = winners_total as f64 / winners.max(1) as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a mean of levels, 0 to 255")]
    let level = mean.round() as u8;
    level
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// By the definition: every split, the classes' variances summed over samples.
    fn slow_otsu(samples: &[u8]) -> Option<u8> {
        let within = |level: u8| {
            let class = |upper: bool| {
                let members: Vec<f64> =
                    samples.iter().filter(|s| (**s > level) == upper).map(|s| f64::from(*s)).collect();
                if members.is_empty() {
                    return None;
                }
                let mean = members.iter().sum::<f64>() / members.len() as f64;
                Some(members.iter().map(|m| (m - mean).powi(2)).sum::<f64>())
            };
            Some(class(false)? + class(true)?)
        };
        let least = (0..=255).filter_map(within).fold(f64::INFINITY, f64::min);
        let winners: Vec<f64> = (0..=255_u8)
            .filter(|level| within(*level).is_some_and(|w| w <= least * (1.0 + 1e-9) + 1e-9))
            .map(f64::from)
            .collect();
        let mean = winners.iter().sum::<f64>() / winners.len() as f64;
        (0..=255).find(|level| (f64::from(*level) - mean.round()).abs() < 0.5)
    }

    proptest! {
        #[test]
        fn the_split_is_the_one_of_least_variance_within(samples in proptest::collection::vec(any::<u8>(), 2..200)) {
            if let Some(slow) = slow_otsu(&samples) {
                prop_assert_eq!(otsu(&histogram(samples)), slow);
            }
        }
    }

    proptest! {
        #[test]
        fn ranks_are_those_of_sorted_samples(
            mut samples in proptest::collection::vec(any::<u8>(), 1..200), place in 0.0..1.0, level in any::<u8>()
        ) {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a rank below the number of samples")]
            let rank = (place * samples.len() as f64) as usize;
            let counts = histogram(samples.iter().copied());
            let mut distances: Vec<u8> = samples.iter().map(|sample| sample.abs_diff(level)).collect();
            distances.sort_unstable();
            samples.sort_unstable();
            let upper = &samples[rank..];
            let mean = upper.iter().map(|sample| f64::from(*sample)).sum::<f64>() / upper.len() as f64;
            prop_assert_eq!(level_at(&counts, rank), usize::from(samples[rank]));
            prop_assert_eq!(distance_at(&counts, usize::from(level), rank), usize::from(distances[rank]));
            prop_assert_eq!(mean_from(&counts, rank).to_bits(), mean.to_bits());
        }
    }

    #[test]
    fn two_levels_are_split_half_way() {
        assert_eq!(otsu(&histogram([10, 10, 10, 200])), 105);
        assert_eq!(otsu(&histogram([77; 9])), 0);
        assert_eq!(otsu(&histogram([])), 0);
    }
}
