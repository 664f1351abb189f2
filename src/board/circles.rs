//! A lattice of discs.

use nalgebra::Vector2;

use super::shape::Shape;
use super::{BoardError, check_count, check_length};

/// How the lattice is laid out; both as in OpenCV.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CircleLayout {
    /// Point `(column, row)` lies at `(column, row) * spacing_m`.
    Symmetric,
    /// Every other row is shifted: point `(column, row)` lies at `(2 column + row % 2, row) * spacing_m`.
    Asymmetric,
}

/// A lattice of black discs on white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circles {
    /// Discs a row.
    pub columns: u32,
    /// Rows.
    pub rows: u32,
    /// Unit of the lattice, m: see the layout.
    pub spacing_m: f64,
    /// Radius of a disc, m.
    pub radius_m: f64,
    /// The layout.
    pub layout: CircleLayout,
}

impl Circles {
    /// The centres, row by row; the first is the origin.
    pub(super) fn points(&self) -> Result<Vec<Vector2<f64>>, BoardError> {
        let need = "from 3 to 40 discs a side";
        check_count("columns", self.columns, [3, 40], need)?;
        check_count("rows", self.rows, [3, 40], need)?;
        check_length("spacing_m", self.spacing_m)?;
        check_length("radius_m", self.radius_m)?;
        let most = match self.layout {
            CircleLayout::Symmetric => 0.45,
            CircleLayout::Asymmetric => 0.45 * std::f64::consts::SQRT_2,
        };
        if self.radius_m > most * self.spacing_m {
            let need = "at most 0.45 of the distance between neighbours, or the discs touch in a picture";
            return Err(BoardError::Length { field: "radius_m", value: self.radius_m, need });
        }
        Ok((0..self.rows)
            .flat_map(|row| (0..self.columns).map(move |column| (column, row)))
            .map(|(column, row)| self.place(column, row))
            .collect())
    }

    /// Where the disc lies, m.
    #[must_use]
    pub fn place(&self, column: u32, row: u32) -> Vector2<f64> {
        let across = match self.layout {
            CircleLayout::Symmetric => column,
            CircleLayout::Asymmetric => 2 * column + row % 2,
        };
        Vector2::new(f64::from(across), f64::from(row)) * self.spacing_m
    }

    pub(super) fn shapes(&self) -> Vec<Shape> {
        let all = (0..self.rows).flat_map(|row| (0..self.columns).map(move |column| (column, row)));
        all.map(|(column, row)| Shape::Disc { centre: self.place(column, row), radius: self.radius_m }).collect()
    }
}
