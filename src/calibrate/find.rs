//! A picture in, the board's points in it out.

mod aprilgrid;
mod chessboard;
mod circles;
mod discs;
mod dots;
mod plane;
mod sampling;
mod tone;
#[cfg(test)]
mod views;

use thiserror::Error;

use super::SeenPoint;
use crate::board::{Board, Pattern};
use crate::camera::Pixel;
use crate::detect::luma;
use crate::frame::{Frame, FrameError, Region};

/// Least side of a picture in which a board is looked for, px.
const MIN_SIDE_PX: u32 = 48;

/// The luma of a picture, rows from the top, no padding.
struct Luma {
    width: usize,
    height: usize,
    samples: Vec<u8>,
}

impl Luma {
    /// All of it; `None` if it has no pixels.
    fn region(&self) -> Option<Region> {
        let [width, height] = [self.width, self.height].map(|side| u32::try_from(side).unwrap_or(0));
        let holds = self.width > 0 && self.height > 0 && self.samples.len() == self.width * self.height;
        holds.then_some(Region { x: 0, y: 0, width, height })
    }

    /// The pixel there, or the nearest of the border.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "casting saturates")]
    fn nearest(&self, place: &Pixel) -> u8 {
        let [x, y] = [(place.x, self.width), (place.y, self.height)]
            .map(|(at, side)| (at.round() as usize).min(side.saturating_sub(1)));
        self.samples.get(y * self.width + x).copied().unwrap_or(0)
    }
}

/// The points of the board that `frame` shows, each with its place.
///
/// # Errors
/// [`NoBoard`] says what is there instead.
pub fn find(frame: &Frame, board: &Board) -> Result<Vec<SeenPoint>, NoBoard> {
    let (width, height) = (frame.width(), frame.height());
    if width.min(height) < MIN_SIDE_PX {
        return Err(NoBoard::TooSmall { width, height, min: MIN_SIDE_PX });
    }
    let mut picture = Luma { width: width as usize, height: height as usize, samples: Vec::new() };
    luma::take(frame, frame.full(), &mut picture.samples);
    match board.pattern() {
        Pattern::Chessboard(chessboard) => chessboard::find(&picture, chessboard),
        Pattern::Circles(circles) => circles::find(&picture, circles),
        Pattern::Dots(dots) => dots::find(&picture, dots),
        Pattern::AprilGrid(grid) => aprilgrid::find(&picture, board, grid),
    }
}

/// Why a picture gives no points.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum NoBoard {
    /// The picture is smaller than any board could be seen in.
    #[error("the picture is {width} x {height} px: a board needs at least {min} px a side")]
    TooSmall {
        /// Its width, px.
        width: u32,
        /// Its height, px.
        height: u32,
        /// Least side, px.
        min: u32,
    },
    /// Nothing like the board.
    #[error("no {pattern} is seen: {}", hanging_together(*found, *need))]
    NotSeen {
        /// Name of the pattern.
        pattern: &'static str,
        /// The most points that hung together.
        found: usize,
        /// How many there are to be.
        need: usize,
    },
    /// A board, but of another size.
    #[error("a {pattern} of {}{found_columns} x {found_rows} is seen, not of {columns} x {rows}", if *cut { "at least " } else { "" })]
    OtherSize {
        /// Name of the pattern.
        pattern: &'static str,
        /// Columns that are seen.
        found_columns: usize,
        /// Rows that are seen.
        found_rows: usize,
        /// Columns that it has.
        columns: usize,
        /// Rows that it has.
        rows: usize,
        /// Whether the picture ends before what is seen does, so that there may be more of it.
        cut: bool,
    },
    /// What may be the board, but most of it is out of the picture.
    #[error(
        "{found_columns} x {found_rows} of the {columns} x {rows} points of a {pattern} are seen before the picture ends: {need} are needed"
    )]
    CutOff {
        /// Name of the pattern.
        pattern: &'static str,
        /// Columns that are seen.
        found_columns: usize,
        /// Rows that are seen.
        found_rows: usize,
        /// Columns that it has.
        columns: usize,
        /// Rows that it has.
        rows: usize,
        /// What is needed to be sure of it.
        need: Need,
    },
    /// More than one of it: which is meant, nobody knows.
    #[error("{count} boards are seen: cover or remove all but one")]
    Several {
        /// How many.
        count: usize,
    },
    /// The picture cannot be read.
    #[error(transparent)]
    Frame(#[from] FrameError),
}

/// How much of a board must be seen.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum Need {
    /// So many columns and rows.
    #[error("{0} columns and rows")]
    Lines(usize),
    /// So many points.
    #[error("{0} points")]
    Points(usize),
}

/// What is seen in place of a board of `need` points.
fn hanging_together(found: usize, need: usize) -> String {
    match found {
        0 => "nothing looks like its points".into(),
        _ if found < need => format!("{found} of its {need} points at most"),
        _ => format!("{found} points hang together, but not as its {need} do"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_without_the_board_is_told_what_is_true_of_it() {
        let not_seen = |found| NoBoard::NotSeen { pattern: "board of circles", found, need: 35 }.to_string();
        assert_eq!(not_seen(0), "no board of circles is seen: nothing looks like its points");
        assert_eq!(not_seen(20), "no board of circles is seen: 20 of its 35 points at most");
        assert_eq!(not_seen(35), "no board of circles is seen: 35 points hang together, but not as its 35 do");
        let (pattern, found_columns, found_rows, columns, rows) = ("chessboard", 9, 3, 8, 6);
        let other = |cut| NoBoard::OtherSize { pattern, found_columns, found_rows, columns, rows, cut }.to_string();
        assert_eq!(other(false), "a chessboard of 9 x 3 is seen, not of 8 x 6");
        assert_eq!(other(true), "a chessboard of at least 9 x 3 is seen, not of 8 x 6");
        let cut = NoBoard::CutOff { pattern, found_columns, found_rows, columns: 9, rows, need: Need::Lines(4) };
        let text =
            "9 x 3 of the 9 x 6 points of a chessboard are seen before the picture ends: 4 columns and rows are needed";
        assert_eq!(cut.to_string(), text);
    }
}
