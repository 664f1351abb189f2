//! Lens distortion models, named and ordered as in ROS `CameraInfo` and OpenCV.

use nalgebra::{Matrix2, Vector2};

use super::Normalized;

/// How the lens moves a ray away from where an ideal pinhole would put it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// An ideal pinhole.
    None,
    /// Brown-Conrady with coefficients k1 k2 p1 p2 k3 (D. C. Brown 1966, "Decentering distortion of lenses").
    PlumbBob([f64; 5]),
    /// A rational radial term, coefficients k1 k2 p1 p2 k3 k4 k5 k6 (Claus and Fitzgibbon 2005).
    RationalPolynomial([f64; 8]),
    /// Fisheye with coefficients k1 k2 k3 k4 of the angle's odd polynomial (Kannala and Brandt 2006).
    Equidistant([f64; 4]),
}

/// A radial factor and its derivative by the squared radius.
struct Radial {
    factor: f64,
    slope: f64,
}

/// Below this squared radius the fisheye factor is taken from its series; the first term left out is below 1e-16.
const SERIES_RADIUS_SQUARED: f64 = 1e-8;

impl Distortion {
    /// The model's name in the contract.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::None => "none",
            Self::PlumbBob(_) => "plumb_bob",
            Self::RationalPolynomial(_) => "rational_polynomial",
            Self::Equidistant(_) => "equidistant",
        }
    }

    /// The coefficients in the contract's order.
    #[must_use]
    pub const fn coefficients(&self) -> &[f64] {
        match self {
            Self::None => &[],
            Self::PlumbBob(k) => k,
            Self::RationalPolynomial(k) => k,
            Self::Equidistant(k) => k,
        }
    }

    /// Names of the coefficients in the contract's order.
    #[must_use]
    pub const fn coefficient_names(&self) -> &'static [&'static str] {
        match self {
            Self::None => &[],
            Self::PlumbBob(_) => &["k1", "k2", "p1", "p2", "k3"],
            Self::RationalPolynomial(_) => &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
            Self::Equidistant(_) => &["k1", "k2", "k3", "k4"],
        }
    }

    /// A lens of the same model with these coefficients; those that are not given are zero, those beyond its own are left out.
    #[must_use]
    pub fn with_coefficients(&self, coefficients: &[f64]) -> Self {
        fn taken<const N: usize>(given: &[f64]) -> [f64; N] {
            std::array::from_fn(|index| given.get(index).copied().unwrap_or(0.0))
        }
        match self {
            Self::None => Self::None,
            Self::PlumbBob(_) => Self::PlumbBob(taken(coefficients)),
            Self::RationalPolynomial(_) => Self::RationalPolynomial(taken(coefficients)),
            Self::Equidistant(_) => Self::Equidistant(taken(coefficients)),
        }
    }

    /// The distorted position of the undistorted `ideal`, with the 2 x 2 Jacobian of the one by the other.
    #[must_use]
    pub fn distort(&self, ideal: &Normalized) -> (Normalized, Matrix2<f64>) {
        let (x, y) = (ideal.x, ideal.y);
        let (p1, p2) = self.tangential();
        let radial = self.radial(x * x + y * y);
        let cross = 2.0 * x * y * radial.slope + 2.0 * (p1 * x + p2 * y);
        let distorted = Vector2::new(
            x * radial.factor + 2.0 * p1 * x * y + p2 * (3.0 * x * x + y * y),
            y * radial.factor + p1 * (x * x + 3.0 * y * y) + 2.0 * p2 * x * y,
        );
        let jacobian = Matrix2::new(
            radial.factor + 2.0 * x * x * radial.slope + 2.0 * p1 * y + 6.0 * p2 * x,
            cross,
            cross,
            radial.factor + 2.0 * y * y * radial.slope + 6.0 * p1 * y + 2.0 * p2 * x,
        );
        (distorted, jacobian)
    }

    const fn tangential(&self) -> (f64, f64) {
        match self {
            Self::None | Self::Equidistant(_) => (0.0, 0.0),
            Self::PlumbBob([_, _, p1, p2, _]) | Self::RationalPolynomial([_, _, p1, p2, ..]) => (*p1, *p2),
        }
    }

    fn radial(&self, r2: f64) -> Radial {
        match *self {
            Self::None => Radial { factor: 1.0, slope: 0.0 },
            Self::PlumbBob([k1, k2, _, _, k3]) => {
                Radial { factor: 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)), slope: k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3) }
            }
            Self::RationalPolynomial([k1, k2, _, _, k3, k4, k5, k6]) => {
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
                let above_slope = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3);
                let below_slope = k4 + r2 * (2.0 * k5 + 3.0 * r2 * k6);
                Radial { factor: above / below, slope: (above_slope - above / below * below_slope) / below }
            }
            Self::Equidistant([k1, k2, k3, k4]) => {
                if r2 < SERIES_RADIUS_SQUARED {
                    let slope = k1 - 1.0 / 3.0;
                    return Radial { factor: 1.0 + slope * r2, slope };
                }
                let r = r2.sqrt();
                let angle = r.atan();
                let a2 = angle * angle;
                let bent = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))));
                let bent_slope = 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4)));
                Radial { factor: bent / r, slope: (bent_slope / (1.0 + r2) - bent / r) / (2.0 * r2) }
            }
        }
    }

    /// The largest undistorted radius up to which the model still moves outward: beyond it the polynomial folds back and
    /// would put a point far outside the view into the middle of the picture. At most `tan(89.5 degrees)`.
    #[must_use]
    pub fn valid_radius(&self) -> f64 {
        let grows = |r: f64| {
            let radial = self.radial(r * r);
            let outward = radial.factor + 2.0 * r * r * radial.slope;
            radial.factor > 0.0 && outward > 0.0
        };
        let radius = |step: u32| (f64::from(step) * 0.25_f64.to_radians()).tan();
        let last = 358;
        let Some(broken) = (1..=last).find(|&step| !grows(radius(step))) else {
            return radius(last);
        };
        let (mut good, mut bad) = (radius(broken - 1), radius(broken));
        for _ in 0..50 {
            let middle = 0.5 * (good + bad);
            if grows(middle) {
                good = middle;
            } else {
                bad = middle;
            }
        }
        good
    }

    /// The undistorted position that [`distort`](Self::distort) takes to `distorted`, within `valid_radius`; `None` where
    /// there is none.
    #[must_use]
    pub fn undistort(&self, distorted: &Normalized, valid_radius: f64) -> Option<Normalized> {
        if *self == Self::None {
            return Some(*distorted);
        }
        // Damped Newton. The start has the right radius if the tangential part is ignored.
        let mut ideal = self.radial_start(distorted, valid_radius)?;
        let (mut image, mut jacobian) = self.distort(&ideal);
        let mut error = distorted - image;
        for _ in 0..40 {
            if error.norm() <= 1e-15 * (1.0 + distorted.norm()) {
                break;
            }
            let step = jacobian.try_inverse()? * error;
            let mut share = 1.0;
            loop {
                let candidate = ideal + step * share;
                let (next_image, next_jacobian) = self.distort(&candidate);
                let next_error = distorted - next_image;
                if next_error.norm() < error.norm() {
                    (ideal, image, jacobian, error) = (candidate, next_image, next_jacobian, next_error);
                    break;
                }
                share *= 0.5;
                if share < 1e-3 {
                    // No step makes it smaller: at the floor of rounding, or stuck.
                    return accepted(ideal, distorted - image, distorted, valid_radius);
                }
            }
        }
        accepted(ideal, error, distorted, valid_radius)
    }

    /// Newton's steps on the radius alone, which is monotonic up to `valid_radius`; where one leaves what is known, its middle.
    fn radial_start(&self, distorted: &Normalized, valid_radius: f64) -> Option<Normalized> {
        let wanted = distorted.norm();
        if wanted == 0.0 {
            return Some(*distorted);
        }
        let (mut low, mut high) = (0.0, valid_radius);
        // A little slack: the tangential part may push a valid point outward.
        if wanted > high * self.radial(high * high).factor * 1.1 {
            return None;
        }
        let mut radius = wanted.min(high);
        for _ in 0..20 {
            let Radial { factor, slope } = self.radial(radius * radius);
            let error = radius * factor - wanted;
            // What is left the steps in both coordinates take.
            if error.abs() <= 1e-6 * wanted {
                break;
            }
            *(if error < 0.0 { &mut low } else { &mut high }) = radius;
            let next = radius - error / (factor + 2.0 * radius * radius * slope);
            radius = if (low..high).contains(&next) { next } else { 0.5 * (low + high) };
        }
        Some(distorted * (radius / wanted))
    }
}

/// A solution that fits to rounding and lies where the model is one to one.
fn accepted(ideal: Normalized, error: Vector2<f64>, distorted: &Normalized, valid_radius: f64) -> Option<Normalized> {
    let converged = error.norm() <= 1e-11 * (1.0 + distorted.norm());
    (converged && ideal.norm() <= valid_radius).then_some(ideal)
}

#[cfg(test)]
pub(crate) mod tests {
    use proptest::prelude::*;

    use super::*;

    /// One of each model with coefficients of real lenses.
    pub(crate) const REAL: [Distortion; 5] = [
        Distortion::None,
        Distortion::PlumbBob([-0.2852, 0.0812, -0.0004, 0.0007, -0.0091]),
        Distortion::PlumbBob([0.12, -0.25, 0.001, -0.0015, 0.11]),
        Distortion::RationalPolynomial([0.4783, -2.5632, 0.0006, -0.0001, 1.4821, 0.3592, -2.3908, 1.4103]),
        Distortion::Equidistant([-0.0139, 0.0216, -0.0319, 0.0118]),
    ];

    proptest! {
        #[test]
        fn undistort_undoes_distort(index in 0..REAL.len(), x in -0.8..0.8, y in -0.6..0.6) {
            let model = REAL[index];
            let ideal = Vector2::new(x, y);
            prop_assume!(ideal.norm() < 0.95 * model.valid_radius());
            let back = model.undistort(&model.distort(&ideal).0, model.valid_radius());
            prop_assert!((back.expect("inside the valid radius") - ideal).norm() < 1e-11);
        }

        #[test]
        fn the_jacobian_agrees_with_central_differences(index in 0..REAL.len(), x in -0.8..0.8, y in -0.6..0.6) {
            let model = REAL[index];
            let h = 1e-6;
            let ideal = Vector2::new(x, y);
            let analytic = model.distort(&ideal).1;
            for axis in 0..2 {
                let mut step = Vector2::zeros();
                step[axis] = h;
                let numeric = (model.distort(&(ideal + step)).0 - model.distort(&(ideal - step)).0) / (2.0 * h);
                prop_assert!((analytic.column(axis) - numeric).norm() < 1e-8 * (1.0 + numeric.norm()));
            }
        }

        #[test]
        fn fisheye_is_smooth_where_the_series_takes_over(r in 0.5e-4..2e-4) {
            let model = REAL[4];
            let (image, jacobian) = model.distort(&Vector2::new(r, 0.0));
            let angle = r.atan();
            let expected = angle * (1.0 - 0.0139 * angle * angle);
            prop_assert!((image.x - expected).abs() < 1e-16);
            prop_assert!((jacobian[(1, 1)] - expected / r).abs() < 1e-12);
        }
    }

    #[test]
    fn a_barrel_lens_folds_back_where_its_derivative_vanishes() {
        // 1 + 3 k1 r^2 = 0 at r = 1 for k1 = -1/3.
        let model = Distortion::PlumbBob([-1.0 / 3.0, 0.0, 0.0, 0.0, 0.0]);
        assert!((model.valid_radius() - 1.0).abs() < 1e-9);
        assert!(model.undistort(&Vector2::new(0.9, 0.0), model.valid_radius()).is_none());
    }

    #[test]
    fn matches_values_computed_with_opencv() {
        // cv2.projectPoints / cv2.fisheye.projectPoints of (0.3, -0.2, 1) with the coefficients above, unit camera.
        let expected = [
            (0.3, -0.2),
            (0.289_547_886_19, -0.193_023_257_460_000_01),
            (0.302_900_001_000_000_03, -0.201_933_334_000_000_05),
            (0.303_679_636_764_621_9, -0.202_383_757_843_081_27),
            (0.287_523_301_602_059_9, -0.191_682_201_068_039_96),
        ];
        for (model, (x, y)) in REAL.iter().zip(expected) {
            let image = model.distort(&Vector2::new(0.3, -0.2)).0;
            assert!((image - Vector2::new(x, y)).norm() < 1e-12, "{}: {image}", model.name());
        }
    }
}
