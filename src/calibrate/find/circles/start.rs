//! Where a lattice begins: a disc with a neighbour on either axis, and more where these two say.
//!
//! The shape of a disc's image tells how the board lies, up to a turn. In radii of the disc its neighbours are at right angles
//! and equally far, however tilted the board is.

use nalgebra::Vector2;

use super::super::discs::{Disc, Near};
use super::lattice::{Lattice, Place};

/// Neighbours of a lattice whose step is so many radii are looked for within this range, as a ratio of the step. A disc may
/// be printed larger or smaller than stated, and a small one looks larger than it is.
const STEP_RANGE: [f64; 2] = [0.55, 1.6];

/// Nearest discs that are looked at.
const NEIGHBOURS: usize = 14;

/// How much longer one step may look than the other, and the least sine of the angle between them.
const MAX_STEP_RATIO: f64 = 1.5;
const MIN_SINE: f64 = 0.85;

/// How far from where it is expected a neighbour may be, in steps.
const GATE: f64 = 0.25;

/// Ratio of the areas of neighbours.
pub(super) const MAX_AREA_RATIO: f64 = 2.5;

/// Discs that must be where the two steps say, of the eight around, those at the steps themselves among them.
const MIN_CONFIRMED: usize = 5;

/// Discs at the places that two steps lead to.
struct Start {
    discs: Vec<(Place, usize)>,
    /// How far they are from these places, together.
    off: f64,
}

impl Start {
    fn is_better(&self, other: &Self) -> bool {
        let (own, others) = (self.discs.len(), other.discs.len());
        own > others || own == others && self.off < other.off
    }
}

/// The beginnings of a lattice about a disc, as far as `is_free` discs go; `None` where there is none.
pub(super) fn start(
    disc: usize,
    discs: &[Disc],
    near: &Near,
    step_radii: f64,
    is_free: impl Fn(usize) -> bool,
) -> Option<Lattice> {
    let middle = &discs[disc];
    let radii_from_px = middle.radii_from_px()?;
    let reach_px = STEP_RANGE[1] * 1.5 * step_radii * middle.half_axes_px()[1];
    let area = middle.area_px();
    let mut ways: Vec<(f64, Vector2<f64>, usize)> = near
        .within(middle.pixel, reach_px)
        .filter(|other| *other != disc && is_free(*other))
        .filter(|other| (MAX_AREA_RATIO.recip()..MAX_AREA_RATIO).contains(&(discs[*other].area_px() / area)))
        .map(|other| {
            let way = radii_from_px * (discs[other].pixel - middle.pixel) / step_radii;
            (way.norm(), way, other)
        })
        .collect();
    ways.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    ways.truncate(NEIGHBOURS);
    let mut best: Option<Start> = None;
    for (length, first, _) in ways.iter().filter(|(length, ..)| (STEP_RANGE[0]..STEP_RANGE[1]).contains(length)) {
        for (other_length, second, _) in &ways {
            let ratio = other_length / length;
            let is_square = (MAX_STEP_RATIO.recip()..MAX_STEP_RATIO).contains(&ratio)
                && first.perp(second) > MIN_SINE * length * other_length;
            if !is_square {
                continue;
            }
            // A disc in the middle of a cell: the steps are diagonals.
            let at = |way: Vector2<f64>| {
                let nearest =
                    ways.iter().map(|(_, to, other)| ((to - way).norm(), *other)).min_by(|a, b| a.0.total_cmp(&b.0));
                nearest.filter(|(off, _)| *off < GATE * length.min(*other_length))
            };
            if at((first + second) * 0.5).is_some() {
                continue;
            }
            let mut start = Start { discs: vec![([0, 0], disc)], off: 0.0 };
            for [i, j] in [[1, 0], [0, 1], [-1, 0], [0, -1], [1, 1], [-1, 1], [1, -1], [-1, -1]] {
                if let Some((off, other)) = at(first * f64::from(i) + second * f64::from(j)) {
                    start.off += off;
                    start.discs.push(([i, j], other));
                }
            }
            if best.as_ref().is_none_or(|best| start.is_better(best)) {
                best = Some(start);
            }
        }
    }
    let best = best.filter(|best| best.discs.len() > MIN_CONFIRMED)?;
    let mut lattice = Lattice::default();
    for (place, disc) in best.discs {
        lattice.put(place, disc, discs[disc].pixel);
    }
    Some(lattice)
}
