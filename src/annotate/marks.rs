//! Rings, crosses and names.

use nalgebra::Vector2;

use super::canvas::{Box, Canvas, Ink};
use super::label::{Label, Labels};
use super::palette::{DARK, NO_TARGET, PREDICTED, REFUSED, of_target};
use super::scale::Scale;
use super::{Overlay, Sought};
use crate::camera::{Camera, Pixel};
use crate::detect::{Centroid, Refused};
use crate::pose::PoseAnswer;

/// Refused blobs that may get their reason written, the largest first; the others get their mark only.
const MAX_REASONS: usize = 16;

/// What lies under every line.
pub(super) const HALO: Ink = Ink { rgb: DARK, opacity: 0.45 };

/// Width of the halo of a line of this width, px.
pub(super) const fn halo_width(width_px: f64) -> f64 {
    2.2 * width_px
}

/// A light line over a dark one.
pub(super) fn stroke(canvas: &mut Canvas, a: Pixel, b: Pixel, width_px: f64, ink: Ink) {
    canvas.line(a, b, halo_width(width_px), Ink { opacity: HALO.opacity * ink.opacity, ..HALO });
    canvas.line(a, b, width_px, ink);
}

/// A small x on each refused blob.
pub(super) fn refused(canvas: &mut Canvas, labels: &mut Labels, scale: Scale, refused: &[Refused]) {
    let arm = refused_arm(scale);
    for blob in refused {
        for (dx, dy) in [(arm, arm), (arm, -arm)] {
            let offset = Vector2::new(dx, dy);
            stroke(canvas, blob.pixel - offset, blob.pixel + offset, 0.7 * scale.line_px, REFUSED_INK);
        }
        labels.keep_clear(Box::about(&blob.pixel, arm));
    }
}

const REFUSED_INK: Ink = Ink { rgb: REFUSED, opacity: 0.8 };

/// Half the size of the mark on a refused blob, px.
const fn refused_arm(scale: Scale) -> f64 {
    0.45 * scale.mark_px
}

/// Why blobs were refused, where there is room for it; once for a group of neighbours.
pub(super) fn reasons(labels: &mut Labels, scale: Scale, refused: &[Refused]) {
    let apart_px = 12.0 * f64::from(scale.remarks.height_px());
    let mut told: Vec<&Refused> = Vec::new();
    for blob in refused.iter().take(MAX_REASONS) {
        let is_new = |known: &&Refused| known.reason != blob.reason || (known.pixel - blob.pixel).norm() > apart_px;
        if told.iter().all(is_new) {
            told.push(blob);
            labels.add(Label {
                anchor: blob.pixel,
                reach_px: refused_arm(scale),
                text: blob.reason.name().replace('_', " "),
                letters: scale.remarks,
                ink: REFUSED_INK,
                away_from: None,
                is_optional: true,
            });
        }
    }
}

/// Radius of the ring about a centroid, px.
fn ring_radius(scale: Scale, centroid: &Centroid) -> f64 {
    let bounds = &centroid.bounds;
    (0.5 * f64::from(bounds.width.max(bounds.height)) + 1.5 * scale.line_px + 1.0).max(scale.mark_px)
}

/// A ring about each centroid.
pub(super) fn rings(canvas: &mut Canvas, labels: &mut Labels, scale: Scale, overlay: &Overlay<'_>) {
    for (index, centroid) in overlay.detection.centroids.iter().enumerate() {
        let owner = overlay.targets.iter().position(|t| t.estimate.centroid_of_marker.contains(&Some(index)));
        let (rgb, width) = owner.map_or((NO_TARGET, 0.8), |target| (of_target(target), 1.0));
        let (radius, width) = (ring_radius(scale, centroid), width * scale.line_px);
        canvas.ring(centroid.pixel, radius, halo_width(width), HALO);
        canvas.ring(centroid.pixel, radius, width, Ink::solid(rgb));
        labels.keep_clear(Box::about(&centroid.pixel, radius));
    }
}

/// The name of each marker that was found, beside its centroid.
pub(super) fn names(labels: &mut Labels, scale: Scale, overlay: &Overlay<'_>) {
    for (index, sought) in overlay.targets.iter().enumerate() {
        let middle = middle(sought, overlay);
        for (marker, centroid) in sought.target.markers().iter().zip(&sought.estimate.centroid_of_marker) {
            let Some(centroid) = centroid.and_then(|centroid| overlay.detection.centroids.get(centroid)) else {
                continue;
            };
            labels.add(Label {
                anchor: centroid.pixel,
                reach_px: ring_radius(scale, centroid),
                text: marker.id.clone(),
                letters: scale.names,
                ink: Ink::solid(of_target(index)),
                away_from: middle,
                is_optional: false,
            });
        }
    }
}

/// Middle of a target's centroids, px.
fn middle(sought: &Sought<'_>, overlay: &Overlay<'_>) -> Option<Pixel> {
    let found = sought.estimate.centroid_of_marker.iter().flatten();
    let places: Vec<Pixel> =
        found.filter_map(|&index| overlay.detection.centroids.get(index)).map(|centroid| centroid.pixel).collect();
    let count = places.len() as f64;
    (!places.is_empty()).then(|| places.iter().sum::<Pixel>() / count)
}

/// A cross where the best pose puts each marker that faces the camera, with the name of one that was not found.
pub(super) fn predictions(
    canvas: &mut Canvas,
    labels: &mut Labels,
    scale: Scale,
    camera: &Camera,
    sought: &Sought<'_>,
    answer: &PoseAnswer,
) {
    let pose = &answer.best.camera_from_target;
    let ink = Ink::solid(PREDICTED);
    for (index, marker) in sought.target.markers().iter().enumerate() {
        if !sought.target.faces_camera(index, pose) {
            continue;
        }
        let Some(centre) = camera.project(&(*pose * marker.position)) else { continue };
        let place = centre + sought.target.centroid_offset(index, camera, pose);
        let arm = 0.5 * scale.mark_px;
        for offset in [Vector2::new(arm, 0.0), Vector2::new(0.0, arm)] {
            stroke(canvas, place - offset, place + offset, 0.5 * scale.line_px, ink);
        }
        if sought.estimate.centroid_of_marker.get(index).is_none_or(Option::is_none) {
            labels.keep_clear(Box::about(&place, arm));
            labels.add(Label {
                anchor: place,
                reach_px: arm,
                text: format!("{}?", marker.id),
                letters: scale.names,
                ink: Ink { rgb: PREDICTED, opacity: 0.8 },
                away_from: None,
                is_optional: false,
            });
        }
    }
}
