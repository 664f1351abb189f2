//! What is printed between four corners, read as a tag.

use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::crossing::Start;
use super::plane::Plane;
use super::quads::Quad;
use crate::board::{AprilGrid, tag36h11};
use crate::camera::Pixel;

/// Most cells that may be read wrong: the family's tags differ in eleven.
const MAX_WRONG: u32 = 3;

/// Least share of the border's cells that must be black, and of the gap that must be white.
const MIN_BLACK: f64 = 0.92;
const MIN_WHITE: f64 = 0.85;

/// Least white less black, codes.
const MIN_CONTRAST: f64 = 8.0;

/// A tag that is seen.
#[derive(Clone, Debug)]
pub(super) struct Tag {
    /// Its number in the family.
    pub number: usize,
    /// Its corners as the board has them: lower left, lower right, upper right, upper left.
    pub corners: [Pixel; 4],
    /// White less black, codes.
    contrast: f64,
    /// From the tag's space, its lower left corner the origin, its side 1, y down as on the board, to pixels.
    pub pixel_from_sides: Matrix3<f64>,
    sides_from_pixel: Matrix3<f64>,
}

/// Cells of a side.
const CELLS: f64 = AprilGrid::CELLS as f64;

impl Tag {
    /// The tag between the corners; `None` where none is printed.
    pub(super) fn read(raw: &Plane, quad: &Quad, grid: &AprilGrid) -> Option<Self> {
        let square = [[0.0, 0.0], [CELLS, 0.0], [CELLS, CELLS], [0.0, CELLS]];
        let pixel_from_cell = homography(&square.map(Vector2::from), quad)?;
        let light = Light::of(raw, &pixel_from_cell, grid)?;
        let code = light.code(raw, &pixel_from_cell)?;
        let mut turn = code;
        for first in 0..4 {
            let nearest = tag36h11::CODES.iter().map(|other| (turn ^ other).count_ones()).enumerate();
            if let Some((number, wrong)) = nearest.min_by_key(|(_, wrong)| *wrong)
                && wrong <= MAX_WRONG
            {
                // The quad is clockwise, its corner `first` the tag's upper left one.
                let corners = [3, 2, 1, 0].map(|corner| quad[(first + corner) % 4]);
                return Self::checked(number, corners, light.contrast);
            }
            turn = turned(turn);
        }
        None
    }

    fn checked(number: usize, corners: [Pixel; 4], contrast: f64) -> Option<Self> {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, -1.0], [0.0, -1.0]].map(Vector2::from);
        let pixel_from_sides = homography(&square, &corners)?;
        Some(Self { number, corners, contrast, pixel_from_sides, sides_from_pixel: pixel_from_sides.try_inverse()? })
    }

    /// Where a pixel lies, in sides of the tag from its lower left corner, as if the board went on flat.
    pub(super) fn place_of(&self, pixel: &Pixel) -> Option<Vector2<f64>> {
        let place = self.sides_from_pixel * pixel.push(1.0);
        (place.z > 0.0).then(|| place.xy() / place.z)
    }

    fn sides_px(&self) -> [f64; 4] {
        [0, 1, 2, 3].map(|corner| (self.corners[corner] - self.corners[(corner + 1) % 4]).norm())
    }

    /// The shortest side, px.
    pub(super) fn least_side_px(&self) -> f64 {
        self.sides_px().into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Whether it is the same tag at the same place.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        let side_px = self.sides_px().iter().sum::<f64>() / 4.0;
        self.number == other.number && (self.corners[0] - other.corners[0]).norm() < 0.3 * side_px
    }

    /// Where the fit of a corner begins.
    pub(super) fn start(&self, corner: usize, grid: &AprilGrid) -> Option<Start> {
        let place = [[0.0, 0.0], [1.0, 0.0], [1.0, -1.0], [0.0, -1.0]][corner];
        let h = &self.pixel_from_sides;
        let image = h * Vector3::new(place[0], place[1], 1.0);
        if !(image.z > 0.0) {
            return None;
        }
        let pixel = image.xy() / image.z;
        let by = |axis: usize| (h.fixed_view::<2, 1>(0, axis) - pixel * h[(2, axis)]) / image.z;
        Some(Start {
            place: self.corners[corner],
            axes: Matrix2::from_columns(&[by(0), by(1)]),
            bends_per_px: [0.0; 2],
            // The gap, and two cells of border.
            reach: (grid.gap_m / grid.tag_m).min(f64::from(AprilGrid::BORDER) / CELLS),
            // The quarter to the right of and below the corner is the tag's for the upper left one.
            is_black: corner % 2 == 1,
            contrast: self.contrast,
        })
    }
}

/// Black and white about a tag, each a plane over its cells.
struct Light {
    black: Vector3<f64>,
    white: Vector3<f64>,
    contrast: f64,
}

impl Light {
    fn of(raw: &Plane, pixel_from_cell: &Matrix3<f64>, grid: &AprilGrid) -> Option<Self> {
        let cells = 0..AprilGrid::CELLS;
        let middle = |cell: u32| f64::from(cell) + 0.5;
        let inside = AprilGrid::BORDER..AprilGrid::CELLS - AprilGrid::BORDER;
        let border = cells.clone().flat_map(|row| cells.clone().map(move |column| [column, row]));
        let border = border.filter(|cell| !cell.iter().all(|c| inside.contains(c))).map(|cell| cell.map(middle));
        let black = samples(raw, pixel_from_cell, border);
        let gap = 0.5 * (grid.gap_m / grid.tag_m).min(0.6) * CELLS;
        let around = cells.flat_map(|cell| {
            let along = middle(cell);
            [[along, -gap], [along, CELLS + gap], [-gap, along], [CELLS + gap, along]]
        });
        let white = samples(raw, pixel_from_cell, around);
        // All of the tag must be seen, and most of what is around it.
        if black.len() < 64 || white.len() < 16 {
            return None;
        }
        let light = Self { black: level(&black)?, white: level(&white)?, contrast: 0.0 };
        let centre = [0.5 * CELLS; 2];
        let contrast = at(&light.white, centre) - at(&light.black, centre);
        let share = |samples: &[Sample], is_white: bool| {
            let right = samples.iter().filter(|sample| (light.is_white(sample)) == is_white).count();
            right as f64 / samples.len() as f64
        };
        let is_tag = contrast >= MIN_CONTRAST && share(&black, false) >= MIN_BLACK && share(&white, true) >= MIN_WHITE;
        is_tag.then_some(Self { contrast, ..light })
    }

    fn is_white(&self, (place, value): &Sample) -> bool {
        *value > 0.5 * (at(&self.black, *place) + at(&self.white, *place))
    }

    /// The cells as bits, row by row.
    fn code(&self, raw: &Plane, pixel_from_cell: &Matrix3<f64>) -> Option<u64> {
        let middle = |cell: u32| f64::from(cell + AprilGrid::BORDER) + 0.5;
        let cells = (0..tag36h11::SIDE).flat_map(|row| (0..tag36h11::SIDE).map(move |column| [column, row]));
        let cells = samples(raw, pixel_from_cell, cells.map(|cell| cell.map(middle)));
        let is_whole = cells.len() == (tag36h11::SIDE * tag36h11::SIDE) as usize;
        is_whole.then(|| cells.iter().fold(0, |code, cell| code << 1 | u64::from(self.is_white(cell))))
    }
}

/// A place in cells, and the light there.
type Sample = ([f64; 2], f64);

/// Means about these places; those that the picture does not show are left out.
fn samples(raw: &Plane, pixel_from_cell: &Matrix3<f64>, places: impl Iterator<Item = [f64; 2]>) -> Vec<Sample> {
    let light = |x: f64, y: f64| {
        let image = pixel_from_cell * Vector3::new(x, y, 1.0);
        raw.at(&(image.xy() / image.z)).filter(|_| image.z > 0.0)
    };
    places
        .filter_map(|[x, y]| {
            let about = [light(x, y)?, light(x - 0.2, y - 0.2)?, light(x + 0.2, y - 0.2)?];
            let sum = about.iter().sum::<f64>() + light(x - 0.2, y + 0.2)? + light(x + 0.2, y + 0.2)?;
            Some(([x, y], sum / 5.0))
        })
        .collect()
}

fn at(level: &Vector3<f64>, [x, y]: [f64; 2]) -> f64 {
    level.dot(&Vector3::new(x, y, 1.0))
}

/// The plane through the samples.
fn level(samples: &[Sample]) -> Option<Vector3<f64>> {
    let (mut normal, mut right) = (Matrix3::<f64>::zeros(), Vector3::<f64>::zeros());
    for ([x, y], value) in samples {
        let row = Vector3::new(*x, *y, 1.0);
        normal += row * row.transpose();
        right += row * *value;
    }
    normal.cholesky().map(|factors| factors.solve(&right))
}

/// The code of the tag as it reads from its upper right corner.
fn turned(code: u64) -> u64 {
    let cells = (0..tag36h11::SIDE).flat_map(|row| (0..tag36h11::SIDE).map(move |column| (row, column)));
    cells.fold(0, |sum, (row, column)| sum << 1 | u64::from(tag36h11::is_white(code, column, tag36h11::SIDE - 1 - row)))
}

/// The homography that takes four points to four others.
fn homography(from: &[Vector2<f64>; 4], to: &[Pixel; 4]) -> Option<Matrix3<f64>> {
    let mut system = SMatrix::<f64, 8, 8>::zeros();
    let mut right = SVector::<f64, 8>::zeros();
    for (index, (p, q)) in from.iter().zip(to).enumerate() {
        for (row, value) in [q.x, q.y].into_iter().enumerate() {
            let at = 2 * index + row;
            system[(at, 3 * row)] = p.x;
            system[(at, 3 * row + 1)] = p.y;
            system[(at, 3 * row + 2)] = 1.0;
            system[(at, 6)] = -value * p.x;
            system[(at, 7)] = -value * p.y;
            right[at] = value;
        }
    }
    let h = system.lu().solve(&right)?;
    let h = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0);
    // All four lie before the camera.
    from.iter().all(|p| h.row(2).dot(&Vector3::new(p.x, p.y, 1.0).transpose()) > 0.0).then_some(h)
}
