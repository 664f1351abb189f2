//! Points that know their space.

use std::marker::PhantomData;

use nalgebra::Vector3;

use super::space::Space;

/// A position in metres in the space `S`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point<S: Space> {
    /// Coordinates in metres.
    pub coords: Vector3<f64>,
    space: PhantomData<S>,
}

impl<S: Space> Point<S> {
    /// The point at `(x_m, y_m, z_m)`.
    #[must_use]
    pub const fn new(x_m: f64, y_m: f64, z_m: f64) -> Self {
        Self { coords: Vector3::new(x_m, y_m, z_m), space: PhantomData }
    }

    /// Whether all three coordinates are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.coords.iter().all(|c| c.is_finite())
    }
}

impl<S: Space> From<Vector3<f64>> for Point<S> {
    fn from(coords: Vector3<f64>) -> Self {
        Self { coords, space: PhantomData }
    }
}

impl<S: Space> From<[f64; 3]> for Point<S> {
    fn from([x_m, y_m, z_m]: [f64; 3]) -> Self {
        Self::new(x_m, y_m, z_m)
    }
}
