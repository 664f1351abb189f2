//! How probable each minimum is, and whether the points are explained at all.

use super::{NoPose, PoseEstimate};
use crate::camera::Camera;
use crate::geometry::CameraFromTarget;
use crate::refine::{Correspondence, Posterior, Refined, posterior};
use crate::statistics::chi_square_quantile;

/// How the residuals compare with their stated standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consistency {
    /// By this factor all variances are multiplied: 1 unless the residuals are significantly larger than stated.
    pub variance_factor: f64,
    /// The largest chi-square that still counts as explained.
    chi_square_limit: f64,
}

/// Residuals larger than this quantile of chi-square by chance: once in a thousand.
const SIGNIFICANT_Z: f64 = 3.09;

/// Alternatives less probable than this are left out.
const NEGLIGIBLE: f64 = 1e-4;

/// The covariance holds as such while chi-square keeps within this share of its paraboloid at two standard deviations of tilt,
/// where 86 % of a normal variable in two dimensions lie. Up to here 94 to 95 % of errors lie inside the 95 % ellipsoid of the
/// minimum's curvature alone, beyond it as few as 80 % (see the accuracy tests); with the moments of the bent valley 93 to
/// 94 % do, but the error is no longer normal.
const MAX_NONLINEARITY: f64 = 0.2;

impl Consistency {
    /// Compares the best of `minima` (sorted by chi-square) with what `points` good points give.
    pub(super) fn of(minima: &[Refined], points: usize, max_residual_ratio: f64) -> Result<Self, NoPose> {
        let best = minima.first().map_or(0.0, |m| m.chi_square);
        let Some(freedom) = (2 * points).checked_sub(6).filter(|f| *f > 0) else {
            return Ok(Self { variance_factor: 1.0, chi_square_limit: f64::INFINITY });
        };
        let freedom = freedom as f64;
        let chi_square_limit = freedom * max_residual_ratio * max_residual_ratio;
        if !(best <= chi_square_limit) {
            return Err(NoPose::HighResidual {
                detail: format!(
                    "the best pose leaves residuals of {:.2} px root mean square, {:.1} times what is stated for the \
                     points; up to {max_residual_ratio:.1} times is accepted",
                    minima[0].rms_px,
                    (best / freedom).sqrt(),
                ),
            });
        }
        let expected = chi_square_quantile(freedom, SIGNIFICANT_Z);
        let variance_factor = if best > expected { best / freedom } else { 1.0 };
        Ok(Self { variance_factor, chi_square_limit })
    }
}

/// `ln(sum(exp(x)))` without overflow.
fn ln_sum_exp(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = values.clone().fold(f64::NEG_INFINITY, f64::max);
    largest + values.map(|x| (x - largest).exp()).sum::<f64>().ln()
}

/// The minima that explain the points, by falling probability, and the logarithm of the evidence of all.
///
/// Each minimum's share is the integral of the likelihood over its valley, all attitudes and places counting as equally likely
/// beforehand. Probabilities among the minima allow for residuals larger than stated; the evidence for the pairs themselves
/// does not.
pub(super) fn weigh(
    camera: &Camera,
    correspondences: &[Correspondence],
    minima: &[Refined],
    consistency: &Consistency,
) -> (Vec<PoseEstimate>, f64) {
    let factor = consistency.variance_factor;
    let explained: Vec<&Refined> = minima.iter().filter(|m| m.chi_square <= consistency.chi_square_limit).collect();
    let valleys: Vec<(&Refined, Posterior)> = explained
        .iter()
        .enumerate()
        .map(|(index, minimum)| {
            let others: Vec<CameraFromTarget> = explained
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != index)
                .map(|(_, other)| other.camera_from_target)
                .collect();
            (*minimum, posterior(camera, correspondences, minimum, &others, factor.sqrt()))
        })
        .collect();
    let ln_weight = |(m, valley): &(&Refined, Posterior), factor: f64| {
        -0.5 * m.chi_square / factor + 0.5 * m.covariance.scaled(factor).ln_determinant() + valley.ln_mass_ratio
    };
    let ln_total = ln_sum_exp(valleys.iter().map(|valley| ln_weight(valley, factor)));
    let mut estimates: Vec<PoseEstimate> = valleys
        .iter()
        .map(|valley| (valley, (ln_weight(valley, factor) - ln_total).exp()))
        .filter(|(_, probability)| *probability >= NEGLIGIBLE)
        .map(|((minimum, valley), probability)| PoseEstimate {
            camera_from_target: minimum.camera_from_target,
            covariance: valley.covariance,
            covariance_reliable: valley.nonlinearity <= MAX_NONLINEARITY,
            reprojection_rms_px: minimum.rms_px,
            probability,
        })
        .collect();
    estimates.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    (estimates, ln_sum_exp(valleys.iter().map(|valley| ln_weight(valley, 1.0))))
}
