//! Pose from three points: up to four solutions.
//!
//! Depths along the three bearings satisfy three quadratic equations. Two homogeneous combinations of them are conics in the
//! ratio of the depths; a degenerate member of their pencil splits into two lines, and each line meets a conic in two
//! points. Following Persson and Nordberg, "Lambda Twist: an accurate fast robust P3P solver", ECCV 2018, and Ding, Yang,
//! Larsson, Olsson and Åström, "Revisiting the P3P problem", CVPR 2023.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::{Pair, Solutions, SolveError, is_in_front, squared_ray_error};
use crate::geometry::{CameraFromTarget, Point, space};

/// All poses with `depth * bearing = camera_from_target * point` and positive depths; at most four.
///
/// `bearings` are unit vectors. Empty if the points are collinear, two bearings coincide, or no real solution exists.
#[must_use]
pub fn p3p(bearings: &[Vector3<f64>; 3], points: &[Point<space::Target>; 3]) -> Solutions {
    let [x1, x2, x3] = points.map(|p| p.coords);
    let [y1, y2, y3] = *bearings;
    let (d12, d13, d23) = ((x1 - x2).norm_squared(), (x1 - x3).norm_squared(), (x2 - x3).norm_squared());
    let longest = d12.max(d13).max(d23);
    let collinear = (x2 - x1).cross(&(x3 - x1)).norm_squared() <= 1e-20 * longest * longest;
    if !(longest > 0.0 && longest.is_finite()) || collinear || d12.min(d13).min(d23) <= 1e-20 * longest {
        return Solutions::new();
    }
    // Squared sides in units of the longest.
    let squares = [d12 / longest, d13 / longest, d23 / longest];
    let cosines = [y1.dot(&y2), y1.dot(&y3), y2.dot(&y3)];
    let Some(target_axes) = axes_of(&[x1, x2, x3]) else { return Solutions::new() };
    let middle = (x1 + x2 + x3) / 3.0;
    let length = longest.sqrt();
    depths(&cosines, &squares)
        .into_iter()
        .filter_map(|unit_depths| {
            let [p1, p2, p3] = [y1 * unit_depths.x, y2 * unit_depths.y, y3 * unit_depths.z];
            let rotation = Rotation3::from_matrix_unchecked(axes_of(&[p1, p2, p3])? * target_axes.transpose());
            let pose = CameraFromTarget::new(rotation, (p1 + p2 + p3) * (length / 3.0) - rotation * middle);
            pose.is_finite().then_some(pose)
        })
        .collect()
}

/// P3P on the three points that fix a pose best: all solutions, by falling agreement with the remaining points.
#[must_use]
pub fn p3p_of_widest(pairs: &[Pair]) -> Solutions {
    let chosen = widest_three(pairs);
    let bearings = chosen.map(|i| Vector3::new(pairs[i].ray.x, pairs[i].ray.y, 1.0).normalize());
    let mut solutions = p3p(&bearings, &chosen.map(|i| pairs[i].point));
    let cost = |pose: &CameraFromTarget| {
        if is_in_front(pairs, pose) { squared_ray_error(pairs, pose) } else { f64::INFINITY }
    };
    solutions.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
    solutions
}

/// The named method: all solutions for three points; the one that further points agree with best for more.
///
/// # Errors
/// [`SolveError::Degenerate`] if the three have no real solution.
pub fn p3p_of_many(pairs: &[Pair]) -> Result<Solutions, SolveError> {
    let mut solutions = p3p_of_widest(pairs);
    if pairs.len() > 3 {
        solutions.truncate(1);
    }
    if solutions.is_empty() { Err(SolveError::Degenerate { solver: "p3p" }) } else { Ok(solutions) }
}

/// The points of a large triangle: the one farthest from the middle, the one farthest from that, and the one farthest from
/// their line.
fn widest_three(pairs: &[Pair]) -> [usize; 3] {
    let farthest = |distance: &dyn Fn(&Vector3<f64>) -> f64| {
        let score = |i: &usize| distance(&pairs[*i].point.coords);
        (0..pairs.len()).max_by(|a, b| score(a).total_cmp(&score(b))).unwrap_or(0)
    };
    let middle = pairs.iter().map(|p| p.point.coords).sum::<Vector3<f64>>() / pairs.len() as f64;
    let a = farthest(&|p| (p - middle).norm());
    let pa = pairs[a].point.coords;
    let b = farthest(&|p| (p - pa).norm());
    let along = (pairs[b].point.coords - pa).normalize();
    let c = farthest(&|p| (p - pa).cross(&along).norm());
    [a, b, c]
}

/// Positive depths with `di^2 + dj^2 - 2 cos_ij di dj = square_ij`.
fn depths(cosines: &[f64; 3], squares: &[f64; 3]) -> ArrayVec<Vector3<f64>, 4> {
    let ([c12, c13, c23], [s12, s13, s23]) = (*cosines, *squares);
    // Two conics through all solutions: the equations' homogeneous combinations without a constant.
    let first = Conic { xx: s23, xy: -s23 * c12, xz: 0.0, yy: s23 - s12, yz: s12 * c23, zz: -s12 };
    let second = Conic { xx: s23, xy: 0.0, xz: -s23 * c13, yy: -s13, yz: s13 * c23, zz: s23 - s13 };
    let mut found = ArrayVec::new();
    let Some(lines) = degenerate_lines(&first, &second) else {
        return found;
    };
    for line in lines {
        for ratio in meet(&line, &first, &second) {
            let same_sign = ratio.iter().all(|d| *d > 0.0) || ratio.iter().all(|d| *d < 0.0);
            if !same_sign {
                continue;
            }
            let [x, y, z] = [ratio.x, ratio.y, ratio.z];
            let sides = 2.0 * (x * x + y * y + z * z - c12 * x * y - c13 * x * z - c23 * y * z);
            let scale = ((s12 + s13 + s23) / sides).sqrt();
            if !scale.is_finite() {
                continue;
            }
            let polished = polish(ratio.abs() * scale, cosines, squares);
            let fresh =
                found.iter().all(|d: &Vector3<f64>| (d - polished).norm_squared() > 1e-18 * polished.norm_squared());
            if polished.iter().all(|d| *d > 0.0 && d.is_finite()) && fresh && !found.is_full() {
                found.push(polished);
            }
        }
    }
    found
}

/// A symmetric 3 x 3 matrix as the conic that it is.
#[derive(Clone, Copy)]
struct Conic {
    xx: f64,
    xy: f64,
    xz: f64,
    yy: f64,
    yz: f64,
    zz: f64,
}

impl Conic {
    /// `self + x other`.
    fn plus(&self, x: f64, other: &Self) -> Self {
        Self {
            xx: self.xx + x * other.xx,
            xy: self.xy + x * other.xy,
            xz: self.xz + x * other.xz,
            yy: self.yy + x * other.yy,
            yz: self.yz + x * other.yz,
            zz: self.zz + x * other.zz,
        }
    }

    fn adjugate(&self) -> Self {
        Self {
            xx: self.yy * self.zz - self.yz * self.yz,
            xy: self.xz * self.yz - self.xy * self.zz,
            xz: self.xy * self.yz - self.xz * self.yy,
            yy: self.xx * self.zz - self.xz * self.xz,
            yz: self.xy * self.xz - self.xx * self.yz,
            zz: self.xx * self.yy - self.xy * self.xy,
        }
    }

    /// Sum of the products of the entries of both matrices.
    fn dot(&self, other: &Self) -> f64 {
        self.xx * other.xx
            + self.yy * other.yy
            + self.zz * other.zz
            + 2.0 * (self.xy * other.xy + self.xz * other.xz + self.yz * other.yz)
    }

    fn of(&self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }

    /// The two lines of which a degenerate conic consists, if they are real, and how clearly they are.
    fn lines(&self) -> Option<(f64, [Vector3<f64>; 2])> {
        let cofactors = self.adjugate();
        // The adjugate of a pair of lines is minus the square of their intersection.
        let p = if cofactors.xx <= cofactors.yy.min(cofactors.zz) {
            Vector3::new(cofactors.xx, cofactors.xy, cofactors.xz) / (-cofactors.xx).sqrt()
        } else if cofactors.yy <= cofactors.zz {
            Vector3::new(cofactors.xy, cofactors.yy, cofactors.yz) / (-cofactors.yy).sqrt()
        } else {
            Vector3::new(cofactors.xz, cofactors.yz, cofactors.zz) / (-cofactors.zz).sqrt()
        };
        let strength = -cofactors.xx.min(cofactors.yy).min(cofactors.zz) / self.dot(self);
        if !(strength > 1e-14) {
            return None;
        }
        // With their intersection's cross product added the matrix has rank one: its rows are one line, its columns the other.
        let m = Matrix3::new(
            self.xx,
            self.xy + p.z,
            self.xz - p.y,
            self.xy - p.z,
            self.yy,
            self.yz + p.x,
            self.xz + p.y,
            self.yz - p.x,
            self.zz,
        );
        let largest = largest_entry(&m);
        Some((strength, [m.row(largest.0).transpose(), m.column(largest.1).into()]))
    }
}

/// Lines as clear as this need no comparison with those of the pencil's other degenerate members.
const CLEARLY_REAL: f64 = 1e-3;

/// The two real lines of a degenerate conic `first + x second`; `None` if no member of the pencil splits into real lines.
fn degenerate_lines(first: &Conic, second: &Conic) -> Option<[Vector3<f64>; 2]> {
    // det(first + x second) as a cubic in x.
    let (adjugate_first, adjugate_second) = (first.adjugate(), second.adjugate());
    let cubic = [
        second.dot(&adjugate_second) / 3.0,
        first.dot(&adjugate_second),
        second.dot(&adjugate_first),
        first.dot(&adjugate_first) / 3.0,
    ];
    let lines_at = |x: f64| first.plus(x, second).lines();
    let cubic = Cubic::of(cubic)?;
    let root = cubic.outer_root();
    let found = root.and_then(lines_at);
    if found.is_some_and(|(strength, _)| strength > CLEARLY_REAL) {
        return found.map(|(_, lines)| lines);
    }
    // Rarely: the other members of the pencil that degenerate.
    let others = cubic.other_roots(root).into_iter().filter_map(lines_at);
    found.into_iter().chain(others).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, lines)| lines)
}

/// Where a line meets the conics: up to two points, taken from the conic that is better conditioned there.
fn meet(line: &Vector3<f64>, first: &Conic, second: &Conic) -> ArrayVec<Vector3<f64>, 2> {
    // An orthogonal basis of the line's points.
    let a = line.cross(&smallest_axis(line)).normalize();
    let b = line.cross(&a) / line.norm();
    let along = |m: &Conic| {
        let (ma, mb) = (m.of(&a), m.of(&b));
        (a.dot(&ma), a.dot(&mb), b.dot(&mb))
    };
    let weight = |(aa, ab, bb): (f64, f64, f64)| aa.abs().max(ab.abs()).max(bb.abs());
    let (aa, ab, bb) = {
        let (f, s) = (along(first), along(second));
        if weight(f) >= weight(s) { f } else { s }
    };
    let size = weight((aa, ab, bb));
    let mut discriminant = ab * ab - aa * bb;
    if discriminant < 0.0 {
        // Two solutions that meet come out slightly complex by rounding alone.
        if discriminant < -1e-10 * size * size {
            return ArrayVec::new();
        }
        discriminant = 0.0;
    }
    let root = discriminant.sqrt();
    // Stable pair of homogeneous roots of aa u^2 + 2 ab u v + bb v^2.
    let q = -(ab + root.copysign(ab));
    [(q, aa), (bb, q)].into_iter().filter(|(u, v)| *u != 0.0 || *v != 0.0).map(|(u, v)| a * u + b * v).collect()
}

fn largest_entry(m: &Matrix3<f64>) -> (usize, usize) {
    let column = (0..3).max_by(|&a, &b| m.column(a).amax().total_cmp(&m.column(b).amax())).unwrap_or(0);
    (m.column(column).iamax(), column)
}

fn smallest_axis(v: &Vector3<f64>) -> Vector3<f64> {
    let mut axis = Vector3::zeros();
    axis[v.iamin()] = 1.0;
    axis
}

/// Newton's method on the three depth equations: two or three steps reach rounding.
fn polish(start: Vector3<f64>, [c12, c13, c23]: &[f64; 3], [s12, s13, s23]: &[f64; 3]) -> Vector3<f64> {
    let [mut x, mut y, mut z] = [start.x, start.y, start.z];
    for _ in 0..4 {
        let r12 = x * x + y * y - 2.0 * c12 * x * y - s12;
        let r13 = x * x + z * z - 2.0 * c13 * x * z - s13;
        let r23 = y * y + z * z - 2.0 * c23 * y * z - s23;
        if r12.abs().max(r13.abs()).max(r23.abs()) < 4e-15 * (x * x + y * y + z * z) {
            break;
        }
        // Half the Jacobian is [a b 0; c 0 d; 0 e f].
        let (a, b) = (x - c12 * y, y - c12 * x);
        let (c, d) = (x - c13 * z, z - c13 * x);
        let (e, f) = (y - c23 * z, z - c23 * y);
        let half = -0.5 / (a * d * e + b * c * f);
        if !half.is_finite() {
            break;
        }
        x += half * (d * e * r12 + b * f * r13 - b * d * r23);
        y += half * (c * f * r12 - a * f * r13 + a * d * r23);
        z += half * (-c * e * r12 + a * e * r13 + b * c * r23);
    }
    Vector3::new(x, y, z)
}

/// Orthonormal axes of a triangle: along its first side, in its plane, along its normal.
fn axes_of([a, b, c]: &[Vector3<f64>; 3]) -> Option<Matrix3<f64>> {
    let x = (b - a).try_normalize(0.0)?;
    let z = x.cross(&(c - a)).try_normalize(0.0)?;
    Some(Matrix3::from_columns(&[x, z.cross(&x), z]))
}

/// `x^3 + b x^2 + c x + d`, or without its first term.
struct Cubic {
    has_cube: bool,
    b: f64,
    c: f64,
    d: f64,
}

impl Cubic {
    fn of([c0, c1, c2, c3]: [f64; 4]) -> Option<Self> {
        let largest = c0.abs().max(c1.abs()).max(c2.abs()).max(c3.abs());
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        // Without a cube, one root has gone to infinity.
        let has_cube = c0.abs() > 1e-14 * largest;
        let unit = if has_cube { 1.0 / c0 } else { 1.0 };
        Some(Self { has_cube, b: c1 * unit, c: c2 * unit, d: c3 * unit })
    }

    fn at(&self, x: f64) -> f64 {
        ((x + self.b) * x + self.c) * x + self.d
    }

    /// A Newton step.
    fn improved(&self, x: f64) -> f64 {
        x - self.at(x) / ((3.0 * x + 2.0 * self.b) * x + self.c)
    }

    /// The real root outside of both turning points, by Newton's method from a bound of all roots: there the slope only
    /// falls, so no step overshoots.
    fn outer_root(&self) -> Option<f64> {
        if !self.has_cube {
            return None;
        }
        let turn = -self.b / 3.0;
        let height = self.at(turn);
        // With the turn as origin, y^3 + p y + height: if the roots are three, the outermost lies within 2 sqrt(-p / 3).
        let p = self.c + self.b * turn;
        let bound = if p < 0.0 { 2.0 * (-p / 3.0).sqrt() } else { 0.0 };
        let mut x = turn - (bound.max(height.abs().cbrt())).copysign(height);
        for _ in 0..60 {
            let next = self.improved(x);
            let is_settled = (next - x).abs() <= 1e-7 * x.abs();
            x = next;
            if is_settled {
                break;
            }
        }
        // The last step was below 1e-7 of it, so the next one is below rounding.
        x = self.improved(x);
        x.is_finite().then_some(x)
    }

    /// The real roots beside `known`.
    fn other_roots(&self, known: Option<f64>) -> ArrayVec<f64, 2> {
        let Some(x) = known else { return real_quadratic_roots([self.b, self.c, self.d]) };
        let linear = self.b + x;
        let roots = real_quadratic_roots([1.0, linear, self.c + x * linear]);
        let polished = |x: f64| {
            let better = self.improved(self.improved(x));
            if (better - x).abs() < 0.1 * (1.0 + x.abs()) { better } else { x }
        };
        roots.into_iter().map(polished).collect()
    }
}

/// The real roots of `a x^2 + b x + c`; both of a pair that rounding has made complex.
fn real_quadratic_roots([a, b, c]: [f64; 3]) -> ArrayVec<f64, 2> {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < -1e-12 * b * b {
        return ArrayVec::new();
    }
    let q = -0.5 * (b + discriminant.max(0.0).sqrt().copysign(b));
    [q / a, c / q].into_iter().filter(|x| x.is_finite()).collect()
}

#[cfg(test)]
mod tests;
