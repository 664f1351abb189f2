//! What our cameras have seen of others lately, and what they say together of one moment.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use nalgebra::{Vector3, Vector6};

use super::comparison::{Comparison, compare};
use super::mounts::{Mounts, Worn};
use super::options::SwarmOptions;
use super::view::{Candidate, Seen, View};
use crate::geometry::UncertainTransform;
use crate::geometry::space::{Body, Camera, Peer, Target};
use crate::track::{Hypothesis, Life, Track, TrackOptions};

/// Frames of a camera that are kept beyond those that may be compared: what another tells of a moment comes later than our own frame.
const KEPT_BEYOND: Duration = Duration::from_secs(2);

/// Most frames of a camera that are kept.
const MOST_KEPT: usize = 256;

/// What one frame has made of the tracks of a target.
#[derive(Clone, Debug, PartialEq)]
pub struct Sighting {
    /// When the frame was taken, since any epoch that all nodes share.
    pub stamp: Duration,
    /// The tracks, those that are not believed too.
    pub tracks: Vec<Track>,
    /// How they are kept.
    pub options: TrackOptions,
}

impl Sighting {
    /// The tracks that are believed.
    fn believed(&self) -> impl Iterator<Item = &Track> {
        self.tracks.iter().filter(|track| matches!(track.life(), Life::Confirmed | Life::Coasting))
    }
}

/// What our cameras have seen lately, by camera and target.
#[derive(Clone, Debug, Default)]
pub struct Sightings(BTreeMap<(String, String), VecDeque<Sighting>>);

/// What our cameras say of another body at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnView {
    /// What they say.
    pub view: View<Body, Peer>,
    /// Velocity of the other's origin along our axes, and its angular velocity about them; m/s and rad/s.
    pub rate: Vector6<f64>,
    /// How long before the moment the oldest frame behind it was taken.
    pub apart: Duration,
    /// How the cameras agree, where there is more than one.
    pub cameras: Option<Comparison<Body, Target>>,
}

/// Why our cameras say nothing of another body.
#[derive(Clone, Debug, PartialEq)]
pub enum NoView {
    /// None of them has seen it lately.
    Unseen,
    /// They contradict each other.
    Contradiction {
        /// How far they are apart.
        comparison: Box<Comparison<Body, Target>>,
        /// What each of them says.
        views: Vec<View<Body, Peer>>,
    },
}

/// What one camera says.
struct CameraView {
    view: View<Body, Target>,
    /// Velocity of the target's origin and angular velocity, along our axes.
    rate: [Vector3<f64>; 2],
    apart: Duration,
}

impl Sightings {
    /// A frame of one of our cameras. One that is not younger than the last means that its clock was set: what was kept is forgotten.
    pub fn add(&mut self, camera: &str, target: &str, sighting: Sighting, options: &SwarmOptions) {
        let kept = self.0.entry((camera.to_owned(), target.to_owned())).or_default();
        if kept.back().is_some_and(|last| sighting.stamp <= last.stamp) {
            kept.clear();
        }
        let oldest = sighting.stamp.saturating_sub(options.max_apart.saturating_add(KEPT_BEYOND));
        kept.push_back(sighting);
        while kept.len() > MOST_KEPT || kept.front().is_some_and(|first| first.stamp < oldest) {
            kept.pop_front();
        }
    }

    /// What our cameras say of the body of `peer` at `stamp`, each by its last frame before.
    ///
    /// # Errors
    /// [`NoView`] says why there is nothing.
    pub fn own_view(
        &self,
        mounts: &Mounts,
        peer: &str,
        stamp: Duration,
        options: &SwarmOptions,
    ) -> Result<OwnView, NoView> {
        let worn = mounts.peers.get(peer).ok_or(NoView::Unseen)?;
        let views: Vec<CameraView> = mounts
            .cameras
            .iter()
            .filter_map(|(camera, mount)| self.camera_view(camera, mount, &worn.target, stamp, options))
            .collect();
        let Some((first, others)) = views.split_first() else { return Err(NoView::Unseen) };
        let apart = views.iter().map(|view| view.apart).max().unwrap_or_default();
        let (mut of_target, mut cameras) = (first.view.clone(), None);
        if !others.is_empty() {
            let all: Vec<&View<Body, Target>> = views.iter().map(|view| &view.view).collect();
            let comparison = compare(&all, options).ok_or(NoView::Unseen)?;
            if !comparison.agrees() {
                let views = all.into_iter().map(|view| on_body(view, worn)).collect();
                return Err(NoView::Contradiction { comparison: Box::new(comparison), views });
            }
            of_target = View {
                cameras: all.iter().flat_map(|view| view.cameras.clone()).collect(),
                candidates: comparison
                    .fused
                    .iter()
                    .map(|fused| Candidate { seen: Seen::Along(fused.pose), probability: fused.probability })
                    .collect(),
            };
            cameras = Some(comparison);
        }
        let arm = of_target.candidates.first().map_or_else(Vector3::zeros, |best| {
            best.seen.along().transform.rotation * worn.peer_from_target.transform.inverse().translation
        });
        let [velocity, turning] = first.rate;
        let swing = velocity + turning.cross(&arm);
        let rate = Vector6::new(swing.x, swing.y, swing.z, turning.x, turning.y, turning.z);
        Ok(OwnView { view: on_body(&of_target, worn), rate, apart, cameras })
    }

    fn camera_view(
        &self,
        camera: &str,
        body_from_camera: &UncertainTransform<Body, Camera>,
        target: &str,
        stamp: Duration,
        options: &SwarmOptions,
    ) -> Option<CameraView> {
        let kept = self.0.get(&(camera.to_owned(), target.to_owned()))?;
        let sighting = kept.iter().rev().find(|sighting| sighting.stamp <= stamp)?;
        let apart = stamp.checked_sub(sighting.stamp).filter(|apart| *apart <= options.max_apart)?;
        let tracks: Vec<Vec<Hypothesis>> = sighting
            .believed()
            .map(|track| track.predicted(apart, &sighting.options))
            .filter(|hypotheses| !hypotheses.is_empty())
            .collect();
        // Where several wear the same target, any of the tracks may be of this one.
        let share = 1.0 / tracks.len() as f64;
        let turn = body_from_camera.transform.rotation;
        let best = &tracks.first()?.first()?.motion;
        let rate = [turn * best.velocity_mps(), turn * best.angular_velocity_radps()];
        let candidates = tracks.iter().flatten().map(|hypothesis| {
            let motion = &hypothesis.motion;
            let camera_from_target = UncertainTransform {
                transform: *motion.camera_from_target(),
                covariance: *motion.pose_covariance().matrix(),
            };
            let seen = Seen::Along(*body_from_camera * camera_from_target);
            Candidate { seen, probability: hypothesis.probability * share }
        });
        let view = View { cameras: vec![camera.to_owned()], candidates: candidates.collect() };
        Some(CameraView { view, rate, apart })
    }
}

/// What is seen of a target as what is seen of the body that wears it.
fn on_body(view: &View<Body, Target>, worn: &Worn) -> View<Body, Peer> {
    let target_from_peer = worn.peer_from_target.inverse();
    let candidate = |of_target: &Candidate<Body, Target>| Candidate {
        seen: Seen::Along(of_target.seen.along() * target_from_peer),
        probability: of_target.probability,
    };
    View { cameras: view.cameras.clone(), candidates: view.candidates.iter().map(candidate).collect() }
}

impl OwnView {
    /// Compares with what the other says of our body at the same moment. Its clock may differ from ours, which moves what we see along our
    /// rate. `None` where numbers end.
    #[must_use]
    pub fn compare(&self, other: &View<Body, Peer>, options: &SwarmOptions) -> Option<Comparison<Body, Peer>> {
        compare(&[&self.with_clock(options), other], options)
    }

    fn with_clock(&self, options: &SwarmOptions) -> View<Body, Peer> {
        let step = self.rate * options.clock_sigma.as_secs_f64();
        let by_clock = step * step.transpose();
        let mut view = self.view.clone();
        for candidate in &mut view.candidates {
            if let Seen::Along(seen) = &mut candidate.seen {
                seen.covariance += by_clock;
            }
        }
        view
    }
}
