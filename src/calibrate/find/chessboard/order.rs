//! Which point of the board is which corner of a lattice.

use super::extent::{Extent, Placement};
use super::lattice::{Lattice, Node};
use crate::board::Chessboard;

/// For each node its point of the board; `None` where the lattice's extent is not that of the board.
///
/// Of the ways in which the lattice may lie on the board, those come first that have the square above and to the left of point 0
/// black; of these the one whose first point lies nearest to the picture's upper left; of these the one that hides the fewest of the
/// first columns and rows. A board with an odd and an even number of corners a side has one way; others have two or four, which
/// only the place in the picture tells apart.
pub(super) fn points(lattice: &Lattice, extent: &Extent, chessboard: &Chessboard) -> Option<Vec<usize>> {
    let columns = chessboard.columns as usize;
    let on_board = |placement: &Placement, node: &Node| placement.of_cell(node.cell, extent.bounds);
    let best = Placement::all(extent, chessboard).into_iter().min_by(|a, b| {
        let [a, b] = [a, b].map(|placement| {
            let cell = extent.bounds[0];
            let [column, row] = placement.of_cell(cell, extent.bounds);
            // A quarter turn changes black and white over, as does a step.
            let odd = (cell[0] + cell[1]).unsigned_abs() as usize + placement.turns + column + row;
            let first = lattice.nodes.iter().min_by_key(|node| on_board(placement, node).iter().sum::<usize>());
            let across = first.map_or(0.0, |node| node.pixel.x + node.pixel.y);
            (odd % 2, across, placement.shift.iter().sum::<usize>())
        });
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2))
    })?;
    let point = |node: &Node| {
        let [column, row] = on_board(&best, node);
        row * columns + column
    };
    Some(lattice.nodes.iter().map(point).collect())
}
