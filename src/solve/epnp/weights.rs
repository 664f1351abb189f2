//! The weights of the singular vectors, from the distances between control points.
//!
//! With `x = sum_k b_k v_k`, each distance is linear in the products `b_k b_l`. One, two and three vectors leave no more
//! products than distances; four leave ten against six, which is closed by relinearization (the products are not
//! independent: `b_i b_j * b_k b_l = b_i b_k * b_j b_l`).

use arrayvec::ArrayVec;
use nalgebra::{Matrix4, SMatrix, SVector, Vector3, Vector4};

use super::ControlPoints;

/// Gauss-Newton steps at most; it converges quadratically.
const REFINEMENTS: usize = 20;

/// A step below this share of the weights is rounding.
const SETTLED: f64 = 1e-14;

/// Of the diagonal: what keeps directions that the equations leave open at rest. Below the rounding of what they fix.
const RIDGE: f64 = 1e-15;

/// A weight for each vector; those of vectors that there are not stay zero.
pub(super) type Weights = Vector4<f64>;

/// One set of weights for each number of vectors assumed, each refined on the distances.
pub(super) fn candidates(vectors: &[ControlPoints], control_points: &ControlPoints) -> ArrayVec<Weights, 4> {
    let sides = Sides::of(vectors, control_points);
    let mut found: ArrayVec<Weights, 4> = ArrayVec::new();
    found.push(sides.one());
    if vectors.len() == 4 {
        found.extend(sides.by_products::<6, 3>(2));
        found.extend(sides.by_products::<6, 6>(3));
        found.extend(sides.four());
        for weights in &mut found {
            sides.refine::<4>(weights);
        }
    } else {
        found.extend(sides.by_products::<3, 3>(2));
        for weights in &mut found {
            sides.refine::<2>(weights);
        }
    }
    found
}

/// For each pair of control points: the difference in every singular vector, and the true squared distance.
struct Sides {
    differences: ArrayVec<[Vector3<f64>; 4], 6>,
    squares: ArrayVec<f64, 6>,
}

impl Sides {
    fn of(vectors: &[ControlPoints], control_points: &ControlPoints) -> Self {
        let count = control_points.len();
        let ends = || (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
        let difference = |(i, j)| std::array::from_fn(|k| vectors.get(k).map_or(Vector3::zeros(), |v| v[i] - v[j]));
        Self {
            differences: ends().map(difference).collect(),
            squares: ends().map(|(i, j)| (control_points[i] - control_points[j]).norm_squared()).collect(),
        }
    }

    /// One vector: the scale that fits all distances best.
    fn one(&self) -> Weights {
        let (mut above, mut below) = (0.0, 0.0);
        for (difference, square) in self.differences.iter().zip(self.squares.iter()) {
            above += difference[0].norm() * square.sqrt();
            below += difference[0].norm_squared();
        }
        Weights::new(above / below, 0.0, 0.0, 0.0)
    }

    /// Coefficients of the products `b_k b_l`, `k <= l < count`, in the squared distances.
    fn product_matrix<const S: usize, const P: usize>(&self, count: usize) -> SMatrix<f64, S, P> {
        let mut matrix = SMatrix::zeros();
        for (side, difference) in self.differences.iter().enumerate() {
            for (product, (k, l)) in products(count).enumerate() {
                let dot = difference[k].dot(&difference[l]);
                matrix[(side, product)] = if k == l { dot } else { 2.0 * dot };
            }
        }
        matrix
    }

    fn squares<const S: usize>(&self) -> SVector<f64, S> {
        SVector::from_fn(|side, _| self.squares[side])
    }

    /// Two or three vectors: the products by least squares, the weights from the products.
    fn by_products<const S: usize, const P: usize>(&self, count: usize) -> Option<Weights> {
        let solution = least_squares(&self.product_matrix::<S, P>(count), &self.squares())?;
        let matrix = symmetric(count, |index| solution[index]);
        Some(weights_of(&matrix, count))
    }

    /// Four vectors by relinearization (Kipnis and Shamir 1999, as the paper uses it).
    fn four(&self) -> Option<Weights> {
        let count = 4;
        let linear = self.product_matrix::<6, 10>(count);
        // The distances fix six of the ten products' directions, those of the rows; an orthonormal basis of all ten.
        let mut basis = [SVector::<f64, 10>::zeros(); 10];
        let mut known = 0;
        let rows = (0..6).map(|row| linear.row(row).transpose());
        let axes = (0..10).map(|axis| SVector::<f64, 10>::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 }));
        let mut triangular = SMatrix::<f64, 6, 6>::zeros();
        for (index, vector) in rows.chain(axes).enumerate() {
            let mut rest = vector;
            // Twice is enough for orthogonality to rounding.
            for _ in 0..2 {
                for (k, direction) in basis[..known].iter().enumerate() {
                    let along = rest.dot(direction);
                    rest -= direction * along;
                    if index < 6 {
                        triangular[(index, k)] += along;
                    }
                }
            }
            let length = rest.norm();
            if index < 6 {
                triangular[(index, known)] = length;
            } else if length < 0.3 {
                // Nearly in what is there already. The squares of what is left of the ten axes sum to the number of directions that
                // are still open, so one of them is above a tenth.
                continue;
            }
            basis[known] = rest.try_normalize(0.0)?;
            known += 1;
            if known == 10 {
                break;
            }
        }
        if known < 10 {
            return None;
        }
        let shares = triangular.solve_lower_triangular(&self.squares::<6>())?;
        let particular: SVector<f64, 10> = basis.iter().zip(shares.iter()).map(|(b, share)| b * *share).sum();
        let fixed = symmetric(count, |index| particular[index]);
        let open: [Matrix4<f64>; 4] = std::array::from_fn(|k| symmetric(count, |index| basis[6 + k][index]));
        // All 2 x 2 minors of the matrix of products vanish; each is quadratic in the four open shares.
        let mut system = SMatrix::<f64, 21, 14>::zeros();
        let mut right = SVector::<f64, 21>::zeros();
        for (row, ((a, b), (c, d))) in MINORS.into_iter().enumerate() {
            let minor = |m: &Matrix4<f64>, n: &Matrix4<f64>| m[(a, c)] * n[(b, d)] - m[(a, d)] * n[(b, c)];
            for (column, (k, l)) in products(4).enumerate() {
                system[(row, column)] = if k == l {
                    minor(&open[k], &open[k])
                } else {
                    minor(&open[k], &open[l]) + minor(&open[l], &open[k])
                };
            }
            for (k, direction) in open.iter().enumerate() {
                system[(row, 10 + k)] = minor(&fixed, direction) + minor(direction, &fixed);
            }
            right[row] = -minor(&fixed, &fixed);
        }
        let shares = least_squares(&system, &right)?;
        let matrix = open.iter().enumerate().fold(fixed, |sum, (k, m)| sum + m * shares[10 + k]);
        Some(weights_of(&matrix, count))
    }

    /// Gauss-Newton on the squared distances over as many weights as there are vectors.
    fn refine<const K: usize>(&self, weights: &mut Weights) {
        let mut best = self.misfit(weights);
        for _ in 0..REFINEMENTS {
            let mut normal = SMatrix::<f64, K, K>::zeros();
            let mut descent = SVector::<f64, K>::zeros();
            for (difference, square) in self.differences.iter().zip(&self.squares) {
                let total = mixed(difference, weights);
                let slope = SVector::<f64, K>::from_fn(|k, _| 2.0 * total.dot(&difference[k]));
                normal += slope * slope.transpose();
                descent += slope * (square - total.norm_squared());
            }
            let Some(step) = with_ridge(normal).cholesky().map(|c| c.solve(&descent)) else { return };
            let step = Weights::from_fn(|k, _| if k < K { step[k] } else { 0.0 });
            // A full step may overshoot; a share of it that makes the misfit smaller exists unless it has settled.
            let shorter = (0..6).map(|halvings| 0.5_f64.powi(halvings)).find_map(|share| {
                let next = *weights + step * share;
                let misfit = self.misfit(&next);
                (misfit < best).then_some((next, misfit))
            });
            let Some((next, misfit)) = shorter else { return };
            best = misfit;
            *weights = next;
            if step.norm_squared() <= SETTLED * SETTLED * next.norm_squared() {
                return;
            }
        }
    }

    fn misfit(&self, weights: &Weights) -> f64 {
        let off = |(difference, square): (&_, &f64)| (mixed(difference, weights).norm_squared() - square).powi(2);
        self.differences.iter().zip(self.squares.iter()).map(off).sum()
    }
}

/// Rows and columns of the minors of a symmetric 4 x 4 matrix.
const MINORS: [((usize, usize), (usize, usize)); 21] = {
    let pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
    let mut minors = [((0, 0), (0, 0)); 21];
    let (mut row, mut count) = (0, 0);
    while row < 6 {
        let mut column = row;
        while column < 6 {
            minors[count] = (pairs[row], pairs[column]);
            count += 1;
            column += 1;
        }
        row += 1;
    }
    minors
};

fn mixed(difference: &[Vector3<f64>; 4], weights: &Weights) -> Vector3<f64> {
    let [a, b, c, d] = difference;
    a * weights.x + b * weights.y + c * weights.z + d * weights.w
}

/// By the triangular factor, which keeps the digits that squaring would lose; `None` where the columns are not independent.
fn least_squares<const R: usize, const C: usize>(
    matrix: &SMatrix<f64, R, C>,
    right: &SVector<f64, R>,
) -> Option<SVector<f64, C>> {
    let mut columns = *matrix;
    let mut triangular = SMatrix::<f64, C, C>::zeros();
    let mut along = SVector::<f64, C>::zeros();
    let mut rest = *right;
    for k in 0..C {
        // Orthogonal to those before; twice is enough for that to hold to rounding.
        let mut column: SVector<f64, R> = columns.column(k).into_owned();
        for _ in 0..2 {
            for earlier in 0..k {
                let share = columns.column(earlier).dot(&column);
                triangular[(earlier, k)] += share;
                column -= columns.column(earlier) * share;
            }
        }
        triangular[(k, k)] = column.norm();
        column = column.try_normalize(0.0)?;
        columns.set_column(k, &column);
        along[k] = column.dot(&rest);
        rest -= column * along[k];
    }
    triangular.solve_upper_triangular(&along)
}

fn with_ridge<const N: usize>(mut normal: SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let ridge = RIDGE * normal.trace();
    for k in 0..N {
        normal[(k, k)] += ridge;
    }
    normal
}

/// The products of `count` weights, in the order of the linear systems.
fn products(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |k| (k..count).map(move |l| (k, l)))
}

/// The symmetric matrix of the products; rows and columns past `count` are zero.
fn symmetric(count: usize, value: impl Fn(usize) -> f64) -> Matrix4<f64> {
    let mut matrix = Matrix4::zeros();
    for (index, (k, l)) in products(count).enumerate() {
        matrix[(k, l)] = value(index);
        matrix[(l, k)] = value(index);
    }
    matrix
}

/// Weights whose products come near the matrix: the row of its largest diagonal entry, rescaled.
fn weights_of(matrix: &Matrix4<f64>, count: usize) -> Weights {
    let pivot = (0..count).max_by(|&a, &b| matrix[(a, a)].abs().total_cmp(&matrix[(b, b)].abs())).unwrap_or(0);
    let diagonal = matrix[(pivot, pivot)];
    let scale = diagonal.abs().sqrt().max(f64::MIN_POSITIVE);
    // A negative diagonal is noise; the paper flips the sign of the whole set.
    matrix.row(pivot).transpose() * (diagonal.signum() / scale)
}
