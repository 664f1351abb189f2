//! Discs that have found their places in a square lattice.

use std::collections::BTreeMap;

use nalgebra::Vector2;

use super::super::plane::{Plane, Sight};
use crate::camera::Pixel;

/// A place of the lattice, in steps from where it began to grow; the second step turns from the first as y from x.
pub(super) type Place = [i32; 2];

/// Which disc is where.
#[derive(Clone, Debug, Default)]
pub(super) struct Lattice {
    discs: BTreeMap<Place, (usize, Pixel)>,
}

impl Lattice {
    pub(super) fn len(&self) -> usize {
        self.discs.len()
    }

    pub(super) fn put(&mut self, place: Place, disc: usize, pixel: Pixel) {
        self.discs.insert(place, (disc, pixel));
    }

    pub(super) fn remove(&mut self, place: Place) {
        self.discs.remove(&place);
    }

    pub(super) fn at(&self, place: Place) -> Option<usize> {
        self.discs.get(&place).map(|(disc, _)| *disc)
    }

    /// Places, discs and where these are seen.
    pub(super) fn iter(&self) -> impl Iterator<Item = (Place, usize, Pixel)> + '_ {
        self.discs.iter().map(|(place, (disc, pixel))| (*place, *disc, *pixel))
    }

    /// Those no further than `reach` steps along each axis.
    pub(super) fn around(&self, [i, j]: Place, reach: i32) -> impl Iterator<Item = (Place, usize, Pixel)> + '_ {
        let columns = i.saturating_sub(reach)..=i.saturating_add(reach);
        columns.flat_map(move |i| {
            let column = self.discs.range([i, j.saturating_sub(reach)]..=[i, j.saturating_add(reach)]);
            column.map(|(place, (disc, pixel))| (*place, *disc, *pixel))
        })
    }

    /// How the lattice lies in the picture about a place, as those around it tell, without itself: at least `need` of them
    /// within the least reach, up to `reach`, that has so many.
    pub(super) fn plane(&self, place: Place, reach: i32, need: usize) -> Option<Plane> {
        (1..=reach).find_map(|reach| {
            let others = self.around(place, reach).filter(|(other, ..)| *other != place);
            let sights: Vec<Sight> = others.map(|(other, _, pixel)| (steps(other), pixel)).collect();
            (sights.len() >= need).then(|| Plane::through(&sights, steps(place), 1.0)).flatten()
        })
    }
}

/// A place in the plane of the lattice.
pub(super) fn steps([i, j]: Place) -> Vector2<f64> {
    Vector2::new(f64::from(i), f64::from(j))
}
