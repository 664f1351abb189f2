//! How well the camera's own parameters are known, and how a picture moves with them.
//!
//! Their order is fx, fy, cx, cy, then the coefficients of the distortion model.

use nalgebra::{SMatrix, Vector2};

use super::{Camera, CameraError, Distortion, Normalized};
use crate::geometry::{Point, space};

/// Most parameters of a camera: four, and eight coefficients.
pub const MAX_PARAMETERS: usize = 12;

/// The derivative of a pixel by the parameters; columns of parameters that the camera does not have are zero.
pub type ByParameters = SMatrix<f64, 2, MAX_PARAMETERS>;

/// Covariance of a camera's parameters; rows and columns of parameters that are certain, or missing, are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterCovariance {
    matrix: SMatrix<f64, MAX_PARAMETERS, MAX_PARAMETERS>,
    size: usize,
}

impl ParameterCovariance {
    /// The matrix, padded with zeros.
    #[must_use]
    pub const fn matrix(&self) -> &SMatrix<f64, MAX_PARAMETERS, MAX_PARAMETERS> {
        &self.matrix
    }

    /// A square root: its product with a standard normal vector is an error of the parameters as they are uncertain.
    #[must_use]
    pub fn root(&self) -> SMatrix<f64, MAX_PARAMETERS, MAX_PARAMETERS> {
        // Brought to a unit diagonal: focal lengths and coefficients differ by orders of magnitude.
        let deviation = self.matrix.diagonal().map(f64::sqrt);
        let correlation = SMatrix::<f64, MAX_PARAMETERS, MAX_PARAMETERS>::from_fn(|r, c| {
            let scale = deviation[r] * deviation[c];
            if scale > 0.0 { self.matrix[(r, c)] / scale } else { 0.0 }
        });
        let eigen = correlation.symmetric_eigen();
        let spread = eigen.eigenvalues.map(|variance| variance.max(0.0).sqrt());
        SMatrix::from_diagonal(&deviation) * eigen.eigenvectors * SMatrix::from_diagonal(&spread)
    }

    /// Its rows as they were given.
    #[must_use]
    pub fn rows(&self) -> Vec<Vec<f64>> {
        (0..self.size).map(|r| (0..self.size).map(|c| self.matrix[(r, c)]).collect()).collect()
    }
}

impl Camera {
    /// The camera with this covariance of its parameters: of the first four, or of these and all coefficients of its model.
    ///
    /// # Errors
    /// [`CameraError::ParameterCovariance`] if the rows are no covariance of so many parameters.
    pub fn with_parameter_covariance(mut self, rows: &[Vec<f64>]) -> Result<Self, CameraError> {
        let wrong = |problem| Err(CameraError::ParameterCovariance { problem });
        let size = rows.len();
        let all = 4 + self.distortion.coefficients().len();
        if (size != 4 && size != all) || rows.iter().any(|row| row.len() != size) {
            return wrong("4 x 4 (fx, fy, cx, cy), or with a row and a column more for each distortion coefficient");
        }
        let mut matrix = SMatrix::<f64, MAX_PARAMETERS, MAX_PARAMETERS>::zeros();
        for (r, row) in rows.iter().enumerate() {
            for (c, value) in row.iter().enumerate() {
                if !value.is_finite() {
                    return wrong("a finite number in every place");
                }
                matrix[(r, c)] = *value;
            }
        }
        if (0..size).any(|i| matrix[(i, i)] < 0.0) {
            return wrong("variances of zero or more on its diagonal");
        }
        // Brought to a unit diagonal: focal lengths and coefficients differ by orders of magnitude.
        let scale = matrix.diagonal().map(|variance| if variance > 0.0 { 1.0 / variance.sqrt() } else { 1.0 });
        let correlation =
            SMatrix::<f64, MAX_PARAMETERS, MAX_PARAMETERS>::from_fn(|r, c| matrix[(r, c)] * scale[r] * scale[c]);
        if (correlation - correlation.transpose()).amax() > 1e-9 {
            return wrong("symmetry");
        }
        if correlation.symmetric_eigenvalues().min() < -1e-9 {
            return wrong("no negative variance in any direction");
        }
        self.parameter_covariance = Some(ParameterCovariance { matrix, size });
        Ok(self)
    }

    /// How well its parameters are known, where that was said.
    #[must_use]
    pub const fn parameter_covariance(&self) -> Option<&ParameterCovariance> {
        self.parameter_covariance.as_ref()
    }

    /// How the pixel of `point` moves with the camera's parameters; `None` if it has no pixel.
    #[must_use]
    pub fn pixel_by_parameters(&self, point: &Point<space::Camera>) -> Option<ByParameters> {
        self.project(point)?;
        let ideal = Vector2::new(point.coords.x / point.coords.z, point.coords.y / point.coords.z);
        let (image, _) = self.distortion.distort(&ideal);
        let mut by = ByParameters::zeros();
        by[(0, 0)] = image.x;
        by[(1, 1)] = image.y;
        by[(0, 2)] = 1.0;
        by[(1, 3)] = 1.0;
        for (index, moved) in self.distortion.by_coefficients(&ideal).into_iter().enumerate() {
            by[(0, 4 + index)] = self.fx * moved.x;
            by[(1, 4 + index)] = self.fy * moved.y;
        }
        Some(by)
    }
}

impl Distortion {
    /// How the distorted position of `ideal` moves with each coefficient; zero for those that the model does not have.
    fn by_coefficients(&self, ideal: &Normalized) -> [Vector2<f64>; 8] {
        let (x, y) = (ideal.x, ideal.y);
        let r2 = x * x + y * y;
        let powers = [r2, r2 * r2, r2 * r2 * r2];
        let p1 = Vector2::new(2.0 * x * y, r2 + 2.0 * y * y);
        let p2 = Vector2::new(r2 + 2.0 * x * x, 2.0 * x * y);
        let none = Vector2::zeros();
        match *self {
            Self::None => [none; 8],
            Self::PlumbBob(_) => {
                let [k1, k2, k3] = powers.map(|power| ideal * power);
                [k1, k2, p1, p2, k3, none, none, none]
            }
            Self::RationalPolynomial([k1, k2, _, _, k3, k4, k5, k6]) => {
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
                let [k1, k2, k3] = powers.map(|power| ideal * (power / below));
                let [k4, k5, k6] = powers.map(|power| ideal * (-power * above / (below * below)));
                [k1, k2, p1, p2, k3, k4, k5, k6]
            }
            Self::Equidistant(_) => {
                let r = r2.sqrt();
                let angle = r.atan();
                let share = if r > 0.0 { angle / r } else { 1.0 };
                let a2 = angle * angle;
                let [k1, k2, k3, k4] = [a2, a2 * a2, a2 * a2 * a2, a2 * a2 * a2 * a2].map(|p| ideal * (p * share));
                [k1, k2, k3, k4, none, none, none, none]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::distortion::tests::REAL;

    /// The camera with one parameter moved.
    fn moved(lens: &Distortion, parameter: usize, step: f64) -> Camera {
        let mut numbers = [608.7, 611.2, 314.0, 220.0];
        let mut lens = *lens;
        if parameter < 4 {
            numbers[parameter] += step;
        } else {
            match &mut lens {
                Distortion::None => {}
                Distortion::PlumbBob(k) => k[parameter - 4] += step,
                Distortion::RationalPolynomial(k) => k[parameter - 4] += step,
                Distortion::Equidistant(k) => k[parameter - 4] += step,
            }
        }
        Camera::checked([640, 480], [numbers[0], numbers[1]], [numbers[2], numbers[3]], lens).expect("a real camera")
    }

    #[test]
    fn the_derivatives_agree_with_central_differences() {
        for lens in REAL {
            let camera = moved(&lens, 0, 0.0);
            for point in [[0.3, -0.2, 1.0], [-0.9, 0.7, 2.0], [0.0, 0.0, 1.0], [0.01, 0.4, 1.5]] {
                let point = Point::from(point);
                let analytic = camera.pixel_by_parameters(&point).expect("in view");
                for parameter in 0..4 + lens.coefficients().len() {
                    let step = if parameter < 4 { 1e-3 } else { 1e-6 };
                    let at = |sign: f64| moved(&lens, parameter, sign * step).project(&point).expect("in view");
                    let numeric = (at(1.0) - at(-1.0)) / (2.0 * step);
                    let found = analytic.column(parameter);
                    assert!((found - numeric).norm() < 1e-5 * (1.0 + numeric.norm()), "{} {parameter}", lens.name());
                }
            }
        }
    }

    #[test]
    fn what_is_no_covariance_of_the_parameters_is_refused() {
        let camera = moved(&Distortion::PlumbBob([0.1, 0.0, 0.0, 0.0, 0.0]), 0, 0.0);
        let diagonal = |variances: &[f64]| -> Vec<Vec<f64>> {
            let size = variances.len();
            (0..size).map(|r| (0..size).map(|c| if r == c { variances[r] } else { 0.0 }).collect()).collect()
        };
        let nine = [4.0, 4.0, 1.0, 1.0, 1e-4, 1e-4, 1e-6, 1e-6, 0.0];
        let held = camera.with_parameter_covariance(&diagonal(&nine)).expect("a covariance");
        assert_eq!(held.parameter_covariance().expect("given").rows(), diagonal(&nine));
        assert!(camera.with_parameter_covariance(&diagonal(&nine[..4])).is_ok());
        let mut turned = diagonal(&nine);
        turned[0][1] = 3.0;
        let mut beyond = diagonal(&nine);
        (beyond[0][1], beyond[1][0]) = (5.0, 5.0);
        for rows in [diagonal(&nine[..5]), diagonal(&[-1.0, 1.0, 1.0, 1.0]), diagonal(&[f64::NAN; 4]), turned, beyond] {
            let refused = camera.with_parameter_covariance(&rows).expect_err("no covariance");
            assert_eq!(refused.field(), "parameter_covariance");
        }
    }
}
