//! Least squares over all rotations, any layout of the points, without a start to be given.
//!
//! Terzakis and Lourakis 2020, "A consistently fast and globally optimal solution to the perspective-n-point problem". With
//! the translation eliminated, the sum of squared distances between points and rays (each weighed by its depth) is a
//! quadratic form in the nine entries of the rotation. Its eigenvectors of smallest values, turned into rotations, are
//! starts from which sequential quadratic programming finds the local minima; eigenvalues bound what the other starts could
//! still bring.

use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, SymmetricEigen, Vector3};

use super::nearest::nearest;
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

/// Turns below this are followed by Newton's steps, rad.
const NEAR_RAD: f64 = 0.1;

/// A Newton step smaller than this is the last: the next would be its square.
const NEWTON_LIMIT: f64 = 1e-7;

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

/// Sign and place among 1, x, y, x^2 + y^2 of the entries of `q`, with which `p' q p` is the squared distance of a point from
/// the ray `(x, y, 1)` across the axis, weighed by the square of its depth.
const ENTRIES: [[Option<(f64, usize)>; 3]; 3] = [
    [Some((1.0, 0)), None, Some((-1.0, 1))],
    [None, Some((1.0, 0)), Some((-1.0, 2))],
    [Some((-1.0, 1)), Some((-1.0, 2)), Some((1.0, 3))],
];

/// The quadratic form, and the translation that goes with a rotation.
struct Form {
    omega: Matrix9,
    translation_from_rotation: SMatrix<f64, 3, 9>,
    centre: Vector3<f64>,
}

impl Form {
    fn of(pairs: &[Pair], spread: &Spread) -> Option<Self> {
        // Points about their centre keep the form well scaled. Every sum is of a product of the point's coordinates times one of
        // 1, x, y, x^2 + y^2, the entries of what takes a point's square distance from its ray.
        let centre = spread.centre;
        let mut squares = [[0.0; 6]; 4];
        let mut firsts = [Vector3::zeros(); 4];
        let mut sums = [0.0; 4];
        for pair in pairs {
            let p = pair.point.coords - centre;
            let (x, y) = (pair.ray.x, pair.ray.y);
            let products = [p.x * p.x, p.x * p.y, p.x * p.z, p.y * p.y, p.y * p.z, p.z * p.z];
            for (k, weight) in [1.0, x, y, x * x + y * y].into_iter().enumerate() {
                for (sum, product) in squares[k].iter_mut().zip(products) {
                    *sum += weight * product;
                }
                firsts[k] += p * weight;
                sums[k] += weight;
            }
        }
        let squares = squares.map(|[xx, xy, xz, yy, yz, zz]| Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz));
        let mut omega = Matrix9::zeros();
        let mut q_a = SMatrix::<f64, 3, 9>::zeros();
        let mut sum_q = Matrix3::zeros();
        for row in 0..3 {
            for column in 0..3 {
                let Some((sign, k)) = ENTRIES[row][column] else { continue };
                omega.fixed_view_mut::<3, 3>(3 * row, 3 * column).copy_from(&(squares[k] * sign));
                q_a.fixed_view_mut::<1, 3>(row, 3 * column).copy_from(&(firsts[k] * sign).transpose());
                sum_q[(row, column)] = sums[k] * sign;
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

    /// The minimum downhill of the rotation nearest to `start`: Gauss-Newton steps on the rotations until they are small, then
    /// Newton's where the curvature is that of a minimum.
    ///
    /// With `G` the gradient by the entries of `R` and `M = G R'`, the form rises along the turn `w` as
    /// `2 (m . w) + w' (F + (M + M') / 2 - tr(M)) w`, where `m` is the axial vector of `M` and `F` the form's own curvature.
    fn descend(&self, start: &Matrix3<f64>) -> Option<Minimum> {
        let mut rotation = nearest(start)?;
        let mut is_settled = false;
        let mut is_near = false;
        for _ in 0..MAX_STEPS {
            let r = rotation.matrix();
            let rows = [0, 1, 2].map(|row| Vector3::new(r[(row, 0)], r[(row, 1)], r[(row, 2)]));
            let [x, y, z] = rows;
            let none = Vector3::zeros();
            let free = SMatrix::<f64, 9, 3>::from_columns(&[
                stacked(&none, &-z, &y),
                stacked(&z, &none, &-x),
                stacked(&-y, &x, &none),
            ]);
            let gradient = unflat(&(self.omega * flat(r)));
            let m = gradient * r.transpose();
            let slope = Vector3::new(m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)]);
            let form = free.tr_mul(&(self.omega * free));
            let bent = form + (m + m.transpose()) * 0.5 - Matrix3::identity() * m.trace();
            let newton = if is_near { bent.cholesky() } else { None };
            let is_newton = newton.is_some();
            let turn = newton.or_else(|| form.cholesky())?.solve(&-slope);
            rotation = rotation::exp(&turn) * rotation;
            let length = turn.norm();
            is_near = length < NEAR_RAD;
            is_settled = length < if is_newton { NEWTON_LIMIT } else { STEP_LIMIT };
            if is_settled {
                break;
            }
        }
        let pose = self.pose(rotation);
        pose.is_finite().then(|| Minimum { cost: self.cost(&flat(rotation.matrix())), pose, is_settled })
    }
}

fn stacked(a: &Vector3<f64>, b: &Vector3<f64>, c: &Vector3<f64>) -> Vector9 {
    Vector9::from_column_slice(&[a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z])
}

/// The entries row by row.
fn flat(m: &Matrix3<f64>) -> Vector9 {
    Vector9::from_fn(|i, _| m[(i / 3, i % 3)])
}

fn unflat(v: &Vector9) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| v[3 * row + column])
}
