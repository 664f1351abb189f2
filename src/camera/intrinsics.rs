//! The camera's parameters, checked once.

use thiserror::Error;

use super::Distortion;
use super::parameters::ParameterCovariance;

/// A calibrated camera. Only [`Camera::checked`] makes one, so its numbers are finite and its focal lengths positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    width: u32,
    height: u32,
    pub(super) fx: f64,
    pub(super) fy: f64,
    pub(super) cx: f64,
    pub(super) cy: f64,
    pub(super) distortion: Distortion,
    pub(super) valid_radius: f64,
    pub(super) parameter_covariance: Option<ParameterCovariance>,
}

/// Why a set of numbers is not a camera.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CameraError {
    /// Width or height is zero or beyond any sensor.
    #[error("the image size {width} x {height} px is not within 1 to {max} px a side")]
    Size {
        /// Width, px.
        width: u32,
        /// Height, px.
        height: u32,
        /// Largest side, px.
        max: u32,
    },
    /// A focal length is zero, negative, not finite, or out of any proportion to the image.
    #[error("{field} = {value} px: a focal length is a positive number of pixels, here between {min:.3} and {max:.0}")]
    FocalLength {
        /// `fx` or `fy`.
        field: &'static str,
        /// What was given.
        value: f64,
        /// Smallest accepted.
        min: f64,
        /// Largest accepted.
        max: f64,
    },
    /// The principal point is not finite or absurdly far outside the image.
    #[error("{field} = {value} px: the principal point lies within ten image sizes of the image")]
    PrincipalPoint {
        /// `cx` or `cy`.
        field: &'static str,
        /// What was given.
        value: f64,
    },
    /// A coefficient is not finite.
    #[error("distortion coefficient {index} of {model} is {value}: a finite number is needed")]
    Coefficient {
        /// Name of the model.
        model: &'static str,
        /// Position in the model's order, from 0.
        index: usize,
        /// What was given.
        value: f64,
    },
    /// A part that does not lie on the picture.
    #[error(
        "the part of {} x {} px at ({}, {}) does not lie on the picture of {} x {} px",
        crop_px[2], crop_px[3], crop_px[0], crop_px[1], size[0], size[1]
    )]
    Crop {
        /// x, y, width, height of the part, px.
        crop_px: [u32; 4],
        /// Size of the picture, px.
        size: [u32; 2],
    },
    /// No covariance of this camera's parameters.
    #[error("the covariance of the camera's parameters needs {problem}")]
    ParameterCovariance {
        /// What it lacks.
        problem: &'static str,
    },
}

impl CameraError {
    /// The contract's name of the field at fault, for a pointer into the request.
    #[must_use]
    pub const fn field(&self) -> &'static str {
        match self {
            Self::Size { .. } => "width",
            Self::FocalLength { field, .. } | Self::PrincipalPoint { field, .. } => field,
            Self::Coefficient { .. } => "distortion",
            Self::Crop { .. } => "crop_px",
            Self::ParameterCovariance { .. } => "parameter_covariance",
        }
    }
}

impl Camera {
    /// Largest image side accepted, px.
    pub const MAX_SIDE_PX: u32 = 65_535;

    /// A camera of these parameters, pixels throughout.
    ///
    /// # Errors
    /// Names the field that is not finite, not positive, or out of any proportion.
    pub fn checked(
        [width, height]: [u32; 2],
        [fx, fy]: [f64; 2],
        [cx, cy]: [f64; 2],
        distortion: Distortion,
    ) -> Result<Self, CameraError> {
        let max = Self::MAX_SIDE_PX;
        if !(1..=max).contains(&width) || !(1..=max).contains(&height) {
            return Err(CameraError::Size { width, height, max });
        }
        let side = f64::from(width.max(height));
        let (min, max) = (side * 1e-3, side * 1e4);
        for (field, value) in [("fx", fx), ("fy", fy)] {
            if !(min..=max).contains(&value) {
                return Err(CameraError::FocalLength { field, value, min, max });
            }
        }
        for (field, value, size) in [("cx", cx, width), ("cy", cy, height)] {
            if !(value.abs() <= 10.0 * f64::from(size)) {
                return Err(CameraError::PrincipalPoint { field, value });
            }
        }
        let model = distortion.name();
        for (index, &value) in distortion.coefficients().iter().enumerate() {
            if !value.is_finite() {
                return Err(CameraError::Coefficient { model, index, value });
            }
        }
        Ok(Self {
            width,
            height,
            fx,
            fy,
            cx,
            cy,
            valid_radius: distortion.valid_radius(),
            distortion,
            parameter_covariance: None,
        })
    }

    /// Image width, px.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Image height, px.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// Focal lengths `[fx, fy]`, px.
    #[must_use]
    pub const fn focal_lengths(&self) -> [f64; 2] {
        [self.fx, self.fy]
    }

    /// Principal point `[cx, cy]`, px.
    #[must_use]
    pub const fn principal_point(&self) -> [f64; 2] {
        [self.cx, self.cy]
    }

    /// The lens.
    #[must_use]
    pub const fn distortion(&self) -> &Distortion {
        &self.distortion
    }

    /// Whether the pixel lies on the image, its border pixels' outer edges included.
    #[must_use]
    pub fn contains(&self, pixel: &super::Pixel) -> bool {
        (-0.5..=f64::from(self.width) - 0.5).contains(&pixel.x)
            && (-0.5..=f64::from(self.height) - 0.5).contains(&pixel.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(size: [u32; 2], focal: [f64; 2], centre: [f64; 2]) -> Result<Camera, CameraError> {
        Camera::checked(size, focal, centre, Distortion::None)
    }

    #[test]
    fn the_seeds_camera_is_accepted() {
        assert!(camera([640, 480], [608.7, 608.7], [314.0, 320.0]).is_ok());
    }

    #[test]
    fn senseless_numbers_are_named() {
        let field = |r: Result<Camera, CameraError>| r.expect_err("senseless").field();
        assert_eq!(field(camera([0, 480], [600.0, 600.0], [320.0, 240.0])), "width");
        assert_eq!(field(camera([640, 480], [-600.0, 600.0], [320.0, 240.0])), "fx");
        assert_eq!(field(camera([640, 480], [600.0, f64::NAN], [320.0, 240.0])), "fy");
        assert_eq!(field(camera([640, 480], [600.0, f64::INFINITY], [320.0, 240.0])), "fy");
        assert_eq!(field(camera([640, 480], [600.0, 600.0], [f64::NAN, 240.0])), "cx");
        let nan = Distortion::PlumbBob([0.0, f64::NAN, 0.0, 0.0, 0.0]);
        let refused = Camera::checked([640, 480], [600.0, 600.0], [320.0, 240.0], nan).expect_err("NaN");
        assert_eq!(refused.to_string(), "distortion coefficient 1 of plumb_bob is NaN: a finite number is needed");
    }
}
