//! Corners with their columns and rows.

use nalgebra::{Matrix2, Vector2};

use super::links::{Corner, Links};
use crate::camera::Pixel;

/// Column and row, counted from the corner with which the lattice began.
pub(super) type Cell = [i32; 2];

/// The four neighbours of a cell: the next and last column, the next and last row.
pub(super) const STEPS: [Cell; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// Columns and rows on either side of the first corner; boards have at most 40.
const REACH: i32 = 48;
const SIDE: usize = 97;

/// What a lattice holds of a corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Node {
    pub cell: Cell,
    pub pixel: Pixel,
    /// White less black, codes.
    pub contrast: f64,
}

/// A lattice of corners. Rows lie to the right of columns as one sees the picture: it is never mirrored. The square between the
/// ways to the next column and to the next row is black where column and row have an even sum.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    pub nodes: Vec<Node>,
    places: Vec<u16>,
}

/// No node.
const FREE: u16 = u16::MAX;

/// A corner is taken into the lattice where it lies within this share of a step of where its neighbours have it.
const MAX_MISS: f64 = 0.4;

/// The cell `count` steps away.
pub(super) const fn stepped([column, row]: Cell, [across, down]: Cell, count: i32) -> Cell {
    [column + across * count, row + down * count]
}

impl Lattice {
    fn new() -> Self {
        Self { nodes: Vec::new(), places: vec![FREE; SIDE * SIDE] }
    }

    fn slot(cell: Cell) -> Option<usize> {
        let [column, row] = cell.map(|c| usize::try_from(c + REACH).ok().filter(|c| *c < SIDE));
        Some(row? * SIDE + column?)
    }

    /// Where the node of the cell stands in `nodes`.
    pub(super) fn index(&self, cell: Cell) -> Option<usize> {
        let place = self.places[Self::slot(cell)?];
        (place != FREE).then_some(usize::from(place))
    }

    /// The pixel of a cell that has a node.
    pub(super) fn pixel(&self, cell: Cell) -> Option<Pixel> {
        self.index(cell).map(|index| self.nodes[index].pixel)
    }

    /// Whether the cell can be taken.
    pub(super) fn is_free(&self, cell: Cell) -> bool {
        Self::slot(cell).is_some_and(|slot| self.places[slot] == FREE)
    }

    pub(super) fn insert(&mut self, node: Node) {
        let (Some(slot), Ok(place)) = (Self::slot(node.cell), u16::try_from(self.nodes.len())) else { return };
        if self.places[slot] == FREE && place != FREE {
            self.places[slot] = place;
            self.nodes.push(node);
        }
    }

    /// Only the nodes that are to stay.
    pub(super) fn retain(&mut self, stays: impl Fn(&Node) -> bool) {
        let nodes = std::mem::take(&mut self.nodes);
        self.places.fill(FREE);
        for node in nodes.into_iter().filter(|node| stays(node)) {
            self.insert(node);
        }
    }

    /// Least and greatest column and row.
    pub(super) fn bounds(&self) -> [Cell; 2] {
        self.nodes.iter().fold([[i32::MAX; 2], [i32::MIN; 2]], |[least, most], node| {
            [[0, 1].map(|k| least[k].min(node.cell[k])), [0, 1].map(|k| most[k].max(node.cell[k]))]
        })
    }

    /// Corners that hang together with the corner `seed`, as their neighbours have it. Marks them as `used`.
    pub(super) fn of_links(corners: &[Corner], links: &[Links], seed: usize, used: &mut [bool]) -> Self {
        let mut lattice = Self::new();
        let first = &corners[seed];
        // Rows to the right of columns.
        let down = if first.enter.perp(&first.leave) > 0.0 { 1 } else { 3 };
        // For each node its corner, and which of the corner's ways leads to the next column and to the next row.
        let mut ways: Vec<(usize, [usize; 2])> = vec![(seed, [0, down])];
        lattice.insert(Node { cell: [0, 0], pixel: first.pixel, contrast: first.contrast });
        used[seed] = true;
        let mut next = 0;
        while next < lattice.nodes.len() {
            let (here, [across, down]) = ways[next];
            let cell = lattice.nodes[next].cell;
            next += 1;
            for (step, way) in STEPS.into_iter().zip([across, down, (across + 2) % 4, (down + 2) % 4]) {
                let Some(other) = links[here][way] else { continue };
                let target = stepped(cell, step, 1);
                let corner = &corners[other];
                if used[other] || !lattice.is_free(target) || !lattice.is_near(target, &corner.pixel) {
                    continue;
                }
                // Edges have changed over, and may point the other way.
                let turned = |way: usize| {
                    let mine = corners[here].ways()[way];
                    let theirs = (way + 1) % 2;
                    if corner.ways()[theirs].dot(&mine) > 0.0 { theirs } else { theirs + 2 }
                };
                let count = lattice.nodes.len();
                lattice.insert(Node { cell: target, pixel: corner.pixel, contrast: corner.contrast });
                if lattice.nodes.len() > count {
                    ways.push((other, [turned(across), turned(down)]));
                    used[other] = true;
                }
            }
        }
        lattice
    }

    /// Whether the pixel is about where the neighbours have the cell, as far as they tell.
    fn is_near(&self, cell: Cell, pixel: &Pixel) -> bool {
        let Some(place) = self.predicted(cell) else { return true };
        self.axes_about(cell).and_then(Matrix2::try_inverse).is_none_or(|inverse| {
            let miss = inverse * (pixel - place);
            miss.norm() < MAX_MISS
        })
    }

    /// Where the cell should be as its neighbours have it; `None` where too few are there.
    pub(super) fn predicted(&self, cell: Cell) -> Option<Pixel> {
        let mut sum = Vector2::zeros();
        let mut weights = 0.0;
        let mut add = |place: Pixel, weight: f64| {
            sum += place * weight;
            weights += weight;
        };
        for (way, step) in STEPS.into_iter().enumerate() {
            let back = |count: i32| self.pixel(stepped(cell, step, -count));
            let Some(one) = back(1) else { continue };
            if let Some(opposite) = back(-1) {
                add(0.5 * (one + opposite), 1.5);
            }
            if let Some(two) = back(2) {
                // Steps shorten and bend evenly.
                match back(3) {
                    Some(three) => add(3.0 * one - 3.0 * two + three, 1.0),
                    None => add(2.0 * one - two, 0.5),
                }
            }
            let side = STEPS[(way + 1) % 4];
            for sign in [1, -1] {
                let beside = stepped(cell, side, sign);
                if let (Some(beside), Some(back)) = (self.pixel(beside), self.pixel(stepped(beside, step, -1))) {
                    add(one + beside - back, 0.5);
                }
            }
        }
        (weights > 0.0).then(|| sum / weights)
    }

    /// The steps to the next column and to the next row at a cell with a node, px, as columns.
    pub(super) fn axes(&self, cell: Cell) -> Option<Matrix2<f64>> {
        let [across, down] = [STEPS[0], STEPS[1]].map(|step| {
            let beside = if step[0] == 1 { STEPS[1] } else { STEPS[0] };
            let at = |cell: Cell| self.step(cell, step);
            at(cell).or_else(|| at(stepped(cell, beside, 1))).or_else(|| at(stepped(cell, beside, -1)))
        });
        Some(Matrix2::from_columns(&[across?, down?]))
    }

    /// The way to the next cell, px, as the cells before and after have it.
    fn step(&self, cell: Cell, step: Cell) -> Option<Vector2<f64>> {
        let here = self.pixel(cell);
        let [before, after] = [-1, 1].map(|count| self.pixel(stepped(cell, step, count)));
        match (before, here, after) {
            (Some(before), _, Some(after)) => Some(0.5 * (after - before)),
            (None, Some(here), Some(after)) => Some(after - here),
            (Some(before), Some(here), None) => Some(here - before),
            _ => None,
        }
    }

    /// The steps at a cell without a node: the mean of its neighbours'.
    pub(super) fn axes_about(&self, cell: Cell) -> Option<Matrix2<f64>> {
        let near = STEPS.into_iter().map(|step| stepped(cell, step, 1)).filter(|near| !self.is_free(*near));
        let (sum, count) = near
            .filter_map(|near| self.axes(near))
            .fold((Matrix2::zeros(), 0.0), |(sum, count), axes| (sum + axes, count + 1.0));
        (count > 0.0).then(|| sum / count)
    }

    /// Area of the squares about its corners, px^2.
    pub(super) fn area_px(&self) -> f64 {
        self.nodes.iter().filter_map(|node| self.axes(node.cell)).map(|axes| axes.determinant().abs()).sum()
    }

    /// How the lines along columns' way and along rows' way bend at a cell: second differences, px.
    pub(super) fn bends(&self, cell: Cell) -> [Vector2<f64>; 2] {
        [STEPS[0], STEPS[1]].map(|step| {
            let at = |count: i32| self.pixel(stepped(cell, step, count));
            match (at(-1), at(0), at(1)) {
                (Some(before), Some(here), Some(after)) => before + after - 2.0 * here,
                (None, Some(here), Some(after)) => {
                    at(2).map_or_else(Vector2::zeros, |beyond| here + beyond - 2.0 * after)
                }
                (Some(before), Some(here), None) => {
                    at(-2).map_or_else(Vector2::zeros, |beyond| here + beyond - 2.0 * before)
                }
                _ => Vector2::zeros(),
            }
        })
    }
}
