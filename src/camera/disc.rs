//! The image of a disc: where its centroid lies, which is not where the centre is imaged, and what shape it has.
//!
//! Perspective enlarges the near half of a tilted disc, and the lens bends it: at arm's length the difference is larger than
//! everything else that is wrong with a good centroid.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::{Camera, Pixel};
use crate::geometry::{Point, space};

/// Centroid and second moments of the image of a disc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiscImage {
    /// The centroid of its area, px.
    pub centroid: Pixel,
    /// Second moments of its area about the centroid, px^2: a quarter of the squared half axes.
    pub moments: Matrix2<f64>,
}

/// Seven points of the unit disc with their shares, by which polynomials up to degree five are integrated exactly (Stroud 1971, S2
/// 5-1): the middle, and six around it.
const POINTS: [([f64; 2], f64); 7] = {
    // The root of two thirds, half of it, and that times the root of three.
    let (reach, half, high) = (0.816_496_580_927_726, 0.408_248_290_463_863, 0.707_106_781_186_547_5);
    [
        ([0.0, 0.0], 0.25),
        ([reach, 0.0], 0.125),
        ([half, high], 0.125),
        ([-half, high], 0.125),
        ([-reach, 0.0], 0.125),
        ([-half, -high], 0.125),
        ([half, -high], 0.125),
    ]
};

impl Camera {
    /// Image of a flat, evenly bright disc; `None` if a part of it has no image. `normal` is a unit vector.
    ///
    /// Integrated over the disc with seven points, each weighted by how much the image is magnified there.
    #[must_use]
    pub fn disc_image(&self, centre: &Point<space::Camera>, normal: &Vector3<f64>, radius_m: f64) -> Option<DiscImage> {
        let mut square = Matrix2::zeros();
        let add = |from_middle: &Vector2<f64>, weight: f64| square += from_middle * from_middle.transpose() * weight;
        let Sums { middle, weight, moment } = self.disc_sums(centre, normal, radius_m, add)?;
        let mean = moment / weight;
        Some(DiscImage { centroid: middle + mean, moments: square / weight - mean * mean.transpose() })
    }

    /// Centroid of that image.
    #[must_use]
    pub fn disc_centroid(&self, centre: &Point<space::Camera>, normal: &Vector3<f64>, radius_m: f64) -> Option<Pixel> {
        let Sums { middle, weight, moment } = self.disc_sums(centre, normal, radius_m, |_, _| {})?;
        Some(middle + moment / weight)
    }

    /// Sums over the disc's image; `add` is told of each point how far from the middle it is, and its weight.
    fn disc_sums(
        &self,
        centre: &Point<space::Camera>,
        normal: &Vector3<f64>,
        radius_m: f64,
        mut add: impl FnMut(&Vector2<f64>, f64),
    ) -> Option<Sums> {
        let across = normal.cross(&least_aligned_axis(normal)).normalize() * radius_m;
        let along = normal.cross(&across);
        let mut sums = Sums { middle: self.project(centre)?, weight: 0.0, moment: Vector2::zeros() };
        for ([x, y], share) in POINTS {
            let point = centre.coords + across * x + along * y;
            let inverse_depth = point.z.recip();
            // Also false for NaN, and for depths so small that their reciprocal overflows.
            if !(point.z > 0.0 && inverse_depth.is_finite()) {
                return None;
            }
            let (pixel, by_ideal) = self.pixel_with_jacobian(&(point.xy() * inverse_depth))?;
            // A plane is magnified by this, up to its distance from the camera, which is the same for all of it.
            let weight = share * (by_ideal.determinant() * inverse_depth * inverse_depth * inverse_depth).abs();
            let from_middle = pixel - sums.middle;
            sums.weight += weight;
            sums.moment += from_middle * weight;
            add(&from_middle, weight);
        }
        (sums.weight > 0.0).then_some(sums)
    }
}

/// Sums over the image of a disc.
struct Sums {
    /// Where its centre is seen, px.
    middle: Pixel,
    /// Area, in units of its own.
    weight: f64,
    /// From the middle, px, times area.
    moment: Vector2<f64>,
}

fn least_aligned_axis(v: &Vector3<f64>) -> Vector3<f64> {
    let mut axis = Vector3::zeros();
    axis[v.iamin()] = 1.0;
    axis
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use std::f64::consts::TAU;

    use super::*;
    use crate::camera::distortion::tests::REAL;

    /// The image's area, cut into small cells of the disc.
    fn slow(camera: &Camera, centre: &Vector3<f64>, normal: &Vector3<f64>, radius_m: f64) -> DiscImage {
        let x = normal.cross(&least_aligned_axis(normal)).normalize();
        let y = normal.cross(&x);
        let (rings, spokes) = (60, 120);
        let at = |ring: f64, spoke: f64| {
            let (radius, angle) = (radius_m * ring / f64::from(rings), TAU * spoke / f64::from(spokes));
            let p = centre + (x * angle.cos() + y * angle.sin()) * radius;
            camera.project(&Point::from(p)).expect("in view")
        };
        let (mut area, mut moment, mut square) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for ring in 0..rings {
            for spoke in 0..spokes {
                let (r, s) = (f64::from(ring), f64::from(spoke));
                let [a, b, c, d] = [at(r, s), at(r + 1.0, s), at(r + 1.0, s + 1.0), at(r, s + 1.0)];
                for (p, q, t) in [(a, b, c), (a, c, d)] {
                    let triangle = 0.5 * (q - p).perp(&(t - p)).abs();
                    let mean = (p + q + t) / 3.0 - Vector2::new(640.0, 360.0);
                    area += triangle;
                    moment += mean * triangle;
                    square += mean * mean.transpose() * triangle;
                }
            }
        }
        let mean = moment / area;
        let centroid = mean + Vector2::new(640.0, 360.0);
        DiscImage { centroid, moments: square / area - mean * mean.transpose() }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn centroid_and_moments_are_those_of_the_images_area(
            lens in 0..REAL.len(), x in -0.3..0.3, y in -0.2..0.2, z in 0.6..3.0, tilt in 0.0..1.2_f64, turn in 0.0..TAU
        ) {
            let camera = Camera::checked([1280, 720], [1100.0; 2], [640.0, 360.0], REAL[lens]).expect("a camera");
            let centre = Vector3::new(x * z, y * z, z);
            let normal = Vector3::new(tilt.sin() * f64::cos(turn), tilt.sin() * f64::sin(turn), -tilt.cos());
            let fast = camera.disc_image(&Point::from(centre), &normal, 0.05).expect("in view");
            let slow = slow(&camera, &centre, &normal, 0.05);
            // What is left out grows with the fifth power of the disc's size over its distance: nearest, its image is 90 px wide
            // a side, and 4e-3 px is far below what its centroid is seen to.
            prop_assert!((fast.centroid - slow.centroid).norm() < 4e-3);
            // Of the half axes it is a thousandth, which is 0.05 px nearest; the cells leave out as much of the rim.
            prop_assert!((fast.moments - slow.moments).amax() < 2e-3 * slow.moments.amax(), "{} {}", fast.moments, slow.moments);
        }
    }

    #[test]
    fn without_a_lens_it_is_the_centre_of_the_ellipse() {
        // The centre of the conic: its dual is r^2 (I - n n^T) - p p^T, of which the third column is the centre.
        let camera = Camera::checked([640, 480], [600.0; 2], [320.0, 240.0], REAL[0]).expect("a camera");
        let centre = Vector3::new(0.2, -0.1, 0.9);
        let normal = Vector3::new(0.6, 0.3, -0.8).normalize();
        let radius: f64 = 0.04;
        let dual = (Vector3::z() - normal * normal.z) * radius.powi(2) - centre * centre.z;
        let exact = Vector2::new(600.0 * dual.x / dual.z + 320.0, 600.0 * dual.y / dual.z + 240.0);
        let found = camera.disc_centroid(&Point::from(centre), &normal, radius).expect("in view");
        assert!((found - exact).norm() < 1e-4, "{found} {exact}");
        let centre_image = camera.project(&Point::from(centre)).expect("in view");
        assert!((found - centre_image).norm() > 0.3, "the bias that this is about");
    }
}
