//! How a set of points is spread: on a line, on a plane, or through space.

pub(crate) mod jacobi;

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
        Self::of_all(points.iter().map(|p| p.coords))
    }

    /// The spread of the positions `all`, which are gone through several times.
    #[must_use]
    #[expect(clippy::needless_pass_by_value, reason = "an iterator is what is passed")]
    pub fn of_all<I: Iterator<Item = Vector3<f64>> + Clone>(all: I) -> Self {
        let mut count = 0.0_f64;
        let mut sum = Vector3::zeros();
        for position in all.clone() {
            sum += position;
            count += 1.0;
        }
        let count = count.max(1.0);
        let centre = sum / count;
        // The scatter's eigenvalues alone would lose half the digits of small extents. So the scatter is taken again along the
        // axes that it gave, where what is small is summed from small numbers, until the axes stay as they are.
        let mut axes = Matrix3::identity();
        let mut scatter = scatter_along(&axes, &centre, all.clone());
        for _ in 0..30 {
            if is_diagonal(&scatter) {
                break;
            }
            axes *= jacobi::eigenvectors(&scatter).0;
            scatter = scatter_along(&axes, &centre, all.clone());
        }
        let mut rms = scatter.diagonal().map(|square| (square / count).sqrt());
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

/// Sums of products of the coordinates along `axes` about `centre`.
fn scatter_along(axes: &Matrix3<f64>, centre: &Vector3<f64>, all: impl Iterator<Item = Vector3<f64>>) -> Matrix3<f64> {
    let (mut xx, mut xy, mut xz, mut yy, mut yz, mut zz) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for position in all {
        let p = axes.tr_mul(&(position - centre));
        xx += p.x * p.x;
        xy += p.x * p.y;
        xz += p.x * p.z;
        yy += p.y * p.y;
        yz += p.y * p.z;
        zz += p.z * p.z;
    }
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// Off-diagonal entries that change no extent by more than 1e-13 of it, or turn no axis by more than rounding.
fn is_diagonal(scatter: &Matrix3<f64>) -> bool {
    [(0, 1), (0, 2), (1, 2)].into_iter().all(|(a, b)| {
        let (aa, bb, ab) = (scatter[(a, a)], scatter[(b, b)], scatter[(a, b)].abs());
        // Also for NaN, which no turn would better.
        !(ab > 1e-13 * (aa * bb).sqrt() && ab > 1e-15 * aa.max(bb))
    })
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
