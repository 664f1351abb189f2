//! How a lens bends the lines of the board: from corners that lie on one.

use nalgebra::{Matrix3, SMatrix, Vector2, Vector3};

use crate::board::AprilGrid;
use crate::camera::Pixel;

/// Corners on a line are looked at as far as this from the one of which the bend is asked, in steps from tag to tag.
const REACH: f64 = 2.1;

/// Noise makes more of a bend than a lens where all lie within this, steps.
const MIN_SPAN: f64 = 0.95;

/// A corner of the board, and where it is seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// On the board: to the right and down, steps from tag to tag.
    place: Vector2<f64>,
    pixel: Pixel,
}

impl Node {
    /// Of this point of the board, in the order of [`Board::points`](crate::board::Board::points).
    pub(super) fn of(point: usize, pixel: Pixel, grid: &AprilGrid) -> Self {
        let columns = grid.columns as usize;
        let (tag, corner) = (point / 4, point % 4);
        let side = grid.tag_m / (grid.tag_m + grid.gap_m);
        let [right, up] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]][corner];
        let place = Vector2::new((tag % columns) as f64 + right * side, -((tag / columns) as f64) - up * side);
        Self { place, pixel }
    }
}

/// How the board's lines to the right and down bend at a corner, 1/px, positive to the right of their way as one sees the picture; zero
/// where the corners beside it do not tell.
///
/// Perspective keeps lines straight, so that what is found is the lens' alone.
pub(super) fn bends_per_px(at: &Node, nodes: &[Node]) -> [f64; 2] {
    [0, 1].map(|axis| {
        let beside = |node: &&Node| {
            let way = node.place - at.place;
            way[1 - axis].abs() < 1e-6 && way[axis].abs() <= REACH
        };
        bend_per_px(nodes.iter().filter(beside).map(|node| (node.place[axis] - at.place[axis], node.pixel - at.pixel)))
            .unwrap_or_default()
    })
}

/// At the origin of a line: places on it and their offsets in the picture, px. A parabola in least squares.
fn bend_per_px(line: impl Iterator<Item = (f64, Vector2<f64>)>) -> Option<f64> {
    let mut normal = Matrix3::<f64>::zeros();
    let mut right = SMatrix::<f64, 3, 2>::zeros();
    let (mut count, mut least, mut most) = (0, 0.0_f64, 0.0_f64);
    for (place, offset) in line {
        let row = Vector3::new(1.0, place, place * place);
        normal += row * row.transpose();
        right += row * offset.transpose();
        count += 1;
        (least, most) = (least.min(place), most.max(place));
    }
    if count < 3 || most - least < MIN_SPAN {
        return None;
    }
    let parabola = normal.cholesky()?.solve(&right);
    let (slope, second) = (parabola.row(1), parabola.row(2) * 2.0);
    let bend = (slope[0] * second[1] - slope[1] * second[0]) / slope.norm().powi(3);
    bend.is_finite().then_some(bend)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: AprilGrid = AprilGrid { columns: 3, rows: 2, tag_m: 0.1, gap_m: 0.03 };

    /// All corners, seen through this.
    fn nodes(seen: impl Fn(Vector2<f64>) -> Pixel) -> Vec<Node> {
        let node = |point| {
            let node = Node::of(point, Pixel::zeros(), &GRID);
            Node { pixel: seen(node.place), ..node }
        };
        (0..24).map(node).collect()
    }

    #[test]
    fn corners_lie_as_the_board_has_them() {
        let board = crate::board::Board::checked(crate::board::Pattern::AprilGrid(GRID)).expect("a board");
        for (point, place) in board.points().iter().enumerate() {
            let node = Node::of(point, Pixel::zeros(), &GRID);
            assert!((node.place * 0.13 - place.coords.xy()).norm() < 1e-12, "{point}");
        }
    }

    #[test]
    fn circles_bend_as_they_do_and_perspective_does_not() {
        // Lines to the right are circles of 400 px about a place below, those down are straight.
        let bent = nodes(|place| {
            let (radius, angle) = (400.0 - 40.0 * place.y, 0.1 * place.x);
            Pixel::new(radius * angle.sin(), -radius * angle.cos())
        });
        for node in &bent {
            let [across, down] = bends_per_px(node, &bent);
            let radius = 400.0 - 40.0 * node.place.y;
            assert!((across * radius - 1.0).abs() < 0.05, "{node:?}: {across}");
            assert!(down.abs() < 1e-9, "{node:?}: {down}");
        }
        let flat = nodes(|place| {
            let depth = 1.0 + 0.1 * place.x - 0.05 * place.y;
            Pixel::new(30.0 * place.x + 5.0 * place.y, 40.0 * place.y) / depth
        });
        for node in &flat {
            assert!(bends_per_px(node, &flat).iter().all(|bend| bend.abs() < 1e-9), "{node:?}");
        }
    }

    #[test]
    fn two_corners_on_a_line_tell_nothing() {
        let all = nodes(|place| place * 30.0 + Vector2::new(place.y * place.y, 0.0));
        let row = &all[..12];
        assert!(row.iter().all(|node| bends_per_px(node, row)[1].abs() < 1e-12));
        assert!(all.iter().all(|node| bends_per_px(node, &all)[1].abs() > 1e-4));
    }
}
