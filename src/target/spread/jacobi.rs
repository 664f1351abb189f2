//! Eigenvectors of a small symmetric matrix by Jacobi's rotations, which keep the small eigenvalues of graded matrices exact.

use nalgebra::SMatrix;

/// Off-diagonal entries below this share of their diagonal ones are rounding.
const SETTLED: f64 = 1e-16;

/// Sweeps; five are usual.
const SWEEPS: usize = 30;

/// Orthonormal columns that make `v' matrix v` diagonal, and that.
pub(crate) fn eigenvectors<const N: usize>(matrix: &SMatrix<f64, N, N>) -> (SMatrix<f64, N, N>, SMatrix<f64, N, N>) {
    let mut m = *matrix;
    let mut v = SMatrix::<f64, N, N>::identity();
    for _ in 0..SWEEPS {
        let mut turned = false;
        for (a, b) in (0..N).flat_map(|a| (a + 1..N).map(move |b| (a, b))) {
            let (aa, bb, ab) = (m[(a, a)], m[(b, b)], m[(a, b)]);
            // Also for NaN.
            if !(ab * ab > SETTLED * SETTLED * (aa * bb).abs()) {
                continue;
            }
            turned = true;
            let zeta = (bb - aa) / (2.0 * ab);
            let t = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
            let cosine = 1.0 / (1.0 + t * t).sqrt();
            let sine = cosine * t;
            m[(a, a)] = aa - t * ab;
            m[(b, b)] = bb + t * ab;
            (m[(a, b)], m[(b, a)]) = (0.0, 0.0);
            for c in (0..N).filter(|c| *c != a && *c != b) {
                let (ac, bc) = (m[(a, c)], m[(b, c)]);
                (m[(a, c)], m[(b, c)]) = (cosine * ac - sine * bc, sine * ac + cosine * bc);
                (m[(c, a)], m[(c, b)]) = (m[(a, c)], m[(b, c)]);
            }
            for i in 0..N {
                let (va, vb) = (v[(i, a)], v[(i, b)]);
                (v[(i, a)], v[(i, b)]) = (cosine * va - sine * vb, sine * va + cosine * vb);
            }
        }
        if !turned {
            break;
        }
    }
    (v, m)
}
