//! A frame as it came, and what it showed.

use std::time::{Duration, Instant};

use bytes::Bytes;

use super::memory::Seeing;
use super::{micros, now_us};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::swarm::{EstimateNote, FrameNote, Ledger};

/// A frame as it came.
pub struct Arrival {
    /// The bytes, made into one piece when the frame's turn has come.
    pub(super) frame: Box<dyn FnOnce() -> Bytes + Send>,
    pub(super) place: Place,
    pub(super) is_shared: bool,
}

/// What is known of a frame beside its bytes.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub(super) note: FrameNote,
    pub(super) at: Instant,
    pub(super) at_us: i64,
}

impl Arrival {
    /// One that comes now.
    pub fn now(note: FrameNote, frame: impl FnOnce() -> Bytes + Send + 'static) -> Self {
        let place = Place { note, at: Instant::now(), at_us: now_us() };
        Self { frame: Box::new(frame), place, is_shared: false }
    }

    /// One whose bytes lie in memory that is shared with who has sent it.
    #[must_use]
    pub fn shared(self, is_shared: bool) -> Self {
        Self { is_shared, ..self }
    }
}

impl Place {
    /// When the frame was taken, as the camera says, or else when it came.
    pub(super) fn taken_us(&self) -> i64 {
        self.note.timestamp_us.unwrap_or(self.at_us)
    }

    /// When it will be too old.
    ///
    /// # Errors
    /// [`FaultKind::TooOld`] if it is already.
    pub(super) fn deadline(&self, max_age: Duration) -> Result<Instant, Fault> {
        // Its age when it came, by the clocks of two machines, and since then by our own.
        let before = Duration::from_micros(u64::try_from(self.at_us.saturating_sub(self.taken_us())).unwrap_or(0));
        let age = before.saturating_add(self.at.elapsed());
        if let Some(left) = max_age.checked_sub(age) {
            return Ok(Instant::now() + left);
        }
        let detail = format!(
            "the frame was {} ms old when its turn came, {} ms of them before it arrived: up to {} ms are of use",
            age.as_millis(),
            before.as_millis(),
            max_age.as_millis(),
        );
        let pointer = (before > max_age).then(|| "/timestamp_us".to_owned());
        Err(Fault { kind: FaultKind::TooOld, detail, pointer })
    }

    /// With what the frame showed, which is there now.
    pub(super) fn answered(self, seeing: Seeing) -> Answered {
        let looked_us = micros(self.at.elapsed());
        Answered { place: self, looked_us, seeing, first_id: 0 }
    }
}

/// What a frame showed, as it is told to all: JSON that is written once.
#[derive(Debug)]
pub struct Answered {
    place: Place,
    /// Time from the frame's arrival, us.
    looked_us: u64,
    seeing: Seeing,
    /// Number of the estimate among all that is told of the camera; that of the tracks is the next.
    pub(super) first_id: u64,
}

impl Answered {
    /// The estimate and its number.
    #[must_use]
    pub fn estimate(&self) -> (u64, &str) {
        (self.first_id, &self.seeing.estimate)
    }

    /// The tracks and their number; nothing after a frame that was not younger than the last.
    #[must_use]
    pub fn tracks(&self) -> Option<(u64, &str)> {
        self.seeing.tracks.as_deref().map(|tracks| (self.first_id + 1, tracks))
    }

    /// The highest number.
    pub(super) fn last_id(&self) -> u64 {
        self.first_id + u64::from(self.seeing.tracks.is_some())
    }

    /// What it takes to keep it.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() + self.seeing.estimate.len() + self.seeing.tracks.as_ref().map_or(0, String::len)
    }

    /// What stands beside the estimate that is handed on now.
    #[must_use]
    pub fn note(&self) -> EstimateNote {
        EstimateNote {
            sequence: self.place.note.sequence,
            timestamp_us: self.place.note.timestamp_us,
            received_us: self.place.at_us,
            latency_us: Ledger::of(&self.seeing.timing, self.looked_us, micros(self.place.at.elapsed())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_too_old_by_its_own_stamp_or_by_waiting() {
        let place = |age_us: i64| Place {
            note: FrameNote { timestamp_us: Some(1_000_000), ..FrameNote::default() },
            at: Instant::now(),
            at_us: 1_000_000 + age_us,
        };
        let max_age = Duration::from_mins(1);
        let left = |age_us| place(age_us).deadline(max_age).map(|deadline| deadline - Instant::now());
        assert!(left(0).expect("fresh") > Duration::from_secs(50));
        assert!(left(50_000_000).expect("still of use") < Duration::from_secs(11));
        // A clock that is ahead of ours makes no frame older.
        assert!(left(-5_000_000).expect("of the future") <= max_age);
        let fault = left(70_000_000).expect_err("too old");
        assert_eq!((fault.kind, fault.pointer.as_deref()), (FaultKind::TooOld, Some("/timestamp_us")));
        let waited = Place {
            at: Instant::now().checked_sub(Duration::from_secs(61)).expect("the machine runs for longer"),
            ..place(0)
        };
        let fault = waited.deadline(max_age).expect_err("too old");
        assert_eq!((fault.kind, fault.pointer), (FaultKind::TooOld, None));
    }
}
