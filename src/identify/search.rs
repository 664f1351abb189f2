//! Three markers on three blobs: where are the others?

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use arrayvec::ArrayVec;
use nalgebra::{Matrix2, Vector3};

use super::bases::{Base, Other};
use super::worth::Worth;
use super::{Blob, IdentifyOptions, Stats};
use crate::camera::{Camera, Normalized};
use crate::geometry::CameraFromTarget;
use crate::solve::p3p::p3p;
use crate::target::Target;

/// The blobs on the plane `z = 1`, with what is the same for every base.
pub(super) struct Sky<'a> {
    /// Those inside the lens model; the others have no ray and are left out.
    seen: Vec<Seen>,
    /// Where they are, eight in a row, for the question that is asked most.
    places: Vec<Eight>,
    /// Standard deviation of a blob's ray, model error included.
    sigma: f64,
    /// Pixels in a unit of the plane `z = 1`, squared.
    area_scale: f64,
    worth: Worth,
    options: &'a IdentifyOptions,
}

struct Seen {
    /// Position among the blobs.
    blob: usize,
    ray: Normalized,
    bearing: Vector3<f64>,
    area_px: Option<f64>,
}

/// Eight places; those past the last blob are nowhere.
#[derive(Clone, Copy)]
struct Eight {
    x: [f32; 8],
    y: [f32; 8],
}

/// An assignment worth refining.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Candidate {
    /// For each marker its blob.
    pub blob_of_marker: Vec<Option<usize>>,
    /// The pose of three markers that led to it.
    pub pose: CameraFromTarget,
    /// How well it fits, larger is better: only a first sorting.
    pub fit: f64,
}

impl Candidate {
    pub(super) fn found(&self) -> usize {
        self.blob_of_marker.iter().flatten().count()
    }
}

/// Which triples are tried.
pub(super) struct Scope<'a> {
    /// Whether a blob takes part.
    pub takes: &'a dyn Fn(usize) -> bool,
    /// Stop at an assignment of so many markers.
    pub enough: usize,
    /// How many markers a match must take to be more than chance, for it to be looked for here.
    pub needs: RangeInclusive<usize>,
}

/// Candidates handed on from one base.
const MAX_CANDIDATES: usize = 32;

/// Markers beyond the base that a first assignment looks for; more are added when it is weighed.
const MAX_HITS: usize = 29;

/// Half width of a gate in standard deviations.
const GATE: f64 = 4.0;

/// A blob's area may differ from its marker's by this factor either way: blur adds, a threshold takes away.
const AREA_FACTOR: f64 = 2.5;

/// Below this predicted area, px, blur decides the size of a blob.
const SMALL_AREA_PX: f64 = 25.0;

impl<'a> Sky<'a> {
    pub(super) fn of(camera: &Camera, target: &Target, blobs: &[Blob], options: &'a IdentifyOptions) -> Self {
        let seen: Vec<Seen> = blobs
            .iter()
            .enumerate()
            .filter_map(|(index, blob)| {
                let ray = camera.unproject(&blob.pixel)?;
                let bearing = Vector3::new(ray.x, ray.y, 1.0).normalize();
                Some(Seen { blob: index, ray, bearing, area_px: blob.area_px })
            })
            .collect();
        let [fx, fy] = camera.focal_lengths();
        let worst_px = blobs.iter().map(|b| b.sigma_px).fold(0.0, f64::max).hypot(options.model_sigma_px);
        Self {
            places: eights(&seen),
            seen,
            sigma: worst_px / (fx * fy).sqrt(),
            area_scale: fx * fy,
            worth: Worth::of(camera, target, blobs, options),
            options,
        }
    }

    /// The blob nearest to `place`, and its squared distance.
    fn nearest(&self, place: &Normalized) -> Option<(usize, f64)> {
        let mut nearest = (None, f64::INFINITY);
        for seen in &self.seen {
            let squared = (seen.ray - place).norm_squared();
            if squared < nearest.1 {
                nearest = (Some(seen.blob), squared);
            }
        }
        Some((nearest.0?, nearest.1))
    }

    /// Whether a blob is within `reach` of `place`, or nearly so: in single precision, several at a time.
    fn has_near(&self, place: &Normalized, reach: f64) -> bool {
        #[expect(clippy::cast_possible_truncation, reason = "a margin follows")]
        let (x, y, reach) = (place.x as f32, place.y as f32, (1.001 * reach) as f32 + 1e-6);
        let mut nearest = [f32::INFINITY; 8];
        for eight in &self.places {
            for ((nearest, there_x), there_y) in nearest.iter_mut().zip(&eight.x).zip(&eight.y) {
                let (dx, dy) = (there_x - x, there_y - y);
                let squared = dx * dx + dy * dy;
                *nearest = if squared < *nearest { squared } else { *nearest };
            }
        }
        nearest.iter().any(|squared| *squared <= reach * reach)
    }
}

fn eights(seen: &[Seen]) -> Vec<Eight> {
    seen.chunks(8)
        .map(|some| {
            let mut eight = Eight { x: [f32::INFINITY; 8], y: [f32::INFINITY; 8] };
            for (lane, seen) in some.iter().enumerate() {
                #[expect(clippy::cast_possible_truncation, reason = "whoever asks leaves a margin")]
                let (x, y) = (seen.ray.x as f32, seen.ray.y as f32);
                (eight.x[lane], eight.y[lane]) = (x, y);
            }
            eight
        })
        .collect()
}

/// The assignments that this base leads to, at least `need` markers each, the best fits first. Ends where the trials do, or
/// with the first assignment that is enough.
pub(super) fn candidates(
    sky: &Sky<'_>,
    target: &Target,
    base: &Base,
    scope: &Scope<'_>,
    stats: &mut Stats,
) -> Vec<Candidate> {
    let mut found: BTreeMap<Vec<Option<usize>>, (f64, CameraFromTarget)> = BTreeMap::new();
    let points = base.markers.map(|i| target.markers()[i].position);
    let taking: Vec<&Seen> = sky.seen.iter().filter(|seen| (scope.takes)(seen.blob)).collect();
    'search: for (i, a) in taking.iter().enumerate() {
        for (j, b) in taking.iter().enumerate() {
            if i == j {
                continue;
            }
            for (k, c) in taking.iter().enumerate() {
                if j == k || i == k {
                    continue;
                }
                if stats.triples == sky.options.max_trials {
                    break 'search;
                }
                stats.triples += 1;
                let Some(need) = plausible(sky, target, base, [a, b, c], &scope.needs) else { continue };
                stats.solved += 1;
                for pose in p3p(&[a, b, c].map(|seen| seen.bearing), &points) {
                    let blobs = [a, b, c].map(|seen| seen.blob);
                    if let Some((assignment, fit)) = follow(sky, target, base, blobs, &pose, need) {
                        let is_enough = assignment.iter().flatten().count() >= scope.enough;
                        let known = found.entry(assignment).or_insert((fit, pose));
                        if fit > known.0 {
                            *known = (fit, pose);
                        }
                        if is_enough {
                            break 'search;
                        }
                    }
                }
            }
        }
    }
    let mut candidates: Vec<Candidate> =
        found.into_iter().map(|(blob_of_marker, (fit, pose))| Candidate { blob_of_marker, pose, fit }).collect();
    candidates.sort_by(|a, b| b.fit.total_cmp(&a.fit));
    candidates.truncate(MAX_CANDIDATES);
    candidates
}

/// What can be ruled out without a pose: wrong way round, wrong areas, and an affine image in which too few of the others have
/// a blob near the place that perspective leaves them. Otherwise the number of markers that must be found for the match to be
/// more than chance.
fn plausible(
    sky: &Sky<'_>,
    target: &Target,
    base: &Base,
    seen: [&Seen; 3],
    needs: &RangeInclusive<usize>,
) -> Option<usize> {
    let rays @ [a, b, c] = seen.map(|seen| seen.ray);
    let doubled_area = (b - a).perp(&(c - a));
    if base.turn.is_some_and(|turn| turn * doubled_area < 0.0) {
        return None;
    }
    // Three blobs that nearly share a line fix no pose.
    let degenerate = 4.0 * sky.sigma;
    if doubled_area * doubled_area < degenerate * degenerate * (b - a).norm_squared().max((c - a).norm_squared()) {
        return None;
    }
    if !areas_agree(sky, target, base, seen, doubled_area) {
        return None;
    }
    let shape = Shape::of(base, rays);
    let centre = base.centre.x * a + base.centre.y * b + base.centre.z * c;
    let need = sky.worth.need(shape.largest, shape.sine(), &centre, shape.largest * base.extent_m)?;
    if !needs.contains(&need) {
        return None;
    }
    // Largest relative difference of depth within the target that an affine image of this shape allows: its extent over its
    // distance, times the sine of its tilt. The affine image of a target close by is itself distorted; half as much again
    // covers that.
    let slant = 1.5 * shape.largest * (shape.sine() + 0.15);
    // A marker off the plane of the three is also shifted by its height where the line of sight leaves the optical axis.
    let strength = base.extent_m * slant;
    let count = base.others.len();
    let mut near = 0;
    for (tried, other) in base.others.iter().enumerate() {
        if near + 3 >= need {
            break;
        }
        if near + 3 + count - tried < need || is_hopeless(near, tried) {
            return None;
        }
        let place = predicted(other, rays);
        let w = other.weights;
        let shift = w.x.abs() * (a - place).norm() + w.y.abs() * (b - place).norm() + w.z.abs() * (c - place).norm();
        let reach = GATE * sky.sigma * other.noise
            + strength * shift
            + (slant + 1.5 * shape.largest * place.norm()) * other.height_m;
        near += usize::from(sky.has_near(&place, reach));
    }
    (near + 3 >= need).then_some(need)
}

/// Whether so few of so many others are found that less than a third of the markers can be expected to be there. With two
/// thirds of them visible this happens in one base of 200.
const fn is_hopeless(near: usize, tried: usize) -> bool {
    tried >= 3 * near + 6
}

fn areas_agree(sky: &Sky<'_>, target: &Target, base: &Base, seen: [&Seen; 3], doubled_area: f64) -> bool {
    let Some(model_area) = base.doubled_area else { return true };
    let magnification = (doubled_area / model_area).abs();
    base.markers.iter().zip(seen).all(|(&marker, seen)| {
        let expected = target.markers()[marker]
            .radius_m
            .map(|radius| std::f64::consts::PI * radius * radius * magnification * sky.area_scale);
        match expected.zip(seen.area_px) {
            Some((expected, measured)) if expected > SMALL_AREA_PX => {
                measured < AREA_FACTOR * expected && expected < AREA_FACTOR * measured
            }
            Some((_, measured)) => measured < 6.0 * SMALL_AREA_PX,
            None => true,
        }
    })
}

fn predicted(other: &Other, [a, b, c]: [Normalized; 3]) -> Normalized {
    a * other.weights.x + b * other.weights.y + c * other.weights.z
}

/// An affine image of the base's plane.
struct Shape {
    /// Its larger magnification: one over the distance, 1/m.
    largest: f64,
    /// The smaller one over the larger: the cosine of the tilt.
    cosine: f64,
}

impl Shape {
    fn of(base: &Base, [a, b, c]: [Normalized; 3]) -> Self {
        let affine = Matrix2::from_columns(&[b - a, c - a]) * base.from_sides;
        let product = affine.determinant().abs();
        let sum = affine.norm_squared();
        let squared = 0.5 * (sum + (sum * sum - 4.0 * product * product).max(0.0).sqrt());
        Self { largest: squared.sqrt(), cosine: (product / squared).min(1.0) }
    }

    fn sine(&self) -> f64 {
        (1.0 - self.cosine * self.cosine).sqrt()
    }
}

/// The assignment that a pose of the base leads to.
fn follow(
    sky: &Sky<'_>,
    target: &Target,
    base: &Base,
    blobs: [usize; 3],
    pose: &CameraFromTarget,
    need: usize,
) -> Option<(Vec<Option<usize>>, f64)> {
    let [nearest, farthest] = sky.options.range_m;
    if !(nearest..=farthest).contains(&pose.translation.norm())
        || base.markers.iter().any(|m| !sky.options.shows(target, *m, pose))
    {
        return None;
    }
    // Most poses lead nowhere: that is found out first, without an allocation.
    let mut hits: ArrayVec<(usize, usize, f64), MAX_HITS> = ArrayVec::new();
    for (tried, other) in base.others.iter().enumerate() {
        if hits.len() + base.others.len() - tried + 3 < need || is_hopeless(hits.len(), tried) || hits.is_full() {
            break;
        }
        let p = (*pose * target.markers()[other.marker].position).coords;
        if p.z <= 0.0 {
            continue;
        }
        // A pose from three points is free to tilt on top of what an affine image does.
        let reach = 2.0 * GATE * sky.sigma * other.noise;
        let place = p.xy() / p.z;
        if !sky.has_near(&place, reach) {
            continue;
        }
        let Some((blob, squared)) = sky.nearest(&place) else { continue };
        let hit = (other.marker, blob, 2.0 - squared / (reach * reach));
        if hit.2 < 1.0 || blobs.contains(&blob) || !sky.options.shows(target, other.marker, pose) {
            continue;
        }
        // Of two markers near one blob it belongs to the nearer.
        match hits.iter_mut().find(|known| known.1 == blob) {
            Some(known) if known.2 < hit.2 => *known = hit,
            Some(_) => {}
            None => hits.push(hit),
        }
    }
    if hits.len() + 3 < need {
        return None;
    }
    let mut blob_of_marker = vec![None; target.markers().len()];
    for (marker, blob) in base.markers.into_iter().zip(blobs).chain(hits.iter().map(|hit| (hit.0, hit.1))) {
        blob_of_marker[marker] = Some(blob);
    }
    Some((blob_of_marker, hits.iter().map(|hit| hit.2).sum()))
}
