//! What a match could be worth at best: how many markers must be found before it is more than chance.
//!
//! The bound is that of [`weigh`](super::weigh) with residuals of zero, for a target seen through a weak perspective. It
//! tells before any pose is computed that, say, four markers among twenty blobs are not worth the search.

use std::f64::consts::TAU;

use super::weigh::{attitudes, ln_area_gain};
use super::{Blob, IdentifyOptions};
use crate::camera::{Camera, Normalized, Pixel};
use crate::target::Target;

/// What the bound leaves to a better fit than is likely, to a bent valley of the pose, and to rivals: powers of e.
const SLACK: f64 = 6.0;

/// Bounds for one target in one sky.
pub(super) struct Worth {
    /// For each number of markers, from none, what finding them adds at most.
    found: Vec<f64>,
    /// Markers of the target.
    markers: usize,
    /// What a match must be worth to matter.
    threshold: f64,
    /// What a marker that is not found takes away where the whole target is in the picture.
    missing: f64,
    /// What is the same for all poses.
    constant: f64,
    /// Extent of the target across its narrower side, and through its plane, in standard deviations of a ray.
    extents: [f64; 2],
    /// Fewest that make a detection.
    least: usize,
    /// A rectangle on the plane `z = 1` that is inside the picture.
    inside: [Normalized; 2],
}

impl Worth {
    pub(super) fn of(camera: &Camera, target: &Target, blobs: &[Blob], options: &IdentifyOptions) -> Self {
        let markers = target.markers();
        let [fx, fy] = camera.focal_lengths();
        let sigmas = || blobs.iter().map(|b| b.sigma_px.hypot(options.model_sigma_px));
        let (finest, coarsest) = sigmas().fold((f64::INFINITY, 0.0_f64), |(a, b), s| (a.min(s), b.max(s)));
        let area = f64::from(camera.width()) * f64::from(camera.height());
        let sized = blobs.iter().any(|b| b.area_px.is_some()) && markers.iter().any(|m| m.radius_m.is_some());
        let each = (1.0 - options.miss_probability).ln() - (TAU * finest * finest).ln()
            + if sized { ln_area_gain() } else { 0.0 };
        let mut found = vec![0.0];
        for k in 0..markers.len().min(blobs.len()) {
            found.push(found[k] + each + (area / (blobs.len() - k) as f64).ln());
        }
        // All markers are seen together only if they face the same way.
        let together = markers.windows(2).all(|pair| match (pair[0].normal, pair[1].normal) {
            (Some(a), Some(b)) => a.dot(&b) > 0.99,
            (a, b) => a.is_none() && b.is_none(),
        });
        let sigma = coarsest / (fx * fy).sqrt();
        let solid_angle = area / (fx * fy);
        let [nearest, farthest] = options.range_m;
        let rms = target.spread().rms_m;
        Self {
            found,
            markers: markers.len(),
            threshold: options.ln_odds_needed() - SLACK,
            missing: if together { options.miss_probability.ln() } else { 0.0 },
            constant: (TAU.powi(3) * sigma * sigma).ln()
                - (solid_angle * (farthest / nearest).ln() * attitudes(target)).ln(),
            extents: [rms[1] / sigma, rms[2] / sigma],
            least: options.min_markers.max(Target::MIN_MARKERS),
            inside: inside(camera),
        }
    }

    /// Fewest markers that could be accepted at a distance of `1 / magnification` and this tilt; `None` if all are too few.
    pub(super) fn need(&self, magnification: f64, sine: f64, centre: &Normalized, radius: f64) -> Option<usize> {
        let whole = (0..2).all(|i| centre[i] - radius > self.inside[0][i] && centre[i] + radius < self.inside[1][i]);
        let missing = if whole { self.missing } else { 0.0 };
        let all = self.found.len() - 1;
        (self.least..=all).find(|&k| {
            let count = k as f64;
            // Of so many standard deviations: how finely scale, turn and tilts are told. A tilt moves the image with its
            // sine, or with its square, or with the target's depth.
            let fine = (magnification * self.extents[0] * count.sqrt()).max(1.0);
            let deep = magnification * self.extents[1] * count.sqrt();
            let tilt = (0.7 * fine * sine).max(deep).max((0.5 * fine).sqrt());
            let freedom = self.constant - count.ln() - 2.0 * (fine * tilt).ln();
            self.found[k] + freedom + (self.markers - k) as f64 * missing > self.threshold
        })
    }
}

/// A rectangle on the plane `z = 1` whose image is inside the picture; an empty one if the lens model does not reach the edges.
fn inside(camera: &Camera) -> [Normalized; 2] {
    let [width, height] = [f64::from(camera.width()) - 1.0, f64::from(camera.height()) - 1.0];
    let at = |u: f64, v: f64| camera.unproject(&Pixel::new(u * width, v * height));
    let edge = |along: &dyn Fn(f64) -> Option<Normalized>| -> Option<[Normalized; 3]> {
        Some([along(0.0)?, along(0.5)?, along(1.0)?])
    };
    let edges = || {
        let [left, right] = [edge(&|t| at(0.0, t))?, edge(&|t| at(1.0, t))?];
        let [top, bottom] = [edge(&|t| at(t, 0.0))?, edge(&|t| at(t, 1.0))?];
        let most = |edge: [Normalized; 3], axis: usize| edge.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
        let least = |edge: [Normalized; 3], axis: usize| edge.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
        Some([Normalized::new(most(left, 0), most(top, 1)), Normalized::new(least(right, 0), least(bottom, 1))])
    };
    edges().unwrap_or([Normalized::zeros(); 2])
}
