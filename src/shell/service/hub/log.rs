//! What was told of a camera lately.

use std::collections::VecDeque;
use std::sync::Arc;

use super::arrival::Answered;
use crate::shell::wire::swarm::GapWire;

/// The last that was told, as many bytes of it as may be kept, each with a number. Numbers rise by one; the first is the time at which
/// the camera was first heard of, in microseconds, so that they rise over a new start of the service too.
#[derive(Debug)]
pub(super) struct Log {
    first: u64,
    next: u64,
    most_bytes: usize,
    bytes: usize,
    kept: VecDeque<Arc<Answered>>,
}

impl Log {
    pub(super) fn new(first: u64, most_bytes: usize) -> Self {
        Self { first, next: first, most_bytes, bytes: 0, kept: VecDeque::new() }
    }

    /// Gives it its numbers, and keeps it; the oldest make room. The last is kept in any case.
    pub(super) fn push(&mut self, mut answered: Answered) -> Arc<Answered> {
        answered.first_id = self.next;
        self.next = answered.last_id() + 1;
        self.bytes += answered.bytes();
        let answered = Arc::new(answered);
        self.kept.push_back(Arc::clone(&answered));
        while self.bytes > self.most_bytes && self.kept.len() > 1 {
            self.bytes -= self.kept.pop_front().map_or(0, |oldest| oldest.bytes());
        }
        answered
    }

    /// Number of what comes next.
    pub(super) const fn next(&self) -> u64 {
        self.next
    }

    /// What follows the number that was seen last: the oldest of it that is kept, or first what is not.
    pub(super) fn after(&self, last: u64) -> Option<Result<Arc<Answered>, GapWire>> {
        let oldest = self.kept.front().map_or(self.next, |oldest| oldest.first_id);
        let is_foreign = last.checked_add(1).is_none_or(|wanted| wanted < self.first || wanted > self.next);
        if is_foreign || last + 1 < oldest {
            let missed_count = (!is_foreign).then(|| oldest - last - 1);
            return Some(Err(GapWire { missed_count, next_id: oldest }));
        }
        let place = self.kept.partition_point(|kept| kept.last_id() <= last);
        self.kept.get(place).map(|next| Ok(Arc::clone(next)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::service::hub::arrival::Arrival;
    use crate::shell::service::hub::memory::Seeing;
    use crate::shell::wire::swarm::FrameNote;

    /// An estimate of so many bytes, with tracks.
    fn answered(bytes: usize) -> Answered {
        let place = Arrival::now(FrameNote::default(), bytes::Bytes::new).place;
        place.answered(Seeing { estimate: "x".repeat(bytes), tracks: Some(String::new()), ..Seeing::default() })
    }

    fn next(log: &Log, last: u64) -> Option<Result<u64, GapWire>> {
        log.after(last).map(|found| found.map(|answered| answered.first_id))
    }

    #[test]
    fn who_comes_again_goes_on_where_he_was() {
        let mut log = Log::new(1000, 1 << 20);
        assert_eq!(next(&log, 999), None);
        for _ in 0..3 {
            log.push(answered(10));
        }
        assert_eq!(log.next(), 1006);
        // An estimate of which the tracks were not seen yet comes again; who reads leaves out what he has.
        for (last, found) in [(999, 1000), (1000, 1000), (1001, 1002), (1003, 1004), (1004, 1004)] {
            assert_eq!(next(&log, last), Some(Ok(found)), "{last}");
        }
        assert_eq!(next(&log, 1005), None);
    }

    #[test]
    fn what_is_not_kept_is_counted_and_what_is_foreign_told() {
        let each = answered(1000).bytes();
        let mut log = Log::new(1000, 3 * each);
        for _ in 0..10 {
            log.push(answered(1000));
        }
        let gap = |missed_count| Some(Err(GapWire { missed_count, next_id: 1014 }));
        assert_eq!(next(&log, 999), gap(Some(14)));
        assert_eq!(next(&log, 1011), gap(Some(2)));
        assert_eq!(next(&log, 1013), Some(Ok(1014)));
        for foreign in [0, 5, 998, 1020, u64::MAX] {
            assert_eq!(next(&log, foreign), gap(None), "{foreign}");
        }
    }

    #[test]
    fn the_last_is_kept_however_large() {
        let mut log = Log::new(1, 0);
        log.push(answered(10));
        log.push(answered(1000));
        assert_eq!(log.kept.len(), 1);
        assert_eq!(next(&log, 2), Some(Ok(3)));
    }
}
