//! Three markers on three blobs: where are the others?

use std::collections::BTreeMap;

use arrayvec::ArrayVec;
use nalgebra::{Matrix2, Vector3};

use super::bases::{Base, Other};
use super::{Blob, IdentifyOptions, Stats};
use crate::camera::{Camera, Normalized};
use crate::geometry::CameraFromTarget;
use crate::solve::p3p::p3p;
use crate::target::Target;

/// The blobs on the plane `z = 1`, with what is the same for every base.
pub(super) struct Sky<'a> {
    /// Those inside the lens model; the others have no ray and are left out.
    seen: Vec<Seen>,
    /// Standard deviation of a blob's ray, model error included.
    sigma: f64,
    /// Pixels in a unit of the plane `z = 1`, squared.
    area_scale: f64,
    options: &'a IdentifyOptions,
}

struct Seen {
    /// Position among the blobs.
    blob: usize,
    ray: Normalized,
    bearing: Vector3<f64>,
    area_px: Option<f64>,
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
    pub(super) fn of(camera: &Camera, blobs: &[Blob], options: &'a IdentifyOptions) -> Self {
        let seen = blobs.iter().enumerate().filter_map(|(index, blob)| {
            let ray = camera.unproject(&blob.pixel)?;
            let bearing = Vector3::new(ray.x, ray.y, 1.0).normalize();
            Some(Seen { blob: index, ray, bearing, area_px: blob.area_px })
        });
        let [fx, fy] = camera.focal_lengths();
        let worst_px = blobs.iter().map(|b| b.sigma_px).fold(0.0, f64::max).hypot(options.model_sigma_px);
        Self { seen: seen.collect(), sigma: worst_px / (fx * fy).sqrt(), area_scale: fx * fy, options }
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
}

/// The assignments that this base leads to, at least `need` markers each, the best fits first.
pub(super) fn candidates(
    sky: &Sky<'_>,
    target: &Target,
    base: &Base,
    need: usize,
    stats: &mut Stats,
) -> Vec<Candidate> {
    let mut found: BTreeMap<Vec<Option<usize>>, (f64, CameraFromTarget)> = BTreeMap::new();
    let points = base.markers.map(|i| target.markers()[i].position);
    for (i, a) in sky.seen.iter().enumerate() {
        for (j, b) in sky.seen.iter().enumerate() {
            for (k, c) in sky.seen.iter().enumerate() {
                if i == j || j == k || i == k {
                    continue;
                }
                stats.triples += 1;
                if !is_plausible(sky, target, base, [a, b, c], need) {
                    continue;
                }
                stats.solved += 1;
                for pose in p3p(&[a, b, c].map(|seen| seen.bearing), &points) {
                    let blobs = [a, b, c].map(|seen| seen.blob);
                    if let Some((assignment, fit)) = follow(sky, target, base, blobs, &pose, need) {
                        let known = found.entry(assignment).or_insert((fit, pose));
                        if fit > known.0 {
                            *known = (fit, pose);
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

/// What can be ruled out without a pose: wrong way round, wrong areas, and for flat targets an affine image in which too few
/// of the others have a blob near the place that perspective leaves them.
fn is_plausible(sky: &Sky<'_>, target: &Target, base: &Base, seen: [&Seen; 3], need: usize) -> bool {
    let rays @ [a, b, c] = seen.map(|seen| seen.ray);
    let doubled_area = (b - a).perp(&(c - a));
    // Three blobs that nearly share a line fix no pose.
    if doubled_area.abs() < 4.0 * sky.sigma * (b - a).norm().max((c - a).norm()) {
        return false;
    }
    if base.turn.is_some_and(|turn| turn * doubled_area < 0.0) {
        return false;
    }
    let Some(model_area) = base.doubled_area else { return true };
    let magnification = (doubled_area / model_area).abs();
    let areas_agree = base.markers.iter().zip(seen).all(|(&marker, seen)| {
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
    });
    if !areas_agree {
        return false;
    }
    let strength = perspective_strength(target, base, rays);
    let near = base
        .others
        .iter()
        .filter(|other| {
            let place = predicted(other, rays);
            let w = other.weights;
            let shift =
                w.x.abs() * (a - place).norm() + w.y.abs() * (b - place).norm() + w.z.abs() * (c - place).norm();
            let reach = GATE * sky.sigma * (1.0 + w.norm_squared()).sqrt() + strength * shift;
            sky.nearest(&place).is_some_and(|(_, squared)| squared <= reach * reach)
        })
        .count();
    near + 3 >= need
}

fn predicted(other: &Other, [a, b, c]: [Normalized; 3]) -> Normalized {
    a * other.weights.x + b * other.weights.y + c * other.weights.z
}

/// Largest relative difference of depth within the target that an affine image of this shape allows: its extent over its
/// distance, times the sine of its tilt.
fn perspective_strength(target: &Target, base: &Base, [a, b, c]: [Normalized; 3]) -> f64 {
    let flat = |i: usize| target.spread().local(&target.markers()[base.markers[i]].position).xy();
    let (u, v) = (flat(1) - flat(0), flat(2) - flat(0));
    let model = Matrix2::from_columns(&[u, v]);
    let image = Matrix2::from_columns(&[b - a, c - a]);
    let Some(inverse) = model.try_inverse() else { return 1.0 };
    let affine = image * inverse;
    let product = affine.determinant().abs();
    let sum = affine.norm_squared();
    let largest = (0.5 * (sum + (sum * sum - 4.0 * product * product).max(0.0).sqrt())).sqrt();
    let cosine = (product / (largest * largest)).min(1.0);
    // The affine image of a target close by is itself distorted; half as much again covers that.
    let sine = (1.0 - cosine * cosine).sqrt();
    1.5 * base.extent_m * largest * (sine + 0.15)
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
    // Most poses lead nowhere: that is found out first, without an allocation.
    let mut hits: ArrayVec<(usize, usize, f64), MAX_HITS> = ArrayVec::new();
    for (tried, other) in base.others.iter().enumerate() {
        if hits.len() + base.others.len() - tried + 3 < need || hits.is_full() {
            break;
        }
        let p = (*pose * target.markers()[other.marker].position).coords;
        if p.z <= 0.0 {
            continue;
        }
        let reach = GATE * sky.sigma * spread_of_noise(other);
        let Some((blob, squared)) = sky.nearest(&(p.xy() / p.z)) else { continue };
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
    let [nearest, farthest] = sky.options.range_m;
    if hits.len() + 3 < need
        || !(nearest..=farthest).contains(&pose.translation.norm())
        || base.markers.iter().any(|m| !sky.options.shows(target, *m, pose))
    {
        return None;
    }
    let mut blob_of_marker = vec![None; target.markers().len()];
    for (marker, blob) in base.markers.into_iter().zip(blobs).chain(hits.iter().map(|hit| (hit.0, hit.1))) {
        blob_of_marker[marker] = Some(blob);
    }
    Some((blob_of_marker, hits.iter().map(|hit| hit.2).sum()))
}

/// By how much the noise of three blobs is magnified at another marker. The weights give that of an affine image; a pose
/// from three points is free to tilt on top of it.
fn spread_of_noise(other: &Other) -> f64 {
    2.0 * (1.0 + other.weights.norm_squared()).sqrt()
}
