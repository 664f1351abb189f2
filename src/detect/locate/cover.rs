//! Where pixels lie against an ellipse, and what share of their light it gives.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instructions of the function that calls it"
)]

use fearless_simd::f32x8;
use fearless_simd::prelude::*;

use super::ellipse::{Ellipse, FORM, LOGISTIC};
use super::lanes::logistic_fall;
use crate::detect::single;

/// The share of a pixel's light that the ellipse gives, and its derivatives.
pub(super) struct Cover<S: Simd> {
    pub share: f32x8<S>,
    /// For each pixel that the rim moves outwards.
    pub by_rim: f32x8<S>,
    pub by_blur: f32x8<S>,
}

/// Position against the ellipse.
pub(super) struct Place<S: Simd> {
    /// Half of the distance from the rim in radii squared.
    n: f32x8<S>,
    gradient_squared: f32x8<S>,
    gradient: f32x8<S>,
    pub form: [f32x8<S>; FORM],
}

impl<S: Simd> Place<S> {
    #[inline(always)]
    pub(super) fn of(x: f32x8<S>, y: f32x8<S>, ellipse: &Ellipse) -> Self {
        let (m11, m12, m22) = (single(ellipse.matrix.m11), single(ellipse.matrix.m12), single(ellipse.matrix.m22));
        let qx = x - single(ellipse.centre.x);
        let qy = y - single(ellipse.centre.y);
        let (gx, gy) = (qx * m11 + qy * m12, qx * m12 + qy * m22);
        let squared = (qx * gx + qy * gy).max(1e-6);
        let gradient_squared = (gx * gx + gy * gy).max(1e-12);
        let gradient = gradient_squared.sqrt();
        let normal = f32x8::splat(x.simd, 1.0) / gradient;
        // Scaled to the rim, where the product is one.
        let half = normal * 0.5 / squared.sqrt();
        let (xx, xy, yy) = (qx * qx, qx * qy, qy * qy);
        // A larger matrix is a smaller ellipse.
        let form = [gx * normal, gy * normal, -(xx * half), -(xy * half) - xy * half, -(yy * half)];
        Self { n: squared - 1.0, gradient_squared, gradient, form }
    }

    /// Near the outline of a large ellipse the share falls with the distance as through a Gaussian blur; for one that is
    /// small against the blur it falls nearly as a Gaussian of the blur's width. It is symmetric about the centre, which is
    /// what the position lives on.
    #[inline(always)]
    pub(super) fn cover(&self, ellipse: &Ellipse, more: f64) -> Cover<S> {
        let own = ellipse.ln_blur.exp();
        let blur = own + more;
        let half_trace = 0.5 * ellipse.matrix.trace();
        let width = (LOGISTIC * blur * half_trace).powi(2);
        let w = self.gradient_squared * single(blur) + single(width);
        let per_root = f32x8::splat(w.simd, 1.0) / w.sqrt();
        let half = single(0.5 * LOGISTIC);
        let z = self.n * half * per_root;
        let share = logistic_fall(z);
        let edge = share - share * share;
        let by_rim = edge * (2.0 * half) * self.gradient * per_root;
        // Half of dw / d ln blur, over w.
        let widening = self.gradient_squared * single(own)
            + single(2.0 * own * LOGISTIC * LOGISTIC * blur * half_trace * half_trace);
        let by_blur = edge * z * 0.5 * widening * per_root * per_root;
        Cover { share, by_rim, by_blur }
    }
}
