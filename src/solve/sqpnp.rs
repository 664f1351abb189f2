//! Least squares over all rotations, any layout of the points, without a start to be given.
//!
//! Terzakis and Lourakis 2020, "A consistently fast and globally optimal solution to the perspective-n-point problem". With
//! the translation eliminated, the sum of squared distances between points and rays (each weighed by its depth) is a
//! quadratic form in the nine entries of the rotation. Its eigenvectors of smallest values, turned into rotations, are
//! starts from which sequential quadratic programming finds the local minima; eigenvalues bound what the other starts could
//! still bring.

use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, SymmetricEigen, Vector3};

use super::{Pair, Solutions, SolveError, is_in_front};
use crate::geometry::{CameraFromTarget, rotation};
use crate::target::Spread;

type Matrix9 = SMatrix<f64, 9, 9>;
type Vector9 = SVector<f64, 9>;

/// Eigenvalues below this share of the largest belong to the null space: rounding, not noise.
const NULL_RATIO: f64 = 1e-7;

/// Steps from one start; six are usual.
const MAX_STEPS: usize = 30;

/// A step smaller than this ends the search.
const STEP_LIMIT: f64 = 1e-11;

/// Minima closer than this are one, rad.
const SAME_WITHIN_RAD: f64 = 1e-5;

/// The local minima, least first; the first is the global one.
///
/// # Errors
/// [`SolveError::Degenerate`] if the rays do not fix a translation or no search ends in a minimum, and
/// [`SolveError::BehindCamera`] if all minima lie behind the camera.
pub fn sqpnp(pairs: &[Pair], spread: &Spread) -> Result<Solutions, SolveError> {
    let degenerate = SolveError::Degenerate { solver: "sqpnp" };
    let form = Form::of(pairs, spread).ok_or_else(|| degenerate.clone())?;
    let mut minima = form.minima(|pose| is_in_front(pairs, pose));
    if minima.is_empty() {
        return Err(if form.minima(|_| true).is_empty() {
            degenerate
        } else {
            SolveError::BehindCamera { solver: "sqpnp" }
        });
    }
    minima.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let settled = minima.iter().enumerate().filter(|(rank, minimum)| *rank == 0 || minimum.is_settled);
    Ok(settled.map(|(_, minimum)| minimum.pose).take(4).collect())
}

/// Where a search ended.
struct Minimum {
    cost: f64,
    pose: CameraFromTarget,
    /// The last step was no step; otherwise the search ran out of steps, and its end is as good as its cost.
    is_settled: bool,
}

/// The quadratic form, and the translation that goes with a rotation.
struct Form {
    omega: Matrix9,
    translation_from_rotation: SMatrix<f64, 3, 9>,
    centre: Vector3<f64>,
}

impl Form {
    fn of(pairs: &[Pair], spread: &Spread) -> Option<Self> {
        // Points about their centre, in units of their extent, keep the form well scaled.
        let centre = spread.centre;
        let mut sum_q = Matrix3::zeros();
        let mut q_a = SMatrix::<f64, 3, 9>::zeros();
        let mut omega = Matrix9::zeros();
        for pair in pairs {
            let p = pair.point.coords - centre;
            let (x, y) = (pair.ray.x, pair.ray.y);
            let q = Matrix3::new(1.0, 0.0, -x, 0.0, 1.0, -y, -x, -y, x * x + y * y);
            let outer = p * p.transpose();
            sum_q += q;
            for row in 0..3 {
                for column in 0..3 {
                    let mut block = q_a.fixed_view_mut::<1, 3>(row, 3 * column);
                    block += q[(row, column)] * p.transpose();
                    let mut block = omega.fixed_view_mut::<3, 3>(3 * row, 3 * column);
                    block += q[(row, column)] * outer;
                }
            }
        }
        let translation_from_rotation = -(sum_q.cholesky()?.solve(&q_a));
        omega += q_a.tr_mul(&translation_from_rotation);
        omega = (omega + omega.transpose()) * 0.5;
        Some(Self { omega, translation_from_rotation, centre })
    }

    fn cost(&self, r: &Vector9) -> f64 {
        r.dot(&(self.omega * r))
    }

    fn pose(&self, rotation: Rotation3<f64>) -> CameraFromTarget {
        let centre_in_camera = self.translation_from_rotation * flat(rotation.matrix());
        CameraFromTarget::new(rotation, centre_in_camera - rotation * self.centre)
    }

    /// All different local minima that are `wanted`, with their costs.
    fn minima(&self, wanted: impl Fn(&CameraFromTarget) -> bool) -> Vec<Minimum> {
        let eigen = SymmetricEigen::new(self.omega);
        let mut order: [usize; 9] = std::array::from_fn(|i| i);
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let largest = eigen.eigenvalues[order[8]];
        let mut found: Vec<Minimum> = Vec::new();
        for (place, &k) in order.iter().enumerate() {
            let value = eigen.eigenvalues[k];
            // Beyond the null space, a start whose bound is above what is found cannot lead to less.
            let least = found.iter().map(|minimum| minimum.cost).fold(f64::INFINITY, f64::min);
            if place > 0 && value > NULL_RATIO * largest && 3.0 * value > least {
                break;
            }
            let vector: Vector9 = eigen.eigenvectors.column(k).into();
            for sign in [1.0, -1.0] {
                let Some(minimum) = self.descend(&unflat(&(vector * sign))) else { continue };
                let known = |other: &Minimum| {
                    rotation::angle_between_rad(&other.pose.rotation, &minimum.pose.rotation) < SAME_WITHIN_RAD
                };
                if wanted(&minimum.pose) && !found.iter().any(known) {
                    found.push(minimum);
                }
            }
        }
        found
    }

    /// Sequential quadratic programming from the rotation nearest to `start`.
    ///
    /// A step D keeps the rows orthonormal to first order where `R D^T + D R^T = I - R R^T`: all solutions are
    /// `D = ((I - R R^T) / 2 + S) R^-T` with S skew, so three unknowns are left.
    fn descend(&self, start: &Matrix3<f64>) -> Option<Minimum> {
        let mut r: Matrix3<f64> = *rotation::nearest(start)?.matrix();
        let mut is_settled = false;
        for _ in 0..MAX_STEPS {
            let inverse_transposed = r.transpose().try_inverse()?;
            let towards = (Matrix3::identity() - r * r.transpose()) * 0.5 * inverse_transposed;
            let free: [Vector9; 3] = [Vector3::<f64>::x(), Vector3::y(), Vector3::z()]
                .map(|axis| flat(&(axis.cross_matrix() * inverse_transposed)));
            let free = SMatrix::<f64, 9, 3>::from_columns(&free);
            let curvature = free.tr_mul(&(self.omega * free));
            let slope = free.tr_mul(&(self.omega * flat(&(r + towards))));
            let turn = curvature.lu().solve(&-slope)?;
            let step = towards + unflat(&(free * turn));
            r += step;
            is_settled = step.norm_squared() < STEP_LIMIT * STEP_LIMIT;
            if is_settled {
                break;
            }
        }
        let rotation = rotation::nearest(&r)?;
        Some(Minimum { cost: self.cost(&flat(rotation.matrix())), pose: self.pose(rotation), is_settled })
    }
}

/// The entries row by row.
fn flat(m: &Matrix3<f64>) -> Vector9 {
    Vector9::from_fn(|i, _| m[(i / 3, i % 3)])
}

fn unflat(v: &Vector9) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| v[3 * row + column])
}
