//! A lattice grows: what it is says where its next discs are.

use std::collections::{BTreeMap, BTreeSet};

use super::super::discs::{Disc, Near};
use super::lattice::{Lattice, Place, steps};
use super::start::{MAX_AREA_RATIO, start};
use crate::board::{CircleLayout, Circles};

/// Fewer discs than this are no lattice, but chance.
const MIN_DISCS: usize = 9;

/// Starts that are tried at most: clutter has thousands of discs and no lattice.
const MAX_STARTS: usize = 1_200;

/// More discs than any board has, and lattices than anybody lays out.
const MAX_LATTICE: usize = 4_000;
const MAX_LATTICES: usize = 8;

/// How far from where it is expected a disc may be, in steps: where only its next neighbours tell, and where more do.
const FIRST_GATE: f64 = 0.3;
const GATE: f64 = 0.2;
const MANY: usize = 8;

/// A disc is out of place that is further from where its neighbours say than this, in steps.
const STAY_GATE: f64 = 0.15;

/// Steps over which a lattice grows: to its next neighbours, and across what hides some of it.
const NEXT: i32 = 1;
const ACROSS: i32 = 3;

/// The lattices of the picture that could be a board's, the largest first.
pub(super) fn lattices(discs: &[Disc], near: &Near, circles: &Circles) -> Vec<Lattice> {
    let step_m = match circles.layout {
        CircleLayout::Symmetric => circles.spacing_m,
        CircleLayout::Asymmetric => circles.spacing_m * std::f64::consts::SQRT_2,
    };
    let step_radii = step_m / circles.radius_m;
    let mut used = vec![false; discs.len()];
    let mut found: Vec<Lattice> = Vec::new();
    let stride = discs.len().div_ceil(MAX_STARTS).max(1);
    for disc in (0..discs.len()).step_by(stride) {
        if used[disc] || found.len() >= MAX_LATTICES {
            continue;
        }
        let Some(lattice) = start(disc, discs, near, step_radii, |other| !used[other]) else { continue };
        let lattice = Growth { discs, near, used: &used }.grown(lattice);
        if lattice.len() >= MIN_DISCS {
            lattice.iter().for_each(|(_, disc, _)| used[disc] = true);
            found.push(lattice);
        }
    }
    found.sort_by_key(|lattice| std::cmp::Reverse(lattice.len()));
    found
}

struct Growth<'a> {
    discs: &'a [Disc],
    near: &'a Near,
    used: &'a [bool],
}

impl Growth<'_> {
    fn grown(&self, mut lattice: Lattice) -> Lattice {
        for _ in 0..4 {
            let before = lattice.len();
            while self.add(&mut lattice, NEXT) {}
            self.weed(&mut lattice);
            if !self.add(&mut lattice, ACROSS) && lattice.len() <= before {
                break;
            }
        }
        self.weed(&mut lattice);
        lattice
    }

    /// Adds the discs that are where the lattice says, no more than `reach` steps from it; whether there were any.
    fn add(&self, lattice: &mut Lattice, reach: i32) -> bool {
        let taken: BTreeSet<usize> = lattice.iter().map(|(_, disc, _)| disc).collect();
        if taken.len() > MAX_LATTICE {
            return false;
        }
        let mut free: BTreeSet<Place> = BTreeSet::new();
        for ([i, j], ..) in lattice.iter() {
            let sides = (-reach..=reach).filter(|k| *k != 0).flat_map(|k| [[i + k, j], [i, j + k]]);
            free.extend(sides.filter(|place| lattice.at(*place).is_none()));
        }
        // The same disc for two places: it is where it fits better.
        let mut wanted: BTreeMap<usize, (f64, Place)> = BTreeMap::new();
        for place in free {
            let Some((disc, off)) = self.expected(lattice, place, reach, &taken) else { continue };
            let entry = wanted.entry(disc).or_insert((off, place));
            if off < entry.0 {
                *entry = (off, place);
            }
        }
        for (disc, (_, place)) in &wanted {
            lattice.put(*place, *disc, self.discs[*disc].pixel);
        }
        !wanted.is_empty()
    }

    /// The free disc at a free place, and how far it is from there, in steps.
    fn expected(&self, lattice: &Lattice, place: Place, reach: i32, taken: &BTreeSet<usize>) -> Option<(usize, f64)> {
        let plane = lattice.plane(place, reach + 1, 4)?;
        let known: Vec<usize> = lattice.around(place, reach + 1).map(|(_, disc, _)| disc).collect();
        let gate = if known.len() >= MANY { GATE } else { FIRST_GATE };
        let pixel = plane.pixel(&steps(place))?;
        let by_step = plane.by_place(&steps(place));
        let steps_from_px = by_step.try_inverse()?;
        let mut areas: Vec<f64> = known.iter().map(|disc| self.discs[*disc].area_px()).collect();
        areas.sort_unstable_by(f64::total_cmp);
        let area = *areas.get(areas.len() / 2)?;
        let off = |disc: usize| (steps_from_px * (self.discs[disc].pixel - pixel)).norm();
        let fits = |disc: usize| {
            !self.used[disc]
                && !taken.contains(&disc)
                && (MAX_AREA_RATIO.recip()..MAX_AREA_RATIO).contains(&(self.discs[disc].area_px() / area))
                && off(disc) < gate
        };
        let candidates = self.near.within(pixel, gate * by_step.norm()).filter(|disc| fits(*disc));
        candidates.map(|disc| (disc, off(disc))).min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Takes out what is not where its neighbours say.
    fn weed(&self, lattice: &mut Lattice) {
        for _ in 0..3 {
            let off = |(place, disc, _): (Place, usize, _)| {
                let plane = lattice.plane(place, 2, 5)?;
                let off = plane.by_place(&steps(place)).try_inverse()?
                    * (self.discs[disc].pixel - plane.pixel(&steps(place))?);
                (off.norm() > STAY_GATE).then_some((off.norm(), place))
            };
            let bad: Vec<(f64, Place)> = lattice.iter().filter_map(off).collect();
            let worst = bad.iter().map(|(off, _)| *off).fold(0.0, f64::max);
            if bad.is_empty() {
                return;
            }
            // A disc out of place makes its neighbours look so, less than itself.
            bad.iter().filter(|(off, _)| *off > 0.6 * worst).for_each(|(_, place)| lattice.remove(*place));
        }
    }
}
