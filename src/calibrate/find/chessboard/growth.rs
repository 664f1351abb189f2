//! Corners where the lattice has them coming.

use nalgebra::Matrix2;

use super::lattice::{Cell, Lattice, Node, STEPS, stepped};
use super::pyramid::{Level, Pyramid};
use super::ring::{Crossing, Demand, Ring};
use crate::camera::Pixel;

/// A ring's half axes, shares of a step.
const RING: f64 = 0.4;

/// Least half width of a ring on the level on which one looks, px.
const MIN_RING_PX: f64 = 3.2;

/// Where a corner is foretold, less of a ring is enough; shares of the neighbours' contrast, and codes.
const CORRELATION: f64 = 0.7;
const CONTRAST_SHARE: f64 = 0.15;
const MIN_CONTRAST: f64 = 5.0;

/// The corner lies no further from where it is foretold, shares of the ring's half axes.
const REACH: f64 = 0.75;

/// The edges run as the lattice does: sine of the angle between, in steps.
const MAX_SLANT: f64 = 0.45;

/// Most cells that are ever looked at: a few times those of the largest board.
const MAX_LOOKS: usize = 20_000;

/// Takes in every neighbouring corner that the picture shows where the lattice has it.
pub(super) fn grow(lattice: &mut Lattice, pyramid: &Pyramid<'_>, ring: &Ring) {
    let mut looks = 0;
    // A cell is looked at again only when a neighbour has come since.
    let mut next = 0;
    while next < lattice.nodes.len() && looks < MAX_LOOKS {
        let cell = lattice.nodes[next].cell;
        next += 1;
        for step in STEPS {
            let target = stepped(cell, step, 1);
            if !lattice.is_free(target) {
                continue;
            }
            looks += 1;
            if let Some(node) = foretold(lattice, pyramid, ring, target) {
                lattice.insert(node);
            }
        }
    }
}

fn foretold(lattice: &Lattice, pyramid: &Pyramid<'_>, ring: &Ring, cell: Cell) -> Option<Node> {
    let place = lattice.predicted(cell)?;
    let axes = lattice.axes_about(cell)?;
    let near = STEPS.iter().filter_map(|step| lattice.index(stepped(cell, *step, 1)));
    let contrast = near.map(|index| lattice.nodes[index].contrast).fold(f64::MAX, f64::min);
    let level = pyramid.level_with(ring_px(&axes), MIN_RING_PX);
    let contrast = (CONTRAST_SHARE * contrast).max(MIN_CONTRAST);
    let demand = Demand { correlation: CORRELATION, contrast, reach: REACH };
    let seen = look(level, ring, &place, &axes, cell, &demand)?;
    // Once more from there: off its middle a ring sees squares of unequal size.
    let seen = look(level, ring, &seen.0, &axes, cell, &Demand { reach: 0.5 * REACH, ..demand })?;
    let is_other = lattice.nodes.iter().all(|node| (node.pixel - seen.0).norm() > 0.5 * ring_px(&axes));
    is_other.then_some(Node { cell, pixel: seen.0, contrast: seen.1.contrast })
}

/// Half the width of a ring about a corner of a lattice with these steps, px of the picture.
pub(super) fn ring_px(axes: &Matrix2<f64>) -> f64 {
    let [across, down] = [axes.column(0).norm(), axes.column(1).norm()];
    RING * axes.determinant().abs() / across.max(down).max(f64::MIN_POSITIVE)
}

fn look(
    level: &Level<'_>,
    ring: &Ring,
    place: &Pixel,
    axes: &Matrix2<f64>,
    cell: Cell,
    demand: &Demand,
) -> Option<(Pixel, Crossing)> {
    let half = axes * (RING / level.scale);
    let middle = level.of_picture(place);
    let seen = ring.look(level.smooth(), &middle, &half, demand)?;
    let [across, down] = if (cell[0] + cell[1]) % 2 == 0 { [seen.enter, seen.leave] } else { [seen.leave, seen.enter] };
    let runs_along = across.y.abs() < MAX_SLANT && down.x.abs() < MAX_SLANT;
    runs_along.then(|| (level.to_picture(&(middle + half * seen.place)), seen))
}

/// Whether the ring about a corner there would lie within the picture.
pub(super) fn is_in_view(pyramid: &Pyramid<'_>, place: &Pixel, axes: &Matrix2<f64>) -> bool {
    let plane = &pyramid.levels[0].plane;
    let [across, down] = [0, 1].map(|k| axes.row(k).norm() * RING + 1.0);
    let [width, height] = [plane.width as f64 - 1.0, plane.height as f64 - 1.0];
    (across..=width - across).contains(&place.x) && (down..=height - down).contains(&place.y)
}
