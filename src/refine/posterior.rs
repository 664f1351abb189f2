//! What the image says about the pose around a minimum, beyond the paraboloid.
//!
//! Of the six coordinates of a pose it is the two tilts against the line of sight whose error is far from a paraboloid: a
//! marker's image moves with the cosine of the tilt, so with its square near face on. So the residuals are expanded to second
//! order in the tilts and to first order in the other four coordinates; these are then integrated out in closed form, which
//! leaves a polynomial of fourth degree in the tilts, and its exponential is summed on a grid (the trapezoidal rule, which is
//! exact for a normal density to all digits that matter here). Mass and moments come from the same sum. It is Laplace's
//! approximation (Tierney and Kadane 1986) for four coordinates and quadrature for two.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Matrix6, Matrix6x2, Matrix6x3, Vector2, Vector3, Vector6};

use super::{Correspondence, Refined, project_with_pose_jacobian};
use crate::camera::Camera;
use crate::geometry::{CameraFromTarget, PoseCovariance};

/// The valley of the error around a minimum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posterior {
    /// Second moment of the error about the minimum: the covariance that holds in a bent valley too.
    pub covariance: PoseCovariance,
    /// Logarithm of the valley's mass over that of the paraboloid with the minimum's curvature.
    pub ln_mass_ratio: f64,
    /// Largest relative deviation of the error from that paraboloid on the circle of two standard deviations of tilt; infinite
    /// where it could not be expanded.
    pub nonlinearity: f64,
}

/// Half width of the grid, standard deviations; doubled while the valley reaches further, up to [`WIDENINGS`] times.
const HALF_WIDTH: f64 = 4.0;

/// Grid points from the middle to the edge: less than a standard deviation apart.
const HALF_STEPS: i32 = 5;

/// How often the grid may be doubled.
const WIDENINGS: usize = 2;

/// Share of the mass on the grid's edge above which the valley reaches further.
const EDGE_SHARE: f64 = 0.01;

/// The valley around `minimum`, as far as it belongs to this and not to one of the `others`. All residuals count as `1 /
/// scale` times as large as stated: what [`Refined`] says is for a scale of 1.
#[must_use]
pub fn posterior(
    camera: &Camera,
    correspondences: &[Correspondence],
    minimum: &Refined,
    others: &[CameraFromTarget],
    scale: f64,
) -> Posterior {
    let covariance = minimum.covariance.scaled(scale * scale);
    let paraboloid = Posterior { covariance, ln_mass_ratio: 0.0, nonlinearity: f64::INFINITY };
    let Some(whitening) = covariance.matrix().cholesky() else { return paraboloid };
    let from_whitened = whitening.l();
    let Some(valley) = Valley::of(camera, correspondences, minimum, &from_whitened, scale) else { return paraboloid };
    let others: Vec<Vector2<f64>> = others
        .iter()
        .filter_map(|other| {
            let away = minimum.camera_from_target.difference_to(other);
            Some(valley.tilts.tr_mul(&from_whitened.solve_lower_triangular(&away)?))
        })
        .collect();
    let Some((moment, mass)) = valley.moments(&others) else { return paraboloid };
    let moment = from_whitened * moment * from_whitened.transpose();
    let Some(covariance) = PoseCovariance::checked((moment + moment.transpose()) * 0.5) else { return paraboloid };
    Posterior { covariance, ln_mass_ratio: mass.ln(), nonlinearity: valley.nonlinearity() }
}

/// Chi-square about a minimum as a polynomial of the two tilts, in coordinates in which the paraboloid is round.
struct Valley {
    /// Orthonormal directions of the whitened coordinates along which a tilt moves when all else follows it.
    tilts: Matrix6x2<f64>,
    /// Half of how the four other coordinates follow the products `a^2, 2 a b, b^2` of the tilts.
    following: Matrix6x3<f64>,
    /// Coefficients of the products.
    square: Vector3<f64>,
    /// Coefficients of the products times `a` and times `b`.
    cube: [Vector3<f64>; 2],
    /// Coefficients of the products of the products.
    fourth: Matrix3<f64>,
}

impl Valley {
    fn of(
        camera: &Camera,
        correspondences: &[Correspondence],
        minimum: &Refined,
        from_whitened: &Matrix6<f64>,
        scale: f64,
    ) -> Option<Self> {
        let pose = &minimum.camera_from_target;
        let tilts = tilts(correspondences, pose, from_whitened)?;
        let moved = |a: f64, b: f64| pose.perturbed(&(from_whitened * (tilts * Vector2::new(a, b))));
        // Second differences over one standard deviation.
        let d = std::f64::consts::FRAC_1_SQRT_2;
        let along_first = [moved(1.0, 0.0), moved(-1.0, 0.0)];
        let along_second = [moved(0.0, 1.0), moved(0.0, -1.0)];
        let along_sum = [moved(d, d), moved(-d, -d)];
        let along_difference = [moved(d, -d), moved(-d, d)];
        let mut square = Vector3::zeros();
        let mut by_all = Matrix6x3::zeros();
        let mut fourth = Matrix3::zeros();
        for seen in correspondences {
            let weight = 1.0 / (seen.sigma_px * scale);
            let (here, jacobian) = project_with_pose_jacobian(camera, pose, seen)?;
            let both = |poses: &[CameraFromTarget; 2]| {
                let [forth, back] = poses;
                Some(camera.project(&(*forth * seen.point))? + camera.project(&(*back * seen.point))?)
            };
            let bend = [
                both(&along_first)? - here * 2.0,
                (both(&along_sum)? - both(&along_difference)?) * 0.5,
                both(&along_second)? - here * 2.0,
            ];
            let residual = (seen.pixel - here) * weight;
            let by_whitened = jacobian * from_whitened * weight;
            let bend = bend.map(|b| b * weight);
            for (i, b) in bend.iter().enumerate() {
                square[i] -= residual.dot(b);
                let mut column = by_all.column_mut(i);
                column += by_whitened.tr_mul(b);
                for (j, c) in bend.iter().enumerate() {
                    fourth[(i, j)] += 0.25 * b.dot(c);
                }
            }
        }
        let by_tilt = tilts.tr_mul(&by_all);
        let by_rest = by_all - tilts * by_tilt;
        fourth -= by_rest.tr_mul(&by_rest) * 0.25;
        let cube = [by_tilt.row(0).transpose(), by_tilt.row(1).transpose()];
        Some(Self { tilts, following: by_rest * 0.5, square, cube, fourth })
    }

    /// Rise of chi-square over the minimum's along `b` for one `a`, the four other coordinates at their best: coefficients of
    /// the powers of `b` from zero to four.
    fn row(&self, a: f64) -> [f64; 5] {
        let (s, [c, d], f) = (&self.square, &self.cube, &self.fourth);
        let a2 = a * a;
        [
            a2 * (1.0 + s[0] + a * c[0] + a2 * f[(0, 0)]),
            a * (2.0 * s[1] + a * (2.0 * c[1] + d[0]) + a2 * 4.0 * f[(0, 1)]),
            1.0 + s[2] + a * (c[2] + 2.0 * d[1]) + a2 * (2.0 * f[(0, 2)] + 4.0 * f[(1, 1)]),
            d[2] + a * 4.0 * f[(1, 2)],
            f[(2, 2)],
        ]
    }

    fn nonlinearity(&self) -> f64 {
        (0..16)
            .map(|direction| {
                let (sine, cosine) = (f64::from(direction) * std::f64::consts::TAU / 16.0).sin_cos();
                (along(&self.row(2.0 * cosine), 2.0 * sine) / 4.0 - 1.0).abs()
            })
            .fold(0.0, f64::max)
    }

    /// Second moment of all six coordinates about the minimum, and the mass over the paraboloid's; `None` if there is none.
    fn moments(&self, others: &[Vector2<f64>]) -> Option<(Matrix6<f64>, f64)> {
        let mut half_width = HALF_WIDTH;
        let mut sum = self.sum(half_width, others);
        for _ in 0..WIDENINGS {
            if sum.edge <= EDGE_SHARE * sum.of(0, 0) {
                break;
            }
            half_width *= 2.0;
            sum = self.sum(half_width, others);
        }
        let step = half_width / f64::from(HALF_STEPS);
        let mass = sum.of(0, 0) * step * step / std::f64::consts::TAU;
        if !(mass > 0.0 && mass.is_finite()) {
            return None;
        }
        let mean = |a: usize, b: usize| sum.of(a, b) / sum.of(0, 0);
        let tilt_by_tilt = Matrix2::new(mean(2, 0), mean(1, 1), mean(1, 1), mean(0, 2));
        let tilt_by_product =
            Matrix2x3::new(mean(3, 0), 2.0 * mean(2, 1), mean(1, 2), mean(2, 1), 2.0 * mean(1, 2), mean(0, 3));
        let [aaab, aabb, abbb] = [2.0 * mean(3, 1), mean(2, 2), 2.0 * mean(1, 3)];
        let product_by_product = Matrix3::new(mean(4, 0), aaab, aabb, aaab, 4.0 * aabb, abbb, aabb, abbb, mean(0, 4));
        let (tilt, following) = (&self.tilts, &self.following);
        let mixed = tilt * (tilt_by_product * following.transpose());
        let moment = Matrix6::identity() + tilt * ((tilt_by_tilt - Matrix2::identity()) * tilt.transpose())
            - mixed
            - mixed.transpose()
            + following * (product_by_product * following.transpose());
        Some((moment, mass))
    }

    fn sum(&self, half_width: f64, others: &[Vector2<f64>]) -> Sum {
        let step = half_width / f64::from(HALF_STEPS);
        let mut sum = Sum::default();
        for i in -HALF_STEPS..=HALF_STEPS {
            let a = f64::from(i) * step;
            let row = self.row(a);
            let mut powers = [0.0; 5];
            for j in -HALF_STEPS..=HALF_STEPS {
                let b = f64::from(j) * step;
                // Nearer to another minimum: that one's.
                if others.iter().any(|other| a * other.x + b * other.y > 0.5 * other.norm_squared()) {
                    continue;
                }
                let weight = (-0.5 * along(&row, b)).exp();
                if i.abs() == HALF_STEPS || j.abs() == HALF_STEPS {
                    sum.edge += weight;
                }
                let mut term = weight;
                for power in &mut powers {
                    *power += term;
                    term *= b;
                }
            }
            let mut power = 1.0;
            for by_a in &mut sum.moments {
                by_a.iter_mut().zip(powers).for_each(|(sum, of_row)| *sum += power * of_row);
                power *= a;
            }
        }
        sum
    }
}

/// A polynomial of fourth degree.
fn along(coefficients: &[f64; 5], b: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * b + coefficient)
}

/// Weighted sums over the grid.
#[derive(Default)]
struct Sum {
    edge: f64,
    /// Of the powers of `a`, then of `b`.
    moments: [[f64; 5]; 5],
}

impl Sum {
    const fn of(&self, power_of_a: usize, power_of_b: usize) -> f64 {
        self.moments[power_of_a][power_of_b]
    }
}

/// Whitened directions of the turns about two axes across the line of sight, everything else following; orthonormal.
fn tilts(
    correspondences: &[Correspondence],
    pose: &CameraFromTarget,
    from_whitened: &Matrix6<f64>,
) -> Option<Matrix6x2<f64>> {
    let middle: Vector3<f64> = correspondences.iter().map(|seen| (*pose * seen.point).coords).sum();
    let sight = middle.try_normalize(0.0)?;
    let across = if sight.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let first = sight.cross(&across).try_normalize(0.0)?;
    let second = sight.cross(&first);
    let lifted = |axis: &Vector3<f64>| {
        let turn = Vector6::new(0.0, 0.0, 0.0, axis.x, axis.y, axis.z);
        from_whitened.tr_mul(&turn)
    };
    let first = lifted(&first).try_normalize(0.0)?;
    let second = lifted(&second);
    let second = (second - first * first.dot(&second)).try_normalize(0.0)?;
    Some(Matrix6x2::from_columns(&[first, second]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Point, rotation};
    use crate::random;
    use crate::refine::{RefineOptions, chi_square, refine};
    use crate::scene::cases::seed_camera;

    const POINTS: [[f64; 3]; 6] = [
        [0.31, 0.02, 0.0],
        [-0.12, -0.36, 0.0],
        [-0.2, 0.33, 0.0],
        [-0.38, -0.06, 0.0],
        [0.05, 0.1, 0.0],
        [0.1, -0.3, 0.0],
    ];

    /// A plane tilted by so much at such a distance, and the minimum of its exact image.
    fn seen(tilt_rad: f64, range_m: f64) -> (Camera, Vec<Correspondence>, Refined) {
        let camera = seed_camera();
        let turn = rotation::exp(&Vector3::new(0.8 * tilt_rad, 0.6 * tilt_rad, 0.0));
        let pose = CameraFromTarget::new(turn, Vector3::new(0.05, -0.3, 1.0) * range_m);
        let pair = |p: [f64; 3]| {
            let point = Point::from(p);
            Correspondence { point, pixel: camera.project(&(pose * point)).expect("in view"), sigma_px: 0.5 }
        };
        let seen: Vec<_> = POINTS.into_iter().map(pair).collect();
        let minimum = refine(&camera, &seen, &pose, &RefineOptions::default()).expect("in view");
        (camera, seen, minimum)
    }

    #[test]
    fn a_sharp_minimum_is_a_paraboloid() {
        let (camera, seen, minimum) = seen(0.9, 1.5);
        for scale in [1.0, 3.0] {
            let sharp = posterior(&camera, &seen, &minimum, &[], scale);
            assert!(sharp.nonlinearity < 0.05 * scale, "{}", sharp.nonlinearity);
            assert!(sharp.ln_mass_ratio.abs() < 0.01 * scale, "{}", sharp.ln_mass_ratio);
            let ratio = sharp.covariance.matrix().component_div(minimum.covariance.scaled(scale * scale).matrix());
            assert!(ratio.diagonal().iter().all(|r| (r - 1.0).abs() < 0.02 * scale), "{ratio:.3}");
        }
    }

    #[test]
    fn a_bent_valley_has_the_mass_and_the_moments_of_random_samples_of_it() {
        for (tilt_rad, range_m) in [(0.35, 9.0), (0.5, 14.0)] {
            let (camera, seen, minimum) = seen(tilt_rad, range_m);
            let found = posterior(&camera, &seen, &minimum, &[], 1.0);
            assert!(found.nonlinearity > 0.3, "{}", found.nonlinearity);
            // Importance sampling: a normal density three times as wide as the paraboloid, which holds the mirror image too.
            let width = 3.0;
            let from_whitened = minimum.covariance.matrix().cholesky().expect("positive").l();
            let mut rng = random::named("valley");
            let (mut mass, mut moment, count) = (0.0, Matrix6::zeros(), 500_000);
            for _ in 0..count {
                let z = Vector6::from_fn(|_, _| width * random::normal(&mut rng));
                let step = from_whitened * z;
                let pose = minimum.camera_from_target.perturbed(&step);
                let Some(rise) = chi_square(&camera, &seen, &pose) else { continue };
                let weight = (-0.5 * rise + 0.5 * z.norm_squared() / (width * width)).exp();
                mass += weight;
                moment += step * step.transpose() * weight;
            }
            moment /= mass;
            let ln_mass = (mass * width.powi(6) / f64::from(count)).ln();
            assert!((found.ln_mass_ratio - ln_mass).abs() < 0.15, "{} {ln_mass}", found.ln_mass_ratio);
            // What the expansion leaves out, and chance.
            let ratio = found.covariance.matrix().diagonal().component_div(&moment.diagonal());
            assert!(ratio.iter().all(|r| (0.8..1.25).contains(r)), "{tilt_rad}: {ratio:.3}");
            let widened = moment.diagonal().component_div(&minimum.covariance.matrix().diagonal());
            assert!(widened.max() > 3.0, "the curvature alone would not do: {widened:.3}");
        }
    }

    #[test]
    fn two_valleys_share_their_mass() {
        let (camera, seen, minimum) = seen(0.35, 9.0);
        let sight = minimum.camera_from_target.translation.normalize();
        let normal = minimum.camera_from_target.rotation * Vector3::z();
        let axis = normal.cross(&sight);
        let turn = rotation::exp(&(axis.normalize() * (2.0 * axis.norm().asin())));
        let start =
            CameraFromTarget::new(turn * minimum.camera_from_target.rotation, minimum.camera_from_target.translation);
        let other = refine(&camera, &seen, &start, &RefineOptions::default()).expect("in view");
        let half = |of: &Refined, beside: &Refined| {
            let found = posterior(&camera, &seen, of, &[beside.camera_from_target], 1.0);
            (0.5 * (of.covariance.ln_determinant() - of.chi_square) + found.ln_mass_ratio).exp()
        };
        let halves = half(&minimum, &other) + half(&other, &minimum);
        let whole =
            posterior(&camera, &seen, &minimum, &[], 1.0).ln_mass_ratio + 0.5 * minimum.covariance.ln_determinant();
        assert!((halves.ln() - whole).abs() < 0.15, "{} {whole}", halves.ln());
    }

    #[test]
    fn points_without_an_image_nearby_leave_the_curvature() {
        let (camera, mut seen, minimum) = seen(0.35, 9.0);
        seen[0].point = Point::new(0.0, 0.0, -20.0);
        let found = posterior(&camera, &seen, &minimum, &[], 1.0);
        assert_eq!((found.covariance, found.nonlinearity), (minimum.covariance, f64::INFINITY));
    }
}
