//! One cell of the grid: a range and an aspect, tried many times.

use super::AssessOptions;
use super::draws::Draw;
use super::sight::{Bound, MarkedBlob, Seen, Sight};
use super::stage::Stage;
use crate::geometry::rotation;
use crate::identify::identify;
use crate::pose::{PoseAnswer, PoseEstimate, PoseOptions, estimate_pose};

/// An attitude further from the truth than this is that of the wrong minimum (or, far away, of none).
const FLIPPED_BEYOND_RAD: f64 = 0.349_065_850_398_865_9;

/// An assignment less probable than this is stated as unsure: its rivals reach the probability that makes an answer
/// ambiguous.
const SURE_FROM: f64 = 1.0 - PoseAnswer::AMBIGUOUS_FROM;

/// What is to be expected at one range and aspect, over all turns about the line of sight and all directions of tilt.
///
/// Standard deviations are root mean squares over the turns. Where no turn shows enough markers they are `None`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// From the camera to the centre of the markers.
    pub range_m: f64,
    /// Between the line of sight and the front of the target.
    pub aspect_rad: f64,
    /// Markers in the picture that face the camera, mean.
    pub markers_seen: f64,
    /// Largest distance between two of them in the picture, mean.
    pub extent_px: f64,
    /// Smallest distance between two of them in the picture.
    pub closest_px: Option<f64>,
    /// Radius of the largest of them in the picture, where known.
    pub marker_radius_px: Option<f64>,
    /// Area of the smallest of them in the picture, where known. The colour detector needs some pixels to find it at all.
    pub smallest_area_px: Option<f64>,
    /// Standard deviation of the range of the markers' centre, at least (Cramer-Rao).
    pub range_sigma_m: Option<f64>,
    /// Root mean square angle between its true direction and the estimated one, at least.
    pub bearing_sigma_rad: Option<f64>,
    /// Root mean square angle of the error of the attitude as the bound has it, at most 2.3, which is that of an attitude of
    /// which nothing is known. Far too large where poses are not reliable: seen face on, tilt changes the picture only in
    /// second order, of which the bound knows nothing.
    pub attitude_sigma_rad: Option<f64>,
    /// Root mean square angle of the error of simulated attitudes, of each answer the pose nearest to the truth.
    pub attitude_error_rad: Option<f64>,
    /// Share of simulated poses whose covariance is called reliable.
    pub reliable_rate: Option<f64>,
    /// Share of simulated poses, markers being known, whose attitude is more than 20 degrees off: the wrong minimum.
    pub flip_rate: Option<f64>,
    /// Share of draws that give no pose even if the markers are known: too few seen, or in a line.
    pub no_pose_rate: f64,
    /// Share of draws in which the markers are told apart: the right assignment, with a probability of 0.95 or more. `None`,
    /// like the next three, where that was not simulated, as the target has too many markers.
    pub identified_rate: Option<f64>,
    /// Share of draws in which some assignment is found but its probability is below 0.95.
    pub unsure_rate: Option<f64>,
    /// Share of draws in which no assignment is found that cannot be chance.
    pub refused_rate: Option<f64>,
    /// Share of draws in which a wrong assignment is stated with a probability of 0.95 or more.
    pub mistaken_rate: Option<f64>,
    /// Share of draws in which blobs of two markers grow together.
    pub merged_rate: f64,
}

/// How telling the markers apart ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Identification {
    Right,
    Unsure,
    Refused,
    Mistaken,
}

/// Measures a cell with these draws, in the first `identified_draws` of which markers are told apart.
pub(super) fn measure(
    stage: &Stage<'_>,
    range_m: f64,
    aspect_rad: f64,
    draws: &[Draw],
    identified_draws: usize,
    options: &AssessOptions,
) -> Cell {
    let mut tally = Tally::default();
    for (index, draw) in draws.iter().enumerate() {
        let pose = stage.pose(range_m, aspect_rad, draw);
        let sight = Sight::at(stage, pose, options.identify.max_tilt_rad);
        tally.add_sight(&sight, options.pixel_sigma);
        tally.add_pose(stage, &sight, draw, options.pixel_sigma);
        let blobs = sight.blobs(draw, options.pixel_sigma);
        tally.merged += usize::from(blobs.iter().any(|blob| blob.markers.len() > 1));
        if index < identified_draws {
            tally.identifications.push(identification(stage, &blobs, options));
        }
    }
    tally.cell(range_m, aspect_rad, draws.len())
}

/// Sums over the draws of a cell.
#[derive(Default)]
struct Tally {
    markers: usize,
    extents_px: f64,
    closest_px: Option<f64>,
    marker_radius_px: Option<f64>,
    smallest_area_px: Option<f64>,
    bounds: Vec<Bound>,
    poses: usize,
    attitude_squares: f64,
    reliable: usize,
    flipped: usize,
    identifications: Vec<Identification>,
    merged: usize,
}

impl Tally {
    fn add_sight(&mut self, sight: &Sight<'_>, pixel_sigma: f64) {
        self.markers += sight.seen.len();
        if let Some([largest, smallest]) = sight.distances_px() {
            self.extents_px += largest;
            self.closest_px = Some(self.closest_px.map_or(smallest, |known| known.min(smallest)));
        }
        for radius in sight.seen.iter().filter_map(|seen| seen.radius_px) {
            self.marker_radius_px = Some(self.marker_radius_px.map_or(radius, |known| known.max(radius)));
        }
        for area in sight.seen.iter().filter_map(Seen::area_px) {
            self.smallest_area_px = Some(self.smallest_area_px.map_or(area, |known| known.min(area)));
        }
        self.bounds.extend(sight.bound(pixel_sigma));
    }

    fn add_pose(&mut self, stage: &Stage<'_>, sight: &Sight<'_>, draw: &Draw, pixel_sigma: f64) {
        let pairs = sight.correspondences(draw, pixel_sigma);
        let faces = |pose: &_| sight.seen.iter().all(|seen| stage.target.faces_camera(seen.marker, pose));
        let answer = estimate_pose(stage.camera, &pairs, &PoseOptions::default());
        let Ok(answer) = answer.and_then(|answer| answer.restricted(faces)) else { return };
        let off_rad = |estimate: &PoseEstimate| {
            rotation::angle_between_rad(&estimate.camera_from_target.rotation, &sight.pose.rotation)
        };
        let best_off_rad = off_rad(&answer.best);
        self.poses += 1;
        self.attitude_squares += answer.alternatives.iter().map(off_rad).fold(best_off_rad, f64::min).powi(2);
        self.reliable += usize::from(answer.best.covariance_reliable);
        self.flipped += usize::from(best_off_rad > FLIPPED_BEYOND_RAD);
    }

    fn cell(self, range_m: f64, aspect_rad: f64, draws: usize) -> Cell {
        let draws = draws.max(1) as f64;
        let rms = |of: fn(&Bound) -> f64| {
            let squares: f64 = self.bounds.iter().map(|bound| of(bound).powi(2)).sum();
            (!self.bounds.is_empty()).then(|| (squares / self.bounds.len() as f64).sqrt())
        };
        let of_poses = |count: usize| (self.poses > 0).then(|| count as f64 / self.poses as f64);
        let tried = self.identifications.len();
        let share = |kind: Identification| {
            let count = self.identifications.iter().filter(|k| **k == kind).count();
            (tried > 0).then(|| count as f64 / tried as f64)
        };
        Cell {
            range_m,
            aspect_rad,
            markers_seen: self.markers as f64 / draws,
            extent_px: self.extents_px / draws,
            closest_px: self.closest_px,
            marker_radius_px: self.marker_radius_px,
            smallest_area_px: self.smallest_area_px,
            range_sigma_m: rms(|bound| bound.range_m),
            bearing_sigma_rad: rms(|bound| bound.bearing_rad),
            attitude_sigma_rad: rms(|bound| bound.attitude_rad),
            attitude_error_rad: (self.poses > 0).then(|| (self.attitude_squares / self.poses as f64).sqrt()),
            reliable_rate: of_poses(self.reliable),
            flip_rate: of_poses(self.flipped),
            no_pose_rate: 1.0 - self.poses as f64 / draws,
            identified_rate: share(Identification::Right),
            unsure_rate: share(Identification::Unsure),
            refused_rate: share(Identification::Refused),
            mistaken_rate: share(Identification::Mistaken),
            merged_rate: self.merged as f64 / draws,
        }
    }
}

fn identification(stage: &Stage<'_>, blobs: &[MarkedBlob], options: &AssessOptions) -> Identification {
    let given: Vec<_> = blobs.iter().map(|marked| marked.blob).collect();
    let Ok(identified) = identify(stage.camera, stage.target, &given, &options.identify) else {
        return Identification::Refused;
    };
    let best = &identified.hypotheses[0];
    let is_right = best
        .blob_of_marker
        .iter()
        .enumerate()
        .all(|(marker, blob)| blob.is_none_or(|blob| blobs[blob].markers.contains(&marker)));
    match (best.probability >= SURE_FROM, is_right) {
        (false, _) => Identification::Unsure,
        (true, true) => Identification::Right,
        (true, false) => Identification::Mistaken,
    }
}
