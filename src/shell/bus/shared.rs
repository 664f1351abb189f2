//! Shared memory with others on this machine.
//!
//! Zenoh hands large payloads over in pools that both sides map and lock. Two things it leaves to us (1.10): a process that may not lock
//! a pool never hears of what lies in it, and a pool stays mapped until the end of the process even if its owner ended long ago.

mod pool;
mod segments;

use rustix::process::{Resource, getrlimit};
use zenoh::bytes::ZBytes;

pub use pool::Pool;
pub(super) use segments::storage;

/// Memory that a process must be allowed to lock to take part: the pools of a dozen others, 16 MiB each, and what belongs to them.
const LOCKED_BYTES: u64 = 256 << 20;

/// Whether this process may lock what others share with it.
///
/// Where it may not, payloads would vanish without a word: <https://github.com/eclipse-zenoh/zenoh/issues/2788>.
#[must_use]
pub fn is_allowed() -> bool {
    is_enough(getrlimit(Resource::Memlock).current) || has_right()
}

/// `ulimit -l`, bytes; none is no limit.
fn is_enough(limit: Option<u64>) -> bool {
    limit.is_none_or(|limit| limit >= LOCKED_BYTES)
}

/// The right of the administrator's programs, for which no limit holds.
#[cfg(target_os = "linux")]
fn has_right() -> bool {
    use rustix::thread::{CapabilitySet, capabilities};
    capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK))
}

#[cfg(not(target_os = "linux"))]
fn has_right() -> bool {
    false
}

/// Whether a payload lies in shared memory.
#[must_use]
pub fn is_shared(payload: &ZBytes) -> bool {
    payload.as_shm().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_limit_of_a_user_is_too_small() {
        assert!(!is_enough(Some(8 << 20)));
        assert!(is_enough(Some(LOCKED_BYTES)));
        assert!(is_enough(None));
    }
}
