//! A lattice of the picture as part of a board.

use std::collections::BTreeMap;

use super::super::Luma;
use super::lattice::{Lattice, Place, steps};
use crate::board::{CircleLayout, Circles};
use crate::camera::Pixel;

/// What a lattice is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Fit {
    /// The board: its points, each with the number of a disc.
    Board(Vec<(usize, usize)>),
    /// A board of another size, or of which more may be beyond the picture.
    Other { columns: usize, rows: usize, cut: bool },
    /// Nothing of the kind.
    None,
}

/// Of a hundred of its points so many must be seen of a board: what is less may be chance.
const MIN_PERCENT: usize = 30;

/// Share of a lattice that may be clutter beside the board.
const MAX_STRAYS: f64 = 0.05;

/// Share of its points within the picture that must be seen of a board.
const MIN_SEEN: f64 = 0.4;

/// A side of a board is where it is if so many of its discs are seen.
const SIDE: usize = 1;

/// A place this near to the picture's border, in steps, may be hidden by it.
const BORDER: f64 = 0.45;

/// The board in its own coordinates: columns and rows of places, some of which have a disc.
struct Extent {
    columns: i32,
    rows: i32,
    layout: CircleLayout,
}

impl Extent {
    fn of(circles: &Circles) -> Self {
        let (columns, rows) = (circles.columns.cast_signed(), circles.rows.cast_signed());
        match circles.layout {
            CircleLayout::Symmetric => Self { columns, rows, layout: circles.layout },
            CircleLayout::Asymmetric => Self { columns: 2 * columns, rows, layout: circles.layout },
        }
    }

    /// Whether there is a disc.
    fn holds(&self, [x, y]: Place) -> bool {
        let inside = (0..self.columns).contains(&x) && (0..self.rows).contains(&y);
        inside && (self.layout == CircleLayout::Symmetric || (x + y) % 2 == 0)
    }

    /// Its position among the points.
    fn point(&self, [x, y]: Place) -> usize {
        let (x, columns) = match self.layout {
            CircleLayout::Symmetric => (x, self.columns),
            CircleLayout::Asymmetric => (x / 2, self.columns / 2),
        };
        usize::try_from(y * columns + x).unwrap_or(usize::MAX)
    }

    /// Coordinates of a place of the lattice. That of an asymmetric board stands on its corner.
    fn by_lattice(&self, [i, j]: Place) -> Place {
        match self.layout {
            CircleLayout::Symmetric => [i, j],
            CircleLayout::Asymmetric => [i - j, i + j],
        }
    }

    fn lattice_by(&self, [x, y]: Place) -> Place {
        match self.layout {
            CircleLayout::Symmetric => [x, y],
            CircleLayout::Asymmetric => [(x + y).div_euclid(2), (y - x).div_euclid(2)],
        }
    }
}

/// A quarter turn, so many times.
fn turned([x, y]: Place, quarters: u8) -> Place {
    (0..quarters).fold([x, y], |[x, y], _| [-y, x])
}

/// How the lattice lies on the board: turned, then shifted.
#[derive(Clone, Copy)]
struct Lay {
    quarters: u8,
    right: i32,
    down: i32,
}

impl Lay {
    fn on_board(&self, place: Place) -> Place {
        let [x, y] = turned(place, self.quarters);
        [x + self.right, y + self.down]
    }

    fn off_board(&self, [x, y]: Place) -> Place {
        turned([x - self.right, y - self.down], (4 - self.quarters) % 4)
    }

    /// Every one that lets the board hold all of the places, or be held by them.
    fn all(places: &[Place], extent: &Extent) -> Vec<Self> {
        let shifts = |least: i32, greatest: i32, size: i32| {
            let (a, b) = (-least, size - 1 - greatest);
            a.min(b)..=a.max(b)
        };
        let turns = (0..4).filter_map(|quarters| {
            let [least, greatest] = bounds(places.iter().map(|place| turned(*place, quarters)))?;
            let across = shifts(least[0], greatest[0], extent.columns);
            let along = shifts(least[1], greatest[1], extent.rows);
            Some(across.flat_map(move |right| along.clone().map(move |down| Self { quarters, right, down })))
        });
        turns.flatten().collect()
    }
}

/// A lattice laid on the board.
struct Laid {
    /// Points and the numbers of their discs.
    points: Vec<(usize, usize)>,
    /// How far right and down the first point is seen, px.
    corner_px: f64,
}

impl Laid {
    fn is_better(&self, other: &Self) -> bool {
        let (own, others) = (self.points.len(), other.points.len());
        own > others || own == others && self.corner_px < other.corner_px
    }
}

/// What the lattice is, as seen against the board.
pub(super) fn placement(lattice: &Lattice, picture: &Luma, circles: &Circles) -> Fit {
    let extent = Extent::of(circles);
    let (places, discs): (Vec<Place>, Vec<usize>) =
        lattice.iter().map(|(place, disc, _)| (extent.by_lattice(place), disc)).unzip();
    let mut best: Option<Laid> = None;
    for lay in Lay::all(&places, &extent) {
        let on_board = places.iter().map(|place| lay.on_board(*place));
        let points = on_board.clone().zip(&discs).filter(|(place, _)| extent.holds(*place));
        let mut points: Vec<(usize, usize)> = points.map(|(place, disc)| (extent.point(place), *disc)).collect();
        let strays = places.len() - points.len();
        let is_whole = points.len() == (circles.columns * circles.rows) as usize;
        let is_clutter = is_whole && extent.is_clutter(on_board) || strays as f64 <= MAX_STRAYS * places.len() as f64;
        let is_too_few = best.as_ref().is_some_and(|best| points.len() < best.points.len());
        let is_chance = points.len() < least_points(circles);
        if is_too_few || is_chance || !is_clutter {
            continue;
        }
        let back = |place: Place| extent.lattice_by(lay.off_board(place));
        let Some(corner) = lattice.pixel(back([0, 0])) else { continue };
        points.sort_unstable();
        let laid = Laid { points, corner_px: corner.x + corner.y };
        if best.as_ref().is_none_or(|best| laid.is_better(best)) && extent.is_certain(lattice, picture, back) {
            best = Some(laid);
        }
    }
    best.map_or_else(|| other(&places, lattice, picture, circles), |best| Fit::Board(best.points))
}

/// Points that must be seen of a board.
pub(super) fn least_points(circles: &Circles) -> usize {
    ((circles.columns * circles.rows) as usize * MIN_PERCENT).div_ceil(100)
}

impl Extent {
    /// Whether of these places those beside the board are no line of a larger one: of no line more than half.
    fn is_clutter(&self, places: impl Iterator<Item = Place>) -> bool {
        let size = [self.columns, self.rows];
        let mut lines: BTreeMap<(usize, i32), i32> = BTreeMap::new();
        for place in places {
            for axis in [0, 1].into_iter().filter(|axis| !(0..size[*axis]).contains(&place[*axis])) {
                *lines.entry((axis, place[axis])).or_default() += 1;
            }
        }
        let per_place = if self.layout == CircleLayout::Symmetric { 1 } else { 2 };
        lines.iter().all(|((axis, _), count)| 2 * per_place * count <= size[1 - axis])
    }

    /// Whether the board ends where the lattice does or beyond the picture, and most of it that is in the picture is seen.
    fn is_certain(&self, lattice: &Lattice, picture: &Luma, back: impl Fn(Place) -> Place) -> bool {
        let mut sides = [[0_usize; 2]; 4];
        let (mut seen, mut hidden) = (0, 0);
        for y in 0..self.rows {
            for x in 0..self.columns {
                if !self.holds([x, y]) {
                    continue;
                }
                let place = back([x, y]);
                let is_seen = lattice.at(place).is_some();
                let is_hidden = !is_seen && lattice.is_in_view(place, picture);
                seen += usize::from(is_seen);
                hidden += usize::from(is_hidden);
                let on = [x == 0, x == self.columns - 1, y == 0, y == self.rows - 1];
                for (side, _) in sides.iter_mut().zip(on).filter(|(_, on)| *on) {
                    side[0] += usize::from(is_seen);
                    side[1] += usize::from(is_hidden);
                }
            }
        }
        let ends = sides.iter().all(|[seen, hidden]| *seen >= SIDE || *hidden == 0);
        ends && seen as f64 >= MIN_SEEN * (seen + hidden) as f64
    }
}

impl Lattice {
    /// Where a place is seen, or would be.
    fn pixel(&self, place: Place) -> Option<Pixel> {
        self.plane(place, 12, 8).and_then(|plane| plane.pixel(&steps(place)))
    }

    /// Whether a disc there would lie within the picture.
    fn is_in_view(&self, place: Place, picture: &Luma) -> bool {
        let Some(plane) = self.plane(place, 12, 8) else { return false };
        let Some(pixel) = plane.pixel(&steps(place)) else { return false };
        let border = plane.by_place(&steps(place)).map(f64::abs) * nalgebra::Vector2::repeat(BORDER);
        (border.x..picture.width as f64 - 1.0 - border.x).contains(&pixel.x)
            && (border.y..picture.height as f64 - 1.0 - border.y).contains(&pixel.y)
    }
}

fn bounds(places: impl Iterator<Item = Place>) -> Option<[Place; 2]> {
    places.map(|place| [place, place]).reduce(|[least, greatest], [place, _]| {
        [[least[0].min(place[0]), least[1].min(place[1])], [greatest[0].max(place[0]), greatest[1].max(place[1])]]
    })
}

/// Share of a box that must hold discs to be a board of that size.
const FULL: f64 = 0.75;

/// The size of a lattice that is not the board's.
fn other(places: &[Place], lattice: &Lattice, picture: &Luma, circles: &Circles) -> Fit {
    let Some([least, greatest]) = bounds(places.iter().copied()) else { return Fit::None };
    let size = |axis: usize| usize::try_from(greatest[axis] - least[axis] + 1).unwrap_or(0);
    let (wide, high) = (size(0), size(1));
    let per_place = match circles.layout {
        CircleLayout::Symmetric => 1,
        CircleLayout::Asymmetric => 2,
    };
    if (places.len() * per_place) as f64 <= FULL * (wide * high) as f64 {
        return Fit::None;
    }
    // Turned as the board would be.
    let off = |columns: usize, rows: usize| {
        columns.div_ceil(per_place).abs_diff(circles.columns as usize) + rows.abs_diff(circles.rows as usize)
    };
    let (columns, rows) = if off(wide, high) <= off(high, wide) { (wide, high) } else { (high, wide) };
    let columns = columns.div_ceil(per_place);
    // Of the right size, but too little of it.
    let is_same = columns == circles.columns as usize && rows == circles.rows as usize;
    let cut = is_cut(places, [least, greatest], lattice, picture, circles);
    if is_same { Fit::None } else { Fit::Other { columns, rows, cut } }
}

/// Of a line beside the lattice, no more than this share may lie within a picture that cuts it off.
const MAX_INSIDE: f64 = 0.2;

/// Whether the picture ends before the next line of places, on one side at least.
fn is_cut(
    places: &[Place],
    [least, greatest]: [Place; 2],
    lattice: &Lattice,
    picture: &Luma,
    circles: &Circles,
) -> bool {
    let extent = Extent::of(circles);
    let is_open = |axis: usize, step: i32| {
        let end = if step > 0 { greatest[axis] } else { least[axis] };
        let outer = places.iter().filter(|place| place[axis] == end).map(|place| {
            let mut beyond = *place;
            beyond[axis] += step;
            // The next line of an asymmetric board is shifted.
            beyond[1 - axis] += i32::from(extent.layout == CircleLayout::Asymmetric);
            extent.lattice_by(beyond)
        });
        let (inside, all) = outer.fold((0_usize, 0_usize), |(inside, all), place| {
            (inside + usize::from(lattice.is_in_view(place, picture)), all + 1)
        });
        inside as f64 <= MAX_INSIDE * all as f64
    };
    [0, 1].into_iter().any(|axis| is_open(axis, 1) || is_open(axis, -1))
}
