//! What is known of a lens before anything is seen: little, but enough that terms which stand for each other do not run away.

use nalgebra::Vector2;

use crate::calibrate::freedom::Parameters;
use crate::calibrate::start::middle;
use crate::camera::{Camera, Distortion};

/// Standard deviation of a lens' term at the picture's corner before anything is seen, in units of the ray's own length.
const TERM: f64 = 1.0;

/// The same for the first term below the fraction bar of a rational lens, and by how much that of each further one is smaller, as those
/// of a series are: beside the terms above, small ones do as well as large ones. Where all together bring what is below the bar near
/// zero, terms mean something else than where the truth has them, and no covariance of theirs holds.
const DENOMINATOR_TERM: f64 = 0.45;
const DENOMINATOR_FALL: f64 = 0.6;

/// What is known of a lens before anything is seen. `scale` is the noise of the residuals in their units.
pub(in crate::calibrate) fn prior(camera: &Camera, scale: f64) -> Parameters {
    let [fx, fy] = camera.focal_lengths();
    let corner = middle([camera.width(), camera.height()]).component_div(&Vector2::new(fx, fy)).norm();
    let square = corner * corner;
    let powers = match camera.distortion() {
        Distortion::None => [0; 8],
        Distortion::PlumbBob(_) | Distortion::RationalPolynomial(_) => [2, 4, 1, 1, 6, 2, 4, 6],
        Distortion::Equidistant(_) => [2, 4, 6, 8, 0, 0, 0, 0],
    };
    let mut prior = Parameters::zeros();
    for (index, power) in powers.into_iter().enumerate().take(camera.distortion().coefficients().len()) {
        let is_rational = matches!(camera.distortion(), Distortion::RationalPolynomial(_));
        let deviation = match index {
            5 if is_rational => DENOMINATOR_TERM,
            6 if is_rational => DENOMINATOR_TERM * DENOMINATOR_FALL,
            7 if is_rational => DENOMINATOR_TERM * DENOMINATOR_FALL * DENOMINATOR_FALL,
            _ => TERM,
        };
        prior[4 + index] = square.powi(power) * (scale / deviation).powi(2);
    }
    prior
}
