//! All tracks of a sequence: which candidate is which, what is looked for again, what is lost and what is new.

use super::camera_motion::CameraMotion;
use super::candidate::Candidate;
use super::finder::{Finder, Shown};
use super::score;
use super::track::Track;

/// Most tracks at a time.
const MOST_TRACKS: usize = 96;
/// A track that was seen so often is looked for where it is expected.
const LEAST_HITS: u32 = 5;

/// The tracks; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Bank {
    tracks: Vec<Track>,
    pairs: Vec<(f64, usize, usize)>,
    taken: Vec<bool>,
    matched: Vec<bool>,
    last_id: u32,
}

impl Bank {
    /// Every track.
    #[must_use]
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// None any more; their numbers are not used again.
    pub fn clear(&mut self) {
        self.tracks.clear();
    }

    /// The next frame: the camera's motion spans it and those that are missing before it.
    pub fn follow(
        &mut self,
        candidates: &[Candidate],
        finder: &Finder,
        shown: Shown<'_>,
        motion: &CameraMotion,
        missing: u64,
    ) {
        let frame = shown.size().map(|side| side as f64);
        let middle = frame.map(|side| 0.5 * side);
        for track in &mut self.tracks {
            track.predict(motion, middle);
            (0..missing).for_each(|_| track.predict(&CameraMotion::default(), middle));
        }
        self.assign(candidates);
        self.look_again(candidates, finder, shown);
        self.tracks.retain(|track| !track.is_lost(frame));
        for (candidate, taken) in candidates.iter().zip(&self.taken) {
            if !taken && self.tracks.len() < MOST_TRACKS {
                self.last_id = self.last_id.wrapping_add(1);
                self.tracks.push(Track::start(self.last_id, *candidate));
            }
        }
        score::compare(&mut self.tracks);
    }

    /// Each candidate to the track that it fits best.
    fn assign(&mut self, candidates: &[Candidate]) {
        self.pairs.clear();
        for (t, track) in self.tracks.iter().enumerate() {
            for (c, candidate) in candidates.iter().enumerate() {
                if let Some(misfit) = track.misfit(candidate) {
                    // An old track has the first say.
                    let youth = if track.hits < 3 { 4.0 } else { 0.0 };
                    self.pairs.push((misfit + youth, t, c));
                }
            }
        }
        self.pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        self.taken.clear();
        self.taken.resize(candidates.len(), false);
        self.matched.clear();
        self.matched.resize(self.tracks.len(), false);
        for (_, t, c) in &self.pairs {
            if !self.matched[*t] && !self.taken[*c] {
                self.matched[*t] = true;
                self.taken[*c] = true;
                self.tracks[*t].update(&candidates[*c]);
            }
        }
    }

    /// What is known is looked for where it is expected, even if other places of the frame stand out more.
    fn look_again(&mut self, candidates: &[Candidate], finder: &Finder, shown: Shown<'_>) {
        for (track, matched) in self.tracks.iter_mut().zip(&self.matched) {
            if *matched {
                continue;
            }
            let is_other = |again: &Candidate| {
                let others = candidates.iter().zip(&self.taken).filter(|(_, taken)| **taken);
                others.into_iter().any(|(other, _)| other.holds(again.place) || again.holds(other.place))
            };
            let again = if track.hits < LEAST_HITS { None } else { finder.again(shown, track) };
            match again.filter(|again| track.misfit(again).is_some() && !is_other(again)) {
                Some(again) => track.update(&again),
                None => track.miss(),
            }
        }
    }
}
