//! Our own pool, for frames that are large.

use zenoh::Wait;
use zenoh::bytes::ZBytes;
use zenoh::shm::{GarbageCollect, PosixShmProviderBackend, ShmProvider, ShmProviderBuilder};

use super::is_allowed;

/// Frames for which there is room: one being written, some on their way, one waiting, one being looked at.
const FRAMES: usize = 6;

/// Memory from which others on this machine take frames without copying them.
///
/// Zenoh does the same by itself, in a pool of 16 MiB: two raw frames of 1920 x 1080. This one is as large as the frames need.
#[derive(Debug, Default)]
pub struct Pool(State);

#[derive(Debug, Default)]
enum State {
    #[default]
    Unasked,
    Open {
        provider: Box<ShmProvider<PosixShmProviderBackend>>,
        frame_bytes: usize,
    },
    Refused,
}

impl Pool {
    /// The bytes in shared memory, or as they are where there is no place.
    pub fn put(&mut self, bytes: Vec<u8>) -> ZBytes {
        let Some(provider) = self.provider(bytes.len()) else { return bytes.into() };
        match provider.alloc(bytes.len()).with_policy::<GarbageCollect>().wait() {
            Ok(mut place) => {
                place.copy_from_slice(&bytes);
                place.into()
            }
            Err(_) => bytes.into(),
        }
    }

    /// One with room for frames of that size.
    fn provider(&mut self, bytes: usize) -> Option<&ShmProvider<PosixShmProviderBackend>> {
        let is_fitting = match &self.0 {
            State::Unasked => false,
            State::Open { frame_bytes, .. } => bytes <= *frame_bytes,
            State::Refused => true,
        };
        if !is_fitting {
            self.0 = State::with_room(bytes);
        }
        match &self.0 {
            State::Open { provider, .. } => Some(provider),
            State::Unasked | State::Refused => None,
        }
    }
}

impl State {
    fn with_room(frame_bytes: usize) -> Self {
        if !is_allowed() {
            return Self::Refused;
        }
        match ShmProviderBuilder::default_backend(frame_bytes.saturating_mul(FRAMES)).wait() {
            Ok(provider) => Self::Open { provider: Box::new(provider), frame_bytes },
            Err(error) => {
                tracing::debug!(%error, "no shared memory");
                Self::Refused
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::bus::shared::is_shared;

    #[test]
    fn what_finds_no_place_goes_as_it_is() {
        let mut pool = Pool::default();
        let kept: Vec<ZBytes> = (0..20_u8).map(|number| pool.put(vec![number; 100_000])).collect();
        for (number, payload) in (0..).zip(&kept) {
            assert_eq!(payload.to_bytes(), vec![number; 100_000]);
        }
        if !is_allowed() {
            return println!("left out: this process may not lock memory");
        }
        let shared = kept.iter().filter(|payload| is_shared(payload)).count();
        assert!((1..20).contains(&shared), "{shared}");
        // When the others are done with them there is room again, for larger ones too.
        drop(kept);
        assert!(is_shared(&pool.put(vec![1; 100_000])));
        assert!(is_shared(&pool.put(vec![1; 300_000])));
    }
}
