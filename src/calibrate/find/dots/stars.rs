//! The dots of a board, and the triples that they form.

use nalgebra::Vector2;

use super::super::discs::Near;
use crate::board::Dots;

/// The distance between neighbours, nearly: places are in units in which it is this.
pub(super) const UNIT: f64 = 16.0;

/// Nearest dots of each that are known.
const NEIGHBOURS: usize = 16;

/// Nearest dots of each that form triples with it: what is nearest in the picture need not be on the board, and may be hidden.
const PARTNERS: usize = 8;

/// Least sine of the angle of a triple: what is nearly on a line tells little.
pub(super) const MIN_SINE: f64 = 0.3;

/// A dot and two of its neighbours, the second further on in the sense from x to y.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triple {
    pub dots: [usize; 3],
    pub form: Form,
}

/// What a triple looks like however it is turned.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form {
    /// Logarithms of the distances in radii of a dot.
    pub ln_distances: [f64; 2],
    /// Angle between the ways to the two, rad.
    pub angle_rad: f64,
}

impl Form {
    /// Of two ways in radii; `None` if they are on a line, or the second is not further on.
    pub(super) fn of(first: &Vector2<f64>, second: &Vector2<f64>) -> Option<Self> {
        let (a, b) = (first.norm(), second.norm());
        let sine = first.perp(second) / (a * b);
        let ln_distances = [a.ln(), b.ln()];
        (sine > MIN_SINE).then(|| Self { ln_distances, angle_rad: sine.atan2(first.dot(second) / (a * b)) })
    }

    /// Whether both look the same within a tolerance.
    fn is_near(&self, other: &Self, tolerance: f64) -> bool {
        let [a, b] = [0, 1].map(|k| self.ln_distances[k] - other.ln_distances[k]);
        a.abs() < tolerance
            && b.abs() < tolerance
            && (a - b).abs() < tolerance
            && (self.angle_rad - other.angle_rad).abs() < tolerance
    }
}

/// The dots.
pub(super) struct Stars {
    pub places: Vec<Vector2<f64>>,
    pub radius: f64,
    pub near: Near,
    /// The nearest of each, the nearest first.
    pub neighbours: Vec<Vec<usize>>,
    /// By the logarithm of the first distance.
    triples: Vec<Triple>,
}

impl Stars {
    /// `None` if they all lie on a line along an axis, or there are none.
    pub(super) fn of(dots: &Dots) -> Option<Self> {
        let far = Vector2::repeat(f64::INFINITY);
        let bounds = |[least, greatest]: [Vector2<f64>; 2], place: &[f64; 2]| {
            let place = Vector2::from(*place);
            [least.inf(&place), greatest.sup(&place)]
        };
        let [least, greatest] = dots.places_m.iter().fold([far, -far], bounds);
        let size = greatest - least;
        let per_m = UNIT / (size.x * size.y / dots.places_m.len() as f64).sqrt();
        if !(per_m.is_finite() && size.min() > 0.0) {
            return None;
        }
        let places: Vec<Vector2<f64>> =
            dots.places_m.iter().map(|place| (Vector2::from(*place) - least) * per_m).collect();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "casting saturates")]
        let [width, height] = [size.x, size.y].map(|side| ((side * per_m) as usize).clamp(1, 1 << 16));
        let near = Near::of(places.clone(), width, height);
        let neighbours: Vec<Vec<usize>> = (0..places.len()).map(|dot| nearest(dot, &places, &near)).collect();
        let radius = dots.radius_m * per_m;
        let mut triples: Vec<Triple> = Vec::new();
        for (dot, neighbours) in neighbours.iter().enumerate() {
            let way = |other: usize| (places[other] - places[dot]) / radius;
            let partners = &neighbours[..neighbours.len().min(PARTNERS)];
            for first in partners {
                triples.extend(partners.iter().filter_map(|second| {
                    let form = Form::of(&way(*first), &way(*second))?;
                    Some(Triple { dots: [dot, *first, *second], form })
                }));
            }
        }
        triples.sort_unstable_by(|a, b| a.form.ln_distances[0].total_cmp(&b.form.ln_distances[0]));
        Some(Self { places, radius, near, neighbours, triples })
    }

    /// The triples of this form.
    pub(super) fn alike(&self, form: Form, tolerance: f64) -> impl Iterator<Item = &Triple> {
        let at = |ln: f64| self.triples.partition_point(|triple| triple.form.ln_distances[0] < ln);
        let middle = form.ln_distances[0];
        let range = at(middle - tolerance)..at(middle + tolerance);
        self.triples[range].iter().filter(move |triple| triple.form.is_near(&form, tolerance))
    }
}

fn nearest(dot: usize, places: &[Vector2<f64>], near: &Near) -> Vec<usize> {
    let distance = |other: &usize| (places[*other] - places[dot]).norm_squared();
    let mut reach = 2.6 * UNIT;
    let mut others: Vec<usize> = Vec::new();
    while others.len() < NEIGHBOURS.min(places.len() - 1) {
        others = near.within(places[dot], reach).filter(|other| *other != dot).collect();
        reach *= 1.6;
    }
    others.sort_unstable_by(|a, b| distance(a).total_cmp(&distance(b)));
    others.truncate(NEIGHBOURS);
    others
}
