//! A lattice of tags, as of the calibration toolbox Kalibr.

pub mod tag36h11;

use nalgebra::Vector2;

use super::shape::Shape;
use super::{BoardError, check_count, check_length};

/// A lattice of tags of the family `tag36h11`, black squares where their corners meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AprilGrid {
    /// Tags along x.
    pub columns: u32,
    /// Tags along y.
    pub rows: u32,
    /// Side of a tag, black border included, m.
    pub tag_m: f64,
    /// White between two tags, m.
    pub gap_m: f64,
}

impl AprilGrid {
    /// Cells of a side of a tag: those of its code, and two of black border on either side, as Kalibr prints them.
    pub const CELLS: u32 = tag36h11::SIDE + 2 * Self::BORDER;

    /// Cells of black border.
    pub const BORDER: u32 = 2;

    /// The corners of every tag: tags from the lower left as Kalibr numbers them, along x and then upwards; of each the lower
    /// left, lower right, upper right and upper left corner. The origin is the lower left corner of the first.
    pub(super) fn points(&self) -> Result<Vec<Vector2<f64>>, BoardError> {
        let need = "from 2 to 24 tags a side";
        check_count("columns", self.columns, [2, 24], need)?;
        check_count("rows", self.rows, [2, 24], need)?;
        if (self.columns * self.rows) as usize > tag36h11::CODES.len() {
            let value = (self.columns * self.rows) as usize;
            return Err(BoardError::Count {
                field: "columns",
                value,
                need: "at most 587 tags, as many as the family has",
            });
        }
        check_length("tag_m", self.tag_m)?;
        check_length("gap_m", self.gap_m)?;
        let tags = (0..self.rows).flat_map(|row| (0..self.columns).map(move |column| (column, row)));
        Ok(tags
            .flat_map(|(column, row)| {
                // y is down, Kalibr counts upwards.
                let corner = Vector2::new(f64::from(column), -f64::from(row)) * (self.tag_m + self.gap_m);
                [[0.0, 0.0], [1.0, 0.0], [1.0, -1.0], [0.0, -1.0]].map(|c| corner + Vector2::from(c) * self.tag_m)
            })
            .collect())
    }

    /// The tags, and squares in the gaps' crossings, which make every corner one of four fields as on a chessboard.
    pub(super) fn shapes(&self) -> Vec<Shape> {
        let step = self.tag_m + self.gap_m;
        let lattice = |columns: u32, rows: u32| {
            (0..rows).flat_map(move |row| (0..columns).map(move |column| [f64::from(column), -f64::from(row)]))
        };
        let mut shapes = Vec::new();
        for (corner, code) in lattice(self.columns, self.rows).zip(tag36h11::CODES) {
            // y is down: the tag's upper left corner.
            let least = Vector2::from(corner) * step - Vector2::new(0.0, self.tag_m);
            self.print_tag(code, &least, &mut shapes);
        }
        shapes.extend(lattice(self.columns + 1, self.rows + 1).map(|crossing| {
            let least = Vector2::from(crossing) * step - Vector2::new(self.gap_m, 0.0);
            Shape::Rectangle { least, greatest: least + Vector2::repeat(self.gap_m) }
        }));
        shapes
    }

    /// Border and black cells, those that are side by side as one shape.
    fn print_tag(&self, code: u64, least: &Vector2<f64>, shapes: &mut Vec<Shape>) {
        let at = |column: u32, row: u32| {
            least + Vector2::new(f64::from(column), f64::from(row)) * (self.tag_m / f64::from(Self::CELLS))
        };
        let inside = Self::CELLS - Self::BORDER;
        shapes.push(Shape::Rectangle { least: at(0, 0), greatest: at(Self::CELLS, Self::BORDER) });
        for row in Self::BORDER..inside {
            let is_white = |column: u32| tag36h11::is_white(code, row - Self::BORDER, column - Self::BORDER);
            let mut start = 0;
            for column in Self::BORDER..=inside {
                let ends = column == inside || is_white(column);
                if ends {
                    let end = if column == inside { Self::CELLS } else { column };
                    if end > start {
                        shapes.push(Shape::Rectangle { least: at(start, row), greatest: at(end, row + 1) });
                    }
                    start = column + 1;
                }
            }
        }
        shapes.push(Shape::Rectangle { least: at(0, inside), greatest: at(Self::CELLS, Self::CELLS) });
    }
}

#[cfg(test)]
mod tests {
    use crate::board::{Board, Ink};
    use nalgebra::Vector2;

    use super::*;

    #[test]
    fn a_tag_is_printed_cell_by_cell() {
        let board: Board = "aprilgrid:3x2:0.1:0.03".parse().expect("a board");
        let ink = Ink::of(board.shapes());
        for (number, [x, y]) in [(0, [0.0, 0.0]), (1, [0.13, 0.0]), (5, [0.26, -0.13])] {
            for row in 0..10 {
                for column in 0..10 {
                    let place =
                        Vector2::new(x + 0.01 * (f64::from(column) + 0.5), y - 0.1 + 0.01 * (f64::from(row) + 0.5));
                    let is_border = [row, column].iter().any(|c| !(2..8).contains(c));
                    let is_black = is_border || !tag36h11::is_white(tag36h11::CODES[number], row - 2, column - 2);
                    assert_eq!(ink.is_at(&place), is_black, "tag {number}, cell {row} {column}");
                }
            }
        }
    }

    #[test]
    fn every_corner_is_one_of_four_fields() {
        let board: Board = "aprilgrid:4x3:0.08:0.02".parse().expect("a board");
        let ink = Ink::of(board.shapes());
        for point in board.points() {
            let at = |x: f64, y: f64| ink.is_at(&(point.coords.xy() + Vector2::new(x, y) * 1e-3));
            let around = [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
            assert!(
                around == [true, false, true, false] || around == [false, true, false, true],
                "{point:?}: {around:?}"
            );
        }
    }
}
