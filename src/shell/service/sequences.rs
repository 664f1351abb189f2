//! Sequences of frames that are posted one by one: what is remembered of each, and of how many.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::OwnedMutexGuard;

use crate::detect::Watch;
use crate::shell::fault::{Fault, FaultKind};

/// What is remembered of sequences, by name. At most so many; the one not used for longest makes room, and one that is idle for long is
/// forgotten.
#[derive(Debug)]
pub struct Sequences {
    most: usize,
    idle: Duration,
    known: Mutex<HashMap<String, Entry>>,
}

#[derive(Debug)]
struct Entry {
    watch: Arc<tokio::sync::Mutex<Watch>>,
    used: Instant,
}

impl Sequences {
    /// Room for `most`, each for `idle` after its last frame.
    #[must_use]
    pub fn new(most: usize, idle: Duration) -> Self {
        Self { most: most.max(1), idle, known: Mutex::default() }
    }

    /// What is remembered of a sequence, for one frame alone: frames of one name wait for each other in the order of their coming.
    ///
    /// # Errors
    /// [`FaultKind::DeadlineExceeded`] if those before it take too long.
    pub async fn turn(&self, name: &str, deadline: Instant) -> Result<OwnedMutexGuard<Watch>, Fault> {
        let turn = self.watch(name, Instant::now()).lock_owned();
        let late = |_| Fault::new(FaultKind::DeadlineExceeded, "frames of the sequence before this one took too long");
        tokio::time::timeout_at(deadline.into(), turn).await.map_err(late)
    }

    fn watch(&self, name: &str, now: Instant) -> Arc<tokio::sync::Mutex<Watch>> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|_, entry| now.saturating_duration_since(entry.used) < self.idle);
        if !known.contains_key(name) && known.len() >= self.most {
            let oldest = known.iter().min_by_key(|(_, entry)| entry.used).map(|(name, _)| name.clone());
            oldest.and_then(|oldest| known.remove(&oldest));
        }
        let entry = known.entry(name.into()).or_insert_with(|| Entry { watch: Arc::default(), used: now });
        entry.used = now;
        metrics::gauge!("skypose_sequences").set(known.len() as f64);
        known.get(name).map(|entry| entry.watch.clone()).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_one_not_used_for_longest_makes_room() {
        let sequences = Sequences::new(2, Duration::from_mins(1));
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs(seconds);
        let a = sequences.watch("a", at(0));
        let b = sequences.watch("b", at(1));
        assert!(Arc::ptr_eq(&a, &sequences.watch("a", at(2))));
        sequences.watch("c", at(3));
        assert!(Arc::ptr_eq(&a, &sequences.watch("a", at(4))));
        assert!(!Arc::ptr_eq(&b, &sequences.watch("b", at(5))));
    }

    #[test]
    fn an_idle_one_is_forgotten() {
        let sequences = Sequences::new(2, Duration::from_mins(1));
        let start = Instant::now();
        let first = sequences.watch("a", start);
        assert!(Arc::ptr_eq(&first, &sequences.watch("a", start + Duration::from_secs(59))));
        assert!(!Arc::ptr_eq(&first, &sequences.watch("a", start + Duration::from_secs(119))));
    }

    #[tokio::test]
    async fn frames_of_one_name_take_turns() {
        let sequences = Sequences::new(2, Duration::from_mins(1));
        let first = sequences.turn("a", Instant::now() + Duration::from_secs(20)).await.expect("free");
        let refused = sequences.turn("a", Instant::now() + Duration::from_millis(5)).await;
        assert_eq!(refused.expect_err("taken").kind, FaultKind::DeadlineExceeded);
        assert!(sequences.turn("b", Instant::now() + Duration::from_secs(20)).await.is_ok());
        drop(first);
        assert!(sequences.turn("a", Instant::now() + Duration::from_secs(20)).await.is_ok());
    }
}
