//! How wide the valley of a rational lens is.
//!
//! The data leave what stands below the fraction bar open, along a valley in which the terms above follow. It is not equally wide
//! everywhere: what is below the bar divides the errors of what is above, so where the truth lies a deviation along the valley, it lies
//! aside by the deviations of that place and not of the estimate's. A covariance knows one width: here it is the mean along the valley
//! (the law of total covariance, to second order).

use nalgebra::{Matrix3, SMatrix};

use crate::calibrate::bundle::{Bundle, State, covariance_of};
use crate::calibrate::freedom::{ByParameter, Freedom, Parameters};
use crate::camera::Distortion;
use crate::camera::parameters::MAX_PARAMETERS;

/// The first parameter below the fraction bar; there are three.
const BELOW_THE_BAR: usize = 4 + 5;

/// Moves along the valley are halved so often where they leave the lenses that there are.
const MOST_HALVINGS: usize = 6;

/// By how much the mean covariance of what is above the bar, where what is below is known, is more than that at the estimate, for
/// residuals of one standard deviation. Nothing for other lenses, and where something below the bar is held.
pub(super) fn widening(bundle: &Bundle<'_>, state: &State, covariance: &ByParameter) -> ByParameter {
    let valley = matches!(bundle.lens, Distortion::RationalPolynomial(_)).then(|| Valley::of(bundle, covariance));
    let widening = valley.flatten().and_then(|valley| valley.widening(state));
    widening.filter(|sum| sum.iter().all(|value| value.is_finite())).unwrap_or_else(ByParameter::zeros)
}

struct Valley<'a> {
    bundle: &'a Bundle<'a>,
    /// How all parameters go with each of three independent unit normal variables that what is below the bar depends on.
    along: SMatrix<f64, MAX_PARAMETERS, 3>,
    above: Freedom,
}

impl<'a> Valley<'a> {
    fn of(bundle: &'a Bundle<'_>, covariance: &ByParameter) -> Option<Self> {
        let below: Matrix3<f64> = covariance.fixed_view::<3, 3>(BELOW_THE_BAR, BELOW_THE_BAR).into_owned();
        let along = covariance.fixed_columns::<3>(BELOW_THE_BAR) * below.cholesky()?.l().transpose().try_inverse()?;
        Some(Self { bundle, along, above: bundle.freedom.below(BELOW_THE_BAR) })
    }

    /// The covariance of what is above the bar, so far along the valley; `None` where there is no such lens.
    fn width(&self, state: &State, by: &Parameters) -> Option<ByParameter> {
        covariance_of(&self.bundle.information(&self.bundle.moved_along(state, by)?)?, &self.above)
    }

    fn widening(&self, state: &State) -> Option<ByParameter> {
        let here = self.width(state, &Parameters::zeros())?;
        let mut widening = ByParameter::zeros();
        for direction in self.along.column_iter() {
            let sizes = (0..MOST_HALVINGS).map(|halvings| 0.5_f64.powi(i32::try_from(halvings).unwrap_or(0)));
            widening += sizes.into_iter().find_map(|size| {
                let ahead = self.width(state, &(direction * size))?;
                let behind = self.width(state, &(direction * -size))?;
                Some((ahead + behind - here * 2.0) * (0.5 / (size * size)))
            })?;
        }
        Some(widening)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{SIZE, chessboard, options, truth, views};
    use super::*;
    use crate::calibrate::bundle::Loss;
    use crate::calibrate::freedom::parameters_of;
    use crate::calibrate::watch::Watch;
    use crate::random::{case, normal};
    use crate::scene::boards::STUDY_LENSES;

    #[test]
    fn the_valley_is_as_wide_as_it_is_on_average() {
        let board = chessboard();
        for lens in STUDY_LENSES {
            let camera = truth(lens);
            let mut rng = case("width of a valley", 0);
            let views = views(&camera, &board, 8, 0.2, &mut rng);
            let found = super::super::calibrate(SIZE, &board, &views, &options(lens)).expect("a camera");
            let slices: Vec<_> = views.iter().map(Vec::as_slice).collect();
            let freedom = super::super::freedom_of(SIZE, &options(lens)).expect("free");
            let prior = super::super::prior(&found.camera, 1.0);
            let bundle = Bundle {
                size: SIZE,
                board: &board,
                views: &slices,
                lens,
                freedom,
                loss: Loss::Squares,
                prior,
                watch: Watch::nobody(),
            };
            let poses = found.views.iter().map(|view| view.camera_from_board.expect("a pose")).collect();
            let state = State { camera: found.camera, parameters: parameters_of(&found.camera), poses };
            // So short a part of it that the second order is all there is.
            let covariance =
                covariance_of(&bundle.information(&state).expect("determined"), &freedom).expect("finite") * 0.01;
            let widening = widening(&bundle, &state, &covariance);
            if !matches!(lens, Distortion::RationalPolynomial(_)) {
                assert_eq!(widening, ByParameter::zeros(), "{}", lens.name());
                continue;
            }
            let valley = Valley::of(&bundle, &covariance).expect("a valley");
            let here = valley.width(&state, &Parameters::zeros()).expect("finite");
            let mut mean = ByParameter::zeros();
            let draws = 1000;
            for _ in 0..draws {
                let by = valley.along * nalgebra::Vector3::from_fn(|_, _| normal(&mut rng));
                // What is of first order is taken out by going as far the other way.
                for by in [by, -by] {
                    mean += (valley.width(&state, &by).expect("a lens") - here) / (2.0 * f64::from(draws));
                }
            }
            for index in 0..BELOW_THE_BAR {
                let (by_hand, stated) = (mean[(index, index)], widening[(index, index)]);
                println!("{index}: {:.3e} {by_hand:.3e} {stated:.3e}", here[(index, index)]);
                assert!((by_hand / stated - 1.0).abs() < 0.15, "{index}: {by_hand} {stated}");
            }
        }
    }
}
