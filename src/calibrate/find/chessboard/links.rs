//! Which corners are neighbours: each the nearest along the other's edge, black and white changed over.

use nalgebra::Vector2;

use crate::camera::Pixel;

/// A place where four squares seem to meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Corner {
    pub pixel: Pixel,
    /// The edge that one crosses from white into black, turning to the right; of unit length.
    pub enter: Vector2<f64>,
    /// The other edge.
    pub leave: Vector2<f64>,
    /// White less black, codes.
    pub contrast: f64,
}

impl Corner {
    /// Its four ways out: along `enter`, along `leave`, and back; opposite ones are two apart.
    pub(super) fn ways(&self) -> [Vector2<f64>; 4] {
        [self.enter, self.leave, -self.enter, -self.leave]
    }
}

/// Neighbours along the four ways of a corner.
pub(super) type Links = [Option<usize>; 4];

/// A neighbour lies off the edge's direction by no more than this share of the distance: lenses bend, and short edges are coarse.
const MAX_SLANT: f64 = 0.27;

/// Corners that one looks at before it has no neighbour on a side.
const MAX_LOOKS: usize = 120;

/// Contrasts of neighbours differ by no more than this factor.
const MAX_CONTRASTS: f64 = 3.5;

/// For each corner its neighbours; `cell_px` is about the least distance between corners.
pub(super) fn links(corners: &[Corner], cell_px: f64) -> Vec<Links> {
    let cells = Cells::of(corners, cell_px);
    let wished: Vec<Links> = (0..corners.len()).map(|index| cells.neighbours(corners, index)).collect();
    let is_mutual = |index: usize, other: usize| wished[other].contains(&Some(index));
    let kept = |(index, links): (usize, &Links)| links.map(|link| link.filter(|other| is_mutual(index, *other)));
    wished.iter().enumerate().map(kept).collect()
}

/// The corners sorted into squares of the picture.
struct Cells {
    side_px: f64,
    least: Pixel,
    columns: usize,
    rows: usize,
    /// Where each cell begins in `order`, and the end.
    starts: Vec<usize>,
    order: Vec<usize>,
}

/// Corners in a cell, on average.
const CORNERS_A_CELL: f64 = 1.5;

/// Most cells a side.
const MAX_SIDE: f64 = 400.0;

impl Cells {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most MAX_SIDE")]
    fn of(corners: &[Corner], cell_px: f64) -> Self {
        let far = Vector2::repeat(f64::MAX);
        let [least, most] = corners
            .iter()
            .fold([far, -far], |[least, most], corner| [least.inf(&corner.pixel), most.sup(&corner.pixel)]);
        let span = (most - least).sup(&Vector2::zeros());
        let each = (span.x * span.y * CORNERS_A_CELL / (corners.len() as f64 + 1.0)).sqrt();
        let side_px = cell_px.max(each).max(span.max() / MAX_SIDE);
        let [columns, rows] = [span.x, span.y].map(|length| (length / side_px) as usize + 1);
        let mut cells = Self { side_px, least, columns, rows, starts: vec![0; columns * rows + 1], order: Vec::new() };
        let of_corner: Vec<usize> = corners
            .iter()
            .map(|corner| {
                let [x, y] = cells.cell(&corner.pixel);
                y * columns + x
            })
            .collect();
        for cell in &of_corner {
            cells.starts[cell + 1] += 1;
        }
        for cell in 0..columns * rows {
            cells.starts[cell + 1] += cells.starts[cell];
        }
        let mut next = cells.starts.clone();
        cells.order = vec![0; corners.len()];
        for (index, cell) in of_corner.into_iter().enumerate() {
            cells.order[next[cell]] = index;
            next[cell] += 1;
        }
        cells
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the corners' box")]
    fn cell(&self, pixel: &Pixel) -> [usize; 2] {
        let place = (pixel - self.least) / self.side_px;
        [(place.x as usize).min(self.columns - 1), (place.y as usize).min(self.rows - 1)]
    }

    /// The corners in some cells of a row.
    fn run(&self, row: usize, first: usize, last: usize) -> &[usize] {
        let from = row * self.columns;
        &self.order[self.starts[from + first]..self.starts[from + last + 1]]
    }

    /// Hands over the corners in the cells whose larger distance, across or down, from `[x, y]` is `ring`.
    fn each_of_ring(&self, [x, y]: [usize; 2], ring: usize, mut take: impl FnMut(usize)) {
        let (left, right) = (x.saturating_sub(ring), (x + ring).min(self.columns - 1));
        for row in y.saturating_sub(ring)..=(y + ring).min(self.rows - 1) {
            if row.abs_diff(y) == ring {
                self.run(row, left, right).iter().for_each(|corner| take(*corner));
                continue;
            }
            for column in [left, right] {
                // A side that the picture cuts off has no cells.
                if column.abs_diff(x) == ring {
                    self.run(row, column, column).iter().for_each(|corner| take(*corner));
                }
            }
        }
    }

    fn neighbours(&self, corners: &[Corner], index: usize) -> Links {
        let corner = &corners[index];
        let mut best = [(f64::MAX, None); 4];
        let home = self.cell(&corner.pixel);
        let mut looks = 0;
        for ring in 0..self.columns.max(self.rows) {
            // All that is nearer than this has been seen.
            let seen_px = (ring as f64 - 1.0) * self.side_px;
            if looks > MAX_LOOKS || best.iter().all(|(cost, _)| *cost < seen_px) {
                break;
            }
            self.each_of_ring(home, ring, |other| {
                looks += 1;
                if other == index {
                    return;
                }
                let Some((way, cost)) = along(corner, &corners[other]) else { return };
                if cost < best[way].0 {
                    best[way] = (cost, Some(other));
                }
            });
        }
        best.map(|(_, link)| link)
    }
}

/// The way of `corner` on which `other` may be its neighbour, and how far that is, the farther for being off the edge.
fn along(corner: &Corner, other: &Corner) -> Option<(usize, f64)> {
    let off = other.pixel - corner.pixel;
    let squared = off.norm_squared();
    // Most lie along neither edge, which takes no root to see.
    let nearest = corner.enter.perp(&off).powi(2).min(corner.leave.perp(&off).powi(2));
    if !(nearest < MAX_SLANT * MAX_SLANT * squared) {
        return None;
    }
    let distance = squared.sqrt();
    let direction = off / distance;
    let ways = corner.ways();
    let slants = ways.map(|way| if way.dot(&direction) > 0.0 { way.perp(&direction).abs() } else { 1.0 });
    let way = (0..4).min_by(|a, b| slants[*a].total_cmp(&slants[*b]))?;
    // Black and white change over: what one enters here along this line, one leaves there.
    let theirs = if way % 2 == 0 { other.leave } else { other.enter };
    let crossing = if way % 2 == 0 { other.enter } else { other.leave };
    let slant = slants[way].max(theirs.perp(&direction).abs());
    let ratio = corner.contrast / other.contrast;
    let fits = slant < MAX_SLANT
        && crossing.perp(&direction).abs() > slant
        && (1.0 / MAX_CONTRASTS..MAX_CONTRASTS).contains(&ratio);
    fits.then_some((way, distance * (1.0 + slant)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of a lattice of squares of 20 px, turned a little, `(column, row)` in the order of rows.
    fn lattice(columns: usize, rows: usize) -> Vec<Corner> {
        let [across, down] = [Vector2::new(0.98, 0.199), Vector2::new(-0.199, 0.98)];
        (0..rows * columns)
            .map(|index| {
                let (column, row) = (index % columns, index / columns);
                let is_black = (column + row) % 2 == 0;
                let [enter, leave] = if is_black { [across, -down] } else { [-down, across] };
                let pixel = Pixel::new(50.0, 40.0) + (across * column as f64 + down * row as f64) * 20.0;
                Corner { pixel, enter, leave, contrast: 100.0 }
            })
            .collect()
    }

    #[test]
    fn every_corner_has_its_neighbours_and_no_others() {
        let corners = lattice(7, 5);
        for (index, links) in links(&corners, 10.0).iter().enumerate() {
            let (column, row) = (index % 7, index / 7);
            let mut need = Vec::new();
            let steps = [(column > 0, index.wrapping_sub(1)), (column < 6, index + 1)];
            let falls = [(row > 0, index.wrapping_sub(7)), (row < 4, index + 7)];
            need.extend(steps.into_iter().chain(falls).filter(|(is, _)| *is).map(|(_, other)| other));
            let mut found: Vec<usize> = links.iter().flatten().copied().collect();
            found.sort_unstable();
            need.sort_unstable();
            assert_eq!(found, need, "{column} {row}");
        }
    }

    #[test]
    fn nothing_and_one_have_no_neighbours() {
        assert!(links(&[], 10.0).is_empty());
        assert_eq!(links(&lattice(1, 1), 10.0), [[None; 4]]);
        let twice = [lattice(1, 1)[0]; 2];
        assert_eq!(links(&twice, 10.0), [[None; 4]; 2], "at one place");
    }
}
