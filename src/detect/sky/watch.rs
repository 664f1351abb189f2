//! The state machine of a sequence: frame by frame, what is in the sky.

use super::bank::Bank;
use super::camera_motion::{Aligner, CameraMotion};
use super::candidate::Candidate;
use super::change::Change;
use super::finder::{Finder, Shown};
use super::level::Level;
use super::measure::Measurer;
use super::scene_change::scene_change;
use super::track::Track;
use crate::detect::Centroid;
use crate::frame::Region;

/// Most levels: the coarsest has 1/16 of the frame's width, where a thing of 200 px is 12.
const MOST_LEVELS: usize = 5;
/// A level is no smaller than this, px.
const LEAST_SIDE: usize = 24;
/// A frame of which more than this share is new is of another scene. Cuts have 0.5 and more, moving cameras 0.2 and less.
const CUT_RATIO: f32 = 0.35;
/// Frames that may be missing; over more, a thing is not found again by where it was.
pub const MOST_MISSING: u64 = 3;
/// Longest time from frame to frame, us.
pub const MOST_SPAN_US: i64 = 500_000;

/// Which frame of a sequence it is, as far as that is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stamp {
    /// Its number. Frames without one follow each other.
    pub index: Option<u64>,
    /// When it was taken, us.
    pub timestamp_us: Option<i64>,
}

/// Why a frame is the first of its tracks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Beginning {
    /// It is the first.
    First,
    /// Frames or time are missing before it, or it comes from earlier.
    Gap,
    /// It has another size than the one before, or another part of it is looked at.
    Resized,
    /// It shows another scene.
    Cut,
}

impl Beginning {
    /// The contract's word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::First => "first",
            Self::Gap => "gap",
            Self::Resized => "resized",
            Self::Cut => "cut",
        }
    }
}

/// What is in the sky, frame by frame. It keeps its memory: in steady state a frame takes none but for what is
/// reported of it.
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
    bank: Bank,
    last: Option<Stamp>,
    beginning: Option<Beginning>,
    /// The part of the frame that is looked at.
    part: Option<Region>,
    /// Luma of a frame that is stored otherwise.
    pub(super) samples: Vec<u8>,
    /// What measures the things that are reported, and what is reported of a frame.
    pub(super) measurer: Measurer,
    pub(super) reported: Vec<Centroid>,
}

impl Watch {
    /// Before the first frame.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Before the first frame again, with nothing of what was seen but its memory.
    pub fn forget(&mut self) {
        (self.last, self.part, self.beginning) = (None, None, None);
        self.motion = CameraMotion::default();
        self.candidates.clear();
        self.bank.clear();
    }

    /// The next frame's luma, rows without padding. Fewer samples than the size asks for are no frame, and change nothing.
    pub fn observe_luma(&mut self, samples: &[u8], [width, height]: [usize; 2], stamp: Stamp) {
        if samples.is_empty() || samples.len() < width * height {
            return;
        }
        let missing = self.missing(stamp);
        self.beginning = match missing {
            None if self.last.is_none() => Some(Beginning::First),
            _ if self.size != [width, height] => Some(Beginning::Resized),
            None => Some(Beginning::Gap),
            Some(_) => None,
        };
        self.last = Some(stamp);
        self.size = [width, height];
        std::mem::swap(&mut self.levels, &mut self.before);
        self.fill(samples, width, height);
        self.finder.take(&self.levels);
        if self.beginning.is_none() {
            self.motion = self.aligner.align(&self.levels, &self.finder.cells, &self.before, self.motion);
            if scene_change(&self.levels, &self.before, &self.motion) > CUT_RATIO {
                self.beginning = Some(Beginning::Cut);
            }
        }
        if self.beginning.is_some() {
            self.motion = CameraMotion::default();
            self.bank.clear();
            self.change.reset();
        }
        let index = usize::from(self.levels.len() > 1);
        let known = self.beginning.is_none().then_some(self.motion);
        let has_past = self.change.is_known();
        self.change.take(&self.levels[index], index, self.size, known);
        let moving = has_past.then_some(self.change.moving.as_slice());
        let shown = Shown { levels: &self.levels, moving, moving_level: index };
        self.finder.find(shown, &mut self.candidates);
        self.bank.follow(&self.candidates, &self.finder, shown, &self.motion, missing.unwrap_or(0));
    }

    /// From now on at this part of the frames; places in another part are other places.
    pub(super) fn look_at(&mut self, part: Region) {
        if self.part.replace(part).is_some_and(|before| before != part) {
            self.size = [0; 2];
        }
    }

    /// Frames missing before one; none if it does not follow.
    fn missing(&self, stamp: Stamp) -> Option<u64> {
        let last = self.last?;
        let missing = match (last.index, stamp.index) {
            (Some(last), Some(now)) => now.checked_sub(last)?.checked_sub(1)?,
            _ => 0,
        };
        let span_us = match (last.timestamp_us, stamp.timestamp_us) {
            (Some(last), Some(now)) => now.checked_sub(last)?,
            _ => 0,
        };
        (missing <= MOST_MISSING && (0..=MOST_SPAN_US).contains(&span_us)).then_some(missing)
    }

    /// Whether the last frame began anew, and why.
    #[must_use]
    pub const fn beginning(&self) -> Option<Beginning> {
        self.beginning
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

    /// The tracks.
    #[must_use]
    pub fn tracks(&self) -> &[Track] {
        self.bank.tracks()
    }

    /// The last frame's pyramid.
    pub(super) fn levels(&self) -> &[Level] {
        &self.levels
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
