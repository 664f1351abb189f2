//! The image of a disc: where its centroid lies, which is not where the centre is imaged, and what shape it has.
//!
//! Perspective enlarges the near half of a tilted disc, and the lens bends it: at arm's length the difference is larger than
//! everything else that is wrong with a good centroid.

use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

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

impl Camera {
    /// Image of a flat, evenly bright disc; `None` if a part of it has no image. `normal` is a unit vector.
    ///
    /// Integrated over the disc with the seven points that are exact up to degree five (Stroud 1971, S2 5-1), each weighted
    /// by how much the image is magnified there.
    #[must_use]
    pub fn disc_image(&self, centre: &Point<space::Camera>, normal: &Vector3<f64>, radius_m: f64) -> Option<DiscImage> {
        let across = normal.cross(&least_aligned_axis(normal)).normalize();
        let plane = Matrix3x2::from_columns(&[across, normal.cross(&across)]);
        let reach = radius_m * (2.0_f64 / 3.0).sqrt();
        let ring = (0..6).map(|k| {
            let angle = f64::from(k) * std::f64::consts::FRAC_PI_3;
            (Vector2::new(angle.cos(), angle.sin()) * reach, 0.125)
        });
        let middle = self.project(centre)?;
        let (mut sum, mut moment, mut square) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for (offset, share) in std::iter::once((Vector2::zeros(), 0.25)).chain(ring) {
            let (pixel, jacobian) = self.project_with_jacobian(&Point::from(centre.coords + plane * offset))?;
            let weight = share * (jacobian * plane).determinant().abs();
            let from_middle = pixel - middle;
            sum += weight;
            moment += from_middle * weight;
            square += from_middle * from_middle.transpose() * weight;
        }
        let mean = moment / sum;
        (sum > 0.0).then(|| DiscImage { centroid: middle + mean, moments: square / sum - mean * mean.transpose() })
    }

    /// Centroid of that image.
    #[must_use]
    pub fn disc_centroid(&self, centre: &Point<space::Camera>, normal: &Vector3<f64>, radius_m: f64) -> Option<Pixel> {
        Some(self.disc_image(centre, normal, radius_m)?.centroid)
    }
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
