//! A lattice of tags, as of the calibration toolbox Kalibr.

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
    /// Tags of the family.
    const FAMILY: u32 = 587;

    /// The corners of every tag: tags from the lower left as Kalibr numbers them, along x and then upwards; of each the lower
    /// left, lower right, upper right and upper left corner. The origin is the lower left corner of the first.
    pub(super) fn points(&self) -> Result<Vec<Vector2<f64>>, BoardError> {
        let need = "from 2 to 24 tags a side";
        check_count("columns", self.columns, [2, 24], need)?;
        check_count("rows", self.rows, [2, 24], need)?;
        if self.columns * self.rows > Self::FAMILY {
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

    pub(super) fn shapes(&self) -> Vec<Shape> {
        Vec::new()
    }
}
