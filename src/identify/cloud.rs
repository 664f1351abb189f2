//! Clutter that lies in one cloud: along a horizon, a shore, a row of lamps.
//!
//! Blobs that are scattered evenly over the picture meet four markers by chance far less often than such as lie in a strip of
//! it. A cloud is a Gaussian of unknown middle (evenly over the picture) and unknown covariance (inverse Wishart with two
//! degrees of freedom, so as wide as may be); both are integrated out in closed form (Murphy, "Conjugate Bayesian analysis of
//! the Gaussian distribution", 2007, section 9), so a cloud is only as probable as its blobs make it: each of its five
//! unknowns costs what fitting it gains.

use nalgebra::Matrix2;

use super::Blob;
use crate::camera::Pixel;

/// The scale of clouds, as a part of the picture's width: half of them are narrower than about twice of it.
const SCALE: f64 = 1.0 / 64.0;

/// The blobs of a picture, as far as a cloud's likelihood asks for them.
pub(super) struct Cloud {
    ln_area: f64,
    scale: f64,
    middle: Pixel,
    all: Moments,
}

/// Number, sum and sum of products of some blobs' places about a middle.
#[derive(Clone, Copy, Default)]
struct Moments {
    count: u32,
    sum: Pixel,
    square: Matrix2<f64>,
}

impl Moments {
    fn with(mut self, place: Pixel) -> Self {
        self.count += 1;
        self.sum += place;
        self.square += place * place.transpose();
        self
    }

    fn without(mut self, place: Pixel) -> Self {
        self.count -= 1;
        self.sum -= place;
        self.square -= place * place.transpose();
        self
    }
}

impl Cloud {
    pub(super) fn of(blobs: &[Blob], [width, height]: [f64; 2]) -> Self {
        let middle = blobs.iter().map(|blob| blob.pixel).sum::<Pixel>() / (blobs.len().max(1) as f64);
        let all = blobs.iter().fold(Moments::default(), |all, blob| all.with(blob.pixel - middle));
        Self { ln_area: (width * height).ln(), scale: SCALE * width, middle, all }
    }

    /// Logarithm of the density, per squared pixel each, of `taken` where the others are of the same cloud.
    pub(super) fn ln_density<'a>(&self, taken: impl Iterator<Item = &'a Blob>) -> f64 {
        let rest = taken.fold(self.all, |rest, blob| rest.without(blob.pixel - self.middle));
        self.ln_marginal(&self.all) - self.ln_marginal(&rest)
    }

    /// Logarithm of the density of all places of a cloud, whatever its middle and covariance.
    fn ln_marginal(&self, Moments { count, sum, square }: &Moments) -> f64 {
        if *count == 0 {
            return 0.0;
        }
        let ln_factorial: f64 = (2..*count).map(f64::from).map(f64::ln).sum();
        let count = f64::from(*count);
        let scatter = square - sum * sum.transpose() / count + Matrix2::identity() * self.scale.powi(2);
        ln_factorial - count.ln() - self.ln_area - (count - 1.0) * std::f64::consts::TAU.ln() + 4.0 * self.scale.ln()
            - 0.5 * (count + 1.0) * scatter.determinant().ln()
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::random::named;

    const SIZE: [f64; 2] = [640.0, 480.0];

    fn blobs(places: &[[f64; 2]]) -> Vec<Blob> {
        let blob = |[x, y]: &[f64; 2]| Blob { pixel: Pixel::new(*x, *y), sigma_px: 0.1, area_px: None };
        places.iter().map(blob).collect()
    }

    /// What is left of the density of a blob given others, when it is summed over a plane.
    fn summed(others: &[[f64; 2]]) -> f64 {
        // Along each axis by a substitution that reaches far: tails are heavy.
        let steps = || (-400..400).map(|i| (f64::from(i) + 0.5) / 400.0 * 9.0);
        let across = |t: f64| (320.0 + 10.0 * t.sinh(), 10.0 * t.cosh() * 9.0 / 400.0);
        let mut sum = 0.0;
        for (x, dx) in steps().map(across) {
            for (y, dy) in steps().map(across) {
                let all = blobs(&[others, &[[x, y]]].concat());
                sum += Cloud::of(&all, SIZE).ln_density(all.last().into_iter()).exp() * dx * dy;
            }
        }
        sum
    }

    #[test]
    fn given_some_blobs_one_more_is_somewhere() {
        for others in [&[[300.0, 330.0]][..], &[[300.0, 330.0], [340.0, 310.0], [320.0, 300.0], [310.0, 322.0]]] {
            let sum = summed(others);
            assert!((sum - 1.0).abs() < 0.02, "{others:?}: {sum}");
        }
    }

    #[test]
    fn a_row_of_blobs_is_a_cloud_and_scattered_ones_are_none() {
        let even = -4.0 * (SIZE[0] * SIZE[1]).ln();
        let row: Vec<[f64; 2]> = (0..14).map(|i| [f64::from(i) * 40.0 + 20.0, f64::from(i * i % 5) + 300.0]).collect();
        let row = blobs(&row);
        assert!(Cloud::of(&row, SIZE).ln_density(row[4..8].iter()) > even + 8.0);
        // In the mean no density is as likely as the one that was drawn from.
        let mut rng = named("blobs scattered evenly");
        let mut gain = || {
            let scattered: Vec<[f64; 2]> = (0..14).map(|_| SIZE.map(|side| rng.random_range(0.0..side))).collect();
            let scattered = blobs(&scattered);
            Cloud::of(&scattered, SIZE).ln_density(scattered[4..8].iter()) - even
        };
        assert!((0..200).map(|_| gain()).sum::<f64>() < 0.0);
    }

    #[test]
    fn blobs_in_any_order_are_as_likely() {
        let all = blobs(&[[100.0, 90.0], [180.0, 60.0], [400.0, 410.0], [310.0, 300.0]]);
        let cloud = Cloud::of(&all, SIZE);
        let whole = cloud.ln_density(all.iter());
        let some = Cloud::of(&all[..2], SIZE).ln_density(all[..2].iter());
        assert!((cloud.ln_density(all[2..].iter()) + some - whole).abs() < 1e-9);
        // A single blob may be anywhere.
        let one = Cloud::of(&all[..1], SIZE).ln_density(all[..1].iter());
        assert!((one + (SIZE[0] * SIZE[1]).ln()).abs() < 1e-9);
    }
}
