//! Camera calibration: pictures of a board in, a camera with its covariance and a report out.
//!
//! [`find`](find::find) sees the board's points in one picture; [`calibrate`](estimate::calibrate) makes a camera of many such
//! sightings; [`report`](report::report) tells how far to trust it.

mod bundle;
pub mod coverage;
pub mod drawing;
pub mod estimate;
mod evidence;
pub mod find;
pub mod freedom;
pub mod held_out;
pub mod next_view;
pub mod pattern_error;
pub mod report;
mod start;
pub mod watch;

use crate::camera::Pixel;

/// A point of the board where a picture shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenPoint {
    /// Its position in [`Board::points`](crate::board::Board::points).
    pub point: usize,
    /// Where it is seen. For discs the centroid of the disc's image, which is not the image of its centre.
    pub pixel: Pixel,
    /// Standard deviation per axis, px, as far as the picture tells.
    pub sigma_px: f64,
}
