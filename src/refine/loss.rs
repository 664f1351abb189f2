//! How much a residual counts.

use std::sync::LazyLock;

use crate::statistics::normal_share_below;

/// What is summed over the points, of the squared distance in standard deviations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Loss {
    /// The square itself: all points are right, with normal errors of the stated size.
    #[default]
    Squares,
    /// The stated size is a guess: any from zero to so many times as large is equally likely, and points further off than
    /// the widest allows are wrong and count no more (Barath et al., "MAGSAC++, a fast, reliable and accurate robust
    /// estimator", CVPR 2020, for distances in the picture, which have two degrees of freedom).
    Marginal {
        /// The largest standard deviation, in units of the stated one.
        widest: f64,
    },
}

/// Quantile of the distance, in standard deviations, up to which a point may be right: 99 % of two normal variables.
const RIGHT_WITHIN: f64 = 3.035;

impl Loss {
    /// The loss of a squared distance, and its slope there: the weight of the point.
    #[must_use]
    pub fn of(self, squared: f64) -> (f64, f64) {
        match self {
            Self::Squares => (squared, 1.0),
            Self::Marginal { widest } => {
                let scale = widest * widest;
                let (loss, weight) = marginal(squared / scale);
                (loss * scale, weight)
            }
        }
    }

    /// The distance in standard deviations from which a point counts as wrong.
    #[must_use]
    pub fn reach(self) -> f64 {
        match self {
            Self::Squares => f64::INFINITY,
            Self::Marginal { widest } => widest * RIGHT_WITHIN,
        }
    }
}

/// Steps of the table, which is even in the squared distance.
const STEPS: usize = 512;

/// Loss and weight from the table: the exponentials behind them cost more than projecting the point.
fn marginal(squared: f64) -> (f64, f64) {
    static TABLE: LazyLock<Vec<(f64, f64)>> =
        LazyLock::new(|| (0..=STEPS).map(|i| exact(i as f64 * RIGHT_WITHIN * RIGHT_WITHIN / STEPS as f64)).collect());
    let place = squared * (STEPS as f64 / (RIGHT_WITHIN * RIGHT_WITHIN));
    // Also for NaN and infinity.
    if !(place < STEPS as f64) {
        return TABLE[STEPS];
    }
    #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "from zero to STEPS")]
    let index = place as usize;
    let share = place - index as f64;
    let ((low, low_weight), (high, high_weight)) = (TABLE[index], TABLE[index + 1]);
    (low + share * (high - low), low_weight + share * (high_weight - low_weight))
}

/// The weight is `erfc(e / sqrt 2)`, shifted to zero at the reach and scaled to one at zero; the loss is its integral over
/// the square.
fn exact(squared: f64) -> (f64, f64) {
    let erfc = |x: f64| 2.0 * (1.0 - normal_share_below(x));
    let e = squared.sqrt();
    let floor = erfc(RIGHT_WITHIN);
    let weight = (erfc(e) - floor) / (1.0 - floor);
    let density = (-0.5 * squared).exp() * (2.0 / std::f64::consts::PI).sqrt();
    let integral = squared * erfc(e) + (1.0 - erfc(e)) - e * density;
    ((integral - squared * floor) / (1.0 - floor), weight)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weight_is_the_slope_of_the_loss() {
        let loss = Loss::Marginal { widest: 2.0 };
        for squared in [1.0, 4.0, 9.0, 25.0, 35.0, 50.0] {
            // Two steps of the table.
            let step = 0.15;
            let slope = (loss.of(squared + step).0 - loss.of(squared - step).0) / (2.0 * step);
            assert!((slope - loss.of(squared).1).abs() < 1e-2, "{squared}: {slope} {}", loss.of(squared).1);
        }
    }

    #[test]
    fn a_small_residual_counts_as_its_square_and_a_large_one_no_more() {
        let loss = Loss::Marginal { widest: 2.0 };
        assert!((loss.of(1e-4).1 - 1.0).abs() < 0.02);
        assert_eq!(loss.of(loss.reach().powi(2)), loss.of(1e9));
        for nowhere in [f64::INFINITY, f64::NAN] {
            assert_eq!(loss.of(nowhere), loss.of(1e9));
            assert!(loss.of(nowhere).1.abs() < f64::MIN_POSITIVE);
        }
    }

    #[test]
    fn the_weight_is_the_share_of_noise_levels_that_explain_the_residual() {
        // The definition: levels s, even from 0 to 1, weighed by their density of the distance, e / s^2 exp(-e^2 / 2 s^2), over
        // the same at a vanishing distance, where all that matters are the smallest; here by brute force, as a ratio of two
        // distances, with the reach left out (a constant shift).
        let brute = |e: f64| {
            let count = 200_000;
            (1..=count)
                .map(|i| f64::from(i) / f64::from(count))
                .map(|s| e / (s * s) * (-0.5 * e * e / (s * s)).exp())
                .sum::<f64>()
                / f64::from(count)
        };
        let floor = brute(RIGHT_WITHIN);
        let by_definition = (brute(2.0) - floor) / (brute(1.0) - floor);
        let found = exact(4.0).1 / exact(1.0).1;
        assert!((by_definition / found - 1.0).abs() < 1e-3, "{by_definition} {found}");
    }
}
