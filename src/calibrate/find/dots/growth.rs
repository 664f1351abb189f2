//! Dots that are known tell where the next ones are.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix2, Vector2};

use super::super::Luma;
use super::super::discs::{Disc, Near};
use super::super::plane::{Plane, Sight};
use super::stars::{Stars, UNIT};
use crate::camera::Pixel;

/// Which disc each known dot is.
pub(super) type Known = BTreeMap<usize, usize>;

/// What the growth goes by.
pub(super) struct Growth<'a> {
    pub stars: &'a Stars,
    pub discs: &'a [Disc],
    pub near: &'a Near,
    pub picture: &'a Luma,
}

/// A dot that is not known yet.
struct Expected {
    dot: usize,
    /// The disc of the nearest dot that is, and the distance to that on the board.
    like: usize,
    distance: f64,
    /// Where it would be seen, and how the board lies there.
    pixel: Pixel,
    by_place: Matrix2<f64>,
}

/// Known dots by which another is expected: so many at least, and the nearest so many at most.
const MIN_SIGHTS: usize = 4;
const MAX_SIGHTS: usize = 12;

/// How far from where it is expected a dot may be, in distances of neighbours: so much, and more the further what is known.
const GATE: f64 = 0.05;
const GATE_RATIO: f64 = 0.06;
const MAX_GATE: f64 = 0.22;

/// A dot is out of place that is further than this from where its neighbours say.
const STAY_GATE: f64 = 0.08;

/// And, px: small discs are placed no better.
const STAY_GATE_PX: f64 = 0.7;

/// Over so many distances of neighbours the growth goes past what hides dots.
const ACROSS: f64 = 4.0;

/// Ratio of the areas of neighbours.
const MAX_AREA_RATIO: f64 = 2.5;

/// So many dots, and so great a share of those that should be seen where they are, are no chance: a disc is within the gate of a
/// wrong place one time in ten.
const CERTAIN: [(usize, f64); 2] = [(9, 0.75), (14, 0.45)];

impl Growth<'_> {
    /// Whether two discs next to each other may be of one size.
    pub(super) fn is_alike(&self, disc: usize, other: usize) -> bool {
        let ratio = self.discs[disc].area_px() / self.discs[other].area_px();
        (MAX_AREA_RATIO.recip()..MAX_AREA_RATIO).contains(&ratio)
    }

    /// All that follows from what is known, from neighbour to neighbour.
    pub(super) fn grown(&self, mut known: Known) -> Known {
        let mut fresh: Vec<usize> = known.keys().copied().collect();
        self.weed(&mut known, &fresh);
        // What is taken out may come back in: only what grows goes on.
        let mut before = 0;
        while known.len() > before.max(MIN_SIGHTS - 1) {
            before = known.len();
            fresh = self.add(&mut known, false);
            self.weed(&mut known, &fresh);
        }
        known
    }

    /// The same past what hides dots.
    pub(super) fn finished(&self, mut known: Known) -> Vec<(usize, usize)> {
        for _ in 0..6 {
            let before = known.len();
            let fresh = self.add(&mut known, true);
            self.weed(&mut known, &fresh);
            known = self.grown(known);
            if known.len() <= before {
                break;
            }
        }
        known.into_iter().collect()
    }

    /// Whether it is no chance that so many dots are where they should be.
    pub(super) fn is_certain(&self, known: &Known) -> bool {
        let expected = self.expected(known, false);
        let missing = expected.iter().filter(|Expected { pixel, by_place, .. }| {
            let reach = by_place.map(f64::abs) * Vector2::repeat(1.5 * self.stars.radius);
            (reach.x..self.picture.width as f64 - reach.x).contains(&pixel.x)
                && (reach.y..self.picture.height as f64 - reach.y).contains(&pixel.y)
        });
        let share = known.len() as f64 / (known.len() + missing.count()) as f64;
        CERTAIN.iter().any(|(count, least)| known.len() >= *count && share >= *least)
    }

    /// Adds the discs that are where dots are expected; which dots these are.
    fn add(&self, known: &mut Known, across: bool) -> Vec<usize> {
        let taken: BTreeSet<usize> = known.values().copied().collect();
        // The same disc for two dots: it is the one that it fits better.
        let mut wanted: BTreeMap<usize, (f64, usize)> = BTreeMap::new();
        for Expected { dot, like, distance, pixel, by_place } in self.expected(known, across) {
            let Some(place_by_px) = by_place.try_inverse() else { continue };
            let gate = (GATE + GATE_RATIO * distance / UNIT).min(MAX_GATE) * UNIT;
            let off = |disc: usize| (place_by_px * (self.discs[disc].pixel - pixel)).norm();
            let fits = |disc: &usize| !taken.contains(disc) && self.is_alike(*disc, like) && off(*disc) < gate;
            let candidates = self.near.within(pixel, gate * by_place.norm()).filter(fits).map(|disc| (disc, off(disc)));
            let Some((disc, off)) = candidates.min_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
            let entry = wanted.entry(disc).or_insert((off, dot));
            if off < entry.0 {
                *entry = (off, dot);
            }
        }
        known.extend(wanted.iter().map(|(disc, (_, dot))| (*dot, *disc)));
        wanted.into_values().map(|(_, dot)| dot).collect()
    }

    /// The dots that are not known but next to such; `across`, also those further off.
    fn expected(&self, known: &Known, across: bool) -> Vec<Expected> {
        let unknown = (0..self.stars.places.len()).filter(|dot| !known.contains_key(dot));
        let expected = unknown.filter_map(|dot| {
            let place = self.stars.places[dot];
            let mut others: Vec<usize> =
                self.stars.neighbours[dot].iter().copied().filter(|dot| known.contains_key(dot)).collect();
            if across && others.len() < MAX_SIGHTS {
                let distance = |dot: &usize| (self.stars.places[*dot] - place).norm_squared();
                others = known.keys().copied().collect();
                others.sort_unstable_by(|a, b| distance(a).total_cmp(&distance(b)));
            }
            others.truncate(MAX_SIGHTS);
            let (nearest, plane) = self.plane(known, &others, place)?;
            let distance = (self.stars.places[nearest] - place).norm();
            let pixel = plane.pixel(&place)?;
            let like = *known.get(&nearest)?;
            (distance < ACROSS * UNIT).then_some(Expected {
                dot,
                like,
                distance,
                pixel,
                by_place: plane.by_place(&place),
            })
        });
        expected.collect()
    }

    fn plane(&self, known: &Known, others: &[usize], place: Vector2<f64>) -> Option<(usize, Plane)> {
        let sights: Vec<Sight> = others
            .iter()
            .filter_map(|dot| Some((self.stars.places[*dot], self.discs[*known.get(dot)?].pixel)))
            .collect();
        if sights.len() < MIN_SIGHTS {
            return None;
        }
        Some((*others.first()?, Plane::through(&sights, place, UNIT)?))
    }

    /// Takes out what is not where its neighbours say, among what is fresh and what is next to that.
    fn weed(&self, known: &mut Known, fresh: &[usize]) {
        let next = fresh.iter().flat_map(|dot| self.stars.neighbours[*dot].iter().take(MAX_SIGHTS / 2));
        let doubtful: BTreeSet<usize> = fresh.iter().chain(next).copied().collect();
        for _ in 0..4 {
            let off = |(dot, disc): (&usize, &usize)| {
                let place = self.stars.places[*dot];
                let others: Vec<usize> = self.stars.neighbours[*dot]
                    .iter()
                    .copied()
                    .filter(|dot| known.contains_key(dot))
                    .take(MAX_SIGHTS)
                    .collect();
                let (nearest, plane) = self.plane(known, &others, place)?;
                let off_px = self.discs[*disc].pixel - plane.pixel(&place)?;
                let off = (plane.by_place(&place).try_inverse()? * off_px).norm();
                let distance = (self.stars.places[nearest] - place).norm();
                let gate = (STAY_GATE + 0.5 * GATE_RATIO * distance / UNIT) * UNIT;
                (off > gate && off_px.norm() > STAY_GATE_PX).then_some((off, *dot))
            };
            let here = doubtful.iter().filter_map(|dot| known.get_key_value(dot));
            let bad: Vec<(f64, usize)> = here.filter_map(off).collect();
            let worst = bad.iter().map(|(off, _)| *off).fold(0.0, f64::max);
            if bad.is_empty() {
                return;
            }
            // A dot out of place makes its neighbours look so, less than itself.
            bad.iter().filter(|(off, _)| *off > 0.6 * worst).for_each(|(_, dot)| {
                known.remove(dot);
            });
        }
    }
}
