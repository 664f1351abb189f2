//! What is printed: one truth for the sheet, for rendered pictures and for tests.

use nalgebra::Vector2;

/// A black shape, m, in the board's space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Along the axes.
    Rectangle {
        /// Corner of least x and y.
        least: Vector2<f64>,
        /// The opposite corner.
        greatest: Vector2<f64>,
    },
    /// A disc.
    Disc {
        /// Its centre.
        centre: Vector2<f64>,
        /// Its radius.
        radius: f64,
    },
}

impl Shape {
    /// Corners `[least, greatest]` of the box around it.
    #[must_use]
    pub fn bounds(&self) -> [Vector2<f64>; 2] {
        match *self {
            Self::Rectangle { least, greatest } => [least, greatest],
            Self::Disc { centre, radius } => [centre - Vector2::repeat(radius), centre + Vector2::repeat(radius)],
        }
    }

    /// Whether the place lies within it.
    #[must_use]
    pub fn contains(&self, place: &Vector2<f64>) -> bool {
        match *self {
            Self::Rectangle { least, greatest } => {
                (least.x..=greatest.x).contains(&place.x) && (least.y..=greatest.y).contains(&place.y)
            }
            Self::Disc { centre, radius } => (place - centre).norm_squared() <= radius * radius,
        }
    }
}

/// The shapes of a sheet sorted into cells, so that a place is looked up in no time.
#[derive(Clone, Debug)]
pub struct Ink {
    shapes: Vec<Shape>,
    origin: Vector2<f64>,
    cell_m: Vector2<f64>,
    cells: Vec<Vec<u16>>,
}

/// Cells a side.
const CELLS: usize = 48;

impl Ink {
    /// Of these shapes, at most 65,535.
    #[must_use]
    pub fn of(mut shapes: Vec<Shape>) -> Self {
        shapes.truncate(usize::from(u16::MAX));
        let far = Vector2::repeat(f64::INFINITY);
        let [least, greatest] = shapes
            .iter()
            .map(Shape::bounds)
            .fold([far, -far], |sum, shape| [sum[0].inf(&shape[0]), sum[1].sup(&shape[1])]);
        let mut ink = Self {
            shapes,
            origin: least,
            cell_m: (greatest - least) / CELLS as f64,
            cells: vec![Vec::new(); CELLS * CELLS],
        };
        for (index, shape) in (0_u16..).zip(&ink.shapes) {
            let [from, to] = shape.bounds().map(|corner| ink.clamped_cell(&corner));
            for row in from[1]..=to[1] {
                for cell in &mut ink.cells[row * CELLS + from[0]..=row * CELLS + to[0]] {
                    cell.push(index);
                }
            }
        }
        ink
    }

    /// Whether the place is printed black.
    #[must_use]
    pub fn is_at(&self, place: &Vector2<f64>) -> bool {
        let [x, y] = self.clamped_cell(place);
        self.cells[y * CELLS + x].iter().any(|index| self.shapes[usize::from(*index)].contains(place))
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped; NaN is the first cell")]
    fn clamped_cell(&self, place: &Vector2<f64>) -> [usize; 2] {
        let cell = (place - self.origin).component_div(&self.cell_m);
        [cell.x, cell.y].map(|c| (c.max(0.0) as usize).min(CELLS - 1))
    }
}
