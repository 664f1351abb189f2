//! Pose of a plane from its homography.
//!
//! Direct linear transform with normalized coordinates: Hartley 1997, "In defense of the eight-point algorithm", with the first
//! two rows eliminated: Harker and O'Leary 2005, "Computation of homographies". Pose from the homography: Sturm 2000,
//! "Algorithms for plane-based pose estimation"; Zhang 2000.
//!
//! The seed's eq. 4.10 puts `h1 x h2` where the translation belongs and scales the two columns each by its own length; here
//! the third column is the translation, both columns share one scale, and the matrix is projected onto SO(3).

use nalgebra::{Matrix3, Matrix3x2, Vector2, Vector3};

use super::nearest::nearest;
use super::{Pair, Solutions, SolveError};
use crate::geometry::CameraFromTarget;
use crate::target::Spread;
use crate::target::spread::jacobi;

/// The one pose of four or more coplanar points that the homography between plane and image gives.
///
/// # Errors
/// [`SolveError::Degenerate`] if the points do not fix a homography, as when all but one lie on a line.
pub fn homography(pairs: &[Pair], spread: &Spread) -> Result<Solutions, SolveError> {
    let degenerate = SolveError::Degenerate { solver: "homography" };
    let image_from_plane = direct_linear_transform(pairs, spread).ok_or_else(|| degenerate.clone())?;
    let pose = pose_of(&image_from_plane, spread).ok_or(degenerate)?;
    Ok([pose].into_iter().collect())
}

/// The 3 x 3 homography that takes the plane through `spread.centre` along its first two axes to the image, in the least
/// algebraic error over normalized coordinates; of unit norm and unknown sign. `None` if it is not determined.
#[must_use]
pub fn direct_linear_transform(pairs: &[Pair], spread: &Spread) -> Option<Matrix3<f64>> {
    let to = Normalization::of(pairs)?;
    // Along the principal axes in units of the extents the columns x, y, 1 are orthogonal and of one length.
    let units = Vector2::new(spread.rms_m.x, spread.rms_m.y);
    let normalized = |pair: &Pair| {
        let plane = spread.local(&pair.point).xy().component_div(&units);
        (Vector3::new(plane.x, plane.y, 1.0), to.apply(&pair.ray))
    };
    // With p = (x, y, 1) the equations are h1.p = u h3.p and h2.p = v h3.p, so h1 = M_u h3 with M_u the mean of u p p'; what is
    // left for h3 are the rows u p' - p' M_u, and the same with v.
    let (mut by_u, mut by_v) = (Matrix3::zeros(), Matrix3::zeros());
    for pair in pairs {
        let (p, q) = normalized(pair);
        let outer = p * p.transpose();
        by_u += outer * q.x;
        by_v += outer * q.y;
    }
    let count = pairs.len() as f64;
    (by_u, by_v) = (by_u / count, by_v / count);
    let gram = |axes: &Matrix3<f64>| {
        let mut gram = Matrix3::zeros();
        for pair in pairs {
            let (p, q) = normalized(pair);
            for (coordinate, moments) in [(q.x, &by_u), (q.y, &by_v)] {
                let row = axes.tr_mul(&(p * coordinate - moments * p));
                gram += row * row.transpose();
            }
        }
        gram / count
    };
    // Taken again along its own axes the matrix keeps the digits that squaring would lose.
    let first = jacobi::eigenvectors(&gram(&Matrix3::identity())).0;
    let (turn, values) = jacobi::eigenvectors(&gram(&first));
    let values = values.diagonal();
    let least = values.imin();
    // Two vanishing values: a whole family of homographies fits.
    let second = (0..3).filter(|k| *k != least).map(|k| values[k]).fold(f64::INFINITY, f64::min);
    if !(second > MIN_VALUE * MIN_VALUE) {
        return None;
    }
    let h3 = first * turn.column(least);
    let normalized = Matrix3::from_rows(&[(by_u * h3).transpose(), (by_v * h3).transpose(), h3.transpose()]);
    let from_plane = Matrix3::from_diagonal(&Vector3::new(1.0 / units.x, 1.0 / units.y, 1.0));
    let homography = to.inverse_matrix() * normalized * from_plane;
    let norm = homography.norm();
    (norm.is_finite() && norm > 0.0).then(|| homography / norm)
}

/// Below this, in normalized coordinates, the equations leave a homography open.
const MIN_VALUE: f64 = 1e-12;

/// The pose of the plane through `spread.centre` along its first two axes whose homography is proportional to
/// `image_from_plane`.
#[must_use]
pub fn pose_of(image_from_plane: &Matrix3<f64>, spread: &Spread) -> Option<CameraFromTarget> {
    // Depth of the plane's centre is positive.
    let sign = if image_from_plane[(2, 2)] < 0.0 { -1.0 } else { 1.0 };
    let h = image_from_plane * sign;
    let columns: Matrix3x2<f64> = h.fixed_columns::<2>(0).into_owned();
    let svd = columns.svd(true, true);
    let scale = 0.5 * (svd.singular_values[0] + svd.singular_values[1]);
    if !(scale > 0.0 && svd.singular_values.min() > 1e-12 * scale) {
        return None;
    }
    let columns = svd.u? * svd.v_t?;
    let (x, y) = (columns.column(0).into_owned(), columns.column(1).into_owned());
    let camera_from_plane = Matrix3::from_columns(&[x, y, x.cross(&y)]);
    let rotation = nearest(&(camera_from_plane * spread.axes.transpose()))?;
    let centre_in_camera = h.column(2) / scale;
    Some(CameraFromTarget::new(rotation, centre_in_camera - rotation * spread.centre))
}

/// Shift of the rays to their mean and scale to an extent of one.
struct Normalization {
    mean: Vector2<f64>,
    scale: f64,
}

impl Normalization {
    fn of(pairs: &[Pair]) -> Option<Self> {
        let count = pairs.len() as f64;
        let mean = pairs.iter().map(|pair| pair.ray).sum::<Vector2<f64>>() / count;
        let square = pairs.iter().map(|pair| (pair.ray - mean).norm_squared()).sum::<f64>() / count;
        let scale = 1.0 / square.sqrt();
        (scale.is_finite() && scale > 0.0).then_some(Self { mean, scale })
    }

    fn apply(&self, ray: &Vector2<f64>) -> Vector2<f64> {
        (ray - self.mean) * self.scale
    }

    /// From normalized coordinates to rays.
    fn inverse_matrix(&self) -> Matrix3<f64> {
        let (s, m) = (1.0 / self.scale, self.mean);
        Matrix3::new(s, 0.0, m.x, 0.0, s, m.y, 0.0, 0.0, 1.0)
    }
}
