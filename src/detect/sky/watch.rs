//! The state machine of a sequence: frame by frame, what is in the sky.

use super::camera_motion::{Aligner, CameraMotion};
use super::candidate::{Candidate, Finder};
use super::change::Change;
use super::level::{Level, STEPS};
use super::track::Track;

/// Most levels: the coarsest has 1/16 of the frame's width, where a thing of 200 px is 12.
const MOST_LEVELS: usize = 5;
/// A level is no smaller than this, px.
const LEAST_SIDE: usize = 24;
/// The level on which scenes are compared.
const COARSE: usize = 4;
/// A frame of which more than this share is new is of another scene.
const CUT_RATIO: f32 = 0.35;
/// Most tracks at a time.
const MOST_TRACKS: usize = 64;

/// What is in the sky, frame by frame.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    size: [usize; 2],
    levels: Vec<Level>,
    before: Vec<Level>,
    finder: Finder,
    aligner: Aligner,
    change: Change,
    motion: CameraMotion,
    candidates: Vec<Candidate>,
    tracks: Vec<Track>,
    pairs: Vec<(f64, usize, usize)>,
    taken: Vec<bool>,
    matched: Vec<bool>,
    next_id: u32,
    frames: u64,
    scene: f32,
}

impl Watch {
    /// Before the first frame.
    #[must_use]
    pub fn new() -> Self {
        Self { next_id: 1, ..Self::default() }
    }

    /// The next frame's luma.
    pub fn observe_luma(&mut self, samples: &[u8], width: usize, height: usize) {
        if self.size != [width, height] {
            self.size = [width, height];
            self.frames = 0;
            self.tracks.clear();
            self.change.reset();
        }
        std::mem::swap(&mut self.levels, &mut self.before);
        self.fill(samples, width, height);
        self.finder.take(&self.levels);
        let index = usize::from(self.levels.len() > 1);
        let motion = if self.frames > 0 {
            self.motion = self.aligner.align(&self.levels, &self.finder.cells, &self.before, self.motion);
            Some(self.motion)
        } else {
            None
        };
        self.scene = if motion.is_some() { self.scene_change() } else { 0.0 };
        let is_cut = self.scene > CUT_RATIO;
        let motion = motion.filter(|_| !is_cut);
        if is_cut {
            self.motion = CameraMotion::default();
            self.tracks.clear();
        }
        let known = self.change.is_known() && motion.is_some();
        self.change.take(&self.levels[index], index, self.size, motion);
        let moving = known.then_some(self.change.moving.as_slice());
        self.finder.find(&self.levels, moving, index, &mut self.candidates);
        self.associate();
        self.frames += 1;
    }

    /// How much of the coarse picture is not that of the frame before: its mean difference, as a share of its mean deviation.
    #[must_use]
    pub fn scene_change(&self) -> f32 {
        let index = COARSE.min(self.levels.len() - 1);
        let (new, before) = (&self.levels[index], &self.before[index]);
        let scale = f64::from(1_u32 << index);
        let middle = self.size.map(|side| 0.5 * side as f64);
        let (mut sums, mut count) = ([0.0_f32; 2], 0.0_f32);
        let mut pairs = |each: &mut dyn FnMut(f32, f32)| {
            for y in 0..new.height {
                for x in 0..new.width {
                    let place = [(x as f64 + 0.5) * scale - middle[0], (y as f64 + 0.5) * scale - middle[1]];
                    let [u, v] = self.motion.apply(place);
                    let (u, v) = (((u + middle[0]) / scale).floor(), ((v + middle[1]) / scale).floor());
                    if u >= 0.0 && v >= 0.0 && u < new.width as f64 && v < new.height as f64 {
                        let at = v as usize * new.width + u as usize;
                        each(f32::from(new.smooth[y * new.width + x]), f32::from(before.smooth[at]));
                    }
                }
            }
        };
        pairs(&mut |a, b| {
            sums[0] += a;
            sums[1] += b;
            count += 1.0;
        });
        let [mean, mean_before] = sums.map(|sum| sum / count.max(1.0));
        let (mut changed, mut spread) = (0.0, 0.0);
        pairs(&mut |a, b| {
            changed += ((a - mean) - (b - mean_before)).abs();
            spread += (a - mean).abs().max((b - mean_before).abs());
        });
        (changed + 0.5 * count * (mean - mean_before).abs()) / (spread + 6.0 * STEPS * count)
    }

    fn fill(&mut self, samples: &[u8], width: usize, height: usize) {
        let side = width.min(height);
        let count = (0..MOST_LEVELS).take_while(|index| *index == 0 || side >> index >= LEAST_SIDE).count();
        self.levels.resize_with(count, Level::default);
        self.levels[0].take_frame(samples, width, height);
        for index in 1..count {
            let (below, above) = self.levels.split_at_mut(index);
            above[0].take_half(&below[index - 1]);
        }
    }

    fn associate(&mut self) {
        let frame = self.size.map(|side| side as f64);
        let middle = frame.map(|side| 0.5 * side);
        for track in &mut self.tracks {
            track.predict(&self.motion, middle);
        }
        self.pairs.clear();
        for (t, track) in self.tracks.iter().enumerate() {
            for (c, candidate) in self.candidates.iter().enumerate() {
                if let Some(misfit) = track.misfit(candidate) {
                    // An old track has the first say.
                    let youth = if track.hits < 3 { 4.0 } else { 0.0 };
                    self.pairs.push((misfit + youth, t, c));
                }
            }
        }
        self.pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        self.taken.clear();
        self.taken.resize(self.candidates.len(), false);
        self.matched.clear();
        self.matched.resize(self.tracks.len(), false);
        for (_, t, c) in &self.pairs {
            if !self.matched[*t] && !self.taken[*c] {
                self.matched[*t] = true;
                self.taken[*c] = true;
                self.tracks[*t].update(&self.candidates[*c]);
            }
        }
        for (track, matched) in self.tracks.iter_mut().zip(&self.matched) {
            if !matched {
                track.miss();
            }
        }
        self.tracks.retain(|track| !track.is_lost(frame));
        for (candidate, taken) in self.candidates.iter().zip(&self.taken) {
            if !taken && self.tracks.len() < MOST_TRACKS {
                self.tracks.push(Track::start(self.next_id, *candidate));
                self.next_id += 1;
            }
        }
    }

    /// How much of the last frame was new.
    #[must_use]
    pub const fn last_change(&self) -> f32 {
        self.scene
    }

    /// The tracks.
    #[must_use]
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// The camera's motion since the frame before.
    #[must_use]
    pub const fn camera_motion(&self) -> CameraMotion {
        self.motion
    }

    /// Candidates of the last frame.
    #[must_use]
    pub fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }
}
