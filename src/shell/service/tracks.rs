//! What is followed in the frames of one camera: a tracker for each of its targets.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::time::Duration;

use crate::pipeline::TargetEstimate;
use crate::pose::PoseAnswer;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::track::{TrackWire, TracksWire};
use crate::target::Target;
use crate::track::{TrackOptions, Tracker};

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
}

impl Tracks {
    /// The frame of this time shows this of the targets. Nothing for a frame that is not younger than the last one.
    ///
    /// # Errors
    /// If a tracker cannot be made, which is our failure.
    pub fn step(
        &mut self,
        timestamp_us: i64,
        targets: &[Target],
        found: &[TargetEstimate],
    ) -> Result<Option<TracksWire>, Fault> {
        let internal = |error: crate::track::TrackError| Fault::new(FaultKind::Internal, error.to_string());
        let stamp = Duration::from_micros(u64::try_from(timestamp_us).unwrap_or(0));
        match self.last {
            Some(last) if stamp.saturating_add(SET_BACK) < last => {
                self.shift = self.shift.saturating_add(last.saturating_sub(stamp)).saturating_add(PAUSE);
            }
            Some(last) if stamp <= last => return Ok(None),
            _ => {}
        }
        self.last = Some(stamp);
        let stamp = stamp.saturating_add(self.shift);
        if self.trackers.len() > MOST_TRACKERS {
            self.trackers.retain(|name, _| targets.iter().any(|target| target.name() == name));
        }
        let mut tracks = Vec::new();
        for (place, target) in targets.iter().enumerate() {
            let tracker = match self.trackers.entry(target.name().to_owned()) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(place) => place.insert(Tracker::new(TrackOptions::default()).map_err(internal)?),
            };
            let answers: Vec<&PoseAnswer> = found
                .iter()
                .filter(|estimate| estimate.target == place)
                .filter_map(|estimate| estimate.answer.as_ref().ok())
                .collect();
            let report = tracker.step(stamp, answers).map_err(internal)?;
            tracks.extend(report.tracks.iter().map(|track| TrackWire::of(target.name(), track)));
        }
        Ok(Some(TracksWire { timestamp_us, tracks }))
    }
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

    /// What a frame shows of the wing that comes at 2 m/s.
    fn seen(wing: &Target, time_s: f64) -> TargetEstimate {
        let camera = demo_camera();
        let turn = rotation::exp(&nalgebra::Vector3::new(0.5, 0.2, 0.1));
        let pose = CameraFromTarget::new(turn, nalgebra::Vector3::new(0.3, 0.1, 9.0 - 2.0 * time_s));
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
        let mut tracks = Tracks::default();
        let at = |step: u32| 1_000_000_000 + i64::from(step) * 50_000;
        let mut told = None;
        for step in 0..30 {
            let found = [seen(&targets[0], f64::from(step) * 0.05)];
            told = tracks.step(at(step), &targets, &found).expect("steps");
        }
        let told = told.expect("younger");
        let [track] = &told.tracks[..] else { panic!("{told:?}") };
        assert_eq!((track.life, track.seen_count, track.target.as_str()), (LifeName::Confirmed, 30, targets[0].name()));
        let speed = track.motion.closing_speed_mps.expect("told");
        assert!((speed.value - 2.0).abs() < 4.0 * speed.sigma.max(0.02), "{speed:?}");
        assert_eq!(tracks.step(at(29), &targets, &[]), Ok(None));
        let coasting = tracks.step(at(30), &targets, &[]).expect("steps").expect("younger");
        assert_eq!(coasting.tracks[0].life, LifeName::Coasting);
        // The clock was set back: the old track ends, and a new one begins.
        let again = tracks.step(1_000, &targets, &[seen(&targets[0], 0.0)]).expect("steps").expect("a beginning");
        let [ended, begun] = &again.tracks[..] else { panic!("{again:?}") };
        assert_eq!((ended.id, ended.life, ended.lost_because), (track.id, LifeName::Lost, Some(LossName::Gap)));
        assert_eq!((begun.seen_count, begun.id > ended.id), (1, true));
    }
}
