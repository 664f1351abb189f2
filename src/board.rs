//! A calibration board: a flat pattern of known points, what is printed of it and where.
//!
//! Its space, [`space::Board`]: x to the right and y down along the sheet as one reads it, z into the sheet, so that a camera
//! that looks at it squarely from the front has a rotation near identity. All points lie at z = 0.

mod aprilgrid;
mod chessboard;
mod circles;
mod dots;
mod name;
pub mod print;
pub mod shape;

use nalgebra::Vector2;
use thiserror::Error;

pub use aprilgrid::{AprilGrid, tag36h11};
pub use chessboard::Chessboard;
pub use circles::{CircleLayout, Circles};
pub use dots::{DotSheet, Dots};
pub use name::NameError;
pub use print::{Paper, Print, PrintError};
pub use shape::{Ink, Shape};

use crate::geometry::{Point, space};

/// What is on the board.
#[derive(Clone, Debug, PartialEq)]
pub enum Pattern {
    /// Black and white squares; its points are the inner corners.
    Chessboard(Chessboard),
    /// A lattice of dark discs; its points are their centres.
    Circles(Circles),
    /// Dark discs at irregular known places; its points are their centres.
    Dots(Dots),
    /// A lattice of square tags, each with a number; its points are their corners.
    AprilGrid(AprilGrid),
}

/// A board that can be calibrated with. Only [`Board::checked`] makes one.
#[derive(Clone, Debug, PartialEq)]
pub struct Board {
    pattern: Pattern,
    points: Vec<Point<space::Board>>,
}

/// Why a pattern is no board.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum BoardError {
    /// Too few or too many points along a side, or of dots, or of tags.
    #[error("{field} = {value}: {need}")]
    Count {
        /// The field.
        field: &'static str,
        /// What was given.
        value: usize,
        /// What is accepted.
        need: &'static str,
    },
    /// A length that is not finite, not positive, or out of proportion to the others.
    #[error("{field} = {value} m: {need}")]
    Length {
        /// The field.
        field: &'static str,
        /// What was given.
        value: f64,
        /// What is accepted.
        need: &'static str,
    },
    /// Two dots overlap.
    #[error(
        "dots {first} and {second} are {distance_m:.4} m apart, less than the {need_m:.4} m that keep them apart in a picture"
    )]
    Overlap {
        /// Position of the one.
        first: usize,
        /// Position of the other.
        second: usize,
        /// Their distance, m.
        distance_m: f64,
        /// The smallest that is accepted, m.
        need_m: f64,
    },
}

impl BoardError {
    /// The contract's name of the field at fault.
    #[must_use]
    pub const fn field(&self) -> &'static str {
        match self {
            Self::Count { field, .. } | Self::Length { field, .. } => field,
            Self::Overlap { .. } => "dots_m",
        }
    }
}

impl Board {
    /// Most points of a board.
    pub const MAX_POINTS: usize = 2_000;

    /// The board of this pattern.
    ///
    /// # Errors
    /// Names the number that makes no sense.
    pub fn checked(pattern: Pattern) -> Result<Self, BoardError> {
        let points = match &pattern {
            Pattern::Chessboard(chessboard) => chessboard.points()?,
            Pattern::Circles(circles) => circles.points()?,
            Pattern::Dots(dots) => dots.points()?,
            Pattern::AprilGrid(grid) => grid.points()?,
        };
        let points = points.into_iter().map(|place| Point::new(place.x, place.y, 0.0)).collect();
        Ok(Self { pattern, points })
    }

    /// What is on it.
    #[must_use]
    pub const fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// Its points in their order.
    #[must_use]
    pub fn points(&self) -> &[Point<space::Board>] {
        &self.points
    }

    /// Radius of its discs, m, where its points are the centres of discs: those are not seen at the centre of what is imaged.
    #[must_use]
    pub const fn disc_radius_m(&self) -> Option<f64> {
        match &self.pattern {
            Pattern::Circles(circles) => Some(circles.radius_m),
            Pattern::Dots(dots) => Some(dots.radius_m),
            Pattern::Chessboard(_) | Pattern::AprilGrid(_) => None,
        }
    }

    /// Everything that is printed black, on white.
    #[must_use]
    pub fn shapes(&self) -> Vec<Shape> {
        match &self.pattern {
            Pattern::Chessboard(chessboard) => chessboard.shapes(),
            Pattern::Circles(circles) => circles.shapes(),
            Pattern::Dots(dots) => dots.shapes(),
            Pattern::AprilGrid(grid) => grid.shapes(),
        }
    }

    /// White that must be left around what is printed, m: without it the outermost points are not found.
    #[must_use]
    pub const fn margin_m(&self) -> f64 {
        match &self.pattern {
            Pattern::Chessboard(chessboard) => chessboard.square_m,
            Pattern::Circles(circles) => 0.5 * circles.spacing_m,
            Pattern::Dots(dots) => 2.0 * dots.radius_m,
            Pattern::AprilGrid(grid) => grid.gap_m,
        }
    }

    /// Corners `[least, greatest]` of the sheet, margin included, m.
    #[must_use]
    pub fn sheet(&self) -> [Vector2<f64>; 2] {
        let far = Vector2::repeat(f64::INFINITY);
        let [least, greatest] = self
            .shapes()
            .iter()
            .map(Shape::bounds)
            .fold([far, -far], |sum, shape| [sum[0].inf(&shape[0]), sum[1].sup(&shape[1])]);
        let margin = Vector2::repeat(self.margin_m());
        [least - margin, greatest + margin]
    }
}

/// A length within the range of what can be printed and photographed.
fn check_length(field: &'static str, value: f64) -> Result<(), BoardError> {
    if (1e-5..=100.0).contains(&value) {
        return Ok(());
    }
    Err(BoardError::Length { field, value, need: "a length from 0.00001 to 100 m" })
}

fn check_count(field: &'static str, value: u32, [least, most]: [u32; 2], need: &'static str) -> Result<(), BoardError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(BoardError::Count { field, value: value as usize, need })
}
