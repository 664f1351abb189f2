//! Which of a camera's parameters are sought, and what ties the others.

use nalgebra::{SMatrix, SVector};

use crate::camera::parameters::MAX_PARAMETERS;
use crate::camera::{Camera, CameraError, Distortion};

/// fx, fy, cx, cy, then the coefficients of the lens; zero where the lens has none.
pub type Parameters = SVector<f64, MAX_PARAMETERS>;

/// A matrix over them.
pub type ByParameter = SMatrix<f64, MAX_PARAMETERS, MAX_PARAMETERS>;

/// What is held while a camera is calibrated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fixed {
    /// fx : fy stays as it is in the guess, 1 without one.
    pub aspect_ratio: bool,
    /// The principal point stays as it is in the guess, in the middle of the picture without one.
    pub principal_point: bool,
    /// These coefficients, in the order of the lens' model, stay as they are in the guess, zero without one.
    pub coefficients: [bool; 8],
}

/// The free directions in the space of a camera's parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Freedom {
    directions: ByParameter,
    count: usize,
}

impl Freedom {
    /// Of a camera with this lens; `aspect_ratio` is fx : fy where that is held.
    pub fn of(lens: &Distortion, fixed: &Fixed, aspect_ratio: f64) -> Self {
        let mut freedom = Self { directions: ByParameter::zeros(), count: 0 };
        if fixed.aspect_ratio {
            freedom.push(&[(0, aspect_ratio), (1, 1.0)]);
        } else {
            freedom.push(&[(0, 1.0)]);
            freedom.push(&[(1, 1.0)]);
        }
        if !fixed.principal_point {
            freedom.push(&[(2, 1.0)]);
            freedom.push(&[(3, 1.0)]);
        }
        for index in (0..lens.coefficients().len()).filter(|index| !fixed.coefficients[*index]) {
            freedom.push(&[(4 + index, 1.0)]);
        }
        freedom
    }

    /// Nothing is free: only poses are sought.
    pub fn none() -> Self {
        Self { directions: ByParameter::zeros(), count: 0 }
    }

    /// The same without what moves this parameter or a later one.
    pub fn below(&self, parameter: usize) -> Self {
        let mut fewer = Self::none();
        for column in self.directions.column_iter().take(self.count) {
            if column.rows_range(parameter..).iter().all(|part| *part == 0.0) {
                fewer.directions.set_column(fewer.count, &column);
                fewer.count += 1;
            }
        }
        fewer
    }

    fn push(&mut self, parts: &[(usize, f64)]) {
        for &(parameter, part) in parts {
            self.directions[(parameter, self.count)] = part;
        }
        self.count += 1;
    }

    /// How many parameters are free.
    pub const fn count(&self) -> usize {
        self.count
    }

    /// Columns: how the parameters move with each free one; zero beyond [`count`](Self::count).
    pub const fn directions(&self) -> &ByParameter {
        &self.directions
    }
}

/// The numbers of a camera.
pub(super) fn parameters_of(camera: &Camera) -> Parameters {
    let mut parameters = Parameters::zeros();
    let ([fx, fy], [cx, cy]) = (camera.focal_lengths(), camera.principal_point());
    parameters.fixed_rows_mut::<4>(0).copy_from_slice(&[fx, fy, cx, cy]);
    for (index, coefficient) in camera.distortion().coefficients().iter().enumerate() {
        parameters[4 + index] = *coefficient;
    }
    parameters
}

/// The camera of these numbers with a lens of the model of `lens`.
pub(super) fn camera_of(size: [u32; 2], lens: &Distortion, parameters: &Parameters) -> Result<Camera, CameraError> {
    let [fx, fy, cx, cy] = [0, 1, 2, 3].map(|index| parameters[index]);
    Camera::checked(size, [fx, fy], [cx, cy], lens.with_coefficients(&parameters.as_slice()[4..]))
}
