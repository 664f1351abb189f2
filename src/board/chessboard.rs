//! Black and white squares.

use nalgebra::Vector2;

use super::shape::Shape;
use super::{BoardError, check_count, check_length};

/// A chessboard, counted by its inner corners as everybody does. The square of least x and y is black.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chessboard {
    /// Inner corners along x.
    pub columns: u32,
    /// Inner corners along y.
    pub rows: u32,
    /// Side of a square, m.
    pub square_m: f64,
}

impl Chessboard {
    /// The inner corners, row by row; the first is the origin.
    pub(super) fn points(&self) -> Result<Vec<Vector2<f64>>, BoardError> {
        let need = "from 3 to 40 inner corners a side";
        check_count("columns", self.columns, [3, 40], need)?;
        check_count("rows", self.rows, [3, 40], need)?;
        check_length("square_m", self.square_m)?;
        let place = |(column, row): (u32, u32)| Vector2::new(f64::from(column), f64::from(row)) * self.square_m;
        Ok((0..self.rows).flat_map(|row| (0..self.columns).map(move |column| (column, row))).map(place).collect())
    }

    pub(super) fn shapes(&self) -> Vec<Shape> {
        let black = (0..=self.rows).flat_map(|row| (0..=self.columns).map(move |column| (column, row)));
        black
            .filter(|(column, row)| (column + row) % 2 == 0)
            .map(|(column, row)| {
                let greatest = Vector2::new(f64::from(column), f64::from(row)) * self.square_m;
                Shape::Rectangle { least: greatest - Vector2::repeat(self.square_m), greatest }
            })
            .collect()
    }
}
