//! Pose from n points through virtual control points, in time linear in n.
//!
//! Lepetit, Moreno-Noguer and Fua 2009, "EPnP: an accurate O(n) solution to the PnP problem". Every point is a fixed mix of
//! four control points (three for coplanar points), so the control points in camera space are a mix of the few smallest
//! singular vectors of a linear system. The weights of that mix follow from the known distances between control points: one
//! closed form for each number of vectors, a few Gauss-Newton steps on the distances, and the best by reprojection.

mod weights;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::{Pair, Solutions, SolveError, is_in_front, squared_ray_error};
use crate::geometry::{CameraFromTarget, rotation};
use crate::target::Spread;

/// Up to this many points the linear system is factored itself, beyond it its normal matrix.
const EXACT_POINTS: usize = 32;

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
        weights::candidates(&vectors, &self.control_points)
            .into_iter()
            .filter_map(|weights| self.pose(pairs, &mix(&vectors, &weights)))
            .collect()
    }

    /// The singular vectors of the four smallest singular values (two for coplanar points), smallest first, of the linear
    /// system `sum_j share_j (x_j - u z_j) = 0`, `sum_j share_j (y_j - v z_j) = 0`.
    fn null_vectors(&self, pairs: &[Pair]) -> Vec<ControlPoints> {
        let m = self.control_points.len();
        let (values, vectors) =
            if pairs.len() <= EXACT_POINTS { self.singular_vectors(pairs) } else { self.eigenvectors(pairs) };
        let mut order: Vec<usize> = (0..3 * m).collect();
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        let kept = if m == 4 { 4 } else { 2 };
        order[..kept]
            .iter()
            .map(|&k| (0..m).map(|j| Vector3::from_fn(|axis, _| vectors[(3 * j + axis, k)])).collect())
            .collect()
    }

    /// By the system's triangular factor: exact to rounding also where few points leave it ill-conditioned.
    fn singular_vectors(&self, pairs: &[Pair]) -> (DVector<f64>, DMatrix<f64>) {
        let m = self.control_points.len();
        let mut rows = DMatrix::zeros((2 * pairs.len()).max(3 * m), 3 * m);
        for (i, (pair, shares)) in pairs.iter().zip(&self.shares).enumerate() {
            for (j, share) in shares[..m].iter().enumerate() {
                rows[(2 * i, 3 * j)] = *share;
                rows[(2 * i, 3 * j + 2)] = -pair.ray.x * share;
                rows[(2 * i + 1, 3 * j + 1)] = *share;
                rows[(2 * i + 1, 3 * j + 2)] = -pair.ray.y * share;
            }
        }
        let svd = rows.qr().r().svd(false, true);
        let vectors = svd.v_t.map_or_else(|| DMatrix::identity(3 * m, 3 * m), |v_t| v_t.transpose());
        (svd.singular_values, vectors)
    }

    /// By the normal matrix: half the digits, but each of many points costs only ten times four sums.
    fn eigenvectors(&self, pairs: &[Pair]) -> (DVector<f64>, DMatrix<f64>) {
        let m = self.control_points.len();
        // Every 3 x 3 block of the normal matrix needs four sums only.
        let mut sums = [[[0.0_f64; 4]; 4]; 4];
        for (pair, shares) in pairs.iter().zip(&self.shares) {
            let (u, v) = (pair.ray.x, pair.ray.y);
            for j in 0..m {
                for k in j..m {
                    let weight = shares[j] * shares[k];
                    for (sum, value) in sums[j][k].iter_mut().zip([1.0, u, v, u * u + v * v]) {
                        *sum += weight * value;
                    }
                }
            }
        }
        let normal = DMatrix::from_fn(3 * m, 3 * m, |row, column| {
            let (j, k) = (row / 3, column / 3);
            let [one, u, v, square] = if j <= k { sums[j][k] } else { sums[k][j] };
            match (row % 3, column % 3) {
                (0, 0) | (1, 1) => one,
                (0, 2) | (2, 0) => -u,
                (1, 2) | (2, 1) => -v,
                (2, 2) => square,
                _ => 0.0,
            }
        });
        let eigen = normal.symmetric_eigen();
        (eigen.eigenvalues, eigen.eigenvectors)
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
        let rotation = rotation::nearest(&correlation)?;
        let pose = CameraFromTarget::new(rotation, camera_centre - rotation * target_centre);
        pose.is_finite().then_some(pose)
    }
}
