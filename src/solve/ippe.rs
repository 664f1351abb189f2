//! Both poses of a plane in closed form.
//!
//! Collins and Bartoli 2014, "Infinitesimal plane-based pose estimation": the homography's value and first derivative at
//! the middle of the plane fix the plane's rotation up to a two-fold choice, which is the flip that a small or distant
//! plane really has.

use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};

use super::homography::direct_linear_transform;
use super::nearest::nearest;
use super::{Pair, Solutions, SolveError, squared_ray_error};
use crate::geometry::{CameraFromTarget, rotation};
use crate::target::Spread;

/// The two poses of four or more coplanar points, the one that explains their image better first; one where they coincide (a plane seen exactly face on).
///
/// # Errors
/// [`SolveError::Degenerate`] if the points do not fix a homography.
pub fn ippe(pairs: &[Pair], spread: &Spread) -> Result<Solutions, SolveError> {
    direct_linear_transform(pairs, spread)
        .and_then(|h| poses_of(&h, pairs, spread))
        .map(|mut poses| {
            poses.sort_by(|a, b| squared_ray_error(pairs, a).total_cmp(&squared_ray_error(pairs, b)));
            poses
        })
        .ok_or(SolveError::Degenerate { solver: "ippe" })
}

fn poses_of(image_from_plane: &Matrix3<f64>, pairs: &[Pair], spread: &Spread) -> Option<Solutions> {
    let h = image_from_plane / image_from_plane[(2, 2)];
    // Image of the plane's middle, and how the image moves as the plane's point moves away from it.
    let middle = Vector2::new(h[(0, 2)], h[(1, 2)]);
    let slope = Matrix2::new(
        h[(0, 0)] - h[(2, 0)] * middle.x,
        h[(0, 1)] - h[(2, 1)] * middle.x,
        h[(1, 0)] - h[(2, 0)] * middle.y,
        h[(1, 1)] - h[(2, 1)] * middle.y,
    );
    let ray = Vector3::new(middle.x, middle.y, 1.0);
    // The optical axis turned onto the ray; the ray lies in front, so the turn is below a right angle.
    let ray_from_axis = Rotation3::rotation_between(&Vector3::z(), &ray)?;
    let r = ray_from_axis.matrix();
    let across = Matrix2::new(
        r[(0, 0)] - middle.x * r[(2, 0)],
        r[(0, 1)] - middle.x * r[(2, 1)],
        r[(1, 0)] - middle.y * r[(2, 0)],
        r[(1, 1)] - middle.y * r[(2, 1)],
    );
    let scaled = across.try_inverse()? * slope;
    // Inverse depth of the middle is the largest singular value: no column of a rotation's corner is longer than one.
    let (mean, half) = {
        let m = scaled.transpose() * scaled;
        (0.5 * m.trace(), (0.5 * (m[(0, 0)] - m[(1, 1)])).hypot(m[(0, 1)]))
    };
    let inverse_depth = (mean + half).sqrt();
    if !(inverse_depth.is_finite() && inverse_depth > 0.0) {
        return None;
    }
    let corner = scaled / inverse_depth;
    // What the corner lacks to orthonormal columns is the third row, up to one common sign.
    let lack = Matrix2::identity() - corner.transpose() * corner;
    let below_x = lack[(0, 0)].max(0.0).sqrt();
    let below_y = lack[(1, 1)].max(0.0).sqrt().copysign(lack[(0, 1)]);
    let solutions = [1.0, -1.0].into_iter().filter_map(|sign| {
        let x = Vector3::new(corner[(0, 0)], corner[(1, 0)], sign * below_x);
        let y = Vector3::new(corner[(0, 1)], corner[(1, 1)], sign * below_y);
        let axis_from_plane = Matrix3::from_columns(&[x, y, x.cross(&y)]);
        let rotation = nearest(&(r * axis_from_plane * spread.axes.transpose()))?;
        Some(CameraFromTarget::new(rotation, best_translation(pairs, &rotation)?))
    });
    let mut found: Solutions = solutions.collect();
    if found.len() == 2 && rotation::angle_between_rad(&found[0].rotation, &found[1].rotation) < 1e-9 {
        found.pop();
    }
    (!found.is_empty()).then_some(found)
}

/// The translation that solves `(x z, y z) = ray * z` for all points in the least squares sense, the rotation given.
#[must_use]
pub fn best_translation(pairs: &[Pair], rotation: &Rotation3<f64>) -> Option<Vector3<f64>> {
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for pair in pairs {
        let p = rotation * pair.point.coords;
        for (row, known) in [
            (Vector3::new(1.0, 0.0, -pair.ray.x), pair.ray.x * p.z - p.x),
            (Vector3::new(0.0, 1.0, -pair.ray.y), pair.ray.y * p.z - p.y),
        ] {
            normal += row * row.transpose();
            right += row * known;
        }
    }
    normal.cholesky().map(|c| c.solve(&right))
}
