//! What the camera sees of the target at one pose.

use nalgebra::{Matrix3, Matrix6, Vector3};

use super::draws::Draw;
use super::stage::Stage;
use crate::camera::Pixel;
use crate::geometry::{CameraFromTarget, PoseCovariance, rotation::cross_matrix};
use crate::identify::Blob;
use crate::refine::{Correspondence, information};

/// Two blobs grow together when they are this much nearer than the sum of their radii: blur, and a gap to be seen as one.
pub(super) const MERGING_GAP_PX: f64 = 2.0;

/// Standard deviation of the logarithm of a blob's area: thresholds and whole pixels.
const LN_AREA_SIGMA: f64 = 0.2;

/// An attitude of which nothing is known is wrong by this root mean square angle: sqrt(pi^2 / 3 + 2).
pub(super) const UNKNOWN_ATTITUDE_RAD: f64 = 2.299_9;

/// A marker that is in the picture and turned towards the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    pub marker: usize,
    pub pixel: Pixel,
    /// Half the width of its blob, where the marker's radius is known.
    pub radius_px: Option<f64>,
    /// Cosine of the angle under which it is seen; one where its normal is not known.
    facing: f64,
}

/// The visible markers at a pose.
pub(super) struct Sight<'a> {
    stage: &'a Stage<'a>,
    pub pose: CameraFromTarget,
    pub seen: Vec<Seen>,
}

/// Standard deviations of a pose, as far as the noise of the pixels allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bound {
    pub range_m: f64,
    pub bearing_rad: f64,
    pub attitude_rad: f64,
}

/// A blob as it is found, and the markers that are in it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MarkedBlob {
    pub blob: Blob,
    pub markers: Vec<usize>,
}

impl<'a> Sight<'a> {
    pub(super) fn at(stage: &'a Stage<'a>, pose: CameraFromTarget, max_tilt_rad: f64) -> Self {
        let seen = (0..stage.target.markers().len()).filter_map(|marker| {
            let facing = stage.target.facing_cosine(marker, &pose);
            if facing.is_some_and(|cosine| cosine <= max_tilt_rad.cos()) {
                return None;
            }
            let place = pose * stage.target.markers()[marker].position;
            let pixel = stage.camera.project(&place).filter(|pixel| stage.camera.contains(pixel))?;
            let radius_px =
                stage.target.markers()[marker].radius_m.map(|r| r * stage.magnification_px / place.coords.z);
            Some(Seen { marker, pixel, radius_px, facing: facing.unwrap_or(1.0) })
        });
        Self { stage, seen: seen.collect(), pose }
    }

    /// Pairs of known identity, displaced by the draw's noise.
    pub(super) fn correspondences(&self, draw: &Draw, pixel_sigma: f64) -> Vec<Correspondence> {
        self.pairs(pixel_sigma, |seen| seen.pixel + draw.noise[seen.marker] * pixel_sigma)
    }

    /// Pairs of known identity without noise, stated to have some.
    pub(super) fn exact_correspondences(&self, pixel_sigma: f64) -> Vec<Correspondence> {
        self.pairs(pixel_sigma, |seen| seen.pixel)
    }

    fn pairs(&self, sigma_px: f64, pixel: impl Fn(&Seen) -> Pixel) -> Vec<Correspondence> {
        let point = |seen: &Seen| self.stage.target.markers()[seen.marker].position;
        self.seen.iter().map(|seen| Correspondence { point: point(seen), pixel: pixel(seen), sigma_px }).collect()
    }

    /// The least standard deviations that an unbiased estimate can have (Cramer-Rao); `None` where the visible markers do not
    /// fix the pose.
    pub(super) fn bound(&self, pixel_sigma: f64) -> Option<Bound> {
        let covariance = self.covariance(pixel_sigma)?;
        // Of the centre of the markers, wherever the origin of their space lies.
        let arm = self.pose.rotation * self.stage.target.spread().centre;
        let mut to_centre = Matrix6::identity();
        to_centre.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross_matrix(&arm));
        let covariance = to_centre * covariance.matrix() * to_centre.transpose();
        let position: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0).into_owned();
        let centre: Vector3<f64> = self.pose.translation + arm;
        let along = centre.normalize();
        let range_variance = along.dot(&(position * along));
        Some(Bound {
            range_m: range_variance.sqrt(),
            bearing_rad: (position.trace() - range_variance).max(0.0).sqrt() / centre.norm(),
            attitude_rad: covariance.fixed_view::<3, 3>(3, 3).trace().sqrt().min(UNKNOWN_ATTITUDE_RAD),
        })
    }

    /// The least covariance that the pose of the target can have; `None` where the visible markers do not fix it.
    pub(super) fn covariance(&self, pixel_sigma: f64) -> Option<PoseCovariance> {
        let pairs = self.exact_correspondences(pixel_sigma);
        let information = information(self.stage.camera, &pairs, &self.pose).ok()?;
        PoseCovariance::from_information(&information)
    }

    /// Largest and smallest distance between two visible markers; `None` for fewer than two.
    pub(super) fn distances_px(&self) -> Option<[f64; 2]> {
        let distances = || self.pairs_of_seen().map(|(a, b)| (a.pixel - b.pixel).norm());
        Some([distances().reduce(f64::max)?, distances().reduce(f64::min)?])
    }

    fn pairs_of_seen(&self) -> impl Iterator<Item = (&Seen, &Seen)> {
        self.seen.iter().enumerate().flat_map(|(i, a)| self.seen[..i].iter().map(move |b| (a, b)))
    }

    /// The blobs as a detector would find them: in no order, with noise, and one for markers that are too close together.
    pub(super) fn blobs(&self, draw: &Draw, pixel_sigma: f64) -> Vec<MarkedBlob> {
        let mut groups: Vec<Vec<&Seen>> = Vec::new();
        for seen in &self.seen {
            let touches = |other: &&Seen| {
                let radii = seen.radius_px.unwrap_or(0.0) + other.radius_px.unwrap_or(0.0);
                (seen.pixel - other.pixel).norm() < radii + MERGING_GAP_PX
            };
            let (near, mut apart): (Vec<_>, Vec<_>) = groups.into_iter().partition(|group| group.iter().any(touches));
            let mut group = near.concat();
            group.push(seen);
            apart.push(group);
            groups = apart;
        }
        let mut blobs: Vec<(u64, MarkedBlob)> = groups
            .into_iter()
            .map(|group| {
                let count = group.len() as f64;
                let pixel = group.iter().map(|s| s.pixel + draw.noise[s.marker] * pixel_sigma).sum::<Pixel>() / count;
                let area_px = group.iter().map(|seen| blurred_area_px(seen, draw)).sum();
                let markers: Vec<usize> = group.iter().map(|seen| seen.marker).collect();
                (draw.order[markers[0]], MarkedBlob { blob: Blob { pixel, sigma_px: pixel_sigma, area_px }, markers })
            })
            .collect();
        blobs.sort_by_key(|(order, _)| *order);
        blobs.into_iter().map(|(_, blob)| blob).collect()
    }
}

impl Seen {
    /// Of the ellipse that a disc appears as.
    pub(super) fn area_px(&self) -> Option<f64> {
        Some(std::f64::consts::PI * self.radius_px?.powi(2) * self.facing.abs())
    }
}

/// As a detector measures it, with half a pixel of blur all round.
fn blurred_area_px(seen: &Seen, draw: &Draw) -> Option<f64> {
    Some((seen.area_px()?.sqrt() + 1.0).powi(2) * (LN_AREA_SIGMA * draw.area_noise[seen.marker]).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Distortion};
    use crate::target::{Marker, Target};

    fn camera() -> Camera {
        Camera::checked([1280, 1024], [1000.0; 2], [639.5, 511.5], Distortion::None).expect("a camera")
    }

    fn square(half_m: f64, shift: Vector3<f64>) -> Target {
        let corners = [("a", [1.0, 1.0]), ("b", [-1.0, 1.0]), ("c", [-1.0, -1.0]), ("d", [1.0, -1.0])];
        let marker = |(id, [x, y]): (&str, [f64; 2])| Marker {
            id: id.into(),
            position: (Vector3::new(x, y, 0.0) * half_m + shift).into(),
            radius_m: Some(0.02),
            normal: Some(-Vector3::z()),
        };
        Target::checked("square", corners.into_iter().map(marker).collect()).expect("a good target")
    }

    fn bound(target: &Target, range_m: f64) -> Bound {
        let camera = camera();
        let stage = Stage::of(&camera, target);
        let sight = Sight::at(&stage, stage.pose(range_m, 0.0, &Draw::numbered(0, 4)), 1.4);
        sight.bound(0.5).expect("four corners")
    }

    #[test]
    fn the_range_of_a_square_seen_face_on_is_as_good_as_its_size_is_measured() {
        // Scale alone tells the range: u = f x / z, so du/dz = -u / z and sigma_z = z sigma / sqrt(sum |u|^2), the sum being
        // four times twice (f h / z)^2. At a distance, where perspective adds nothing.
        let (half_m, focal_px, sigma_px) = (0.1, 1000.0, 0.5);
        for range_m in [10.0, 20.0] {
            let closed_form = range_m * range_m * sigma_px / (focal_px * half_m * 8.0_f64.sqrt());
            let found = bound(&square(half_m, Vector3::zeros()), range_m).range_m;
            assert!((found / closed_form - 1.0).abs() < 1e-3, "{found} {closed_form}");
        }
        let ratio = |near: f64| {
            let target = square(half_m, Vector3::zeros());
            bound(&target, 2.0 * near).range_m / bound(&target, near).range_m
        };
        assert!((ratio(10.0) - 4.0).abs() < 1e-3, "it grows with the square of the range: {}", ratio(10.0));
    }

    #[test]
    fn the_bound_does_not_depend_on_where_the_origin_is() {
        let here = bound(&square(0.1, Vector3::zeros()), 8.0);
        let there = bound(&square(0.1, Vector3::new(3.0, -2.0, 5.0)), 8.0);
        for (a, b) in [
            (here.range_m, there.range_m),
            (here.bearing_rad, there.bearing_rad),
            (here.attitude_rad, there.attitude_rad),
        ] {
            assert!((a / b - 1.0).abs() < 1e-6, "{here:?} {there:?}");
        }
    }

    #[test]
    fn markers_that_touch_in_the_picture_are_one_blob() {
        let camera = camera();
        let target = square(0.1, Vector3::zeros());
        let stage = Stage::of(&camera, &target);
        let draw = Draw::numbered(0, 4);
        let count = |range_m: f64| Sight::at(&stage, stage.pose(range_m, 0.0, &draw), 1.4).blobs(&draw, 0.1).len();
        // Sides of 200 mm, radii of 20 mm: 160 mm of gap are 2 px at 80 m.
        assert_eq!((count(78.0), count(82.0)), (4, 1));
    }

    #[test]
    fn markers_that_are_turned_away_are_not_seen() {
        let camera = camera();
        let target = square(0.1, Vector3::zeros());
        let stage = Stage::of(&camera, &target);
        let draw = Draw::numbered(0, 4);
        let seen = |aspect_rad: f64| Sight::at(&stage, stage.pose(8.0, aspect_rad, &draw), 1.4).seen.len();
        assert_eq!((seen(1.3), seen(1.5), seen(3.0)), (4, 0, 0));
    }
}
