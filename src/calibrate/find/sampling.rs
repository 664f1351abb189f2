//! What sampling does to the place where two edges cross.
//!
//! An edge along a row of pixels lies alike between all of them, so that what sampling does to one of them it does to all; an edge that drifts across
//! rows has that averaged out. No fit shows it in what it leaves over, and corners of one row share it.

/// What it does to an edge without blur that does not drift, px.
const WHOLE_PX: f64 = 0.032;

/// It falls with the blur as a Gaussian of this does, px.
const BLUR_PX: f64 = 0.5;

/// The drift at which a half of it is left, px.
const HALF_DRIFT_PX: f64 = 1.0;

/// Of what a fit leaves over more lies where the picture is black, or white, and in what a mosaic leaves beside edges, than on the edges that tell the
/// place: there the variance is this share of the mean.
pub(super) const QUIET: f64 = 0.75;

/// The variance per axis, px^2, of where two edges cross of this blur that drift so far across rows or columns of pixels, px.
///
/// Fitted, as [`QUIET`], to 40,000 corners of rendered chessboards and tags, gray and of a mosaic, of blurs from 0.35 to 1 px.
pub(super) fn variance_px2(drifts_px: [f64; 2], blur_px: f64) -> f64 {
    let whole = WHOLE_PX * (-0.5 * (blur_px / BLUR_PX).powi(2)).exp();
    let left = drifts_px.map(|drift| 1.0 / (1.0 + (drift / HALF_DRIFT_PX).powi(4)));
    0.5 * whole * whole * (left[0] + left[1])
}
