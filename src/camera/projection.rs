//! Perspective projection and its inverse.

use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use super::{Camera, Normalized, Pixel};
use crate::geometry::{Point, space};

impl Camera {
    /// Where `point` appears, or `None` if it lies at or behind the camera's plane, or outside the region in which the
    /// distortion model is one-to-one.
    #[must_use]
    pub fn project(&self, point: &Point<space::Camera>) -> Option<Pixel> {
        self.project_with_jacobian(point).map(|(pixel, _)| pixel)
    }

    /// [`project`](Self::project) with the 2 x 3 Jacobian of the pixel by the point (px per m).
    #[must_use]
    pub fn project_with_jacobian(&self, point: &Point<space::Camera>) -> Option<(Pixel, Matrix2x3<f64>)> {
        let p = &point.coords;
        let inverse_depth = p.z.recip();
        // Also false for NaN, and for depths so small that their reciprocal overflows.
        if !(p.z > 0.0 && inverse_depth.is_finite()) {
            return None;
        }
        let ideal = Vector2::new(p.x * inverse_depth, p.y * inverse_depth);
        let by_point =
            Matrix2x3::new(inverse_depth, 0.0, -ideal.x * inverse_depth, 0.0, inverse_depth, -ideal.y * inverse_depth);
        let (pixel, by_ideal) = self.pixel_with_jacobian(&ideal)?;
        Some((pixel, by_ideal * by_point))
    }

    /// The pixel of a normalized ray.
    #[must_use]
    pub fn pixel(&self, ideal: &Normalized) -> Option<Pixel> {
        self.pixel_with_jacobian(ideal).map(|(pixel, _)| pixel)
    }

    /// The pixel of a normalized ray with the 2 x 2 Jacobian of the one by the other (px).
    #[must_use]
    pub fn pixel_with_jacobian(&self, ideal: &Normalized) -> Option<(Pixel, Matrix2<f64>)> {
        let (image, jacobian) = match self.distortion {
            super::Distortion::None => (*ideal, Matrix2::identity()),
            // Also false for NaN.
            ref lens if ideal.norm_squared() <= self.valid_radius * self.valid_radius => lens.distort(ideal),
            _ => return None,
        };
        let pixel = Vector2::new(self.fx * image.x + self.cx, self.fy * image.y + self.cy);
        let scaled = Matrix2::new(
            self.fx * jacobian[(0, 0)],
            self.fx * jacobian[(0, 1)],
            self.fy * jacobian[(1, 0)],
            self.fy * jacobian[(1, 1)],
        );
        (pixel.x.is_finite() && pixel.y.is_finite()).then_some((pixel, scaled))
    }

    /// The normalized ray of a pixel, or `None` where the lens model has none.
    #[must_use]
    pub fn unproject(&self, pixel: &Pixel) -> Option<Normalized> {
        let distorted = Vector2::new((pixel.x - self.cx) / self.fx, (pixel.y - self.cy) / self.fy);
        if !(distorted.x.is_finite() && distorted.y.is_finite()) {
            return None;
        }
        self.distortion.undistort(&distorted, self.valid_radius)
    }

    /// [`unproject`](Self::unproject) with the 2 x 2 Jacobian of the ray by the pixel (1 per px).
    #[must_use]
    pub fn unproject_with_jacobian(&self, pixel: &Pixel) -> Option<(Normalized, Matrix2<f64>)> {
        let ideal = self.unproject(pixel)?;
        let (_, by_ideal) = self.pixel_with_jacobian(&ideal)?;
        Some((ideal, by_ideal.try_inverse()?))
    }

    /// The unit vector of a pixel's ray in the camera's space.
    #[must_use]
    pub fn bearing(&self, pixel: &Pixel) -> Option<Vector3<f64>> {
        self.unproject(pixel).map(|ray| Vector3::new(ray.x, ray.y, 1.0).normalize())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::camera::distortion::tests::REAL;

    fn cameras() -> impl Strategy<Value = Camera> {
        (0..REAL.len())
            .prop_map(|i| Camera::checked([640, 480], [608.7, 611.2], [314.0, 220.0], REAL[i]).expect("a real camera"))
    }

    fn in_view() -> impl Strategy<Value = Point<space::Camera>> {
        (-0.5..0.5, -0.4..0.4, 0.3..50.0).prop_map(|(x, y, z)| Point::new(x * z, y * z, z))
    }

    proptest! {
        #[test]
        fn unproject_undoes_project(camera in cameras(), point in in_view()) {
            let pixel = camera.project(&point).expect("in view");
            let ray = camera.unproject(&pixel).expect("in view");
            let expected = Vector2::new(point.coords.x, point.coords.y) / point.coords.z;
            prop_assert!((ray - expected).norm() < 1e-10);
        }

        #[test]
        fn the_projections_jacobian_agrees_with_central_differences(camera in cameras(), point in in_view()) {
            let analytic = camera.project_with_jacobian(&point).expect("in view").1;
            let h = 1e-6 * point.coords.z;
            for axis in 0..3 {
                let mut step = Vector3::zeros();
                step[axis] = h;
                let ahead = camera.project(&Point::from(point.coords + step)).expect("in view");
                let behind = camera.project(&Point::from(point.coords - step)).expect("in view");
                let numeric = (ahead - behind) / (2.0 * h);
                prop_assert!((analytic.column(axis) - numeric).norm() < 1e-7 * (1.0 + numeric.norm()));
            }
        }

        #[test]
        fn the_unprojections_jacobian_agrees_with_central_differences(
            camera in cameras(), u in 0.0..639.0, v in 0.0..479.0
        ) {
            let pixel = Vector2::new(u, v);
            let (_, analytic) = camera.unproject_with_jacobian(&pixel).expect("on the sensor");
            let h = 1e-3;
            for axis in 0..2 {
                let mut step = Vector2::zeros();
                step[axis] = h;
                let ahead = camera.unproject(&(pixel + step)).expect("on the sensor");
                let behind = camera.unproject(&(pixel - step)).expect("on the sensor");
                let numeric = (ahead - behind) / (2.0 * h);
                prop_assert!((analytic.column(axis) - numeric).norm() < 1e-9);
            }
        }
    }

    #[test]
    fn nothing_behind_or_at_the_camera_has_a_pixel() {
        let camera = Camera::checked([640, 480], [600.0; 2], [320.0, 240.0], REAL[0]).expect("a camera");
        for z in [0.0, -1.0, f64::NAN, 1e-320] {
            assert_eq!(camera.project(&Point::new(0.1, 0.1, z)), None);
        }
    }

    #[test]
    fn a_point_outside_the_lens_models_range_does_not_fold_into_the_picture() {
        let fold = super::super::Distortion::PlumbBob([-1.0 / 3.0, 0.0, 0.0, 0.0, 0.0]);
        let camera = Camera::checked([640, 480], [300.0; 2], [320.0, 240.0], fold).expect("a camera");
        // r = sqrt(3) would be imaged at the principal point.
        assert_eq!(camera.project(&Point::new(3.0_f64.sqrt(), 0.0, 1.0)), None);
    }
}
