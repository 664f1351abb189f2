//! Where a target stands before a camera to be assessed: in the centre of the picture, at a range, turned by an aspect.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::draws::Draw;
use crate::camera::{Camera, Normalized};
use crate::geometry::CameraFromTarget;
use crate::target::Target;

/// Below this extent a blob is as wide as the target: nothing is found there.
const SMALLEST_EXTENT_PX: f64 = 8.0;

/// The nearest default range leaves this share of the half field of view free.
const FIELD_USED_RATIO: f64 = 0.9;

/// Normals that cancel to less than this leave no front.
const LEAST_MEAN_NORMAL: f64 = 0.3;

/// A camera, and a target on its central ray.
#[derive(Clone, Debug)]
pub(super) struct Stage<'a> {
    pub camera: &'a Camera,
    pub target: &'a Target,
    /// Unit vector in the target's space: the direction from which it is seen face on.
    pub front: Vector3<f64>,
    /// Unit vector to the centre of the picture.
    ray: Vector3<f64>,
    /// Pixels per metre on the plane at a distance of one metre, in the centre of the picture.
    pub magnification_px: f64,
}

impl<'a> Stage<'a> {
    pub(super) fn of(camera: &'a Camera, target: &'a Target) -> Self {
        let centre = [camera.width(), camera.height()].map(|side| 0.5 * f64::from(side) - 0.5);
        // A lens model that does not reach the centre of its own picture: then the optical axis.
        let ideal = camera.unproject(&centre.into()).unwrap_or_else(Normalized::zeros);
        let scale = camera.pixel_with_jacobian(&ideal).map(|(_, jacobian)| jacobian.determinant().abs().sqrt());
        let [fx, fy] = camera.focal_lengths();
        Self {
            camera,
            target,
            front: front_of(target),
            ray: Vector3::new(ideal.x, ideal.y, 1.0).normalize(),
            magnification_px: scale.unwrap_or_else(|| (fx * fy).sqrt()),
        }
    }

    /// Looked at from another front.
    #[cfg(test)]
    pub(super) fn facing(self, front: Vector3<f64>) -> Self {
        Self { front, ..self }
    }

    /// The same with another target, looked at from the same front.
    pub(super) fn with<'b>(&'b self, target: &'b Target) -> Stage<'b> {
        Stage { target, ..self.clone() }
    }

    /// The pose with the centre of the markers on the ray at `range_m`, and the front turned away from the camera by
    /// `aspect_rad`; which way, and how the target is turned about the ray, is the draw's.
    pub(super) fn pose(&self, range_m: f64, aspect_rad: f64, draw: &Draw) -> CameraFromTarget {
        let (sine, cosine) = aspect_rad.sin_cos();
        let [across, up] = across(&self.front);
        let sideways = across * draw.azimuth_rad.cos() + up * draw.azimuth_rad.sin();
        // From the target to the camera, and two directions across that, in the target's space and in the camera's.
        let to_camera = self.front * cosine + sideways * sine;
        let down = sideways * cosine - self.front * sine;
        let in_target = Matrix3::from_columns(&[to_camera, down, to_camera.cross(&down)]);
        let [x, y] = across_ray(&self.ray, draw.spin_rad);
        let in_camera = Matrix3::from_columns(&[-self.ray, x, y]);
        let rotation = Rotation3::from_matrix_unchecked(in_camera * in_target.transpose());
        CameraFromTarget::new(rotation, self.ray * range_m - rotation * self.target.spread().centre)
    }

    /// Where the target just fits into the picture, however it is turned, to where it is too small for anything.
    pub(super) fn range_limits_m(&self) -> [f64; 2] {
        let spread = self.target.spread();
        let reach_m = self
            .target
            .markers()
            .iter()
            .map(|marker| (marker.position.coords - spread.centre).norm() + marker.radius_m.unwrap_or(0.0))
            .fold(0.0, f64::max);
        let nearest = reach_m / (FIELD_USED_RATIO * self.half_field_rad()).sin();
        let farthest = extent_m(self.target) * self.magnification_px / SMALLEST_EXTENT_PX;
        [nearest, farthest.max(2.0 * nearest)]
    }

    /// The smallest angle between the central ray and an edge of the picture.
    fn half_field_rad(&self) -> f64 {
        let [width, height] = [self.camera.width(), self.camera.height()].map(f64::from);
        let edges =
            [[-0.5, 0.5 * height], [width - 0.5, 0.5 * height], [0.5 * width, -0.5], [0.5 * width, height - 0.5]];
        let centre = [0.5 * (width - 1.0), 0.5 * (height - 1.0)];
        let angle = |edge: [f64; 2]| {
            // A lens model may end inside the picture: then the last place towards the edge that it reaches.
            (1..=20).rev().map(|k| f64::from(k) / 20.0).find_map(|share| {
                let pixel = [0, 1].map(|i| centre[i] + share * (edge[i] - centre[i]));
                let ray = self.camera.bearing(&pixel.into())?;
                Some(ray.angle(&self.ray))
            })
        };
        let [fx, fy] = self.camera.focal_lengths();
        let pinhole = (0.5 * width / fx).min(0.5 * height / fy).atan();
        edges.into_iter().filter_map(angle).reduce(f64::min).unwrap_or(pinhole)
    }
}

/// The largest distance between two markers.
pub(super) fn extent_m(target: &Target) -> f64 {
    let markers = target.markers();
    let distances = markers
        .iter()
        .enumerate()
        .flat_map(|(i, a)| markers[..i].iter().map(move |b| (a.position.coords - b.position.coords).norm()));
    distances.fold(0.0, f64::max)
}

/// The mean of the normals if all markers have one, else the normal of the best plane.
fn front_of(target: &Target) -> Vector3<f64> {
    let normals: Option<Vector3<f64>> = target.markers().iter().map(|marker| marker.normal).sum();
    let mean = normals.map(|sum| sum / target.markers().len() as f64).filter(|mean| mean.norm() > LEAST_MEAN_NORMAL);
    mean.map_or_else(|| target.spread().axes.column(2).into_owned(), |mean| mean.normalize())
}

/// Two unit vectors that make a right-handed set with `axis`.
pub(super) fn across(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let mut least = Vector3::zeros();
    least[axis.iamin()] = 1.0;
    let first = axis.cross(&least).normalize();
    [first, axis.cross(&first)]
}

/// The same for the direction back along the ray, turned by `spin_rad` about it.
fn across_ray(ray: &Vector3<f64>, spin_rad: f64) -> [Vector3<f64>; 2] {
    let back = -ray;
    let [first, second] = across(&back);
    let x = first * spin_rad.cos() + second * spin_rad.sin();
    [x, back.cross(&x)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;
    use crate::scene::models::{demo_camera, wing_six};

    #[test]
    fn the_target_stands_in_the_centre_at_the_range_and_aspect_that_are_asked_for() {
        let (camera, target) = (demo_camera(), wing_six());
        let stage = Stage::of(&camera, &target);
        for (index, aspect_rad) in [0.0, 0.4, 1.3].into_iter().enumerate() {
            let draw = Draw::numbered(index as u64, 6);
            let pose = stage.pose(7.0, aspect_rad, &draw);
            assert!((pose.rotation.matrix().determinant() - 1.0).abs() < 1e-12);
            let centre = (pose * Point::from(target.spread().centre)).coords;
            assert!((centre.norm() - 7.0).abs() < 1e-12);
            let pixel = camera.project(&Point::from(centre)).expect("in view");
            assert!((pixel.x - 639.5).abs() < 1e-6 && (pixel.y - 359.5).abs() < 1e-6, "{pixel}");
            // The markers face -z.
            let angle = (pose.rotation * -Vector3::z()).angle(&-centre);
            assert!((angle - aspect_rad).abs() < 1e-9, "{angle} {aspect_rad}");
        }
    }

    #[test]
    fn at_the_nearest_range_the_target_fits_and_at_the_farthest_it_is_small() {
        let (camera, target) = (demo_camera(), wing_six());
        let stage = Stage::of(&camera, &target);
        let [nearest, farthest] = stage.range_limits_m();
        let pixels = |range_m: f64, index: u64| -> Vec<_> {
            let pose = stage.pose(range_m, 0.3, &Draw::numbered(index, 6));
            target.markers().iter().filter_map(|m| camera.project(&(pose * m.position))).collect()
        };
        for index in 0..20 {
            assert!(pixels(nearest, index).iter().filter(|p| camera.contains(p)).count() == 6, "{index}");
        }
        let all_fit_nearer = (0..20).all(|index| pixels(0.6 * nearest, index).iter().all(|p| camera.contains(p)));
        assert!(!all_fit_nearer, "the nearest range is not too far");
        let far = pixels(farthest, 0);
        let extent = far.iter().flat_map(|p| far.iter().map(move |q| (p - q).norm())).fold(0.0, f64::max);
        assert!((6.0..=8.1).contains(&extent), "{extent}");
    }
}
