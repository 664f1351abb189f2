//! Sequences of frames that are posted one by one: what is remembered of each, and of how many.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::OwnedMutexGuard;

use crate::detect::Watch;
use crate::shell::fault::{Fault, FaultKind};

/// What is remembered of sequences, by name. At most so many: of those that are not in use the one not used for longest makes room for a
/// new one, which is refused where all are in use, as otherwise each frame of some would begin anew and nothing would be followed. One
/// that is idle for long is forgotten.
#[derive(Debug)]
pub struct Sequences {
    most: usize,
    in_use: Duration,
    idle: Duration,
    known: Mutex<HashMap<String, Entry>>,
}

#[derive(Debug)]
struct Entry {
    watch: Arc<tokio::sync::Mutex<Watch>>,
    used: Instant,
}

impl Sequences {
    /// Room for `most`, each in use for `in_use` after its last frame, and remembered for `idle`.
    #[must_use]
    pub fn new(most: usize, in_use: Duration, idle: Duration) -> Self {
        Self { most: most.max(1), in_use, idle, known: Mutex::default() }
    }

    /// What is remembered of a sequence, for one frame alone: frames of one name wait for each other in the order of their coming.
    ///
    /// # Errors
    /// [`FaultKind::DeadlineExceeded`] if those before it take too long, [`FaultKind::Overloaded`] if it is a new sequence and as many as
    /// are remembered are in use.
    pub async fn turn(&self, name: &str, deadline: Instant) -> Result<OwnedMutexGuard<Watch>, Fault> {
        let turn = self.watch(name, Instant::now())?.lock_owned();
        let late = |_| Fault::new(FaultKind::DeadlineExceeded, "frames of the sequence before this one took too long");
        tokio::time::timeout_at(deadline.into(), turn).await.map_err(late)
    }

    fn watch(&self, name: &str, now: Instant) -> Result<Arc<tokio::sync::Mutex<Watch>>, Fault> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let since = |entry: &Entry| now.saturating_duration_since(entry.used);
        known.retain(|_, entry| since(entry) < self.idle);
        if !known.contains_key(name) && known.len() >= self.most {
            let oldest = known.iter().max_by_key(|(_, entry)| since(entry));
            let unused = oldest.filter(|(_, entry)| since(entry) >= self.in_use).map(|(name, _)| name.clone());
            let Some(unused) = unused else { return Err(self.full()) };
            known.remove(&unused);
        }
        let entry = known.entry(name.into()).or_insert_with(|| Entry { watch: Arc::default(), used: now });
        entry.used = now;
        let watch = entry.watch.clone();
        metrics::gauge!("skypose_sequences").set(known.len() as f64);
        Ok(watch)
    }

    fn full(&self) -> Fault {
        let (most, in_use_s) = (self.most, self.in_use.as_secs_f64());
        let detail = format!(
            "as many sequences as are remembered, {most}, have had a frame in the last {in_use_s} s, and a further one would make one of \
             them begin anew with each frame: the setting sequences.most is how many there may be"
        );
        Fault::new(FaultKind::Overloaded, detail).at("/sequence")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IN_USE: Duration = Duration::from_secs(10);

    fn sequences() -> Sequences {
        Sequences::new(2, IN_USE, Duration::from_mins(1))
    }

    #[test]
    fn the_one_not_used_for_longest_makes_room_if_it_is_not_in_use() {
        let (sequences, start) = (sequences(), Instant::now());
        let at = |name: &str, seconds| sequences.watch(name, start + Duration::from_secs(seconds));
        let (a, b) = (at("a", 0).expect("room"), at("b", 1).expect("room"));
        assert!(Arc::ptr_eq(&a, &at("a", 2).expect("known")));
        // A frame of b was there ten seconds ago, one of a nine.
        at("c", 11).expect("the room of b");
        assert!(Arc::ptr_eq(&a, &at("a", 11).expect("known")));
        let refused = at("b", 12).expect_err("both are in use");
        assert_eq!((refused.kind, refused.pointer.as_deref()), (FaultKind::Overloaded, Some("/sequence")));
        assert!(refused.detail.contains("2, have") && refused.detail.contains("sequences.most"), "{refused}");
        assert!(!Arc::ptr_eq(&b, &at("b", 21).expect("the room of c")));
    }

    #[test]
    fn however_many_are_interleaved_those_that_are_in_use_are_followed() {
        let (sequences, start) = (sequences(), Instant::now());
        let names = ["a", "b", "c", "d"];
        let round = |seconds| names.map(|name| sequences.watch(name, start + Duration::from_secs(seconds)).ok());
        let first = round(0);
        assert_eq!(first.each_ref().map(Option::is_some), [true, true, false, false]);
        for seconds in 1..100 {
            for (watch, first) in round(seconds).iter().zip(&first) {
                assert_eq!(watch.as_ref().map(Arc::as_ptr), first.as_ref().map(Arc::as_ptr), "{seconds}");
            }
        }
    }

    #[test]
    fn an_idle_one_is_forgotten() {
        let (sequences, start) = (sequences(), Instant::now());
        let at = |seconds| sequences.watch("a", start + Duration::from_secs(seconds)).expect("room");
        let first = at(0);
        assert!(Arc::ptr_eq(&first, &at(59)));
        assert!(!Arc::ptr_eq(&first, &at(119)));
    }

    #[tokio::test]
    async fn frames_of_one_name_take_turns() {
        let sequences = sequences();
        let first = sequences.turn("a", Instant::now() + Duration::from_secs(20)).await.expect("free");
        let refused = sequences.turn("a", Instant::now() + Duration::from_millis(5)).await;
        assert_eq!(refused.expect_err("taken").kind, FaultKind::DeadlineExceeded);
        assert!(sequences.turn("b", Instant::now() + Duration::from_secs(20)).await.is_ok());
        drop(first);
        assert!(sequences.turn("a", Instant::now() + Duration::from_secs(20)).await.is_ok());
    }
}
