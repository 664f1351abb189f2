//! Pose from n points through virtual control points, in time linear in n.
//!
//! Lepetit, Moreno-Noguer and Fua 2009, "EPnP: an accurate O(n) solution to the PnP problem". Every point is a fixed mix of
//! four control points (three for coplanar points), so the control points in camera space are a mix of the few smallest
//! singular vectors of a linear system. The weights of that mix follow from the known distances between control points: one
//! closed form for each number of vectors, a few Gauss-Newton steps on the distances, and the best by reprojection.

mod weights;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::nearest::nearest;
use super::{Pair, Solutions, SolveError, is_in_front, squared_ray_error};
use crate::geometry::CameraFromTarget;
use crate::target::Spread;
use crate::target::spread::jacobi;

/// Control points in camera space.
type ControlPoints = arrayvec::ArrayVec<Vector3<f64>, 4>;

/// Points flatter than this lie in a plane to rounding; between it and [`Spread::COPLANAR_RATIO`] both models are tried.
const FLAT_RATIO: f64 = 1e-9;

/// The one pose that explains the image best.
///
/// # Errors
/// [`SolveError::Degenerate`] if no mix of the singular vectors has the control points' distances.
pub fn epnp(pairs: &[Pair], spread: &Spread) -> Result<Solutions, SolveError> {
    let error = |pose: &CameraFromTarget| {
        if is_in_front(pairs, pose) { squared_ray_error(pairs, pose) } else { f64::INFINITY }
    };
    let as_plane = spread.is_coplanar().then_some(2);
    let in_space = (spread.plane_ratio() > FLAT_RATIO).then_some(3);
    as_plane
        .into_iter()
        .chain(in_space)
        .flat_map(|dimensions| ControlModel::of(pairs, spread, dimensions).poses(pairs))
        .min_by(|a, b| error(a).total_cmp(&error(b)))
        .map(|pose| [pose].into_iter().collect())
        .ok_or(SolveError::Degenerate { solver: "epnp" })
}

/// `sum weights[k] * vectors[k]`.
fn mix(vectors: &[ControlPoints], weights: &[f64]) -> ControlPoints {
    let mut mixed: ControlPoints = vectors[0].iter().map(|_| Vector3::zeros()).collect();
    for (vector, weight) in vectors.iter().zip(weights) {
        for (sum, part) in mixed.iter_mut().zip(vector) {
            *sum += part * *weight;
        }
    }
    mixed
}

/// The control points of the target and each point as a mix of them.
struct ControlModel {
    control_points: ControlPoints,
    /// For each point its shares of the control points; they sum to one. The fourth is zero for coplanar points.
    shares: Vec<[f64; 4]>,
}

impl ControlModel {
    /// Control points at the centre and one root mean square extent along each principal axis.
    fn of(pairs: &[Pair], spread: &Spread, dimensions: usize) -> Self {
        let mut control_points = ControlPoints::new();
        control_points.push(spread.centre);
        for axis in 0..dimensions {
            control_points.push(spread.centre + spread.axes.column(axis) * spread.rms_m[axis]);
        }
        let shares = pairs
            .iter()
            .map(|pair| {
                let local = spread.local(&pair.point);
                let mut shares = [0.0; 4];
                for axis in 0..dimensions {
                    shares[axis + 1] = local[axis] / spread.rms_m[axis];
                }
                shares[0] = 1.0 - shares[1] - shares[2] - shares[3];
                shares
            })
            .collect();
        Self { control_points, shares }
    }

    /// One pose for each number of singular vectors assumed.
    fn poses(&self, pairs: &[Pair]) -> Vec<CameraFromTarget> {
        let vectors = self.null_vectors(pairs);
        if vectors.is_empty() {
            return Vec::new();
        }
        weights::candidates(&vectors, &self.control_points)
            .into_iter()
            .filter_map(|weights| self.pose(pairs, &mix(&vectors, weights.as_slice())))
            .collect()
    }

    /// Four mixes of control points in camera space (two for coplanar points) that explain the rays best, the best first.
    fn null_vectors(&self, pairs: &[Pair]) -> Vec<ControlPoints> {
        if self.control_points.len() == 4 { self.best_mixes::<4>(pairs, 4) } else { self.best_mixes::<3>(pairs, 2) }
    }

    /// The linear system is `sum_j share_j x_j = u sum_j share_j z_j`, and the same with `y` and `v`. In terms of the first
    /// control point and the sides `x_j - x_0` the coefficients are the columns of `p = (1, share_1, ...)`, which are
    /// orthogonal and of one length, since the control points stand on the principal axes. So the rows of `x` and `y` follow
    /// from that of `z` as `M_u z` with `M_u` the mean of `u p p'`, and what is left for `z` are the rows `u p' - p' M_u`.
    fn best_mixes<const N: usize>(&self, pairs: &[Pair], kept: usize) -> Vec<ControlPoints> {
        let of_point = |shares: &[f64; 4]| SVector::<f64, N>::from_fn(|j, _| if j == 0 { 1.0 } else { shares[j] });
        let (mut by_u, mut by_v) = (SMatrix::<f64, N, N>::zeros(), SMatrix::<f64, N, N>::zeros());
        for (pair, shares) in pairs.iter().zip(&self.shares) {
            let p = of_point(shares);
            let outer = p * p.transpose();
            by_u += outer * pair.ray.x;
            by_v += outer * pair.ray.y;
        }
        let count = pairs.len() as f64;
        (by_u, by_v) = (by_u / count, by_v / count);
        let gram = |axes: &SMatrix<f64, N, N>| {
            let mut gram = SMatrix::<f64, N, N>::zeros();
            for (pair, shares) in pairs.iter().zip(&self.shares) {
                let p = of_point(shares);
                for row in [p * pair.ray.x - by_u * p, p * pair.ray.y - by_v * p] {
                    let row = axes.tr_mul(&row);
                    gram += row * row.transpose();
                }
            }
            gram
        };
        // In the paper all control points together have the length one, not the rows `z` alone.
        let of_ends = SMatrix::<f64, N, N>::from_fn(|j, k| match (j, k) {
            (0, 0) => N as f64,
            _ if j == k || j == 0 || k == 0 => 1.0,
            _ => 0.0,
        });
        let length = of_ends + by_u.tr_mul(&(of_ends * by_u)) + by_v.tr_mul(&(of_ends * by_v));
        let Some(unit) = length.cholesky().and_then(|c| c.l().tr_solve_lower_triangular(&SMatrix::identity())) else {
            return Vec::new();
        };
        // Taken again along its own axes the matrix keeps the digits that squaring would lose.
        let first = unit * jacobi::eigenvectors(&gram(&unit)).0;
        let (turn, values) = jacobi::eigenvectors(&gram(&first));
        let vectors = first * turn;
        let mut order: [usize; N] = std::array::from_fn(|k| k);
        order.sort_by(|&a, &b| values[(a, a)].total_cmp(&values[(b, b)]));
        order[..kept]
            .iter()
            .map(|&k| {
                let z = vectors.column(k);
                let (x, y) = (by_u * z, by_v * z);
                let at = |j: usize| Vector3::new(x[j], y[j], z[j]);
                (0..N).map(|j| if j == 0 { at(0) } else { at(0) + at(j) }).collect()
            })
            .collect()
    }

    /// The rigid motion onto the points that these control points in camera space stand for (Horn 1987).
    fn pose(&self, pairs: &[Pair], control_points: &ControlPoints) -> Option<CameraFromTarget> {
        let in_camera = |shares: &[f64; 4]| {
            control_points.iter().zip(shares).map(|(point, share)| point * *share).sum::<Vector3<f64>>()
        };
        // The mix is known up to sign: points stand in front of the camera.
        let depth: f64 = self.shares.iter().map(|shares| in_camera(shares).z).sum();
        let sign = if depth < 0.0 { -1.0 } else { 1.0 };
        let count = pairs.len() as f64;
        let camera_centre = self.shares.iter().map(in_camera).sum::<Vector3<f64>>() * sign / count;
        let target_centre = self.control_points[0];
        let correlation: Matrix3<f64> = pairs
            .iter()
            .zip(&self.shares)
            .map(|(pair, shares)| {
                (in_camera(shares) * sign - camera_centre) * (pair.point.coords - target_centre).transpose()
            })
            .sum();
        let rotation = nearest(&correlation)?;
        let pose = CameraFromTarget::new(rotation, camera_centre - rotation * target_centre);
        pose.is_finite().then_some(pose)
    }
}
