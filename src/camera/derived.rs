//! Cameras whose pictures are another camera's, scaled or cut out: exact, covariance included.

use super::{Camera, CameraError};

impl Camera {
    /// The camera whose picture is this one's at another size. Pixels' outer edges coincide, so a centre `u` goes to
    /// `(u + 0.5) * scale - 0.5`; the two axes may be scaled differently.
    ///
    /// # Errors
    /// [`CameraError`] if a size is none, or so small that no camera has it.
    pub fn rescaled(&self, [width, height]: [u32; 2]) -> Result<Self, CameraError> {
        let scale = [f64::from(width) / f64::from(self.width()), f64::from(height) / f64::from(self.height())];
        let [sx, sy] = scale;
        let centre = [(self.cx + 0.5) * sx - 0.5, (self.cy + 0.5) * sy - 0.5];
        let camera = Self::checked([width, height], [self.fx * sx, self.fy * sy], centre, self.distortion)?;
        // Focal lengths and principal point scale with the picture, the lens does not.
        let factor = |parameter: usize| if parameter < 4 { scale[parameter % 2] } else { 1.0 };
        match &self.parameter_covariance {
            Some(covariance) => {
                let mut rows = covariance.rows();
                for (r, row) in rows.iter_mut().enumerate() {
                    row.iter_mut().enumerate().for_each(|(c, value)| *value *= factor(r) * factor(c));
                }
                camera.with_parameter_covariance(&rows)
            }
            None => Ok(camera),
        }
    }

    /// The camera whose picture is a part of this one's: x, y, width and height of the part, px.
    ///
    /// # Errors
    /// [`CameraError::Crop`] if the part does not lie on the picture.
    pub fn cropped(&self, crop_px: [u32; 4]) -> Result<Self, CameraError> {
        let [x, y, width, height] = crop_px;
        let is_within =
            |from: u32, size: u32, all: u32| size > 0 && from.checked_add(size).is_some_and(|end| end <= all);
        if !(is_within(x, width, self.width()) && is_within(y, height, self.height())) {
            return Err(CameraError::Crop { crop_px, size: [self.width(), self.height()] });
        }
        let centre = [self.cx - f64::from(x), self.cy - f64::from(y)];
        let camera = Self::checked([width, height], [self.fx, self.fy], centre, self.distortion)?;
        match &self.parameter_covariance {
            Some(covariance) => camera.with_parameter_covariance(&covariance.rows()),
            None => Ok(camera),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{SMatrix, Vector2};
    use proptest::prelude::*;

    use super::*;
    use crate::camera::distortion::tests::REAL;
    use crate::camera::parameters::MAX_PARAMETERS;
    use crate::geometry::Point;

    /// A camera that is not known exactly.
    fn camera(lens: usize) -> Camera {
        let lens = REAL[lens];
        let size = 4 + lens.coefficients().len();
        let deviation = |k: usize| if k < 4 { 2.0 + k as f64 } else { 0.01 };
        let like = |r: usize, c: usize| if r == c { 1.0 } else { 0.3 };
        let rows: Vec<Vec<f64>> =
            (0..size).map(|r| (0..size).map(|c| like(r, c) * deviation(r) * deviation(c)).collect()).collect();
        let camera = Camera::checked([640, 480], [608.7, 611.2], [314.0, 220.0], lens).expect("a real camera");
        camera.with_parameter_covariance(&rows).expect("a covariance")
    }

    /// Covariance of a point's pixel, by the camera's own uncertainty.
    fn uncertainty(camera: &Camera, point: &Point<crate::geometry::space::Camera>) -> SMatrix<f64, 2, 2> {
        let by = camera.pixel_by_parameters(point).expect("in view");
        let covariance: SMatrix<f64, MAX_PARAMETERS, MAX_PARAMETERS> =
            *camera.parameter_covariance().expect("kept").matrix();
        by * covariance * by.transpose()
    }

    proptest! {
        #[test]
        fn to_project_and_to_scale_is_to_scale_and_to_project(
            lens in 0..REAL.len(), width in 40_u32..3000, height in 40_u32..3000,
            x in -0.5..0.5, y in -0.4..0.4, z in 0.3..50.0
        ) {
            let (camera, point) = (camera(lens), Point::new(x * z, y * z, z));
            let scaled = camera.rescaled([width, height]).expect("a camera");
            let scale = Vector2::new(f64::from(width) / 640.0, f64::from(height) / 480.0);
            let pixel = camera.project(&point).expect("in view");
            let expected = pixel.add_scalar(0.5).component_mul(&scale).add_scalar(-0.5);
            prop_assert!((scaled.project(&point).expect("in view") - expected).norm() < 1e-9);
            let scale = SMatrix::<f64, 2, 2>::from_diagonal(&scale);
            let expected = scale * uncertainty(&camera, &point) * scale;
            prop_assert!((uncertainty(&scaled, &point) - expected).norm() < 1e-9 * (1.0 + expected.norm()));
        }

        #[test]
        fn to_project_and_to_crop_is_to_crop_and_to_project(
            lens in 0..REAL.len(), left in 0_u32..300, top in 0_u32..200, x in -0.5..0.5, y in -0.4..0.4, z in 0.3..50.0
        ) {
            let (camera, point) = (camera(lens), Point::new(x * z, y * z, z));
            let part = camera.cropped([left, top, 340, 280]).expect("a camera");
            let expected = camera.project(&point).expect("in view") - Vector2::new(f64::from(left), f64::from(top));
            prop_assert!((part.project(&point).expect("in view") - expected).norm() < 1e-9);
            prop_assert!((uncertainty(&part, &point) - uncertainty(&camera, &point)).norm() < 1e-9);
        }

        #[test]
        fn there_and_back_is_the_same(lens in 0..REAL.len(), width in 40_u32..3000, height in 40_u32..3000) {
            let camera = camera(lens);
            let back = camera.rescaled([width, height]).and_then(|there| there.rescaled([640, 480])).expect("a camera");
            prop_assert!((back.fx - camera.fx).abs() < 1e-9 && (back.cx - camera.cx).abs() < 1e-9);
            let pixel = Vector2::new(300.0, 200.0);
            prop_assert!((back.unproject(&pixel).expect("seen") - camera.unproject(&pixel).expect("seen")).norm() < 1e-9);
        }
    }

    #[test]
    fn a_crop_beyond_the_picture_is_refused() {
        for crop_px in [[0, 0, 641, 480], [1, 0, 640, 480], [0, 0, 0, 10], [u32::MAX, 0, 2, 2]] {
            let refused = camera(0).cropped(crop_px).expect_err("beyond");
            assert_eq!(refused, CameraError::Crop { crop_px, size: [640, 480] });
        }
        assert!(camera(0).cropped([0, 0, 640, 480]).is_ok());
        assert_eq!(camera(0).rescaled([0, 480]).expect_err("none").field(), "width");
    }
}
