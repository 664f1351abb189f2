//! One thing over time: where it is, how it moves of its own, and what its frames told of it.

use super::camera_motion::CameraMotion;
use super::candidate::{Candidate, Cues};

/// Where a track is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// Seen too seldom to be sure that it is one thing.
    Tentative,
    /// Seen often enough, and in this frame.
    Confirmed,
    /// Confirmed, and not seen in this frame.
    Coasting,
}

/// One thing over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Its number in the sequence, from 1.
    pub id: u32,
    /// The last that was seen of it, moved to where it is expected where it is not seen.
    pub seen: Candidate,
    /// Where it is, px.
    pub place: [f64; 2],
    /// How it moves against the scene, px a frame.
    pub velocity: [f64; 2],
    /// Variances of place and velocity and their covariance, the same along both axes.
    pub covariance: [f64; 3],
    /// Frames since its first.
    pub age: u32,
    /// Frames in which it was seen.
    pub hits: u32,
    /// Frames in a row in which it was not.
    pub misses: u32,
    /// Cues, the mean of late frames.
    pub cues: Cues,
    /// Where it would be if it belonged to the scene; it follows the thing slowly.
    pub anchor: [f64; 2],
    /// Mean square of late relative changes of its area: what flaps its wings flickers.
    pub flicker: f64,
    /// What speaks for the best other thing in its frame: [`score::compare`](super::score::compare).
    pub company: f64,
    /// How far the camera has moved lately, px: over it, the scene's own place is known the worse.
    pub camera_path: f64,
    area_ln: f64,
}

/// Frames over which means are taken.
const MEMORY: f64 = 12.0;
/// Frames over which the anchor follows.
const ANCHOR_MEMORY: f64 = 30.0;
/// Standard deviation of the acceleration, px a frame squared.
const AGILITY: f64 = 0.7;
/// Error of the camera's path, as a share of it.
const PATH_ERROR: f64 = 0.2;
/// Standard deviation of the first velocity, px a frame.
const FIRST_VELOCITY: f64 = 4.0;

impl Track {
    /// Its first frame.
    #[must_use]
    pub fn start(id: u32, seen: Candidate) -> Self {
        let spread = spread_px(&seen);
        Self {
            id,
            seen,
            place: seen.place,
            velocity: [0.0; 2],
            covariance: [spread * spread, 0.0, FIRST_VELOCITY * FIRST_VELOCITY],
            age: 1,
            hits: 1,
            misses: 0,
            cues: seen.cues,
            anchor: seen.place,
            flicker: 0.0,
            company: 0.0,
            camera_path: 0.0,
            area_ln: seen.area_px.max(1.0).ln(),
        }
    }

    /// Where it is in its life.
    #[must_use]
    pub const fn phase(&self) -> Phase {
        match (self.hits, self.misses) {
            (0..3, _) => Phase::Tentative,
            (_, 0) => Phase::Confirmed,
            _ => Phase::Coasting,
        }
    }

    /// Whether nothing is to be expected of it any more.
    #[must_use]
    pub fn is_lost(&self, frame: [f64; 2]) -> bool {
        let patience = if self.hits < 3 { 1 } else { (self.hits / 2).clamp(2, 12) };
        let is_outside = (0..2).any(|axis| self.place[axis] < -2.0 || self.place[axis] > frame[axis] + 2.0);
        self.misses > patience || (is_outside && self.misses > 0)
    }

    /// Moves on by a frame: with the scene, and of its own.
    pub fn predict(&mut self, motion: &CameraMotion, middle: [f64; 2]) {
        let moved = |place: [f64; 2]| {
            let [x, y] = motion.invert([place[0] - middle[0], place[1] - middle[1]]);
            [x + middle[0], y + middle[1]]
        };
        let before = self.place;
        self.camera_path += motion.shift_px[0].hypot(motion.shift_px[1]) - self.camera_path / ANCHOR_MEMORY;
        self.anchor = moved(self.anchor);
        self.place = moved(self.place);
        for (axis, before) in before.into_iter().enumerate() {
            self.place[axis] += self.velocity[axis];
            let shift = self.place[axis] - before;
            self.seen.place[axis] += shift;
            self.seen.bounds[axis] += shift;
            self.seen.bounds[axis + 2] += shift;
        }
        let [place, cross, speed] = self.covariance;
        let q = AGILITY * AGILITY;
        self.covariance = [place + 2.0 * cross + speed + 0.25 * q, cross + speed + 0.5 * q, speed + q];
        self.age += 1;
    }

    /// How badly a candidate fits; none if it cannot be the same.
    #[must_use]
    pub fn misfit(&self, candidate: &Candidate) -> Option<f64> {
        let away = (candidate.place[0] - self.place[0]).hypot(candidate.place[1] - self.place[1]);
        let spread = spread_px(candidate).max(spread_px(&self.seen));
        let sigma = (self.covariance[0] + spread * spread).sqrt();
        if away > 3.0 * sigma + 2.0 {
            return None;
        }
        let growth = f64::from(candidate.cues.size_ln - self.seen.cues.size_ln).abs();
        if growth > 2.2 {
            return None;
        }
        let fade = f64::from(candidate.cues.contrast_ln - self.cues.contrast_ln).abs();
        let flip = if candidate.is_bright == self.seen.is_bright { 0.0 } else { 1.0 };
        Some((away / sigma).powi(2) + 2.0 * growth * growth + 0.5 * fade * fade + 3.0 * flip)
    }

    /// How far from its place it may be, px.
    #[must_use]
    pub fn reach_px(&self) -> f64 {
        let spread = spread_px(&self.seen);
        3.0 * (self.covariance[0] + spread * spread).sqrt()
    }

    /// It is seen in this frame.
    pub fn update(&mut self, candidate: &Candidate) {
        let spread = spread_px(candidate);
        let [place, cross, speed] = self.covariance;
        let total = place + spread * spread;
        let (gain, speed_gain) = (place / total, cross / total);
        for axis in 0..2 {
            let residual = candidate.place[axis] - self.place[axis];
            self.place[axis] += gain * residual;
            self.velocity[axis] += speed_gain * residual;
        }
        self.covariance = [(1.0 - gain) * place, (1.0 - gain) * cross, speed - speed_gain * cross];
        self.hits += 1;
        self.misses = 0;
        let rate = 1.0 / f64::from(self.hits).min(MEMORY);
        if self.hits > 2 {
            let area_ln = candidate.area_px.max(1.0).ln();
            self.flicker += rate * ((area_ln - self.area_ln).powi(2) - self.flicker);
        }
        self.area_ln = candidate.area_px.max(1.0).ln();
        let (mut mean, new) = (self.cues.numbers(), candidate.cues.numbers());
        #[expect(clippy::cast_possible_truncation, reason = "a rate from 0 to 1")]
        mean.iter_mut().zip(new).for_each(|(mean, new)| *mean += rate as f32 * (new - *mean));
        self.cues = Cues::of_numbers(mean);
        self.seen = *candidate;
        self.follow();
    }

    /// It is not seen in this frame.
    pub fn miss(&mut self) {
        self.misses += 1;
        self.follow();
    }

    fn follow(&mut self) {
        for axis in 0..2 {
            self.anchor[axis] += (self.place[axis] - self.anchor[axis]) / ANCHOR_MEMORY;
        }
    }

    /// How far it has come of its own lately, in units of what the camera's motion leaves uncertain.
    #[must_use]
    pub fn drift_ratio(&self) -> f64 {
        self.drift_px() / (1.0 + PATH_ERROR * self.camera_path)
    }

    /// How far it has come of its own lately, px.
    #[must_use]
    pub fn drift_px(&self) -> f64 {
        (self.place[0] - self.anchor[0]).hypot(self.place[1] - self.anchor[1])
    }
}

/// Standard deviation of a candidate's place: blur and pixels, and a share of its size, as parts of it light up.
#[must_use]
pub fn spread_px(candidate: &Candidate) -> f64 {
    0.4 + 0.12 * f64::from(candidate.cues.size_ln).exp()
}
