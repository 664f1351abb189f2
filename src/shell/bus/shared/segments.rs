//! Pools of others, mapped while they are of use.
//!
//! Left to itself Zenoh keeps the pool of everybody who has ever sent something: 16 MiB of locked memory for each camera that is started
//! anew (<https://github.com/eclipse-zenoh/zenoh/issues/2787>). Here a pool is let go in which nothing was looked at for a while; should
//! its owner send again, it is mapped again. That is looked after when somebody new comes, as only then there is more to keep.

use std::sync::atomic::{Ordering, fence};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use zenoh::shm::{
    ChunkID, PosixShmClient, ProtocolID, SegmentID, ShmClient, ShmClientStorage, ShmSegment, WithProtocolID,
};

/// A pool is let go after this time. Mapping it again takes some milliseconds.
const KEPT_FOR: Duration = Duration::from_secs(1);

/// Where a session looks for the pools of others.
pub(in crate::shell::bus) fn storage() -> Arc<ShmClientStorage> {
    let client = Pools { client: Arc::new(PosixShmClient), kept_for: KEPT_FOR, known: Mutex::default() };
    Arc::new(ShmClientStorage::builder().with_client(Arc::new(client)).build())
}

/// All that have been mapped and may be still.
#[derive(Debug)]
struct Pools<C> {
    client: Arc<C>,
    kept_for: Duration,
    known: Mutex<Vec<Weak<Segment<C>>>>,
}

impl<C: ShmClient> WithProtocolID for Pools<C> {
    fn id(&self) -> ProtocolID {
        self.client.id()
    }
}

impl<C: ShmClient + 'static> ShmClient for Pools<C> {
    fn attach(&self, id: SegmentID) -> zenoh::Result<Arc<dyn ShmSegment>> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|segment| segment.strong_count() > 0);
        for segment in &*known {
            Segment::let_go(segment, self.kept_for);
        }
        let mapped = Mapped { segment: Some(self.client.attach(id)?), used: Instant::now() };
        let segment = Arc::new(Segment { id, client: Arc::clone(&self.client), mapped: Mutex::new(mapped) });
        known.push(Arc::downgrade(&segment));
        Ok(segment)
    }
}

/// One pool. Zenoh holds it once for itself, and once for each payload in it that somebody still has.
#[derive(Debug)]
struct Segment<C> {
    id: SegmentID,
    client: Arc<C>,
    mapped: Mutex<Mapped>,
}

#[derive(Debug)]
struct Mapped {
    segment: Option<Arc<dyn ShmSegment>>,
    used: Instant,
}

impl<C> Segment<C> {
    fn mapped(&self) -> MutexGuard<'_, Mapped> {
        self.mapped.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Unmaps it, unless somebody has a payload in it or had one a moment ago.
    fn let_go(this: &Weak<Self>, kept_for: Duration) {
        let Some(segment) = this.upgrade() else { return };
        let mut mapped = segment.mapped();
        // Who takes a payload holds the segment first and asks for its place, under this lock, after that: so a count seen here of Zenoh's
        // own and ours says that nobody has one, and that who takes the next will find it unmapped.
        if Arc::strong_count(&segment) > 2 || mapped.used.elapsed() < kept_for {
            return;
        }
        // The last one who had a payload is done with it.
        fence(Ordering::Acquire);
        mapped.segment = None;
    }
}

impl<C: ShmClient> ShmSegment for Segment<C> {
    fn map(&self, chunk: ChunkID) -> zenoh::Result<*mut u8> {
        let mut mapped = self.mapped();
        mapped.used = Instant::now();
        if let Some(segment) = &mapped.segment {
            return segment.map(chunk);
        }
        let segment = self.client.attach(self.id)?;
        let place = segment.map(chunk);
        mapped.segment = Some(segment);
        place
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use super::*;

    /// Counts what is mapped.
    #[derive(Debug, Default)]
    struct Counting(Arc<AtomicUsize>);

    #[derive(Debug)]
    struct Counted(Arc<AtomicUsize>);

    impl WithProtocolID for Counting {
        fn id(&self) -> ProtocolID {
            7
        }
    }

    impl ShmClient for Counting {
        fn attach(&self, _: SegmentID) -> zenoh::Result<Arc<dyn ShmSegment>> {
            self.0.fetch_add(1, Ordering::SeqCst);
            Ok(Arc::new(Counted(Arc::clone(&self.0))))
        }
    }

    impl ShmSegment for Counted {
        fn map(&self, _: ChunkID) -> zenoh::Result<*mut u8> {
            Ok(std::ptr::null_mut())
        }
    }

    impl Drop for Counted {
        fn drop(&mut self) {
            self.0.fetch_sub(1, Ordering::SeqCst);
        }
    }

    fn pools(kept_for: Duration) -> (Pools<Counting>, Arc<AtomicUsize>) {
        let count = Arc::new(AtomicUsize::new(0));
        (Pools { client: Arc::new(Counting(Arc::clone(&count))), kept_for, known: Mutex::default() }, count)
    }

    #[test]
    fn a_pool_without_use_is_let_go_when_the_next_comes_and_mapped_again_when_asked_for() {
        let (pools, count) = pools(Duration::ZERO);
        let first = pools.attach(1).expect("maps");
        first.map(0).expect("a place");
        let second = pools.attach(2).expect("maps");
        assert_eq!(count.load(Ordering::SeqCst), 1, "the first is let go");
        first.map(0).expect("a place");
        assert_eq!(count.load(Ordering::SeqCst), 2, "and there again");
        drop((first, second));
        assert_eq!(count.load(Ordering::SeqCst), 0);
    }

    #[test]
    fn a_pool_in_which_somebody_has_a_payload_stays() {
        let (pools, count) = pools(Duration::ZERO);
        let first = pools.attach(1).expect("maps");
        let payload = Arc::clone(&first);
        let _second = pools.attach(2).expect("maps");
        assert_eq!(count.load(Ordering::SeqCst), 2);
        drop(payload);
        let _third = pools.attach(3).expect("maps");
        assert_eq!(count.load(Ordering::SeqCst), 1, "of three only the last is of use");
    }

    #[test]
    fn a_pool_that_was_in_use_a_moment_ago_stays() {
        let (pools, count) = pools(Duration::from_mins(1));
        let _first = pools.attach(1).expect("maps");
        let _second = pools.attach(2).expect("maps");
        assert_eq!(count.load(Ordering::SeqCst), 2);
    }
}
