//! Estimates over time to tracks: where each target is, how it moves, whether it comes nearer and when.
//!
//! # How it works
//!
//! One [`Tracker`] follows one target through one camera, several instances of it if several are seen. Every frame goes through
//! [`Tracker::step`], also one in which nothing is seen.
//!
//! *Motion.* A [`Motion`] is a pose with a velocity and an angular velocity, both along the camera's axes, and their joint
//! covariance: an error-state Kalman filter of twelve numbers on SE(3) with constant velocities and white accelerations
//! (Bar-Shalom, Li and Kirubarajan 2001; Sola 2017). The error is that of the rest of the project,
//! `(t_true - t, Log(R_true R^T))`. It is the motion against the camera: a camera that turns makes everything turn.
//!
//! *Flips.* A flat target has two attitudes that look nearly alike, and noise decides which of them a single frame calls best. A
//! track keeps a few [`Hypothesis`]es, each a motion with a probability: every answer multiplies all its poses with all hypotheses
//! (a Gaussian sum: Alspach and Sorenson, "Nonlinear Bayesian estimation using Gaussian sum approximations", 1972). The right
//! attitude gathers evidence frame by frame, and moves as a body moves, while the mirrored one does neither.
//!
//! *Which answer is of which track* is decided by position, all answers with all tracks together (global nearest neighbour within
//! a chi-square gate), confirmed tracks first. What no track takes begins a tentative one.
//!
//! *Covariances that are not reliable* (see [`PoseEstimate`](crate::pose::PoseEstimate)) are counted with at twice their variance,
//! so that a track does not grow surer of itself than bent errors allow.
//!
//! # What it rests on
//!
//! Noise of the pixels that is new in every frame. Where camera or marker places are wrong, every frame errs the same way and time
//! does not help: a bias of a third of the noise costs little, one larger than the noise leaves two thirds of the flips and makes
//! the covariances too small by half. State such errors in the centroids' deviations, and calibrate.
//!
//! # What it must not be fed
//!
//! [`Tracker::prior`] offers the predicted pose as a [`PosePrior`], for identification or for an answer to a single frame. An answer
//! that was made with it already contains what the track knows: given back to [`Tracker::step`] it would be counted twice. Step
//! with the answer from before [`PoseAnswer::given`]. The region of [`Tracker::search`] is no such danger.

mod approach;
mod assignment;
mod life;
mod measured;
mod merge;
mod mixture;
mod motion;
mod options;
mod process_noise;
mod search;
mod update;

use std::time::Duration;

use arrayvec::ArrayVec;

use crate::camera::Camera;
use crate::pose::{PoseAnswer, PosePrior};
use crate::target::Target;
use measured::{MAX_POSES, Measured};

pub use approach::{ClosestApproach, NoApproach, Uncertain};
pub use life::{Life, Loss, Track, TrackId};
pub use mixture::Hypothesis;
pub use motion::Motion;
pub use options::{TrackError, TrackOptions};
pub use search::{FullReason, Search};

/// Follows one target through one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracker {
    options: TrackOptions,
    tracks: Vec<Track>,
    /// Stamp of the last frame.
    last: Option<Duration>,
    /// Frames so far.
    frames: u64,
    next_id: u64,
}

/// What one frame has made of the tracks.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Stamp of the frame.
    pub stamp: Duration,
    /// All tracks, those that ended with this frame included, by rising name.
    pub tracks: Vec<Track>,
    /// For each answer the track that took it; `None` if none did and none was begun.
    pub track_of_answer: Vec<Option<TrackId>>,
}

impl Report {
    /// The tracks that are believed: confirmed or coasting.
    pub fn believed(&self) -> impl Iterator<Item = &Track> {
        self.tracks.iter().filter(|track| matches!(track.life(), Life::Confirmed | Life::Coasting))
    }
}

impl Tracker {
    /// A tracker that has seen nothing.
    ///
    /// # Errors
    /// [`TrackError::Option`] if an option makes no sense.
    pub fn new(options: TrackOptions) -> Result<Self, TrackError> {
        Ok(Self { options: options.checked()?, tracks: Vec::new(), last: None, frames: 0, next_id: 0 })
    }

    /// Other options from the next frame on. Tracks go on.
    ///
    /// # Errors
    /// [`TrackError::Option`] if an option makes no sense; the old ones hold then.
    pub fn set_options(&mut self, options: TrackOptions) -> Result<(), TrackError> {
        self.options = options.checked()?;
        Ok(())
    }

    /// One frame: all answers for the target at `stamp`, a time since any epoch. None at all is a frame in which it was not
    /// seen; an `Option<&PoseAnswer>` does for at most one instance.
    ///
    /// # Errors
    /// [`TrackError::StampNotAfter`] for a frame that is not after the last; nothing has changed then.
    pub fn step<'a>(
        &mut self,
        stamp: Duration,
        answers: impl IntoIterator<Item = &'a PoseAnswer>,
    ) -> Result<Report, TrackError> {
        let dt = match self.last {
            None => Duration::ZERO,
            Some(last) => stamp
                .checked_sub(last)
                .filter(|dt| !dt.is_zero())
                .ok_or(TrackError::StampNotAfter { stamp_s: stamp.as_secs_f64(), last_s: last.as_secs_f64() })?,
        };
        self.last = Some(stamp);
        self.frames = self.frames.wrapping_add(1);
        let answers: Vec<ArrayVec<Measured, MAX_POSES>> =
            answers.into_iter().map(|answer| measured::measured(answer, &self.options)).collect();
        if dt > self.options.max_gap {
            let (gap_s, limit_s) = (dt.as_secs_f64(), self.options.max_gap.as_secs_f64());
            self.tracks.iter_mut().for_each(|track| track.lose(Loss::Gap { gap_s, limit_s }));
        } else {
            self.tracks.iter_mut().for_each(|track| track.advance(dt.as_secs_f64(), &self.options));
        }
        let mut track_of_answer = vec![None; answers.len()];
        for is_believed in [true, false] {
            self.see(&answers, &mut track_of_answer, is_believed, stamp);
        }
        self.begin(&answers, &mut track_of_answer, stamp);
        self.tracks.iter_mut().for_each(|track| track.age(stamp, &self.options));
        let tracks = self.tracks.clone();
        self.tracks.retain(|track| !track.is_lost());
        Ok(Report { stamp, tracks, track_of_answer })
    }

    /// Gives the free answers to the tracks that are believed, or to those that are not.
    fn see(
        &mut self,
        answers: &[ArrayVec<Measured, MAX_POSES>],
        track_of_answer: &mut [Option<TrackId>],
        is_believed: bool,
        stamp: Duration,
    ) {
        let options = &self.options;
        let mut waiting: Vec<&mut Track> =
            self.tracks.iter_mut().filter(|track| !track.is_lost() && track.is_believed() == is_believed).collect();
        let costs: Vec<Vec<Option<f64>>> = waiting
            .iter()
            .map(|track| {
                let cost = |(poses, taken): (&ArrayVec<Measured, MAX_POSES>, &Option<TrackId>)| match taken {
                    Some(_) => None,
                    None => track.mixture().ln_place_density(poses, options).map(|ln| -ln),
                };
                answers.iter().zip(&*track_of_answer).map(cost).collect()
            })
            .collect();
        for (track, answer) in waiting.iter_mut().zip(assignment::assign(&costs, answers.len())) {
            let Some(answer) = answer else { continue };
            if let Some(mixture) = track.mixture().updated(&answers[answer], options) {
                track.see(mixture, answer, stamp, options);
                track_of_answer[answer] = Some(track.id());
            }
        }
    }

    /// Begins a track with every answer that none took, while there is room.
    fn begin(
        &mut self,
        answers: &[ArrayVec<Measured, MAX_POSES>],
        track_of_answer: &mut [Option<TrackId>],
        stamp: Duration,
    ) {
        for (answer, (poses, taken)) in answers.iter().zip(track_of_answer).enumerate() {
            let living = self.tracks.iter().filter(|track| !track.is_lost()).count();
            if taken.is_some() || living >= self.options.max_tracks {
                continue;
            }
            if let Some(mixture) = mixture::Mixture::born(poses, &self.options) {
                let id = TrackId(self.next_id);
                self.next_id += 1;
                self.tracks.push(Track::begun(id, mixture, answer, stamp, &self.options));
                *taken = Some(id);
            }
        }
    }

    /// The tracks that live, as of the last frame.
    #[must_use]
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// Where to look in the next frame, expected at `stamp`: the part of the picture that holds every track, all hypotheses
    /// included, or the whole frame with the reason why. One full search in
    /// [`full_search_every`](TrackOptions::full_search_every) frames finds new targets.
    #[must_use]
    pub fn search(&self, stamp: Duration, camera: &Camera, target: &Target) -> Search {
        let every = self.options.full_search_every;
        if !self.tracks.is_empty() && self.frames.is_multiple_of(u64::from(every)) {
            return Search::Full(FullReason::Schedule { every });
        }
        search::search(&self.tracks, self.ahead_s(stamp), camera, target, &self.options)
    }

    /// The hypotheses of a track at `stamp`, by falling probability; those of the last frame for a stamp before it. Empty for a
    /// track that is not, or is beyond telling by then.
    #[must_use]
    pub fn predicted(&self, id: TrackId, stamp: Duration) -> Vec<Hypothesis> {
        let track = self.tracks.iter().find(|track| track.id() == id);
        let later = track.and_then(|track| track.mixture().predicted(self.ahead_s(stamp), &self.options));
        later.map(|mixture| mixture.hypotheses().to_vec()).unwrap_or_default()
    }

    /// The most probable predicted pose of a track as a prior for a frame at `stamp`. Never step with an answer that was made
    /// with it: see the [room](self)'s warning.
    #[must_use]
    pub fn prior(&self, id: TrackId, stamp: Duration) -> Option<PosePrior> {
        let motion = self.predicted(id, stamp).first()?.motion;
        let predicted = Some((*motion.camera_from_target(), *motion.pose_covariance()));
        Some(PosePrior { predicted, ..PosePrior::default() })
    }

    fn ahead_s(&self, stamp: Duration) -> f64 {
        self.last.map_or(0.0, |last| stamp.saturating_sub(last).min(self.options.max_gap).as_secs_f64())
    }
}

#[cfg(test)]
mod tests;
