//! How a lens bends the lines of the board, from the corners that one picture shows.
//!
//! Perspective keeps lines straight, so that what bends them is the lens' alone. Its model is the division by one number (Fitzgibbon 2001,
//! "Simultaneous linear estimation of multiple view geometry and lens distortion") about a middle that is found too. As it is one for the whole
//! picture, the four corners of each of two tags tell how the edges of all bend; no line needs corners enough of its own.

use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};

use crate::board::Board;
use crate::camera::Pixel;
use crate::geometry::{Point, space};
use crate::solve::{Pair, homography::direct_linear_transform, spread_of};
use crate::target::Spread;

/// Numbers that are tried to begin with: from a fisheye that shows its rim to a pincushion.
const TRIED: [f64; 2] = [-1.6, 0.4];
const TRIES: u32 = 20;

/// At no corner the model divides by less.
const LEAST_DIVISOR: f64 = 0.15;

/// Fewer corners tell no bend.
const MIN_CORNERS: usize = 6;

/// A lens' middle lies off the picture's by about this, in halves of the picture's larger side: of a part that is cut out, by a half.
const OFF_MIDDLE: f64 = 0.3;

/// Corners are known to about this at best, px.
const CORNER_PX: f64 = 0.02;

/// Most steps; one that changes the number by less is the last.
const MAX_STEPS: usize = 10;
const SETTLED: f64 = 1e-5;

/// Derivatives are differences over this.
const DIFFERENCE: f64 = 1e-5;

/// A board's plane, seen through a lens.
pub(super) struct Bends {
    lens: Lens,
    straight_from_plane: Matrix3<f64>,
    spread: Spread,
}

impl Bends {
    /// That which explains best where points of the board are seen, in a picture of `size` px. `None` for too few, or points on a line.
    pub(super) fn of(board: &Board, seen: &[(usize, Pixel)], size: [usize; 2]) -> Option<Self> {
        if seen.len() < MIN_CORNERS {
            return None;
        }
        let with = |numbers: Vector3<f64>| Self::through(Lens::of(size, numbers), board, seen);
        let step = (TRIED[1] - TRIED[0]) / f64::from(TRIES);
        let tries = (0..=TRIES).filter_map(|index| with(Vector3::x() * (TRIED[0] + step * f64::from(index))));
        let (mut bends, mut left) = tries.min_by(|a, b| a.1.norm_squared().total_cmp(&b.1.norm_squared()))?;
        // What is known of the middle before, as weights beside the residuals.
        let hold = CORNER_PX.max(left.norm() / (left.len() as f64).sqrt()) / OFF_MIDDLE;
        let hold = Matrix3::from_diagonal(&Vector3::new(0.0, hold * hold, hold * hold));
        let cost = |left: &DVector<f64>, numbers: &Vector3<f64>| left.norm_squared() + numbers.dot(&(hold * numbers));
        for _ in 0..MAX_STEPS {
            let numbers = bends.lens.numbers;
            let mut by = DMatrix::zeros(left.len(), 3);
            for k in 0..3 {
                let (_, moved) = with(numbers + DIFFERENCE * Vector3::ith(k, 1.0))?;
                by.set_column(k, &((moved - &left) / DIFFERENCE));
            }
            let normal = by.tr_mul(&by).fixed_view::<3, 3>(0, 0) + hold;
            let slope = by.tr_mul(&left).fixed_rows::<3>(0) + hold * numbers;
            let step = normal.cholesky()?.solve(&slope);
            // Far from the answer a whole step may go too far.
            let next = [1.0, 0.5, 0.25, 0.125].into_iter().find_map(|share| {
                let next = numbers - step * share;
                with(next).filter(|(_, less)| cost(less, &next) < cost(&left, &numbers))
            });
            let Some(next) = next else { break };
            (bends, left) = next;
            if (bends.lens.numbers[0] - numbers[0]).abs() < SETTLED {
                break;
            }
        }
        Some(bends)
    }

    /// The plane as it is seen through this lens, and what that leaves over, px.
    fn through(lens: Lens, board: &Board, seen: &[(usize, Pixel)]) -> Option<(Self, DVector<f64>)> {
        let pair = |(point, pixel): &(usize, Pixel)| {
            Some(Pair { point: Point::from(board.points()[*point].coords), ray: lens.straight(pixel)? })
        };
        let pairs: Vec<Pair> = seen.iter().map(pair).collect::<Option<_>>()?;
        let spread = spread_of(&pairs);
        let straight_from_plane = direct_linear_transform(&pairs, &spread)?;
        let bends = Self { lens, straight_from_plane, spread };
        let mut left = DVector::zeros(2 * seen.len());
        for (index, (pair, (_, pixel))) in pairs.iter().zip(seen).enumerate() {
            left.fixed_rows_mut::<2>(2 * index).copy_from(&(bends.pixel(&pair.point)? - pixel));
        }
        left.norm().is_finite().then_some((bends, left))
    }

    fn pixel(&self, point: &Point<space::Target>) -> Option<Pixel> {
        let image = self.straight_from_plane * self.spread.local(point).xy().push(1.0);
        self.lens.bent(&(image.xy() / image.z))
    }

    /// How the board's lines to the right and down bend at a point of it, 1/px, positive to the right of their way as one sees the picture;
    /// taken over so much of them on either side.
    pub(super) fn per_px(&self, point: &Point<space::Board>, over_m: f64) -> [f64; 2] {
        [Vector3::x(), Vector3::y()].map(|way| {
            let [before, here, after] = [-1.0, 0.0, 1.0].map(|share| {
                let point = Point::from(point.coords + way * (share * over_m));
                self.pixel(&point).unwrap_or_else(|| Pixel::repeat(f64::NAN))
            });
            let (slope, second) = (0.5 * (after - before), after + before - 2.0 * here);
            let bend = slope.perp(&second) / slope.norm().powi(3);
            if bend.is_finite() { bend } else { 0.0 }
        })
    }
}

/// The division model.
#[derive(Clone, Copy)]
struct Lens {
    /// Half of the picture's larger side, px: the unit of what follows.
    unit_px: f64,
    /// The picture's middle.
    middle: Pixel,
    /// The number that divides, and how far the lens' middle is off the picture's.
    numbers: Vector3<f64>,
}

impl Lens {
    fn of(size: [usize; 2], numbers: Vector3<f64>) -> Self {
        let middle = Pixel::from(size.map(|side| 0.5 * (side as f64 - 1.0)));
        Self { unit_px: 0.5 * size[0].max(size[1]) as f64, middle, numbers }
    }

    fn centre(&self) -> Pixel {
        self.middle + self.numbers.yz() * self.unit_px
    }

    /// Where a pixel would be seen without the lens, in units.
    fn straight(&self, pixel: &Pixel) -> Option<Vector2<f64>> {
        let offset = (pixel - self.centre()) / self.unit_px;
        let divisor = 1.0 + self.numbers[0] * offset.norm_squared();
        (divisor >= LEAST_DIVISOR).then(|| offset / divisor)
    }

    /// And with it.
    fn bent(&self, straight: &Vector2<f64>) -> Option<Pixel> {
        let root = 1.0 - 4.0 * self.numbers[0] * straight.norm_squared();
        (root >= 0.0).then(|| self.centre() + straight * (2.0 * self.unit_px / (1.0 + root.sqrt())))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;
    use crate::camera::{Camera, Distortion};
    use crate::geometry::CameraFromBoard;

    const SIZE: [u32; 2] = [640, 480];

    fn board() -> Board {
        "aprilgrid:6x4:0.03".parse().expect("a board")
    }

    /// Before the camera, tilted, off its axis.
    fn pose() -> CameraFromBoard {
        let turn = Rotation3::from_euler_angles(0.4, -0.3, 0.2);
        CameraFromBoard::new(turn, Vector3::new(-0.06, 0.05, 0.25))
    }

    fn pixel(camera: &Camera, point: &Point<space::Board>) -> Pixel {
        camera.project(&(pose() * *point)).expect("in view")
    }

    /// How the lines to the right and down truly bend at a point.
    fn truly(camera: &Camera, point: &Point<space::Board>) -> [f64; 2] {
        [Vector3::x(), Vector3::y()].map(|way| {
            let at = |off: f64| pixel(camera, &Point::from(point.coords + way * off));
            let (slope, second) = ((at(1e-3) - at(-1e-3)) / 2e-3, (at(1e-3) + at(-1e-3) - 2.0 * at(0.0)) / 1e-6);
            slope.perp(&second) / slope.norm().powi(3)
        })
    }

    fn bends(camera: &Camera, board: &Board, points: impl IntoIterator<Item = usize>) -> Option<Bends> {
        let seen: Vec<_> = points.into_iter().map(|point| (point, pixel(camera, &board.points()[point]))).collect();
        Bends::of(board, &seen, SIZE.map(|side| side as usize))
    }

    #[test]
    fn two_tags_tell_how_all_edges_bend_under_any_lens() {
        let board = board();
        for (focal, centre, lens) in [
            (270.0, [323.0, 236.0], Distortion::Equidistant([-0.02, 0.006, -0.003, 0.001])),
            (530.0, [323.0, 236.0], Distortion::PlumbBob([-0.28, 0.09, 0.0012, -0.0006, 0.02])),
            (530.0, [323.0, 236.0], Distortion::PlumbBob([0.2, 0.0, 0.0, 0.0, 0.0])),
            // A part of a picture.
            (270.0, [200.0, 330.0], Distortion::Equidistant([-0.02, 0.006, -0.003, 0.001])),
        ] {
            let camera = Camera::checked(SIZE, [focal; 2], centre, lens).expect("a camera");
            for (what, tags) in [("all", 0..24), ("two", 7..9)] {
                let points: Vec<usize> = tags.flat_map(|tag| 4 * tag..4 * tag + 4).collect();
                let bends = bends(&camera, &board, points.iter().copied()).expect("bends");
                let (mut off, mut all) = (0.0, 0.0);
                for point in points.iter().map(|point| &board.points()[*point]) {
                    for (found, truth) in bends.per_px(point, 0.005).into_iter().zip(truly(&camera, point)) {
                        (off, all) = (off + (found - truth).powi(2), all + truth * truth);
                    }
                }
                let [off, all] = [off, all].map(|sum| f64::sqrt(sum / (2 * points.len()) as f64));
                println!("{} {what}: off by {off:.6}/px of {all:.6}/px", lens.name());
                // At 5 px from its corner such an edge is off by 0.002 px.
                assert!(off < 1.6e-4 && all > 3.0 * off, "{} {what}: {off} of {all}", lens.name());
            }
        }
    }

    #[test]
    fn perspective_bends_nothing() {
        let board = board();
        let camera = Camera::checked(SIZE, [530.0; 2], [323.0, 236.0], Distortion::None).expect("a camera");
        let bends = bends(&camera, &board, 0..96).expect("bends");
        for point in board.points() {
            assert!(bends.per_px(point, 0.005).iter().all(|bend| bend.abs() < 1e-7), "{point:?}");
        }
    }

    #[test]
    fn few_corners_and_such_on_a_line_tell_nothing() {
        let board = board();
        let camera = Camera::checked(SIZE, [270.0; 2], [323.0, 236.0], Distortion::None).expect("a camera");
        assert!(bends(&camera, &board, 0..5).is_none());
        assert!(bends(&camera, &board, (0..6).flat_map(|tag| [4 * tag, 4 * tag + 1])).is_none());
    }
}
