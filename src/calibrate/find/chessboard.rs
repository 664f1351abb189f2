//! A chessboard in a picture: its inner corners.
//!
//! Corners of four squares are found by their response ([`response`]), each with the edges that cross there ([`ring`]); those that are each
//! other's neighbours ([`links`]) make lattices ([`lattice`]), which take in what the picture shows where they have it coming ([`growth`]).
//! A lattice as large as the board, or cut off by the picture's border, is the board ([`extent`], [`order`]), and a model of the light about
//! each corner says where exactly it is ([`saddle`], [`exact`]). Lines are never taken for straight, so that a lens may bend them.
//!
//! A part of the board suffices where the picture ends. Which rows are missing then may be told by nothing; any answer that is
//! consistent is right for a calibration, because the board's pose makes up for the difference: a shift by whole squares, or a
//! quarter turn. Two such pictures must not be taken as views of the same points in space.

mod exact;
mod extent;
mod growth;
mod lattice;
mod links;
mod order;
mod pyramid;
mod response;
mod ring;
mod saddle;

use nalgebra::Matrix2;

use self::extent::{Extent, Placement};
use self::lattice::Lattice;
use self::links::Corner;
use self::pyramid::{Level, Pyramid};
use self::ring::{Demand, Ring};
use super::{Luma, Need, NoBoard};
use crate::board::Chessboard;
use crate::calibrate::SeenPoint;
use crate::camera::Pixel;

/// The size of picture in which corners are looked for first: longest side, px.
const FIRST_SIDE_PX: usize = 1_300;

/// Pictures up to this size are also looked at twice as large, for squares of few pixels: longest side, px.
const DOUBLED_SIDE_PX: usize = 1_600;

/// A board of less than this share of another's area in the picture is the other's picture on a screen or in a mirror: the larger is
/// meant.
const SMALL_SHARE: f64 = 0.25;

/// What a ring must show of a corner of which nothing is known.
const DEMAND: Demand = Demand { correlation: 0.8, contrast: 8.0, reach: 0.5 };

/// Fewer neighbouring corners than this are no lattice.
const MIN_NODES: usize = 4;

/// The inner corners that are seen.
///
/// A board that the picture cuts off is found by the corners that are left, at least three (of a small board) or four along each side.
/// Corners that something covers are left out as long as the lattice about them says how large the board is.
pub(super) fn find(picture: &Luma, chessboard: &Chessboard) -> Result<Vec<SeenPoint>, NoBoard> {
    let pyramid = Pyramid::of(picture);
    let ring = Ring::new();
    let longest = |level: &Level<'_>| level.plane.width.max(level.plane.height);
    let first = pyramid.levels.iter().position(|level| longest(level) <= FIRST_SIDE_PX).unwrap_or(0);
    let coarser = first + 1..pyramid.levels.len();
    let mut answer = Answer::of(chessboard);
    for index in std::iter::once(first).chain((0..first).rev()).chain(coarser) {
        answer.consider(&pyramid, &pyramid.levels[index], &ring);
        if answer.is_whole() {
            return answer.into_result();
        }
    }
    if longest(&pyramid.levels[0]) <= DOUBLED_SIDE_PX {
        let twice = Level::of(pyramid.levels[0].plane.doubled(), 0.5);
        answer.consider(&pyramid, &twice, &ring);
    }
    answer.into_result()
}

/// A board of another size.
struct Other {
    extent: Extent,
    /// Area of the picture that it covers, px^2.
    area_px: f64,
    /// The box that holds it: least and greatest x and y, px.
    bounds: [Pixel; 2],
}

/// The best that the levels have given.
struct Answer<'a> {
    chessboard: &'a Chessboard,
    points: Vec<SeenPoint>,
    /// Area of the picture that they cover, px^2.
    area_px: f64,
    /// Boards of the right size that lie apart and are about as large in the picture.
    several: usize,
    /// The largest board of another size.
    other: Option<Other>,
    /// The most corners that hung together.
    found: usize,
}

impl<'a> Answer<'a> {
    const fn of(chessboard: &'a Chessboard) -> Self {
        Self { chessboard, points: Vec::new(), area_px: 0.0, several: 0, other: None, found: 0 }
    }

    const fn need(&self) -> usize {
        (self.chessboard.columns * self.chessboard.rows) as usize
    }

    /// Columns and rows that must be seen.
    const fn least_lines(&self) -> usize {
        let shorter =
            if self.chessboard.columns < self.chessboard.rows { self.chessboard.columns } else { self.chessboard.rows };
        if shorter < 4 { shorter as usize } else { 4 }
    }

    /// Whether no other level can give more.
    fn is_whole(&self) -> bool {
        self.several > 1 || self.points.len() == self.need()
    }

    fn consider(&mut self, pyramid: &Pyramid<'_>, level: &Level<'_>, ring: &Ring) {
        let mut whole_areas_px: Vec<f64> = Vec::new();
        for mut lattice in lattices(pyramid, level, ring) {
            let extent = extent::extent(&mut lattice, pyramid);
            self.found = self.found.max(extent.count);
            if !extent.is_board() {
                continue;
            }
            let Some(points) = self.points_of(&mut lattice, &extent, pyramid) else {
                self.consider_other(lattice, pyramid);
                continue;
            };
            let size = extent.size();
            let board = [self.chessboard.columns as usize, self.chessboard.rows as usize];
            let area_px = lattice.area_px();
            if size == board || size == [board[1], board[0]] {
                whole_areas_px.push(area_px);
            }
            if area_px > self.area_px {
                (self.points, self.area_px) = (points, area_px);
            }
        }
        let near = whole_areas_px.iter().filter(|area| **area > SMALL_SHARE * self.area_px).count();
        self.several = self.several.max(near);
    }

    /// A board of another size has corners that stand a close look; what clutter makes has not.
    fn consider_other(&mut self, mut lattice: Lattice, pyramid: &Pyramid<'_>) {
        exact::settle(&mut lattice, pyramid);
        let extent = extent::extent(&mut lattice, pyramid);
        if extent.is_board() && self.other.as_ref().is_none_or(|other| other.extent.count < extent.count) {
            let pixels = || lattice.nodes.iter().map(|node| node.pixel);
            let least = pixels().fold(Pixel::repeat(f64::INFINITY), |least, pixel| least.inf(&pixel));
            let most = pixels().fold(Pixel::repeat(f64::NEG_INFINITY), |most, pixel| most.sup(&pixel));
            self.other = Some(Other { extent, area_px: lattice.area_px(), bounds: [least, most] });
        }
    }

    /// The board's points if the lattice is one of it.
    fn points_of(&self, lattice: &mut Lattice, extent: &Extent, pyramid: &Pyramid<'_>) -> Option<Vec<SeenPoint>> {
        let [columns, rows] = extent.size();
        if columns.min(rows) < self.least_lines() {
            return None;
        }
        order::points(lattice, extent, self.chessboard)?;
        let sigmas = exact::settle(lattice, pyramid);
        let points = order::points(lattice, extent, self.chessboard)?;
        let seen = lattice.nodes.iter().zip(&sigmas).zip(points);
        let mut seen: Vec<SeenPoint> =
            seen.map(|((node, sigma_px), point)| SeenPoint { point, pixel: node.pixel, sigma_px: *sigma_px }).collect();
        seen.sort_unstable_by_key(|seen| seen.point);
        let is_enough = 10 * seen.len() >= 5 * columns * rows;
        is_enough.then_some(seen)
    }

    /// Whether what was found is a part of a board of another size of which a level has missed some corners, or small beside one.
    fn is_none_beside_other(&self) -> bool {
        let sum: Pixel = self.points.iter().map(|seen| seen.pixel).sum();
        let middle = sum / self.points.len().max(1) as f64;
        self.other.as_ref().is_some_and(|other| {
            let [least, most] = other.bounds;
            let is_inside = least.inf(&middle) == least && most.sup(&middle) == most;
            let is_small = self.area_px < SMALL_SHARE * other.area_px;
            other.extent.count > self.points.len() && (is_inside || is_small)
        })
    }

    fn into_result(self) -> Result<Vec<SeenPoint>, NoBoard> {
        let need = self.need();
        let (columns, rows) = (self.chessboard.columns as usize, self.chessboard.rows as usize);
        if self.several > 1 {
            return Err(NoBoard::Several { count: self.several });
        }
        if !self.points.is_empty() && !self.is_none_beside_other() {
            return Ok(self.points);
        }
        let pattern = "chessboard";
        let Some(Other { extent: other, .. }) = &self.other else {
            return Err(NoBoard::NotSeen { pattern, found: self.found, need });
        };
        let [a, b] = other.size();
        let (long, short) = (a.max(b), a.min(b));
        let (found_columns, found_rows) = if columns >= rows { (long, short) } else { (short, long) };
        let cut = other.open.contains(&true);
        // It fits the board as far as it goes, and does not go far enough.
        if cut && short < self.least_lines() && !Placement::all(other, self.chessboard).is_empty() {
            let need = Need::Lines(self.least_lines());
            return Err(NoBoard::CutOff { pattern, found_columns, found_rows, columns, rows, need });
        }
        Err(NoBoard::OtherSize { pattern, found_columns, found_rows, columns, rows, cut })
    }
}

/// The lattices that a level shows, grown and apart, the larger first.
fn lattices(pyramid: &Pyramid<'_>, level: &Level<'_>, ring: &Ring) -> Vec<Lattice> {
    let corners = corners(level, ring);
    let links = links::links(&corners, 2.0 * response::RADIUS as f64 * level.scale);
    let mut used = vec![false; corners.len()];
    let mut seeds: Vec<usize> = (0..corners.len()).collect();
    let degree = |index: usize| links[index].iter().flatten().count();
    seeds.sort_by_key(|index| std::cmp::Reverse(degree(*index)));
    let mut found: Vec<Lattice> = Vec::new();
    for seed in seeds {
        if used[seed] || degree(seed) < 2 {
            continue;
        }
        let lattice = Lattice::of_links(&corners, &links, seed, &mut used);
        if lattice.nodes.len() >= MIN_NODES {
            found.push(lattice);
        }
    }
    found.sort_by_key(|lattice| std::cmp::Reverse(lattice.nodes.len()));
    found.truncate(MAX_LATTICES);
    apart(found, pyramid, ring)
}

/// Most lattices of a level: in clutter there are many small ones.
const MAX_LATTICES: usize = 12;

/// The lattices grown, without those of which an earlier one has taken in most.
fn apart(found: Vec<Lattice>, pyramid: &Pyramid<'_>, ring: &Ring) -> Vec<Lattice> {
    let mut grown: Vec<Lattice> = Vec::new();
    for mut lattice in found {
        let is_in = |pixel: Pixel| {
            grown.iter().any(|other: &Lattice| other.nodes.iter().any(|node| (node.pixel - pixel).norm() < 3.0))
        };
        let taken = lattice.nodes.iter().filter(|node| is_in(node.pixel)).count();
        if 2 * taken < lattice.nodes.len() {
            growth::grow(&mut lattice, pyramid, ring);
            grown.push(lattice);
        }
    }
    grown
}

/// Places of the level at which four squares seem to meet.
fn corners(level: &Level<'_>, ring: &Ring) -> Vec<Corner> {
    let smooth = level.smooth();
    let axes = Matrix2::identity() * response::RADIUS as f64;
    let at = |[x, y]: [usize; 2]| {
        let middle = Pixel::new(x as f64, y as f64);
        let seen = ring.look(smooth, &middle, &axes, &DEMAND)?;
        let pixel = level.to_picture(&(middle + axes * seen.place));
        Some(Corner { pixel, enter: seen.enter, leave: seen.leave, contrast: seen.contrast })
    };
    response::peaks(smooth).into_iter().filter_map(at).collect()
}

#[cfg(test)]
mod tests;
