//! Cameras that send frame after frame. Whichever door brings it, a frame goes one way: into its camera's only place, where a newer one
//! takes it over, to a worker, and what it shows to all who listen.

mod arrival;
mod camera;
mod listener;
mod log;
mod look;
mod memory;
mod settings;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use tokio::runtime::Handle;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::shell::config::StreamSettings;

pub use arrival::{Answered, Arrival};
pub use camera::Camera;
pub use listener::{Heard, Listener};
pub(super) use settings::StreamTask;

/// A camera for which no stream is stored is forgotten after this time without a frame.
const FORGOTTEN_AFTER: Duration = Duration::from_mins(1);

/// All cameras, by the names under which they send.
#[derive(Debug)]
pub(super) struct Hub {
    settings: StreamSettings,
    cameras: Mutex<HashMap<String, Arc<Camera>>>,
    readers: Arc<Semaphore>,
    /// On which frames are looked at; those who bring them may be on no runtime.
    runtime: Handle,
}

impl Hub {
    /// Without cameras, on the runtime of the caller.
    pub(super) fn new(settings: &StreamSettings) -> Self {
        Self {
            settings: settings.clone(),
            cameras: Mutex::default(),
            readers: Arc::new(Semaphore::new(settings.max_readers)),
            runtime: Handle::current(),
        }
    }

    /// The camera of this name; nothing where there is no room for one more.
    fn camera(&self, name: &str) -> Option<Arc<Camera>> {
        let mut cameras = self.cameras.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(camera) = cameras.get(name) {
            return Some(Arc::clone(camera));
        }
        if cameras.len() >= self.settings.max_cameras {
            metrics::counter!("skypose_cameras_refused_total").increment(1);
            return None;
        }
        let camera = Arc::new(Camera::new(name, self.settings.kept_bytes));
        cameras.insert(name.into(), Arc::clone(&camera));
        metrics::gauge!("skypose_cameras").set(cameras.len() as f64);
        Some(camera)
    }

    /// Forgets cameras that nobody has stored, that have sent nothing for long, and to which nobody listens.
    fn forget(&self, is_stored: impl Fn(&str) -> bool) {
        let mut cameras = self.cameras.lock().unwrap_or_else(PoisonError::into_inner);
        cameras.retain(|name, camera| {
            is_stored(name) || Arc::strong_count(camera) > 1 || camera.heard().elapsed() < FORGOTTEN_AFTER
        });
        metrics::gauge!("skypose_cameras").set(cameras.len() as f64);
    }

    /// A place among those who read; nothing where there is none left.
    fn place(&self) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.readers).try_acquire_owned().ok()
    }
}

fn now_us() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_micros()).unwrap_or(i64::MAX)
}

fn micros(span: Duration) -> u64 {
    u64::try_from(span.as_micros()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn there_is_room_for_so_many_and_who_is_listened_to_stays() {
        let hub = Hub::new(&StreamSettings { max_cameras: 2, ..StreamSettings::default() });
        let front = hub.camera("front").expect("room");
        assert!(Arc::ptr_eq(&front, &hub.camera("front").expect("known")));
        assert!(hub.camera("aft").is_some());
        assert!(hub.camera("left").is_none());
        // Just heard of, so nobody is forgotten.
        hub.forget(|_| false);
        assert!(hub.camera("left").is_none());
        for name in ["front", "aft"] {
            hub.camera(name).expect("known").silent_for(FORGOTTEN_AFTER);
        }
        hub.forget(|_| false);
        assert!(Arc::ptr_eq(&front, &hub.camera("front").expect("kept for us")));
        assert!(hub.camera("left").is_some());
    }
}
