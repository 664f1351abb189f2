//! Sums over a replay.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use super::client::Reply;
use crate::shell::fault::Fault;

/// What has become of the frames.
pub(super) struct Tally {
    start: Instant,
    shown: u64,
    dropped: u64,
    late: u64,
    refused: u64,
    failed: u64,
    latencies: Vec<Duration>,
    /// Faults that have been told of.
    told: BTreeSet<String>,
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            start: Instant::now(),
            shown: 0,
            dropped: 0,
            late: 0,
            refused: 0,
            failed: 0,
            latencies: Vec::new(),
            told: BTreeSet::new(),
        }
    }
}

impl Tally {
    /// A frame was due.
    pub(super) const fn shown(&mut self) {
        self.shown += 1;
    }

    /// It was not posted.
    pub(super) const fn dropped(&mut self) {
        self.dropped += 1;
    }

    /// A reply came.
    pub(super) fn add(&mut self, reply: &Reply) {
        match &reply.answer {
            Ok(_) => {
                self.latencies.push(reply.latency);
                self.late += u64::from(reply.is_late);
            }
            Err(fault) if fault.kind.is_passing() => self.refused += 1,
            Err(_) => self.failed += 1,
        }
    }

    /// Whether a fault has not come before: a server that is gone need not be mentioned for each frame.
    pub(super) fn is_new(&mut self, fault: &Fault) -> bool {
        self.told.insert(fault.to_string())
    }

    /// For people.
    pub(super) fn summary(&self) -> String {
        let text = format!(
            "{} frames in {:.1} s: {} answered, {} of them late, {} dropped, {} refused, {} failed.",
            self.shown,
            self.start.elapsed().as_secs_f64(),
            self.latencies.len(),
            self.late,
            self.dropped,
            self.refused,
            self.failed,
        );
        let mut sorted = self.latencies.clone();
        sorted.sort_unstable();
        let at = |hundredths: usize| sorted.get((sorted.len().saturating_sub(1)) * hundredths / 100);
        if let (Some(median), Some(high)) = (at(50), at(95)) {
            let ms = |span: &Duration| span.as_secs_f64() * 1e3;
            return format!("{text} Latency {:.1} ms (median), {:.1} ms (95 %).", ms(median), ms(high));
        }
        text
    }
}
