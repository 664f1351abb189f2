//! What sampling does to the place where two edges cross.
//!
//! An edge along a row of pixels lies alike between all of them, so that what sampling does to one of them it does to all; an edge that drifts across
//! rows has that averaged out. No fit shows it in what it leaves over, and corners of one row share it.

/// What it does to an edge without blur that does not drift, px.
const WHOLE_PX: f64 = 0.05;

/// It falls with the blur as a Gaussian of this does, px.
const BLUR_PX: f64 = 0.35;

/// The drift at which a half of it is left, px.
const HALF_DRIFT_PX: f64 = 1.0;

/// The part of what a fit leaves over that moves the place where two edges cross of this blur, px, as noise of the same variance would: what sampling
/// leaves beside sharp edges, and a mosaic the more, lies alike on both of their sides.
pub(super) fn moving_share(blur_px: f64) -> f64 {
    (0.5 + (blur_px - 0.45) / 0.6).clamp(0.5, 1.0)
}

/// The variance per axis, px^2, of where two edges cross of this blur that drift so far across rows or columns of pixels, px.
///
/// Fitted, as [`moving_share`], to 40,000 corners of rendered chessboards and tags, gray and of a mosaic, of blurs from 0.35 to 1 px.
pub(super) fn variance_px2(drifts_px: [f64; 2], blur_px: f64) -> f64 {
    let whole = WHOLE_PX * (-0.5 * (blur_px / BLUR_PX).powi(2)).exp();
    let left = drifts_px.map(|drift| 1.0 / (1.0 + (drift / HALF_DRIFT_PX).powi(4)));
    0.5 * whole * whole * (left[0] + left[1])
}
