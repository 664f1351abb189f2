//! Four correspondences at one pose: how far each is from its place, and how that moves with the pose.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instructions of the function that calls it"
)]

use super::lanes::{LANES, Lanes};
use crate::camera::{Camera, Distortion};
use crate::geometry::CameraFromTarget;
use crate::refine::Correspondence;

/// Up to four points side by side; lanes without a point of their own have the weight zero.
pub(super) struct View {
    /// From the projection to the pixel.
    pub distance: [Lanes; 2],
    /// One over the stated variance.
    pub stated: Lanes,
    /// The point turned into the camera's axes, not yet moved.
    turned: [Lanes; 3],
    /// Rows of the derivative of the projection by the point.
    by_point: [[Lanes; 3]; 2],
    /// Which lanes have no image.
    pub lost: [bool; LANES],
}

impl View {
    /// `seen` are one to four.
    #[inline(always)]
    pub(super) fn of(camera: &Camera, pose: &CameraFromTarget, seen: &[Correspondence]) -> Self {
        let (mut px, mut py, mut pz) = (Lanes::ZERO, Lanes::ZERO, Lanes::ZERO);
        let (mut u, mut v, mut sigma) = (Lanes::ZERO, Lanes::ZERO, Lanes::ZERO);
        for lane in 0..LANES {
            // Lanes that are left over repeat the first point.
            let one = if lane < seen.len() { &seen[lane] } else { &seen[0] };
            (px.0[lane], py.0[lane], pz.0[lane]) = (one.point.coords.x, one.point.coords.y, one.point.coords.z);
            (u.0[lane], v.0[lane], sigma.0[lane]) = (one.pixel.x, one.pixel.y, one.sigma_px);
        }
        let mut stated = (sigma * sigma).recip();
        for lane in seen.len()..LANES {
            stated.0[lane] = 0.0;
        }
        let turned_x = along(pose, 0, px, py, pz);
        let turned_y = along(pose, 1, px, py, pz);
        let turned_z = along(pose, 2, px, py, pz);
        let z = turned_z + Lanes::all(pose.translation.z);
        let per_depth = z.recip();
        let x = (turned_x + Lanes::all(pose.translation.x)) * per_depth;
        let y = (turned_y + Lanes::all(pose.translation.y)) * per_depth;
        let ([image_u, image_v], [by_x, by_y]) = pixels(camera, x, y);
        let has_image = |lane: usize| {
            // Also false for NaN, and for depths so small that their reciprocal overflows.
            let (w, u, v) = (per_depth.0[lane], image_u.0[lane], image_v.0[lane]);
            z.0[lane] > 0.0 && w.is_finite() && u.is_finite() && v.is_finite()
        };
        let lost = [!has_image(0), !has_image(1), !has_image(2), !has_image(3)];
        Self {
            distance: [u - image_u, v - image_v],
            stated,
            turned: [turned_x, turned_y, turned_z],
            by_point: [by_point(by_x, per_depth, x, y), by_point(by_y, per_depth, x, y)],
            lost,
        }
    }

    /// As if the lost lanes did not exist.
    pub(super) fn without_lost(mut self) -> Self {
        for lane in (0..LANES).filter(|lane| self.lost[*lane]) {
            let rows = self.by_point.iter_mut().flatten();
            let others = self.distance.iter_mut().chain(&mut self.turned).chain([&mut self.stated]);
            for number in rows.chain(others) {
                number.0[lane] = 0.0;
            }
        }
        self
    }

    #[inline(always)]
    pub(super) fn squared_distance(&self) -> Lanes {
        let [x, y] = self.distance;
        x * x + y * y
    }

    /// Derivatives of the two coordinates of the pixel by the pose's six: a turn moves the point across itself, and
    /// `a . (w x q) = w . (q x a)`.
    #[inline(always)]
    pub(super) fn by_pose(&self) -> [[Lanes; 6]; 2] {
        [by_pose(&self.by_point[0], &self.turned), by_pose(&self.by_point[1], &self.turned)]
    }
}

/// A coordinate of the turned points.
#[inline(always)]
fn along(pose: &CameraFromTarget, row: usize, x: Lanes, y: Lanes, z: Lanes) -> Lanes {
    let r = pose.rotation.matrix();
    Lanes::all(r[(row, 0)]) * x + Lanes::all(r[(row, 1)]) * y + Lanes::all(r[(row, 2)]) * z
}

/// The derivative of a pixel's coordinate by the point, from that by the ray `(x, y)`.
#[inline(always)]
fn by_point(by_ray: [Lanes; 2], per_depth: Lanes, x: Lanes, y: Lanes) -> [Lanes; 3] {
    let (by_x, by_y) = (by_ray[0] * per_depth, by_ray[1] * per_depth);
    [by_x, by_y, Lanes::ZERO - (by_x * x + by_y * y)]
}

#[inline(always)]
fn by_pose([a, b, c]: &[Lanes; 3], [x, y, z]: &[Lanes; 3]) -> [Lanes; 6] {
    let (a, b, c, x, y, z) = (*a, *b, *c, *x, *y, *z);
    [a, b, c, y * c - z * b, z * a - x * c, x * b - y * a]
}

/// The pixels of four normalized rays with their derivatives; not finite where the lens has none.
#[inline(always)]
fn pixels(camera: &Camera, x: Lanes, y: Lanes) -> ([Lanes; 2], [[Lanes; 2]; 2]) {
    if matches!(camera.distortion(), Distortion::None) {
        let ([fx, fy], [cx, cy]) = (camera.focal_lengths(), camera.principal_point());
        let (fx, fy) = (Lanes::all(fx), Lanes::all(fy));
        let image = [fx * x + Lanes::all(cx), fy * y + Lanes::all(cy)];
        return (image, [[fx, Lanes::ZERO], [Lanes::ZERO, fy]]);
    }
    let mut image = [Lanes::all(f64::NAN); 2];
    let mut slope = [[Lanes::ZERO; 2]; 2];
    for lane in 0..LANES {
        let ray = [x.0[lane], y.0[lane]].into();
        let Some((pixel, by_ray)) = camera.pixel_with_jacobian(&ray) else { continue };
        for row in 0..2 {
            image[row].0[lane] = pixel[row];
            for column in 0..2 {
                slope[row][column].0[lane] = by_ray[(row, column)];
            }
        }
    }
    (image, slope)
}
