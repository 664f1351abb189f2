//! How a set of points is spread: on a line, on a plane, or through space.

use nalgebra::{Matrix3, Vector3};

use crate::geometry::{Point, space::Space};

/// Centre, principal axes and extents of a set of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Mean position, metres.
    pub centre: Vector3<f64>,
    /// Right-handed principal axes as columns, the widest first; the third is the normal of the best plane.
    pub axes: Matrix3<f64>,
    /// Root mean square extent along each axis, metres, falling.
    pub rms_m: Vector3<f64>,
}

impl Spread {
    /// Points whose third extent is below this share of the first count as lying in one plane. A millimetre of
    /// measuring error on an arm's length of target stays below it.
    pub const COPLANAR_RATIO: f64 = 2e-3;

    /// The spread of `points`. All zero for none.
    #[must_use]
    pub fn of<S: Space>(points: &[Point<S>]) -> Self {
        let count = points.len().max(1) as f64;
        let centre = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / count;
        // One-sided Jacobi on the scatter's factor keeps small extents exact, where the scatter's eigenvalues would lose
        // half the digits: rotate pairs of columns of the (implicit) n x 3 matrix until they are orthogonal.
        let mut axes = Matrix3::identity();
        let mut columns: Vec<Vector3<f64>> = points.iter().map(|p| p.coords - centre).collect();
        for _ in 0..30 {
            let mut turned = false;
            for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                turned |= orthogonalize(&mut columns, &mut axes, a, b);
            }
            if !turned {
                break;
            }
        }
        let mut rms = Vector3::from_fn(|i, _| (columns.iter().map(|r| r[i] * r[i]).sum::<f64>() / count).sqrt());
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            if rms[b] > rms[a] {
                rms.swap_rows(a, b);
                axes.swap_columns(a, b);
            }
        }
        if axes.determinant() < 0.0 {
            let flipped = -axes.column(2);
            axes.set_column(2, &flipped);
        }
        Self { centre, axes, rms_m: rms }
    }

    /// Second extent over the first: 0 on a line (and for a single place).
    #[must_use]
    pub fn line_ratio(&self) -> f64 {
        if self.rms_m[0] > 0.0 { self.rms_m[1] / self.rms_m[0] } else { 0.0 }
    }

    /// Third extent over the first: 0 on a plane.
    #[must_use]
    pub fn plane_ratio(&self) -> f64 {
        if self.rms_m[0] > 0.0 { self.rms_m[2] / self.rms_m[0] } else { 0.0 }
    }

    /// Whether the points count as lying in one plane.
    #[must_use]
    pub fn is_coplanar(&self) -> bool {
        self.plane_ratio() <= Self::COPLANAR_RATIO
    }

    /// `point` in the principal axes about the centre.
    #[must_use]
    pub fn local<S: Space>(&self, point: &Point<S>) -> Vector3<f64> {
        self.axes.tr_mul(&(point.coords - self.centre))
    }
}

/// One Jacobi rotation that makes columns `a` and `b` orthogonal; false if they were.
fn orthogonalize(rows: &mut [Vector3<f64>], axes: &mut Matrix3<f64>, a: usize, b: usize) -> bool {
    let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
    for row in rows.iter() {
        aa += row[a] * row[a];
        bb += row[b] * row[b];
        ab += row[a] * row[b];
    }
    if ab.abs() <= 1e-15 * (aa * bb).sqrt() || ab == 0.0 {
        return false;
    }
    let zeta = (bb - aa) / (2.0 * ab);
    let t = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
    let c = 1.0 / (1.0 + t * t).sqrt();
    let s = c * t;
    for row in rows.iter_mut() {
        (row[a], row[b]) = (c * row[a] - s * row[b], s * row[a] + c * row[b]);
    }
    for i in 0..3 {
        (axes[(i, a)], axes[(i, b)]) = (c * axes[(i, a)] - s * axes[(i, b)], s * axes[(i, a)] + c * axes[(i, b)]);
    }
    true
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::space::Target;

    proptest! {
        #[test]
        fn the_axes_are_a_rotation_and_local_coordinates_give_the_points_back(
            raw in proptest::collection::vec(proptest::array::uniform3(-2.0..2.0), 4..12)
        ) {
            let points: Vec<Point<Target>> = raw.into_iter().map(Point::from).collect();
            let spread = Spread::of(&points);
            prop_assert!((spread.axes.transpose() * spread.axes - Matrix3::identity()).amax() < 1e-12);
            prop_assert!((spread.axes.determinant() - 1.0).abs() < 1e-12);
            prop_assert!(spread.rms_m[0] >= spread.rms_m[1] && spread.rms_m[1] >= spread.rms_m[2]);
            for p in &points {
                prop_assert!((spread.axes * spread.local(p) + spread.centre - p.coords).norm() < 1e-12);
            }
        }

        #[test]
        fn a_tilted_plane_far_away_is_seen_as_a_plane(
            flat in proptest::collection::vec(proptest::array::uniform2(-1.0..1.0), 6..7),
            axis in proptest::array::uniform3(-2.0..2.0)
        ) {
            let tilt = Rotation3::new(Vector3::from(axis));
            let points: Vec<Point<Target>> = flat
                .iter()
                .map(|[x, y]| Point::from(tilt * Vector3::new(*x, *y, 0.0) + Vector3::new(30.0, -20.0, 10.0)))
                .collect();
            let spread = Spread::of(&points);
            prop_assume!(spread.line_ratio() > 1e-2);
            prop_assert!(spread.plane_ratio() < 1e-12);
            prop_assert!((spread.axes.column(2).dot(&(tilt * Vector3::z()))).abs() > 1.0 - 1e-9);
        }
    }

    #[test]
    fn no_points_have_no_spread() {
        let spread = Spread::of::<Target>(&[]);
        assert_eq!((spread.line_ratio(), spread.plane_ratio()), (0.0, 0.0));
    }
}
