//! What is followed in the frames of one camera: a tracker for each of its targets.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::time::Duration;

use crate::camera::Camera;
use crate::encounter::Means;
use crate::frame::Region;
use crate::pipeline::TargetEstimate;
use crate::pose::PoseAnswer;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::track::{TrackWire, TracksWire};
use crate::target::Target;
use crate::track::{Track, TrackError, TrackOptions, Tracker};

/// A stamp that is this much before the last one means that the camera's clock was set. One that is less before it is a frame that came
/// late.
const SET_BACK: Duration = Duration::from_secs(1);
/// So much time counts as passed then: longer than any track lives unseen.
const PAUSE: Duration = Duration::from_hours(1);
/// Trackers that are kept when other targets are stored for the camera, so that no name of a track is given twice.
const MOST_TRACKERS: usize = 64;

/// The trackers of a camera, by the names of the targets.
#[derive(Debug, Default)]
pub struct Tracks {
    trackers: BTreeMap<String, Tracker>,
    /// Stamp of the last frame.
    last: Option<Duration>,
    /// What is added to stamps so that they rise.
    shift: Duration,
    /// Those of the last frame.
    options: TrackOptions,
}

/// The tracks of one target after a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Followed {
    /// The target.
    pub target: String,
    /// All of them, those that ended with the frame included.
    pub tracks: Vec<Track>,
}

/// These as they are told, with what is left to do by these means.
#[must_use]
pub fn told(timestamp_us: i64, followed: &[Followed], means: Option<&Means>) -> TracksWire {
    let tracks =
        followed.iter().flat_map(|of| of.tracks.iter().map(|track| TrackWire::of(&of.target, track, means))).collect();
    TracksWire { timestamp_us, tracks }
}

impl Tracks {
    /// Where to look for the targets in the frame of this time: the part that holds all their tracks. Nothing where all of it has to be
    /// searched.
    #[must_use]
    pub fn region(&self, timestamp_us: i64, camera: &Camera, targets: &[Target]) -> Option<Region> {
        let stamp = stamp_of(timestamp_us);
        // Of a frame that is not younger than the last one, nothing is predicted.
        if self.last.is_none_or(|last| stamp <= last) {
            return None;
        }
        let stamp = stamp.saturating_add(self.shift);
        let part = |target: &Target| self.trackers.get(target.name())?.search(stamp, camera, target).region();
        let parts: Option<Vec<Region>> = targets.iter().map(part).collect();
        let region = parts?.into_iter().reduce(Region::with)?;
        let frame = f64::from(camera.width()) * f64::from(camera.height());
        (region.area() as f64 <= self.options.max_region_ratio * frame).then_some(region)
    }

    /// Whether all tracks that are believed were found again: at least as many answers as there are tracks of each target.
    #[must_use]
    pub fn are_found(&self, targets: &[Target], found: &[TargetEstimate]) -> bool {
        targets.iter().enumerate().all(|(place, target)| {
            let tracks = self.trackers.get(target.name()).map_or(0, |tracker| tracker.tracks().len());
            answers(place, found).count() >= tracks
        })
    }

    /// The frame of this time shows this of the targets. Nothing for a frame that is not younger than the last one.
    ///
    /// # Errors
    /// If a tracker cannot be made, which is our failure.
    pub fn step(
        &mut self,
        timestamp_us: i64,
        targets: &[Target],
        found: &[TargetEstimate],
        options: &TrackOptions,
    ) -> Result<Option<Vec<Followed>>, Fault> {
        let internal = |error: TrackError| Fault::new(FaultKind::Internal, error.to_string());
        let stamp = stamp_of(timestamp_us);
        match self.last {
            Some(last) if stamp.saturating_add(SET_BACK) < last => {
                self.shift = self.shift.saturating_add(last.saturating_sub(stamp)).saturating_add(PAUSE);
            }
            Some(last) if stamp <= last => return Ok(None),
            _ => {}
        }
        if self.options != *options {
            self.options = *options;
            for tracker in self.trackers.values_mut() {
                tracker.set_options(*options).map_err(internal)?;
            }
        }
        self.last = Some(stamp);
        let stamp = stamp.saturating_add(self.shift);
        if self.trackers.len() > MOST_TRACKERS {
            self.trackers.retain(|name, _| targets.iter().any(|target| target.name() == name));
        }
        let mut followed = Vec::with_capacity(targets.len());
        for (place, target) in targets.iter().enumerate() {
            let tracker = match self.trackers.entry(target.name().to_owned()) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(place) => place.insert(Tracker::new(*options).map_err(internal)?),
            };
            let report = tracker.step(stamp, answers(place, found)).map_err(internal)?;
            followed.push(Followed { target: target.name().to_owned(), tracks: report.tracks });
        }
        Ok(Some(followed))
    }
}

/// The poses of one of the targets.
fn answers(place: usize, found: &[TargetEstimate]) -> impl Iterator<Item = &PoseAnswer> {
    found.iter().filter(move |estimate| estimate.target == place).filter_map(|estimate| estimate.answer.as_ref().ok())
}

fn stamp_of(timestamp_us: i64) -> Duration {
    Duration::from_micros(u64::try_from(timestamp_us).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Pixel;
    use crate::geometry::{CameraFromTarget, Point, rotation};
    use crate::pose::{PoseOptions, estimate_pose};
    use crate::refine::Correspondence;
    use crate::scene::models::{demo_camera, wing};
    use crate::shell::wire::track::{LifeName, LossName};

    fn pose(time_s: f64) -> CameraFromTarget {
        let turn = rotation::exp(&nalgebra::Vector3::new(0.5, 0.2, 0.1));
        CameraFromTarget::new(turn, nalgebra::Vector3::new(0.3, 0.1, 9.0 - 2.0 * time_s))
    }

    /// What a frame shows of the wing that comes at 2 m/s.
    fn seen(wing: &Target, time_s: f64) -> TargetEstimate {
        let (camera, pose) = (demo_camera(), pose(time_s));
        let image = |point: &Point<_>| -> Pixel { camera.project(&(pose * *point)).expect("in view") };
        let pairs: Vec<Correspondence> = wing
            .markers()
            .iter()
            .map(|marker| Correspondence { point: marker.position, pixel: image(&marker.position), sigma_px: 0.05 })
            .collect();
        let answer = estimate_pose(&camera, &pairs, &PoseOptions::default());
        TargetEstimate { target: 0, centroid_of_marker: Vec::new(), answer }
    }

    #[test]
    fn a_target_is_confirmed_and_its_speed_told_and_late_frames_change_nothing() {
        let targets = [wing().target];
        let (mut tracks, options) = (Tracks::default(), TrackOptions::default());
        let at = |step: u32| 1_000_000_000 + i64::from(step) * 50_000;
        let mut told = None;
        for step in 0..30 {
            let found = [seen(&targets[0], f64::from(step) * 0.05)];
            told = tracks.step(at(step), &targets, &found, &options).expect("steps");
        }
        let told = super::told(at(29), &told.expect("younger"), None);
        let [track] = &told.tracks[..] else { panic!("{told:?}") };
        assert_eq!((track.life, track.seen_count, track.target.as_str()), (LifeName::Confirmed, 30, targets[0].name()));
        let speed = track.motion.closing_speed_mps.expect("told");
        assert!((speed.value - 2.0).abs() < 4.0 * speed.sigma.max(0.02), "{speed:?}");
        assert_eq!(tracks.step(at(29), &targets, &[], &options), Ok(None));
        let coasting = tracks.step(at(30), &targets, &[], &options).expect("steps").expect("younger");
        assert_eq!(super::told(at(30), &coasting, None).tracks[0].life, LifeName::Coasting);
        // The clock was set back: the old track ends, and a new one begins.
        let found = [seen(&targets[0], 0.0)];
        let again = tracks.step(1_000, &targets, &found, &options).expect("steps").expect("a beginning");
        let again = super::told(1_000, &again, None);
        let [ended, begun] = &again.tracks[..] else { panic!("{again:?}") };
        assert_eq!((ended.id, ended.life, ended.lost_because), (track.id, LifeName::Lost, Some(LossName::Gap)));
        assert_eq!((begun.seen_count, begun.id > ended.id), (1, true));
    }

    #[test]
    fn the_part_to_search_holds_all_targets_once_their_tracks_are_believed() {
        let targets = [wing().target];
        let camera = demo_camera();
        let (mut tracks, options) = (Tracks::default(), TrackOptions::default());
        let at = |step: u32| 1_000_000_000 + i64::from(step) * 50_000;
        let time_s = |step: u32| f64::from(step) * 0.05;
        let mut parts = 0;
        for step in 0..40 {
            let found = [seen(&targets[0], time_s(step))];
            if let Some(part) = tracks.region(at(step), &camera, &targets) {
                parts += 1;
                let pose = pose(time_s(step));
                for marker in targets[0].markers() {
                    let pixel = camera.project(&(pose * marker.position)).expect("in view");
                    let (right, bottom) = (f64::from(part.x + part.width), f64::from(part.y + part.height));
                    assert!(
                        pixel.x > f64::from(part.x)
                            && pixel.x < right
                            && pixel.y > f64::from(part.y)
                            && pixel.y < bottom
                    );
                }
                assert!(tracks.are_found(&targets, &found) && !tracks.are_found(&targets, &[]));
            }
            tracks.step(at(step), &targets, &found, &options).expect("steps");
        }
        // Until it is believed and its speed is known all is searched, and every tenth time.
        assert!((20..=36).contains(&parts), "{parts}");
        assert_eq!(tracks.region(at(39), &camera, &targets), None, "not younger than the last");
        assert_eq!(tracks.region(at(41), &camera, &[]), None);
        tracks.step(at(41), &targets, &[], &options).expect("steps");
        assert_eq!(tracks.region(at(42), &camera, &targets), None, "it was not seen");
    }

    #[test]
    fn other_options_hold_from_the_next_frame_on_and_tracks_keep_their_names() {
        let targets = [wing().target];
        let (mut tracks, options) = (Tracks::default(), TrackOptions::default());
        let found = [seen(&targets[0], 0.0)];
        let life = |told: Result<Option<Vec<Followed>>, Fault>| {
            let told = super::told(0, &told.expect("steps").expect("younger"), None);
            (told.tracks[0].id, told.tracks[0].life)
        };
        assert_eq!(life(tracks.step(1_000_000, &targets, &found, &options)), (0, LifeName::Tentative));
        let eager = TrackOptions { confirm_hits: 2, ..options };
        assert_eq!(life(tracks.step(1_050_000, &targets, &found, &eager)), (0, LifeName::Confirmed));
    }
}
