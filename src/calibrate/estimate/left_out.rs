//! Why a camera does not rest on a view.

use thiserror::Error;

/// Why a camera does not rest on a view.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum LeftOut {
    /// Fewer points than a view needs.
    #[error("{points} points are too few: {need} are needed")]
    TooFewPoints {
        /// Points that are seen.
        points: usize,
        /// Points that a view needs.
        need: usize,
    },
    /// Neither board nor camera has moved since an earlier view.
    #[error("the board is where an earlier picture has it, so it tells nothing new: move the board or the camera")]
    Repeated,
    /// The board has no pose in which the points could be seen so.
    #[error("no pose of the board explains its points")]
    NoPose,
    /// Its points as a whole are too far from where the others have them.
    #[error(
        "it does not fit the others, its points are {median_px:.1} px off: another camera, zoom or board, or a board that moved"
    )]
    DoesNotFit {
        /// The median distance of its points from where they are predicted, px.
        median_px: f64,
    },
    /// Most of its points are wrong.
    #[error("only {inliers} of its {points} points fit: {need} are needed")]
    FewFit {
        /// Points that fit.
        inliers: usize,
        /// Points that are seen.
        points: usize,
        /// Points that a view needs.
        need: usize,
    },
    /// The points that fit leave the board's pose open, as points on one line do.
    #[error("the {inliers} points of it that fit lie on one line or nearly: that leaves the board's pose open")]
    PoseOpen {
        /// Points that fit.
        inliers: usize,
    },
}
