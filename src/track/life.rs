//! The life of a track: tentative, confirmed, coasting, lost.

use std::time::Duration;

use super::mixture::{Hypothesis, Mixture};
use super::options::TrackOptions;

/// Names a track for as long as its tracker lives; never given twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TrackId(pub u64);

/// Where a track stands in its life.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Life {
    /// Seen, but not often enough to be believed.
    Tentative,
    /// Believed, and seen in this frame.
    Confirmed,
    /// Believed, but not seen in this frame: what is told of it is predicted.
    Coasting,
    /// Over; told once.
    Lost(Loss),
}

/// Why a track is over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loss {
    /// Never believed: not seen often enough in its first frames.
    Unconfirmed {
        /// Frames in which it was seen.
        hits: u32,
        /// Frames since it began.
        frames: u32,
    },
    /// Not seen for too long.
    Unseen {
        /// How long, s.
        unseen_s: f64,
        /// The most that is allowed, s.
        limit_s: f64,
    },
    /// Its position has become too uncertain.
    Uncertain {
        /// Largest standard deviation, m.
        sigma_m: f64,
        /// The most that is allowed, m.
        limit_m: f64,
    },
    /// Too long a time between two frames.
    Gap {
        /// How long, s.
        gap_s: f64,
        /// The most that is allowed, s.
        limit_s: f64,
    },
    /// Its motion has left what numbers can tell.
    Diverged,
}

/// One target over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    id: TrackId,
    life: Life,
    mixture: Mixture,
    /// The answer of this frame that it took.
    answer: Option<usize>,
    is_believed: bool,
    hits: u32,
    frames: u32,
    coasted: u32,
    seen_at: Duration,
    began_at: Duration,
}

impl Track {
    /// A track that begins with answer number `answer` of the frame taken at `stamp`.
    pub(super) fn begun(id: TrackId, mixture: Mixture, answer: usize, stamp: Duration, options: &TrackOptions) -> Self {
        let is_believed = options.confirm_hits <= 1;
        let life = if is_believed { Life::Confirmed } else { Life::Tentative };
        let answer = Some(answer);
        Self { id, life, mixture, answer, is_believed, hits: 1, frames: 1, coasted: 0, seen_at: stamp, began_at: stamp }
    }

    /// Its name.
    #[must_use]
    pub const fn id(&self) -> TrackId {
        self.id
    }

    /// Where it stands in its life.
    #[must_use]
    pub const fn life(&self) -> Life {
        self.life
    }

    /// The most probable motion, at the stamp of the last frame.
    #[must_use]
    pub fn best(&self) -> &Hypothesis {
        self.mixture.best()
    }

    /// The others, by falling probability.
    #[must_use]
    pub fn alternatives(&self) -> &[Hypothesis] {
        &self.mixture.hypotheses()[1..]
    }

    /// All motions so much later than the last frame, by falling probability, if it is not seen until then; empty where that is beyond
    /// telling.
    #[must_use]
    pub fn predicted(&self, later: Duration, options: &TrackOptions) -> Vec<Hypothesis> {
        self.mixture.predicted(later.as_secs_f64(), options).map_or_else(Vec::new, |later| later.hypotheses().to_vec())
    }

    /// All of them.
    pub(super) const fn mixture(&self) -> &Mixture {
        &self.mixture
    }

    /// Which of the last frame's answers it took; `None` while it coasts.
    #[must_use]
    pub const fn answer(&self) -> Option<usize> {
        self.answer
    }

    /// Frames in which it was seen.
    #[must_use]
    pub const fn seen_count(&self) -> u32 {
        self.hits
    }

    /// Frames since it was last seen; 0 if it was in this one.
    #[must_use]
    pub const fn coasted_count(&self) -> u32 {
        self.coasted
    }

    /// Time stamp of the frame in which it was last seen.
    #[must_use]
    pub const fn seen_at(&self) -> Duration {
        self.seen_at
    }

    /// Time stamp of its first frame.
    #[must_use]
    pub const fn began_at(&self) -> Duration {
        self.began_at
    }

    /// Whether it is over.
    #[must_use]
    pub const fn is_lost(&self) -> bool {
        matches!(self.life, Life::Lost(_))
    }

    /// Whether it has ever been confirmed.
    pub(super) const fn is_believed(&self) -> bool {
        self.is_believed
    }

    /// The track `dt_s` later, not seen yet.
    pub(super) fn advance(&mut self, dt_s: f64, options: &TrackOptions) {
        self.frames = self.frames.saturating_add(1);
        self.answer = None;
        match self.mixture.predicted(dt_s, options) {
            Some(later) => self.mixture = later,
            None => self.life = Life::Lost(Loss::Diverged),
        }
    }

    /// It is seen: answer number `answer` has led to `mixture`.
    pub(super) fn see(&mut self, mixture: Mixture, answer: usize, stamp: Duration, options: &TrackOptions) {
        self.mixture = mixture;
        self.answer = Some(answer);
        self.hits = self.hits.saturating_add(1);
        self.coasted = 0;
        self.seen_at = stamp;
        self.is_believed |= self.hits >= options.confirm_hits;
        self.life = if self.is_believed { Life::Confirmed } else { Life::Tentative };
    }

    /// It is over.
    pub(super) const fn lose(&mut self, loss: Loss) {
        self.life = Life::Lost(loss);
        self.answer = None;
    }

    /// What becomes of it at the end of a frame.
    pub(super) fn age(&mut self, stamp: Duration, options: &TrackOptions) {
        if self.is_lost() {
            return;
        }
        let motion = &self.best().motion;
        let sigma_m = motion.position_sigma_m();
        let limit_m = options.max_position_sigma_ratio * motion.camera_from_target().translation.norm();
        if self.answer.is_none() {
            self.coasted = self.coasted.saturating_add(1);
            let unseen = stamp.saturating_sub(self.seen_at);
            // M of N: even if it were seen in all frames left, it would be confirmed no more.
            let missed = self.frames - self.hits.min(self.frames);
            if !self.is_believed && missed > options.confirm_frames.saturating_sub(options.confirm_hits) {
                self.lose(Loss::Unconfirmed { hits: self.hits, frames: self.frames });
            } else if unseen > options.max_coast {
                let (unseen_s, limit_s) = (unseen.as_secs_f64(), options.max_coast.as_secs_f64());
                self.lose(Loss::Unseen { unseen_s, limit_s });
            } else if !(sigma_m <= limit_m) {
                self.lose(Loss::Uncertain { sigma_m, limit_m });
            } else if self.is_believed {
                self.life = Life::Coasting;
            }
        }
    }
}
