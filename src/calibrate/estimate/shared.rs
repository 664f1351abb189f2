//! Errors that the points of a view share: a board that bends as it is held, light that shifts an edge, motion while the shutter is
//! open. Points whose errors go together tell less than as many independent ones.
//!
//! How the views pull at the optimum tells it: were errors independent, each would pull with the strength of what it tells. Pulls that
//! are stronger are taken for what they are, view by view (the covariance of clustered data: Liang and Zeger 1986; its bias
//! with few clusters taken out as by Bell and `McCaffrey` 2002). As some dozen views hardly tell the strength of pulls in every direction,
//! it is drawn towards the same in all, which is Kish's design effect (1965). What all views share stays unseen.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::calibrate::bundle::{Bundle, State};
use crate::calibrate::freedom::ByParameter;

/// Views pull harder than independent errors would let them where the mean is above one by so many deviations of a normal variable.
const SIGNIFICANT: f64 = 3.3;

/// What a view leaves to the others of a direction that it alone determines, at least.
const LEAST_LEFT: f64 = 1e-2;

/// What the views tell about the free parameters.
pub(super) struct Shared {
    /// The inverse of the covariance of the free parameters.
    pub information: ByParameter,
    /// Mean of the variances over those that independent errors would leave, at least 1.
    pub design_effect: f64,
}

impl Shared {
    /// At the optimum, for residuals of `scale` standard deviations; `None` where something is left open.
    pub fn of(bundle: &Bundle<'_>, state: &State, scale: f64) -> Option<Self> {
        let independent = bundle.information(state)?;
        let pulls = Pulls::of(bundle, state, &independent);
        let variance = scale * scale;
        let Some(pulls) = pulls.filter(|pulls| pulls.excess(variance) > SIGNIFICANT) else {
            return Some(Self { information: independent / variance, design_effect: 1.0 });
        };
        let information = pulls.information(variance)?;
        Some(Self { information, design_effect: pulls.mean() / variance })
    }
}

/// Pulls of the views in coordinates in which all views together tell the same in every direction.
struct Pulls {
    /// How the scaled information comes of these coordinates.
    factor: DMatrix<f64>,
    /// Their mean square in each direction: the unit matrix for independent errors of one standard deviation.
    strength: DMatrix<f64>,
    /// How many directions the views determine.
    told: f64,
    /// Variance of the trace of the strength where errors are independent.
    spread: f64,
    views: usize,
}

impl Pulls {
    fn of(bundle: &Bundle<'_>, state: &State, information: &ByParameter) -> Option<Self> {
        let free = bundle.freedom.count();
        let information = DMatrix::from_fn(free, free, |r, c| information[(r, c)]);
        let diagonal = information.diagonal().map(f64::sqrt);
        let unit = DMatrix::from_fn(free, free, |r, c| information[(r, c)] / (diagonal[r] * diagonal[c]));
        let factor = DMatrix::from_diagonal(&diagonal) * unit.cholesky()?.l();
        let views = bundle.by_view(state)?;
        let mut pulls =
            Self { strength: DMatrix::zeros(free, free), told: 0.0, spread: 0.0, views: views.len(), factor };
        for (tells, pull) in views {
            let tells = DMatrix::from_fn(free, free, |r, c| tells[(r, c)]);
            let half = pulls.factor.solve_lower_triangular(&tells)?;
            let tells = pulls.factor.solve_lower_triangular(&half.transpose())?;
            let pull = pulls.factor.solve_lower_triangular(&DVector::from_fn(free, |row, _| pull[row]))?;
            pulls.told += tells.trace();
            pulls.spread += 2.0 * tells.norm_squared();
            // The fit has followed each view by what it tells: its pull is what is left.
            let SymmetricEigen { eigenvectors, eigenvalues } = tells.symmetric_eigen();
            let left = eigenvalues.map(|share| (1.0 - share).max(LEAST_LEFT).sqrt());
            let pull = &eigenvectors * eigenvectors.tr_mul(&pull).component_div(&left);
            pulls.strength += &pull * pull.transpose();
        }
        Some(pulls)
    }

    /// Mean over the directions.
    fn mean(&self) -> f64 {
        self.strength.trace() / self.told
    }

    /// By how many deviations of a normal variable the mean is above what independent errors of this variance give: a chi-square
    /// variable over its degrees of freedom (Wilson and Hilferty 1931).
    fn excess(&self, variance: f64) -> f64 {
        let spread = self.spread / (self.told * self.told) / 9.0;
        ((self.mean() / variance).cbrt() - (1.0 - spread)) / spread.sqrt()
    }

    /// What is told by views that pull like this; of no direction more than independent errors of this variance would.
    fn information(&self, variance: f64) -> Option<ByParameter> {
        let free = self.strength.nrows();
        // As if as many views as there are directions had pulled equally in all of them.
        let (known, seen) = (free as f64, self.views as f64);
        let same = DMatrix::identity(free, free) * (self.mean() * known / (known + seen));
        let SymmetricEigen { eigenvectors, eigenvalues } =
            (same + &self.strength * (seen / (known + seen))).symmetric_eigen();
        let told = DMatrix::from_diagonal(&eigenvalues.map(|strength| strength.max(variance).recip()));
        let rows = &self.factor * &eigenvectors;
        let information = &rows * told * rows.transpose();
        information.iter().all(|value| value.is_finite()).then(|| {
            let mut all = ByParameter::zeros();
            all.view_mut((0, 0), (free, free)).copy_from(&information);
            all
        })
    }
}

#[cfg(test)]
mod tests;
