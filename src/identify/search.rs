//! Three markers on three blobs: where are the others?

use std::collections::BTreeMap;

use nalgebra::{Matrix2, Vector2, Vector3};

use super::bases::{Base, Other};
use super::{Blob, IdentifyOptions, Stats};
use crate::camera::{Camera, Normalized};
use crate::geometry::CameraFromTarget;
use crate::solve::p3p::p3p;
use crate::target::Target;

/// The blobs on the plane `z = 1`, with what is the same for every base.
pub(super) struct Sky<'a> {
    pub blobs: &'a [Blob],
    /// Ray of each blob; blobs outside the lens model have none and are left out.
    rays: Vec<Option<Normalized>>,
    bearings: Vec<Vector3<f64>>,
    /// Standard deviation of a blob's ray, model error included.
    sigma: f64,
    /// Pixels in a unit of the plane `z = 1`, squared.
    area_scale: f64,
    options: &'a IdentifyOptions,
}

/// An assignment worth refining.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Candidate {
    /// For each marker its blob.
    pub blob_of_marker: Vec<Option<usize>>,
    /// How well it fits, larger is better: only a first sorting.
    pub fit: f64,
}

/// Candidates handed on from one base.
const MAX_CANDIDATES: usize = 24;

/// Half width of a gate in standard deviations.
const GATE: f64 = 4.0;

/// A blob's area may differ from its marker's by this factor either way: blur adds, a threshold takes away.
const AREA_FACTOR: f64 = 2.5;

/// Below this predicted area, px, blur decides the size of a blob.
const SMALL_AREA_PX: f64 = 25.0;

impl<'a> Sky<'a> {
    pub(super) fn of(camera: &Camera, blobs: &'a [Blob], options: &'a IdentifyOptions) -> Self {
        let rays: Vec<_> = blobs.iter().map(|blob| camera.unproject(&blob.pixel)).collect();
        let bearing = |ray: &Option<Normalized>| ray.map_or(Vector3::z(), |r| Vector3::new(r.x, r.y, 1.0).normalize());
        let [fx, fy] = camera.focal_lengths();
        let worst_px = blobs.iter().map(|b| b.sigma_px).fold(0.0, f64::max).hypot(options.model_sigma_px);
        Self {
            bearings: rays.iter().map(bearing).collect(),
            rays,
            blobs,
            sigma: worst_px / (fx * fy).sqrt(),
            area_scale: fx * fy,
            options,
        }
    }

    /// The blob nearest to `place`, and its squared distance.
    fn nearest(&self, place: &Normalized) -> Option<(usize, f64)> {
        self.rays
            .iter()
            .enumerate()
            .filter_map(|(i, ray)| Some((i, (ray.as_ref()? - place).norm_squared())))
            .min_by(|a, b| a.1.total_cmp(&b.1))
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
    let mut found: BTreeMap<Vec<Option<usize>>, f64> = BTreeMap::new();
    let seen: Vec<(usize, Normalized)> =
        sky.rays.iter().enumerate().filter_map(|(i, ray)| Some((i, (*ray)?))).collect();
    let points = base.markers.map(|i| target.markers()[i].position);
    for &(i, ray_i) in &seen {
        for &(j, ray_j) in &seen {
            for &(k, ray_k) in &seen {
                if i == j || j == k || i == k {
                    continue;
                }
                stats.triples += 1;
                let rays = [ray_i, ray_j, ray_k];
                if !is_plausible(sky, target, base, [i, j, k], rays, need) {
                    continue;
                }
                stats.solved += 1;
                for pose in p3p(&[i, j, k].map(|b| sky.bearings[b]), &points) {
                    if let Some((assignment, fit)) = follow(sky, target, base, [i, j, k], &pose, need) {
                        let known = found.entry(assignment).or_insert(fit);
                        *known = known.max(fit);
                    }
                }
            }
        }
    }
    let mut candidates: Vec<Candidate> =
        found.into_iter().map(|(blob_of_marker, fit)| Candidate { blob_of_marker, fit }).collect();
    candidates.sort_by(|a, b| b.fit.total_cmp(&a.fit));
    candidates.truncate(MAX_CANDIDATES);
    candidates
}

/// What can be ruled out without a pose: wrong way round, wrong areas, and for flat targets an affine image in which too few
/// of the others have a blob near the place that perspective leaves them.
fn is_plausible(
    sky: &Sky<'_>,
    target: &Target,
    base: &Base,
    blobs: [usize; 3],
    rays: [Normalized; 3],
    need: usize,
) -> bool {
    let [a, b, c] = rays;
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
    let areas_agree = base.markers.iter().zip(blobs).all(|(&marker, blob)| {
        let expected = target.markers()[marker]
            .radius_m
            .map(|radius| std::f64::consts::PI * radius * radius * magnification * sky.area_scale);
        match expected.zip(sky.blobs[blob].area_px) {
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
    let [nearest, farthest] = sky.options.range_m;
    let range = pose.translation.norm();
    if !(nearest..=farthest).contains(&range) || base.markers.iter().any(|m| !sky.options.shows(target, *m, pose)) {
        return None;
    }
    let mut blob_of_marker = vec![None; target.markers().len()];
    for (marker, blob) in base.markers.iter().zip(blobs) {
        blob_of_marker[*marker] = Some(blob);
    }
    let mut fit = 0.0;
    for other in &base.others {
        let p = (*pose * target.markers()[other.marker].position).coords;
        if p.z <= 0.0 || !sky.options.shows(target, other.marker, pose) {
            continue;
        }
        let place: Vector2<f64> = p.xy() / p.z;
        let reach = GATE * sky.sigma * spread_of_noise(other);
        let Some((blob, squared)) = sky.nearest(&place) else { continue };
        if squared <= reach * reach && !blob_of_marker.contains(&Some(blob)) {
            blob_of_marker[other.marker] = Some(blob);
            fit += 2.0 - squared / (reach * reach);
        }
    }
    (blob_of_marker.iter().flatten().count() >= need).then_some((blob_of_marker, fit))
}

/// By how much the noise of three blobs is magnified at another marker. The weights give that of an affine image; a pose
/// from three points is free to tilt on top of it.
fn spread_of_noise(other: &Other) -> f64 {
    2.0 * (1.0 + other.weights.norm_squared()).sqrt()
}
