//! Where to look for the targets in the next frame.

use nalgebra::{Matrix2, Matrix3, SMatrix};

use super::life::{Life, Track};
use super::motion::Motion;
use super::options::TrackOptions;
use crate::camera::{Camera, Pixel};
use crate::frame::Region;
use crate::geometry::rotation::cross_matrix;
use crate::target::Target;

/// Where to look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Search {
    /// In the whole frame.
    Full(FullReason),
    /// In this part of it, which holds every track.
    Part(Region),
}

/// Why in the whole frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FullReason {
    /// There is nothing to follow.
    NoTrack,
    /// It is the turn of a full search, for new targets.
    Schedule {
        /// Every so many frames.
        every: u32,
    },
    /// A track is not confirmed, or was not seen in the last frame.
    Unsettled,
    /// A track's predicted image is not in the frame, or behind the camera.
    OutOfView,
    /// The part would be nearly all.
    Wide {
        /// Its share of the frame.
        share_ratio: f64,
        /// The most that is worth it.
        limit_ratio: f64,
    },
}

impl Search {
    /// The region for the detector; `None` for the whole frame.
    #[must_use]
    pub const fn region(&self) -> Option<Region> {
        match self {
            Self::Full(_) => None,
            Self::Part(region) => Some(*region),
        }
    }
}

/// A box in the picture, not cut to it: least and largest u and v, px.
#[derive(Clone, Copy, Debug)]
struct Extent {
    least: Pixel,
    most: Pixel,
}

impl Extent {
    const NONE: Self = Self {
        least: Pixel::new(f64::INFINITY, f64::INFINITY),
        most: Pixel::new(f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    fn with(self, other: &Self) -> Self {
        Self { least: self.least.inf(&other.least), most: self.most.sup(&other.most) }
    }
}

/// The part of the frame that holds all of `tracks` after `dt_s`, as far as it is known.
pub(super) fn search(tracks: &[Track], dt_s: f64, camera: &Camera, target: &Target, options: &TrackOptions) -> Search {
    if tracks.is_empty() {
        return Search::Full(FullReason::NoTrack);
    }
    if tracks.iter().any(|track| track.life() != Life::Confirmed) {
        return Search::Full(FullReason::Unsettled);
    }
    let mut extent = Extent::NONE;
    for track in tracks {
        let Some(later) = track.mixture().predicted(dt_s, options) else {
            return Search::Full(FullReason::Unsettled);
        };
        for one in later.hypotheses() {
            let Some(image) = image(&one.motion, camera, target, options) else {
                return Search::Full(FullReason::OutOfView);
            };
            extent = extent.with(&image);
        }
    }
    let Some(region) = cut(&extent, camera) else { return Search::Full(FullReason::OutOfView) };
    let share_ratio = region.area() as f64 / (f64::from(camera.width()) * f64::from(camera.height()));
    if share_ratio > options.max_region_ratio {
        return Search::Full(FullReason::Wide { share_ratio, limit_ratio: options.max_region_ratio });
    }
    Search::Part(region)
}

/// The markers' images with what the motion's uncertainty adds. `None` if one has none.
fn image(motion: &Motion, camera: &Camera, target: &Target, options: &TrackOptions) -> Option<Extent> {
    let pose = motion.camera_from_target();
    let mut extent = Extent::NONE;
    for marker in target.markers() {
        let point = *pose * marker.position;
        let (pixel, by_point) = camera.project_with_jacobian(&point)?;
        let mut by_pose = SMatrix::<f64, 3, 6>::zeros();
        by_pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
        by_pose.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross_matrix(&(pose.rotation * marker.position.coords)));
        let slope = by_point * by_pose;
        let spread: Matrix2<f64> = slope * motion.pose_covariance().matrix() * slope.transpose();
        // Face on, a disc looks largest.
        let radius_px = marker.radius_m.unwrap_or(0.0) * by_point.column(0).norm().max(by_point.column(1).norm());
        let reach = spread
            .diagonal()
            .map(|variance| variance.max(0.0).sqrt() * options.region_sigmas + options.region_margin_px + radius_px);
        extent = extent.with(&Extent { least: pixel - reach, most: pixel + reach });
    }
    let is_finite = extent.least.iter().chain(&extent.most).all(|x| x.is_finite());
    is_finite.then_some(extent)
}

/// The whole pixels of `extent` in the frame; `None` if there are none.
fn cut(extent: &Extent, camera: &Camera) -> Option<Region> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the frame by the clamp")]
    let side = |least: f64, most: f64, size: u32| {
        let from = (least.floor().max(0.0)).min(f64::from(size)) as u32;
        let to = ((most.ceil() + 1.0).max(0.0)).min(f64::from(size)) as u32;
        (to > from).then(|| (from, to - from))
    };
    let (x, width) = side(extent.least.x, extent.most.x, camera.width())?;
    let (y, height) = side(extent.least.y, extent.most.y, camera.height())?;
    Some(Region { x, y, width, height })
}
