//! Where the growth begins: a triple that looks like one of the board's, and neighbours that agree.

use nalgebra::{Matrix2, Vector2};

use super::growth::{Growth, Known};
use super::stars::{Form, Triple, UNIT};

/// Neighbours of a disc that form triples with it, and that are asked whether they agree.
const PARTNERS: usize = 5;
const WITNESSES: usize = 10;

/// Triples of a disc that are tried.
const MAX_TRIPLES: usize = 8;

/// How far a triple may be off its form: so much for perspective, and more for discs of few pixels, whose shape is vague.
const TOLERANCE: f64 = 0.14;
const TOLERANCE_PX: f64 = 0.5;
const MAX_TOLERANCE: f64 = 0.4;

/// Where three dots say a fourth is: within this part of the way to it, and of a radius, on the board.
const GATE_RATIO: f64 = 0.12;
const GATE_RADII: f64 = 0.4;

/// Witnesses that must agree, at least twice as many as do not.
const MIN_AGREED: usize = 4;
const MAX_DENIED: usize = 3;

/// Comparisons with triples of the board, and growths from those that agree, until the search is given up.
const MAX_COMPARISONS: usize = 400_000;
const MAX_GROWTHS: usize = 150;

/// The dots of the picture, `(dot, disc)`; else the most that hung together.
pub(super) fn starts(growth: &Growth<'_>) -> Result<Vec<(usize, usize)>, usize> {
    let count = growth.discs.len();
    let mut most = 0;
    let (mut comparisons, mut growths) = (0, 0);
    // Scattered over the picture: in order, a search could spend itself on the clutter above the board.
    let stride = stride(count);
    for index in 0..count {
        let disc = index * stride % count;
        let neighbours = neighbours(growth, disc);
        for (triple, form, tolerance) in triples(growth, disc, &neighbours) {
            for alike in growth.stars.alike(form, tolerance) {
                comparisons += 1;
                let Some(known) = agreed(growth, triple, alike, &neighbours) else { continue };
                let known = growth.grown(known);
                if growth.is_certain(&known) {
                    return Ok(growth.finished(known));
                }
                most = most.max(known.len());
                growths += 1;
            }
            if comparisons > MAX_COMPARISONS || growths > MAX_GROWTHS {
                return Err(most);
            }
        }
    }
    Err(most)
}

/// A number without a divisor in common with `count`, so that its multiples reach everything.
fn stride(count: usize) -> usize {
    let shares = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a > 1
    };
    let start = count * 5 / 13 + 1;
    (start..start + count).find(|stride| !shares(count, *stride)).unwrap_or(1)
}

/// The discs nearest to a disc on the board, as far as its shape tells, with the ways to them in radii.
fn neighbours(growth: &Growth<'_>, disc: usize) -> Vec<(usize, Vector2<f64>)> {
    let middle = &growth.discs[disc];
    let Some(radii_from_px) = middle.radii_from_px() else { return Vec::new() };
    let reach_radii = 2.3 * UNIT / growth.stars.radius;
    let mut near: Vec<(f64, usize, Vector2<f64>)> = growth
        .near
        .within(middle.pixel, reach_radii * middle.half_axes_px()[1])
        .filter(|other| *other != disc && growth.is_alike(disc, *other))
        .map(|other| {
            let way = radii_from_px * (growth.discs[other].pixel - middle.pixel);
            (way.norm(), other, way)
        })
        .filter(|(distance, ..)| *distance < reach_radii)
        .collect();
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    near.truncate(PARTNERS + WITNESSES);
    near.into_iter().map(|(_, other, way)| (other, way)).collect()
}

fn triples(growth: &Growth<'_>, disc: usize, neighbours: &[(usize, Vector2<f64>)]) -> Vec<([usize; 3], Form, f64)> {
    let tolerance = (TOLERANCE + TOLERANCE_PX / growth.discs[disc].half_axes_px()[0].max(1.0)).min(MAX_TOLERANCE);
    let partners = &neighbours[..neighbours.len().min(PARTNERS)];
    let pairs = partners.iter().flat_map(|first| partners.iter().map(move |second| (first, second)));
    let triples = pairs.filter_map(|((first, to_first), (second, to_second))| {
        Some(([disc, *first, *second], Form::of(to_first, to_second)?, tolerance))
    });
    triples.take(MAX_TRIPLES).collect()
}

/// What is known if both triples are the same, and enough neighbours agree.
fn agreed(
    growth: &Growth<'_>,
    discs: [usize; 3],
    alike: &Triple,
    neighbours: &[(usize, Vector2<f64>)],
) -> Option<Known> {
    let stars = growth.stars;
    let pixels = discs.map(|disc| growth.discs[disc].pixel);
    let places = alike.dots.map(|dot| stars.places[dot]);
    let sides = |[a, b, c]: [Vector2<f64>; 3]| Matrix2::from_columns(&[b - a, c - a]);
    let px_by_place = sides(pixels) * sides(places).try_inverse()?;
    let place_by_px = px_by_place.try_inverse()?;
    // The same disc, seen by its shape and by its neighbours.
    let area = std::f64::consts::PI * stars.radius.powi(2) * px_by_place.determinant();
    if !(0.4..2.5).contains(&(area / growth.discs[discs[0]].area_px())) {
        return None;
    }
    let mut known: Known = alike.dots.into_iter().zip(discs).collect();
    let (mut agreed, mut denied) = (0, 0);
    for (disc, _) in neighbours.iter().filter(|(disc, _)| !discs.contains(disc)) {
        let way = place_by_px * (growth.discs[*disc].pixel - pixels[0]);
        let gate = GATE_RATIO * way.norm() + GATE_RADII * stars.radius;
        match stars.near.nearest(places[0] + way, gate, |dot| !known.contains_key(&dot)) {
            Some(dot) => {
                agreed += 1;
                known.insert(dot, *disc);
            }
            None => denied += 1,
        }
        if denied > MAX_DENIED {
            return None;
        }
    }
    (agreed >= MIN_AGREED && agreed >= 2 * denied).then_some(known)
}
