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
    depths(&cosines, &squares)
        .into_iter()
        .filter_map(|unit_depths| {
            let scaled = unit_depths * longest.sqrt();
            align(&[y1 * scaled[0], y2 * scaled[1], y3 * scaled[2]], &[x1, x2, x3])
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
fn depths([c12, c13, c23]: &[f64; 3], [s12, s13, s23]: &[f64; 3]) -> ArrayVec<Vector3<f64>, 4> {
    // The quadratic forms of the three sides.
    let side = |i: usize, j: usize, cosine: f64| {
        let mut m = Matrix3::zeros();
        m[(i, i)] = 1.0;
        m[(j, j)] = 1.0;
        m[(i, j)] = -cosine;
        m[(j, i)] = -cosine;
        m
    };
    let (m12, m13, m23) = (side(0, 1, *c12), side(0, 2, *c13), side(1, 2, *c23));
    // Two conics through all solutions.
    let first = m12 * *s23 - m23 * *s12;
    let second = m13 * *s23 - m23 * *s13;
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
            let quadratic = |m: &Matrix3<f64>| ratio.dot(&(m * ratio));
            let scale = ((s12 + s13 + s23) / (quadratic(&m12) + quadratic(&m13) + quadratic(&m23))).sqrt();
            if !scale.is_finite() {
                continue;
            }
            let polished = polish(ratio.abs() * scale, [c12, c13, c23], [s12, s13, s23]);
            let fresh = found.iter().all(|d: &Vector3<f64>| (d - polished).norm() > 1e-9 * polished.norm());
            if polished.iter().all(|d| *d > 0.0 && d.is_finite()) && fresh && !found.is_full() {
                found.push(polished);
            }
        }
    }
    found
}

/// The two real lines of a degenerate conic `first + x second`; `None` if no member of the pencil splits into real lines.
fn degenerate_lines(first: &Matrix3<f64>, second: &Matrix3<f64>) -> Option<[Vector3<f64>; 2]> {
    // det(first + x second) as a cubic in x.
    let adjugate_first = adjugate(first);
    let adjugate_second = adjugate(second);
    let cubic = [
        second.determinant(),
        (first.transpose().component_mul(&adjugate_second)).sum(),
        (second.transpose().component_mul(&adjugate_first)).sum(),
        first.determinant(),
    ];
    // The member whose lines are most clearly real.
    real_cubic_roots(cubic)
        .into_iter()
        .map(|x| first + second * x)
        .filter_map(|conic| {
            let cofactors = -adjugate(&conic);
            let size = conic.norm_squared();
            let pivot = (0..3).max_by(|&a, &b| cofactors[(a, a)].total_cmp(&cofactors[(b, b)]))?;
            let strength = cofactors[(pivot, pivot)] / size;
            (strength > 1e-14).then_some((conic, cofactors, pivot, strength))
        })
        .max_by(|a, b| a.3.total_cmp(&b.3))
        .and_then(|(conic, cofactors, pivot, _)| {
            // The lines' intersection, scaled so that conic + [p]x has rank one: its rows are one line, its columns the other.
            let p = cofactors.column(pivot) / cofactors[(pivot, pivot)].sqrt();
            let product = conic + crate::geometry::rotation::cross_matrix(&p.into_owned());
            let (row, column) =
                (0..9).map(|i| (i / 3, i % 3)).max_by(|&a, &b| product[a].abs().total_cmp(&product[b].abs()))?;
            Some([product.row(row).transpose().normalize(), product.column(column).normalize()])
        })
}

/// Where a line meets the conics: up to two points, taken from the conic that is better conditioned there.
fn meet(line: &Vector3<f64>, first: &Matrix3<f64>, second: &Matrix3<f64>) -> ArrayVec<Vector3<f64>, 2> {
    // An orthonormal basis of the line's points.
    let a = line.cross(&smallest_axis(line)).normalize();
    let b = line.cross(&a);
    let along = |m: &Matrix3<f64>| (a.dot(&(m * a)), a.dot(&(m * b)), b.dot(&(m * b)));
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
    [(q, aa), (bb, q)].into_iter().filter(|(u, v)| u.hypot(*v) > 0.0).map(|(u, v)| a * u + b * v).collect()
}

fn smallest_axis(v: &Vector3<f64>) -> Vector3<f64> {
    let mut axis = Vector3::zeros();
    axis[v.iamin()] = 1.0;
    axis
}

/// Newton's method on the three depth equations: two or three steps reach rounding.
fn polish(start: Vector3<f64>, [c12, c13, c23]: [&f64; 3], [s12, s13, s23]: [&f64; 3]) -> Vector3<f64> {
    let mut d = start;
    for _ in 0..4 {
        let residual = Vector3::new(
            d[0] * d[0] + d[1] * d[1] - 2.0 * c12 * d[0] * d[1] - s12,
            d[0] * d[0] + d[2] * d[2] - 2.0 * c13 * d[0] * d[2] - s13,
            d[1] * d[1] + d[2] * d[2] - 2.0 * c23 * d[1] * d[2] - s23,
        );
        if residual.amax() < 1e-15 * d.norm_squared() {
            break;
        }
        let jacobian = Matrix3::new(
            d[0] - c12 * d[1],
            d[1] - c12 * d[0],
            0.0,
            d[0] - c13 * d[2],
            0.0,
            d[2] - c13 * d[0],
            0.0,
            d[1] - c23 * d[2],
            d[2] - c23 * d[1],
        );
        match jacobian.try_inverse() {
            Some(inverse) => d -= inverse * residual * 0.5,
            None => break,
        }
    }
    d
}

/// The rigid motion that takes the triangle `to` (target) onto the triangle `from` (camera).
fn align(camera: &[Vector3<f64>; 3], target: &[Vector3<f64>; 3]) -> Option<CameraFromTarget> {
    let basis = |[a, b, c]: &[Vector3<f64>; 3]| {
        let x = (b - a).try_normalize(0.0)?;
        let z = x.cross(&(c - a)).try_normalize(0.0)?;
        Some(Matrix3::from_columns(&[x, z.cross(&x), z]))
    };
    let rotation = Rotation3::from_matrix_unchecked(basis(camera)? * basis(target)?.transpose());
    let middle = |[a, b, c]: &[Vector3<f64>; 3]| (a + b + c) / 3.0;
    let pose = CameraFromTarget::new(rotation, middle(camera) - rotation * middle(target));
    pose.is_finite().then_some(pose)
}

fn adjugate(m: &Matrix3<f64>) -> Matrix3<f64> {
    let (a, b, c) = (m.row(0).transpose(), m.row(1).transpose(), m.row(2).transpose());
    Matrix3::from_columns(&[b.cross(&c), c.cross(&a), a.cross(&b)])
}

/// The real roots of `c0 x^3 + c1 x^2 + c2 x + c3`, each polished by Newton's method.
fn real_cubic_roots([c0, c1, c2, c3]: [f64; 4]) -> ArrayVec<f64, 3> {
    let mut roots = ArrayVec::new();
    let largest = c0.abs().max(c1.abs()).max(c2.abs()).max(c3.abs());
    if !(largest > 0.0 && largest.is_finite()) {
        return roots;
    }
    if c0.abs() <= 1e-14 * largest {
        // A quadratic; the third root has gone to infinity.
        let discriminant = c2 * c2 - 4.0 * c1 * c3;
        if discriminant >= 0.0 {
            let q = -0.5 * (c2 + discriminant.sqrt().copysign(c2));
            roots.extend([q / c1, c3 / q].into_iter().filter(|x| x.is_finite()));
        }
        return roots;
    }
    let (b, c, d) = (c1 / c0, c2 / c0, c3 / c0);
    let shift = b / 3.0;
    let p = c - b * shift;
    let q = shift * (2.0 * shift * shift - c) + d;
    let discriminant = 0.25 * q * q + p * p * p / 27.0;
    if discriminant > 0.0 {
        let root = discriminant.sqrt();
        let u = (-0.5 * q - root.copysign(q)).cbrt();
        let v = if u == 0.0 { 0.0 } else { -p / (3.0 * u) };
        roots.push(u + v - shift);
    } else {
        let radius = 2.0 * (-p / 3.0).max(0.0).sqrt();
        let angle = if radius == 0.0 { 0.0 } else { (3.0 * q / (p * radius)).clamp(-1.0, 1.0).acos() / 3.0 };
        for k in 0..3 {
            roots.push(radius * (angle - f64::from(k) * std::f64::consts::TAU / 3.0).cos() - shift);
        }
    }
    for x in &mut roots {
        for _ in 0..2 {
            let value = ((*x + b) * *x + c) * *x + d;
            let slope = (3.0 * *x + 2.0 * b) * *x + c;
            let step = value / slope;
            if step.is_finite() && step.abs() < 0.1 * (1.0 + x.abs()) {
                *x -= step;
            }
        }
    }
    roots
}
