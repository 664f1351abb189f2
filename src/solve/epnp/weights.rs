//! The weights of the singular vectors, from the distances between control points.
//!
//! With `x = sum_k b_k v_k`, each distance is linear in the products `b_k b_l`. One, two and three vectors leave no more
//! products than distances; four leave ten against six, which is closed by relinearization (the products are not
//! independent: `b_i b_j * b_k b_l = b_i b_k * b_j b_l`).

use nalgebra::{DMatrix, DVector, Matrix4, Vector3};

use super::ControlPoints;

/// Gauss-Newton steps at most; it converges quadratically.
const REFINEMENTS: usize = 20;

/// One set of weights for each number of vectors assumed, each refined on the distances.
pub(super) fn candidates(vectors: &[ControlPoints], control_points: &ControlPoints) -> Vec<Vec<f64>> {
    let sides = Sides::of(vectors, control_points);
    let mut found = vec![sides.one()];
    found.extend(sides.by_products(2));
    if vectors.len() == 4 {
        found.extend(sides.by_products(3));
        found.extend(sides.four());
    }
    for weights in &mut found {
        weights.resize(vectors.len(), 0.0);
        sides.refine(weights);
    }
    found
}

/// For each pair of control points: the difference in every singular vector, and the true squared distance.
struct Sides {
    differences: Vec<Vec<Vector3<f64>>>,
    squares: DVector<f64>,
}

impl Sides {
    fn of(vectors: &[ControlPoints], control_points: &ControlPoints) -> Self {
        let count = control_points.len();
        let ends: Vec<(usize, usize)> = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j))).collect();
        let differences = ends.iter().map(|&(i, j)| vectors.iter().map(|v| v[i] - v[j]).collect()).collect();
        let squares = DVector::from_iterator(
            ends.len(),
            ends.iter().map(|&(i, j)| (control_points[i] - control_points[j]).norm_squared()),
        );
        Self { differences, squares }
    }

    /// One vector: the scale that fits all distances best.
    fn one(&self) -> Vec<f64> {
        let (mut above, mut below) = (0.0, 0.0);
        for (difference, square) in self.differences.iter().zip(self.squares.iter()) {
            above += difference[0].norm() * square.sqrt();
            below += difference[0].norm_squared();
        }
        vec![above / below]
    }

    /// Coefficients of the products `b_k b_l`, `k <= l < count`, in the squared distances.
    fn product_matrix(&self, count: usize) -> DMatrix<f64> {
        let products = products(count);
        DMatrix::from_fn(self.squares.len(), products.len(), |side, product| {
            let (k, l) = products[product];
            let dot = self.differences[side][k].dot(&self.differences[side][l]);
            if k == l { dot } else { 2.0 * dot }
        })
    }

    /// Two or three vectors: the products by least squares, the weights from the products.
    fn by_products(&self, count: usize) -> Option<Vec<f64>> {
        let solution = self.product_matrix(count).svd(true, true).solve(&self.squares, 1e-14).ok()?;
        let matrix = symmetric(count, |index| solution[index]);
        Some(weights_of(&matrix, count))
    }

    /// Four vectors by relinearization (Kipnis and Shamir 1999, as the paper uses it).
    fn four(&self) -> Option<Vec<f64>> {
        let count = 4;
        let linear = self.product_matrix(count);
        let particular = linear.clone().svd(true, true).solve(&self.squares, 1e-14).ok()?;
        // The four directions in which the six distances leave the ten products open.
        let gram = linear.transpose() * &linear;
        let eigen = gram.symmetric_eigen();
        let mut order: Vec<usize> = (0..10).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let fixed = symmetric(count, |index| particular[index]);
        let open: Vec<Matrix4<f64>> =
            order[..4].iter().map(|&k| symmetric(count, |index| eigen.eigenvectors[(index, k)])).collect();
        // All 2 x 2 minors of the matrix of products vanish; each is quadratic in the four open shares.
        let corners: Vec<(usize, usize)> = (0..4).flat_map(|a| (a + 1..4).map(move |b| (a, b))).collect();
        let minors: Vec<_> = corners
            .iter()
            .enumerate()
            .flat_map(|(i, &rows)| corners[i..].iter().map(move |&columns| (rows, columns)))
            .collect();
        let squares = products(4);
        let mut system = DMatrix::zeros(minors.len(), squares.len() + 4);
        let mut right = DVector::zeros(minors.len());
        for (row, &((a, b), (c, d))) in minors.iter().enumerate() {
            let minor = |m: &Matrix4<f64>, n: &Matrix4<f64>| m[(a, c)] * n[(b, d)] - m[(a, d)] * n[(b, c)];
            for (column, &(k, l)) in squares.iter().enumerate() {
                system[(row, column)] = if k == l {
                    minor(&open[k], &open[k])
                } else {
                    minor(&open[k], &open[l]) + minor(&open[l], &open[k])
                };
            }
            for (k, direction) in open.iter().enumerate() {
                system[(row, squares.len() + k)] = minor(&fixed, direction) + minor(direction, &fixed);
            }
            right[row] = -minor(&fixed, &fixed);
        }
        let shares = system.svd(true, true).solve(&right, 1e-12).ok()?;
        let matrix = open.iter().enumerate().fold(fixed, |sum, (k, m)| sum + m * shares[squares.len() + k]);
        Some(weights_of(&matrix, count))
    }

    /// Gauss-Newton on the squared distances over as many weights as the distances can fix.
    fn refine(&self, weights: &mut [f64]) {
        let count = weights.len();
        let mut best = self.misfit(weights);
        for _ in 0..REFINEMENTS {
            let mut jacobian = DMatrix::zeros(self.squares.len(), count);
            let mut residual = DVector::zeros(self.squares.len());
            for (side, difference) in self.differences.iter().enumerate() {
                let total: Vector3<f64> = difference.iter().zip(weights.iter()).map(|(d, w)| d * *w).sum();
                residual[side] = self.squares[side] - total.norm_squared();
                for k in 0..count {
                    jacobian[(side, k)] = 2.0 * total.dot(&difference[k]);
                }
            }
            let Ok(step) = jacobian.svd(true, true).solve(&residual, 1e-12) else { return };
            // A full step may overshoot; a share of it that makes the misfit smaller exists unless it has settled.
            let shorter = (0..6).map(|halvings| 0.5_f64.powi(halvings)).find_map(|share| {
                let next: Vec<f64> = weights.iter().zip(step.iter()).map(|(w, s)| w + share * s).collect();
                let misfit = self.misfit(&next);
                (misfit < best).then_some((next, misfit))
            });
            let Some((next, misfit)) = shorter else { return };
            best = misfit;
            weights.copy_from_slice(&next);
        }
    }

    fn misfit(&self, weights: &[f64]) -> f64 {
        self.differences
            .iter()
            .zip(self.squares.iter())
            .map(|(difference, square)| {
                let total: Vector3<f64> = difference.iter().zip(weights).map(|(d, w)| d * *w).sum();
                (total.norm_squared() - square).powi(2)
            })
            .sum()
    }
}

/// The products of `count` weights, in the order of the linear systems.
fn products(count: usize) -> Vec<(usize, usize)> {
    (0..count).flat_map(|k| (k..count).map(move |l| (k, l))).collect()
}

/// The symmetric matrix of the products; rows and columns past `count` are zero.
fn symmetric(count: usize, value: impl Fn(usize) -> f64) -> Matrix4<f64> {
    let mut matrix = Matrix4::zeros();
    for (index, (k, l)) in products(count).into_iter().enumerate() {
        matrix[(k, l)] = value(index);
        matrix[(l, k)] = value(index);
    }
    matrix
}

/// Weights whose products come near the matrix: the row of its largest diagonal entry, rescaled.
fn weights_of(matrix: &Matrix4<f64>, count: usize) -> Vec<f64> {
    let pivot = (0..count).max_by(|&a, &b| matrix[(a, a)].abs().total_cmp(&matrix[(b, b)].abs())).unwrap_or(0);
    let diagonal = matrix[(pivot, pivot)];
    let scale = diagonal.abs().sqrt().max(f64::MIN_POSITIVE);
    // A negative diagonal is noise; the paper flips the sign of the whole set.
    (0..count).map(|k| matrix[(pivot, k)] * diagonal.signum() / scale).collect()
}
