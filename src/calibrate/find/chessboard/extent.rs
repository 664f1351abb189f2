//! Which part of the board a lattice is.

use super::growth::is_in_view;
use super::lattice::{Cell, Lattice, Node, STEPS, stepped};
use super::pyramid::Pyramid;
use crate::board::Chessboard;

/// A lattice cut to its box, and on which sides the picture ends before the next line.
#[derive(Clone, Debug)]
pub(super) struct Extent {
    /// Least and greatest cell.
    pub bounds: [Cell; 2],
    /// Whether more may lie beyond: next column, next row, last column, last row, as [`STEPS`].
    pub open: [bool; 4],
    /// Corners that are seen.
    pub count: usize,
}

impl Extent {
    /// Columns and rows.
    pub(super) fn size(&self) -> [usize; 2] {
        let [least, most] = self.bounds;
        [0, 1].map(|k| usize::try_from(most[k].saturating_sub(least[k]).saturating_add(1)).unwrap_or(0))
    }

    /// Whether so much of its box is seen that it is a board's.
    pub(super) fn is_board(&self) -> bool {
        let [columns, rows] = self.size();
        columns.min(rows) >= 3 && 10 * self.count >= 6 * columns * rows
    }
}

/// An outermost line of which less than this share is seen, of what the picture could show, is none of the board's.
const MIN_SHARE: f64 = 0.4;

/// Of a line that lies outside, no more than this share may lie inside.
const MAX_INSIDE: f64 = 0.2;

/// Cuts away outermost lines of which too little is seen, and looks where the picture ends.
pub(super) fn extent(lattice: &mut Lattice, pyramid: &Pyramid<'_>) -> Extent {
    loop {
        let bounds = lattice.bounds();
        let count = lattice.nodes.len();
        if count < 4 {
            return Extent { bounds: [[0; 2], [-1; 2]], open: [false; 4], count };
        }
        let whole = filled(lattice, bounds);
        let sparse = STEPS.into_iter().find(|step| {
            let line = line(bounds, *step, 0);
            let seen = line.iter().filter(|cell| !lattice.is_free(**cell)).count();
            let possible = line.iter().filter(|cell| is_seen(&whole, pyramid, **cell)).count().max(seen);
            seen < 2 || (seen as f64) < MIN_SHARE * possible as f64
        });
        if let Some(step) = sparse {
            let outer = line(bounds, step, 0);
            lattice.retain(|node| !outer.contains(&node.cell));
            continue;
        }
        let open = STEPS.map(|step| {
            let line = line(bounds, step, 1);
            let inside = line.iter().filter(|cell| is_seen(&whole, pyramid, **cell)).count();
            (inside as f64) <= MAX_INSIDE * line.len() as f64
        });
        return Extent { bounds, open, count };
    }
}

fn is_seen(whole: &Lattice, pyramid: &Pyramid<'_>, cell: Cell) -> bool {
    let seen = whole.pixel(cell).zip(whole.axes(cell));
    seen.is_some_and(|(place, axes)| is_in_view(pyramid, &place, &axes))
}

/// The outermost line on the side to which `step` leads, or that `beyond` further.
fn line([least, most]: [Cell; 2], step: Cell, beyond: i32) -> Vec<Cell> {
    let along = usize::from(step[0] != 0);
    let across = 1 - along;
    let end = if step[across] > 0 { most } else { least };
    (least[along]..=most[along])
        .map(|place| {
            let mut cell = end;
            cell[along] = place;
            stepped(cell, step, beyond)
        })
        .collect()
}

/// The lattice with every cell of its box, and of the lines about it, where its neighbours have it.
fn filled(lattice: &Lattice, [least, most]: [Cell; 2]) -> Lattice {
    let mut whole = lattice.clone();
    let rows = least[1] - 1..=most[1] + 1;
    let cells: Vec<Cell> = rows.flat_map(|row| (least[0] - 1..=most[0] + 1).map(move |c| [c, row])).collect();
    // Each round fills what has neighbours; at most as many rounds as the box is wide and high.
    loop {
        let found: Vec<Node> = cells
            .iter()
            .filter(|cell| whole.is_free(**cell))
            .filter_map(|cell| Some(Node { cell: *cell, pixel: whole.predicted(*cell)?, contrast: 0.0 }))
            .collect();
        if found.is_empty() {
            return whole;
        }
        for node in found {
            whole.insert(node);
        }
    }
}

/// How a lattice lies on a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Placement {
    /// Quarter turns from the lattice's columns to the board's.
    pub turns: usize,
    /// Column and row of the board that the turned box's first cell has.
    pub shift: [usize; 2],
}

impl Placement {
    /// All ways in which the extent may lie on the board: as large where it is closed, no larger where it is open.
    pub(super) fn all(extent: &Extent, chessboard: &Chessboard) -> Vec<Self> {
        let board = [chessboard.columns as usize, chessboard.rows as usize];
        let mut all = Vec::new();
        for turns in 0..4 {
            let size = extent.size();
            let size = if turns % 2 == 0 { size } else { [size[1], size[0]] };
            // The board's ways are the lattice's, so many further.
            let open = [0, 1, 2, 3].map(|way: usize| extent.open[(way + turns) % 4]);
            let shifts = [0, 1].map(|k| {
                let missing = board[k].checked_sub(size[k]);
                match (missing, open[k + 2], open[k]) {
                    (Some(0), ..) => 0..1,
                    (Some(missing), true, true) => 0..missing + 1,
                    (Some(missing), false, true) => 0..usize::from(missing > 0),
                    (Some(missing), true, false) => missing..missing + 1,
                    _ => 0..0,
                }
            });
            let [across, down] = shifts;
            all.extend(down.flat_map(|row| across.clone().map(move |column| Self { turns, shift: [column, row] })));
        }
        all
    }

    /// Column and row on the board of a cell.
    pub(super) fn of_cell(&self, cell: Cell, [least, most]: [Cell; 2]) -> [usize; 2] {
        let [column, row] = match self.turns {
            0 => [cell[0] - least[0], cell[1] - least[1]],
            1 => [cell[1] - least[1], most[0] - cell[0]],
            2 => [most[0] - cell[0], most[1] - cell[1]],
            _ => [most[1] - cell[1], cell[0] - least[0]],
        };
        let [across, down] = [column, row].map(|c| usize::try_from(c).unwrap_or(0));
        [across + self.shift[0], down + self.shift[1]]
    }
}
