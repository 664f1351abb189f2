//! Pose from orthography and scaling with iterations.
//!
//! A scaled orthographic image has a linear pose; the perspective image is corrected towards it with the depths of the last
//! pose, and so on. DeMenthon and Davis 1995, "Model-based object pose in 25 lines of code"; for coplanar points, where each
//! step has two solutions, Oberkampf, DeMenthon and Davis 1996, "Iterative pose estimation using coplanar feature points".
//!
//! The iteration contracts only where the object is small against its distance; where it does not, that is reported.

use arrayvec::ArrayVec;
use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};

use super::nearest::nearest;
use super::{Pair, Solutions, SolveError, is_in_front, squared_ray_error};
use crate::geometry::CameraFromTarget;
use crate::target::Spread;

const MAX_ITERATIONS: usize = 1000;
/// Change of a relative depth at which the iteration has settled.
const SETTLED: f64 = 1e-13;

/// The poses on which the iteration settles: one for points in space, one or two for coplanar ones, the better first.
///
/// # Errors
/// [`SolveError::NotConverged`] if no branch settles in front of the camera, [`SolveError::Degenerate`] if the first step
/// already has no solution.
pub fn posit(pairs: &[Pair], spread: &Spread) -> Result<Solutions, SolveError> {
    let model = Model::of(pairs, spread).ok_or(SolveError::Degenerate { solver: "posit" })?;
    let flat = vec![0.0; pairs.len()];
    let starts = model.steps(&flat);
    let mut found: Solutions = starts.into_iter().filter_map(|start| model.settle(start)).collect();
    found.sort_by(|a, b| squared_ray_error(pairs, a).total_cmp(&squared_ray_error(pairs, b)));
    if found.len() == 2 && found[0].difference_to(&found[1]).norm() < 1e-6 * found[0].translation.norm() {
        found.pop();
    }
    if found.is_empty() {
        return Err(SolveError::NotConverged { solver: "posit", iterations: MAX_ITERATIONS });
    }
    Ok(found)
}

/// The object seen from its first point, in its principal axes, with the pseudoinverse of its shape.
struct Model<'a> {
    pairs: &'a [Pair],
    axes: Matrix3<f64>,
    /// Offsets from the first point along the axes.
    offsets: Vec<Vector3<f64>>,
    /// Columns of the pseudoinverse of the matrix of offsets.
    pseudoinverse: Vec<Vector3<f64>>,
    coplanar: bool,
}

impl<'a> Model<'a> {
    fn of(pairs: &'a [Pair], spread: &Spread) -> Option<Self> {
        let origin = pairs.first()?.point.coords;
        let coplanar = spread.is_coplanar();
        let offsets: Vec<_> = pairs.iter().map(|pair| spread.axes.tr_mul(&(pair.point.coords - origin))).collect();
        let scatter: Matrix3<f64> = offsets.iter().map(|o| o * o.transpose()).sum();
        let inverse = if coplanar {
            let in_plane: Matrix2<f64> = scatter.fixed_view::<2, 2>(0, 0).into_owned();
            let mut inverse = Matrix3::zeros();
            inverse.fixed_view_mut::<2, 2>(0, 0).copy_from(&in_plane.try_inverse()?);
            inverse
        } else {
            scatter.try_inverse()?
        };
        let pseudoinverse = offsets.iter().map(|o| inverse * o).collect();
        Some(Self { pairs, axes: spread.axes, offsets, pseudoinverse, coplanar })
    }

    /// The poses whose scaled orthographic image is the perspective one corrected by the relative depths `depths`.
    fn steps(&self, depths: &[f64]) -> ArrayVec<CameraFromTarget, 2> {
        let first = self.pairs[0].ray;
        let (mut i, mut j) = (Vector3::zeros(), Vector3::zeros());
        for ((pair, column), depth) in self.pairs.iter().zip(&self.pseudoinverse).zip(depths) {
            let shift: Vector2<f64> = pair.ray * (1.0 + depth) - first;
            i += column * shift.x;
            j += column * shift.y;
        }
        if !self.coplanar {
            return self.pose(i, j).into_iter().collect();
        }
        // i + l u and j + m u are to be orthogonal and of one length, u the plane's normal:
        // l m = -i.j and l^2 - m^2 = j.j - i.i, that is (l + m sqrt(-1))^2 = (j.j - i.i) - 2 i.j sqrt(-1).
        let (real, imaginary) = (j.norm_squared() - i.norm_squared(), -2.0 * i.dot(&j));
        let modulus = real.hypot(imaginary).sqrt();
        let half_angle = 0.5 * imaginary.atan2(real);
        let (l, m) = (modulus * half_angle.cos(), modulus * half_angle.sin());
        let normal = Vector3::z();
        [1.0, -1.0].into_iter().filter_map(|sign| self.pose(i + normal * (sign * l), j + normal * (sign * m))).collect()
    }

    fn pose(&self, i: Vector3<f64>, j: Vector3<f64>) -> Option<CameraFromTarget> {
        let inverse_depth = (i.norm() * j.norm()).sqrt();
        let (i, j) = (i.try_normalize(0.0)?, j.try_normalize(0.0)?);
        let rows = Matrix3::from_rows(&[i.transpose(), j.transpose(), i.cross(&j).transpose()]);
        let camera_from_axes: Rotation3<f64> = nearest(&rows)?;
        let turn = camera_from_axes * Rotation3::from_matrix_unchecked(self.axes.transpose());
        let first = self.pairs[0];
        let first_in_camera = Vector3::new(first.ray.x, first.ray.y, 1.0) / inverse_depth;
        let pose = CameraFromTarget::new(turn, first_in_camera - turn * first.point.coords);
        pose.is_finite().then_some(pose)
    }

    /// Iterates from `pose`, the better of the two solutions at each step, until the relative depths stand still.
    fn settle(&self, mut pose: CameraFromTarget) -> Option<CameraFromTarget> {
        let mut depths = vec![0.0; self.pairs.len()];
        for _ in 0..MAX_ITERATIONS {
            if !is_in_front(self.pairs, &pose) {
                return None;
            }
            let change = self.update_depths(&pose, &mut depths);
            if change < SETTLED {
                return Some(pose);
            }
            let error = |candidate: &CameraFromTarget| {
                if is_in_front(self.pairs, candidate) {
                    squared_ray_error(self.pairs, candidate)
                } else {
                    f64::INFINITY
                }
            };
            pose = self.steps(&depths).into_iter().min_by(|a, b| error(a).total_cmp(&error(b)))?;
        }
        None
    }

    /// Depths relative to the first point's; returns the largest change.
    fn update_depths(&self, pose: &CameraFromTarget, depths: &mut [f64]) -> f64 {
        let axis = self.axes.tr_mul(&pose.rotation.matrix().row(2).transpose());
        let first_depth = (*pose * self.pairs[0].point).coords.z;
        let mut change = 0.0_f64;
        for (depth, offset) in depths.iter_mut().zip(&self.offsets) {
            let next = axis.dot(offset) / first_depth;
            change = change.max((next - *depth).abs());
            *depth = next;
        }
        change
    }
}
