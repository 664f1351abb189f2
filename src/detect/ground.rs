//! What lies around a blob: its level, its noise, and how its hue slopes, whatever else is seen on it.

use nalgebra::{Matrix3, Vector2, Vector3};

use super::single;

/// What a pixel is, and where.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub x: f32,
    pub y: f32,
    pub value: f32,
}

/// Ground of chroma is levelled by so many samples at least, and what is beyond so many deviations is none of it.
const MIN_LEVELLED: usize = 12;
const LEVEL_DEVIATIONS: f64 = 4.0;

/// What eight bits leave.
const STEP_NOISE: f64 = 0.3;

/// Middle of the shortest stretch that holds half of the values, and the deviation that it tells: what the ground is, also where much of
/// what is seen beyond the rim is none.
pub(super) fn shortest_half(values: &mut [f32]) -> Option<(f32, f32)> {
    values.sort_unstable_by(f32::total_cmp);
    let (middle, length) = shortest(values, values.len() / 2)?;
    Some((middle, 0.7413 * length))
}

/// The same of a third, which of two grounds is the one of which there is more.
pub(super) fn shortest_third(values: &mut [f32]) -> Option<(f32, f32)> {
    values.sort_unstable_by(f32::total_cmp);
    let (middle, length) = shortest(values, values.len() / 3)?;
    Some((middle, 1.161 * length))
}

/// Middle and length of the shortest stretch that has so many steps of values in order.
fn shortest(values: &[f32], steps: usize) -> Option<(f32, f32)> {
    let stretch = |start: usize| values[start + steps] - values[start];
    let start = (0..values.len() - steps).min_by(|a, b| stretch(*a).total_cmp(&stretch(*b)))?;
    Some((values[start] + 0.5 * stretch(start), stretch(start)))
}

/// The slope of most of the samples, in values a pixel, as far as it is more than chance; `offs` are what it works with. `None` for too few of
/// them.
pub(super) fn slope(samples: &[Sample], offs: &mut Vec<f32>) -> Option<Vector2<f64>> {
    if samples.len() < MIN_LEVELLED {
        return None;
    }
    let mut plane = Vector3::zeros();
    let mut certainty = 0.0;
    for round in 0..3 {
        let off = |s: &Sample| f64::from(s.value) - plane.dot(&Vector3::new(f64::from(s.x), f64::from(s.y), 1.0));
        offs.clear();
        offs.extend(samples.iter().map(|sample| single(off(sample))));
        let (middle, noise) = middle(offs)?;
        let variance = f64::from(noise).hypot(STEP_NOISE).powi(2);
        // First of all samples that are near their median, then of those near the plane.
        let reach = LEVEL_DEVIATIONS * LEVEL_DEVIATIONS * variance;
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for sample in samples {
            let apart = off(sample) - f64::from(middle);
            let weight = (1.0 - apart * apart / reach).max(0.0).powi(2) / variance;
            let at = Vector3::new(f64::from(sample.x), f64::from(sample.y), 1.0);
            normal += at * at.transpose() * weight;
            right += at * (weight * f64::from(sample.value));
        }
        plane = normal.cholesky()?.solve(&right);
        if round == 2 {
            let covariance = normal.try_inverse()?.fixed_view::<2, 2>(0, 0).into_owned();
            certainty = (covariance.try_inverse()? * plane.xy()).dot(&plane.xy());
        }
    }
    // Chance alone makes two of this; what is left is shrunk as by James and Stein (1961).
    Some(plane.xy() * (1.0 - 2.0 / certainty.max(2.0)))
}

/// Median, and the deviation that the distances from it tell.
pub(super) fn middle(values: &mut [f32]) -> Option<(f32, f32)> {
    let middle = median(values)?;
    for value in &mut *values {
        *value = (*value - middle).abs();
    }
    Some((middle, 1.4826 * median(values)?))
}

pub(super) fn median(values: &mut [f32]) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ring of samples around a marker; every fifth is of something else.
    fn ring(value: impl Fn(f32, f32) -> f32) -> Vec<Sample> {
        (0..60_u16)
            .map(|index| {
                let (sine, cosine) = (f32::from(index) * 0.7).sin_cos();
                let (x, y) = (5.0 * cosine, 5.0 * sine);
                // Ripples that no plane has.
                let ripple = if index % 2 == 0 { 0.4 } else { -0.4 };
                Sample { x, y, value: value(x, y) + if index % 5 == 0 { 40.0 } else { ripple } }
            })
            .collect()
    }

    #[test]
    fn a_ground_that_slopes_is_levelled_whatever_else_lies_on_it() {
        let found = slope(&ring(|x, y| 20.0 + 1.5 * x - 0.7 * y), &mut Vec::new()).expect("enough samples");
        assert!((found - Vector2::new(1.5, -0.7)).norm() < 0.1, "{found:?}");
    }

    #[test]
    fn a_level_ground_stays_and_few_samples_tell_nothing() {
        let found = slope(&ring(|_, _| 20.0), &mut Vec::new()).expect("enough samples");
        assert!(found.norm() < 0.05, "{found:?}");
        assert!(slope(&ring(|x, _| x)[..MIN_LEVELLED - 1], &mut Vec::new()).is_none());
    }
}
