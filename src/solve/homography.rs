//! Pose of a plane from its homography.
//!
//! Direct linear transform with normalized coordinates: Hartley 1997, "In defense of the eight-point algorithm". Pose from
//! the homography: Sturm 2000, "Algorithms for plane-based pose estimation"; Zhang 2000.
//!
//! The seed's eq. 4.10 puts `h1 x h2` where the translation belongs and scales the two columns each by its own length; here
//! the third column is the translation, both columns share one scale, and the matrix is projected onto SO(3).

use nalgebra::{DMatrix, Matrix3, Matrix3x2, SMatrix, Vector2};

use super::{Pair, Solutions, SolveError};
use crate::geometry::{CameraFromTarget, rotation};
use crate::target::Spread;

/// The one pose of four or more coplanar points that the homography between plane and image gives.
///
/// # Errors
/// [`SolveError::Degenerate`] if the points do not fix a homography, as when all but one lie on a line.
pub fn homography(pairs: &[Pair], spread: &Spread) -> Result<Solutions, SolveError> {
    let degenerate = SolveError::Degenerate { solver: "homography" };
    let plane: Vec<Vector2<f64>> = pairs.iter().map(|pair| spread.local(&pair.point).xy()).collect();
    let image: Vec<Vector2<f64>> = pairs.iter().map(|pair| pair.ray).collect();
    let image_from_plane = direct_linear_transform(&plane, &image).ok_or_else(|| degenerate.clone())?;
    let pose = pose_of(&image_from_plane, spread).ok_or(degenerate)?;
    Ok([pose].into_iter().collect())
}

/// The 3 x 3 homography that takes `plane` to `image`, in the least algebraic error over normalized coordinates; of unit
/// norm and unknown sign. `None` if it is not determined.
#[must_use]
pub fn direct_linear_transform(plane: &[Vector2<f64>], image: &[Vector2<f64>]) -> Option<Matrix3<f64>> {
    let from = Normalization::of(plane)?;
    let to = Normalization::of(image)?;
    // One row more than equations where there are four points, so that the triangular factor is square.
    let mut rows = DMatrix::zeros((2 * plane.len()).max(9), 9);
    for (i, (p, q)) in plane.iter().zip(image).enumerate() {
        let (p, q) = (from.apply(p), to.apply(q));
        let (x, y, u, v) = (p.x, p.y, q.x, q.y);
        for (row, values) in
            [[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y, -u], [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y, -v]]
                .into_iter()
                .enumerate()
        {
            rows.row_mut(2 * i + row).copy_from_slice(&values);
        }
    }
    // The singular vectors of the rows are those of their triangular factor, which is small.
    let triangular = rows.qr().r();
    let triangular: SMatrix<f64, 9, 9> = triangular.fixed_view::<9, 9>(0, 0).into_owned();
    let svd = triangular.try_svd(false, true, f64::EPSILON, 500)?;
    let v_t = svd.v_t?;
    let mut order: [usize; 9] = std::array::from_fn(|i| i);
    order.sort_by(|&a, &b| svd.singular_values[a].total_cmp(&svd.singular_values[b]));
    // Two vanishing singular values: a whole family of homographies fits.
    if svd.singular_values[order[1]] <= 1e-12 * svd.singular_values[order[8]] {
        return None;
    }
    let h = v_t.row(order[0]);
    let normalized = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8]);
    let homography = to.matrix().try_inverse()? * normalized * from.matrix();
    let norm = homography.norm();
    (norm.is_finite() && norm > 0.0).then(|| homography / norm)
}

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
    let nearest = svd.u? * svd.v_t?;
    let (x, y) = (nearest.column(0).into_owned(), nearest.column(1).into_owned());
    let camera_from_plane = Matrix3::from_columns(&[x, y, x.cross(&y)]);
    let rotation = rotation::nearest(&(camera_from_plane * spread.axes.transpose()))?;
    let centre_in_camera = h.column(2) / scale;
    Some(CameraFromTarget::new(rotation, centre_in_camera - rotation * spread.centre))
}

/// Shift to the mean and scale to a mean distance of sqrt(2).
struct Normalization {
    mean: Vector2<f64>,
    scale: f64,
}

impl Normalization {
    fn of(points: &[Vector2<f64>]) -> Option<Self> {
        let count = points.len() as f64;
        let mean = points.iter().sum::<Vector2<f64>>() / count;
        let distance = points.iter().map(|p| (p - mean).norm()).sum::<f64>() / count;
        let scale = std::f64::consts::SQRT_2 / distance;
        (scale.is_finite() && scale > 0.0).then_some(Self { mean, scale })
    }

    fn apply(&self, point: &Vector2<f64>) -> Vector2<f64> {
        (point - self.mean) * self.scale
    }

    fn matrix(&self) -> Matrix3<f64> {
        let (s, m) = (self.scale, self.mean);
        Matrix3::new(s, 0.0, -s * m.x, 0.0, s, -s * m.y, 0.0, 0.0, 1.0)
    }
}
