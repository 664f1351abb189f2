//! How probable each minimum is, and whether the points are explained at all.

use super::{NoPose, Noise, PoseEstimate, PoseOptions};
use crate::camera::{Camera, Pixel};
use crate::geometry::{CameraFromTarget, PoseCovariance};
use crate::refine::calibration::from_camera;
use crate::refine::{Correspondence, Posterior, Refined, posterior};
use crate::statistics::chi_square_quantile;

/// How the residuals compare with their stated standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consistency {
    /// The noise as a factor on the stated deviations: with [`Noise::Stated`] 1 unless the residuals are significantly larger.
    pub noise_scale: f64,
    /// By this factor all variances are multiplied.
    variance_factor: f64,
    /// The largest chi-square that still counts as explained.
    chi_square_limit: f64,
    /// Degrees of freedom from which the noise was estimated, if it was.
    estimated_from: Option<f64>,
}

/// Residuals larger than this quantile of chi-square by chance: once in a thousand.
const SIGNIFICANT_Z: f64 = 3.09;

/// Alternatives less probable than this are left out.
const NEGLIGIBLE: f64 = 1e-4;

/// The covariance holds as such while chi-square keeps within this share of its paraboloid at two standard deviations of tilt,
/// where 86 % of a normal variable in two dimensions lie. Up to here 94 to 95 % of errors lie inside the 95 % ellipsoid of the
/// minimum's curvature alone, beyond it as few as 80 % (see docs/accuracy.md); with the moments of the bent valley 93 to
/// 94 % do, but the error is no longer normal.
const MAX_NONLINEARITY: f64 = 0.2;

/// Fewest degrees of freedom from which an estimated noise leaves the error near enough to normal: below, the 95 % ellipsoid
/// holds 90 to 92 %.
const MIN_FREEDOM: f64 = 14.0;

/// Noise below this is rounding, px.
const MIN_NOISE_PX: f64 = 1e-3;

/// Points with an estimated noise above this share of their extent in the picture explain nothing.
const MAX_NOISE_SHARE: f64 = 0.25;

impl Consistency {
    /// Compares the best of `minima` (sorted by chi-square) with what good points give.
    pub(super) fn of(minima: &[Refined], seen: &[Correspondence], options: &PoseOptions) -> Result<Self, NoPose> {
        let best = minima.first().map_or(0.0, |m| m.chi_square);
        let freedom = (2 * seen.len()).saturating_sub(6) as f64;
        match options.noise {
            Noise::Stated => Self::with_stated_noise(minima, best, freedom, options.max_residual_ratio),
            Noise::Estimated => Self::with_estimated_noise(best, freedom, seen),
        }
    }

    fn with_stated_noise(minima: &[Refined], best: f64, freedom: f64, most: f64) -> Result<Self, NoPose> {
        let as_stated =
            Self { noise_scale: 1.0, variance_factor: 1.0, chi_square_limit: f64::INFINITY, estimated_from: None };
        if freedom <= 0.0 {
            return Ok(as_stated);
        }
        let chi_square_limit = freedom * most * most;
        if !(best <= chi_square_limit) {
            return Err(NoPose::HighResidual {
                detail: format!(
                    "the best pose leaves residuals of {:.2} px root mean square, {:.1} times what is stated for the \
                     points; up to {most:.1} times is accepted",
                    minima[0].rms_px,
                    (best / freedom).sqrt(),
                ),
            });
        }
        let expected = chi_square_quantile(freedom, SIGNIFICANT_Z);
        let variance_factor = if best > expected { best / freedom } else { 1.0 };
        Ok(Self { noise_scale: variance_factor.sqrt(), variance_factor, chi_square_limit, ..as_stated })
    }

    fn with_estimated_noise(best: f64, freedom: f64, seen: &[Correspondence]) -> Result<Self, NoPose> {
        // The error is distributed as Student's t, whose variance exists from three degrees of freedom on.
        if freedom <= 2.0 {
            return Err(NoPose::TooFewPoints { given: seen.len(), need: 5 });
        }
        let count = seen.len() as f64;
        let stated_px = seen.iter().map(|s| s.sigma_px).fold(f64::INFINITY, f64::min);
        let squared = (best / freedom).max((MIN_NOISE_PX / stated_px).powi(2));
        let middle = seen.iter().map(|s| s.pixel).sum::<Pixel>() / count;
        let extent_px = (seen.iter().map(|s| (s.pixel - middle).norm_squared()).sum::<f64>() / (2.0 * count)).sqrt();
        let noise_px = squared.sqrt() * seen.iter().map(|s| s.sigma_px).sum::<f64>() / count;
        if !(noise_px <= MAX_NOISE_SHARE * extent_px) {
            return Err(NoPose::HighResidual {
                detail: format!(
                    "the best pose leaves residuals that make a noise of {noise_px:.2} px, of points that spread over \
                     {extent_px:.2} px; up to {MAX_NOISE_SHARE} of that is accepted"
                ),
            });
        }
        Ok(Self {
            noise_scale: squared.sqrt(),
            variance_factor: squared * freedom / (freedom - 2.0),
            chi_square_limit: f64::INFINITY,
            estimated_from: Some(freedom),
        })
    }

    /// By this factor the deviations of all points are multiplied where errors are computed from them.
    pub(super) fn sigma_factor(&self) -> f64 {
        self.variance_factor.sqrt()
    }

    /// Logarithm of the likelihood of points with this chi-square, up to a constant. An unknown noise is integrated out, all
    /// magnitudes being equally likely beforehand (Jeffreys).
    fn ln_likelihood(&self, chi_square: f64) -> f64 {
        match self.estimated_from {
            None => -0.5 * chi_square / self.variance_factor,
            Some(freedom) => -0.5 * freedom * (chi_square / freedom).max(self.noise_scale.powi(2) * 1e-6).ln(),
        }
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
    let ln_volume =
        |(minimum, valley): &(&Refined, Posterior)| 0.5 * minimum.covariance.ln_determinant() + valley.ln_mass_ratio;
    let ln_weight = |found: &(&Refined, Posterior)| consistency.ln_likelihood(found.0.chi_square) + ln_volume(found);
    let ln_total = ln_sum_exp(valleys.iter().map(ln_weight));
    let mut estimates: Vec<PoseEstimate> = valleys
        .iter()
        .map(|found| (found, (ln_weight(found) - ln_total).exp()))
        .filter(|(_, probability)| *probability >= NEGLIGIBLE)
        .map(|((minimum, valley), probability)| PoseEstimate {
            camera_from_target: minimum.camera_from_target,
            covariance: with_camera(camera, correspondences, minimum, &valley.covariance),
            covariance_reliable: valley.nonlinearity <= MAX_NONLINEARITY
                && consistency.estimated_from.is_none_or(|freedom| freedom >= MIN_FREEDOM),
            reprojection_rms_px: minimum.rms_px,
            probability,
        })
        .collect();
    estimates.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let as_stated = |found: &(&Refined, Posterior)| -0.5 * found.0.chi_square + ln_volume(found);
    (estimates, ln_sum_exp(valleys.iter().map(as_stated)))
}

/// The covariance with what the camera's own uncertainty adds.
fn with_camera(
    camera: &Camera,
    correspondences: &[Correspondence],
    minimum: &Refined,
    covariance: &PoseCovariance,
) -> PoseCovariance {
    from_camera(camera, correspondences, &minimum.camera_from_target, &minimum.covariance)
        .and_then(|added| PoseCovariance::checked(covariance.matrix() + (added + added.transpose()) * 0.5))
        .unwrap_or(*covariance)
}
