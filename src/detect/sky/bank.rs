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
    again: Vec<Candidate>,
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
        self.again.clear();
        for (track, matched) in self.tracks.iter_mut().zip(&self.matched) {
            if *matched {
                continue;
            }
            let again = if track.hits < LEAST_HITS { None } else { finder.again(shown, track) };
            let again = again.filter(|again| track.misfit(again).is_some());
            // What another track has is no second thing.
            let others = candidates.iter().zip(&self.taken).filter_map(|(other, taken)| taken.then_some(other));
            let mut others = others.chain(&self.again);
            match again.filter(|again| !others.any(|other| other.holds(again.place) || again.holds(other.place))) {
                Some(again) => {
                    track.update(&again);
                    self.again.push(again);
                }
                None => track.miss(),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::sky::level::Level;

    #[test]
    fn two_tracks_of_which_one_is_left_do_not_both_find_it_again() {
        // A dark dot in an even frame.
        let (width, height) = (96, 96);
        let mut samples = vec![150_u8; width * height];
        for (x, y) in [(47, 48), (48, 47), (48, 48), (48, 49), (49, 48)] {
            samples[y * width + x] = 40;
        }
        let mut level = Level::default();
        level.take_frame(&samples, width, height);
        let levels = [level];
        let mut finder = Finder::default();
        finder.take(&levels);
        let shown = Shown { levels: &levels, moving: None, moving_level: 0 };
        let mut found = Vec::new();
        finder.find(shown, &mut found);
        let dot = *found.first().expect("it stands out");
        let mut bank = Bank::default();
        for (id, shift) in [(1, -1.0), (2, 1.0)] {
            let mut track = Track::start(id, Candidate { place: [dot.place[0] + shift, dot.place[1]], ..dot });
            track.hits = LEAST_HITS;
            bank.tracks.push(track);
        }
        // Nothing of this frame is a candidate.
        bank.follow(&[], &finder, shown, &CameraMotion::default(), 0);
        let seen = bank.tracks().iter().filter(|track| track.misses == 0).count();
        assert_eq!(seen, 1, "{:?}", bank.tracks());
        // And where nothing is, nothing is found again.
        let mut empty = Level::default();
        empty.take_frame(&vec![150; width * height], width, height);
        let levels = [empty];
        finder.take(&levels);
        let shown = Shown { levels: &levels, moving: None, moving_level: 0 };
        bank.follow(&[], &finder, shown, &CameraMotion::default(), 0);
        assert!(bank.tracks().iter().all(|track| track.misses > 0));
    }
}
