//! Cameras and targets, given or named.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::camera::Camera;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store::{Kind, Store};
use crate::shell::wire::{CameraWire, Ref, StreamWire, TargetWire, from_json};
use crate::target::Target;

/// A named thing is read anew after this time, should another process have changed the file.
const FRESH: Duration = Duration::from_secs(1);

/// Most things kept.
const MOST_KNOWN: usize = 1024;

/// What was read and parsed lately, so that a stream of frames that name the same camera and target does not read them from
/// the disk for each. What this process changes in the store is seen at once.
#[derive(Debug, Default)]
pub struct Known {
    cameras: Mutex<HashMap<String, Entry<Camera>>>,
    targets: Mutex<HashMap<String, Entry<Target>>>,
    streams: Mutex<HashMap<String, Entry<StreamWire>>>,
}

#[derive(Debug)]
struct Entry<T> {
    thing: T,
    /// [`Store::changes`] when it was read.
    changes: u64,
    read: Instant,
}

/// Finds what a request names.
pub struct Lookup<'a> {
    store: Option<&'a Store>,
    known: Arc<Known>,
}

impl<'a> Lookup<'a> {
    /// In `store`, if there is one, and before that in what is `known`.
    #[must_use]
    pub const fn new(store: Option<&'a Store>, known: Arc<Known>) -> Self {
        Self { store, known }
    }

    /// The camera.
    ///
    /// # Errors
    /// None of that name, or numbers that are no camera.
    pub async fn camera(&self, wanted: &Ref<CameraWire>) -> Result<Camera, Fault> {
        let parse = |wire: &CameraWire| Camera::try_from(wire);
        match wanted {
            Ref::Object(wire) => parse(wire),
            Ref::Name(name) => self.named(Kind::Camera, name, &self.known.cameras, parse).await,
        }
    }

    /// The target.
    ///
    /// # Errors
    /// None of that name, or markers that are no target.
    pub async fn target(&self, wanted: &Ref<TargetWire>) -> Result<Target, Fault> {
        let parse = |wire: &TargetWire| Target::try_from(wire);
        match wanted {
            Ref::Object(wire) => parse(wire),
            Ref::Name(name) => self.named(Kind::Target, name, &self.known.targets, parse).await,
        }
    }

    /// What is looked for in the frames of a camera.
    ///
    /// # Errors
    /// Nothing stored for it.
    pub async fn stream(&self, camera: &str) -> Result<StreamWire, Fault> {
        let parse = |wire: &StreamWire| Ok(wire.clone());
        self.named(Kind::Stream, camera, &self.known.streams, parse).await
    }

    async fn named<W: serde::de::DeserializeOwned, T: Clone>(
        &self,
        kind: Kind,
        name: &str,
        known: &Mutex<HashMap<String, Entry<T>>>,
        parse: impl Fn(&W) -> Result<T, Fault>,
    ) -> Result<T, Fault> {
        let changes = self.store.map_or(0, Store::changes);
        let open = || known.lock().unwrap_or_else(PoisonError::into_inner);
        let is_fresh = |entry: &&Entry<T>| entry.changes == changes && entry.read.elapsed() < FRESH;
        if let Some(entry) = open().get(name).filter(is_fresh) {
            return Ok(entry.thing.clone());
        }
        let thing = parse(&self.stored::<W>(kind, name).await?)?;
        let mut known = open();
        if known.len() >= MOST_KNOWN {
            known.clear();
        }
        known.insert(name.to_owned(), Entry { thing: thing.clone(), changes, read: Instant::now() });
        Ok(thing)
    }

    async fn stored<T: serde::de::DeserializeOwned>(&self, kind: Kind, name: &str) -> Result<T, Fault> {
        let kind_name = kind.name();
        let Some(store) = self.store else {
            let detail = format!("no stored {kind_name} {name:?}: there is no store here, so give the object itself");
            return Err(Fault { kind: FaultKind::NotFound, detail, pointer: Some(String::new()) });
        };
        match store.get(kind, name).await? {
            Some(stored) => from_json(stored.body.as_bytes()),
            None => Err(Fault {
                kind: FaultKind::NotFound,
                detail: format!("no stored {kind_name} {name:?}"),
                pointer: Some(String::new()),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::store::Precondition;

    fn camera(fx: f64) -> String {
        format!(r#"{{"width": 640, "height": 480, "fx": {fx}, "fy": 600, "cx": 320, "cy": 240}}"#)
    }

    #[tokio::test]
    async fn what_is_known_is_what_is_stored() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).await.expect("opens");
        let known = Arc::new(Known::default());
        let name = Ref::Name("front".to_owned());
        let focal = async || {
            let found = Lookup::new(Some(&store), known.clone()).camera(&name).await;
            found.map(|camera| camera.focal_lengths()[0]).map_err(|fault| fault.kind)
        };
        assert_eq!(focal().await, Err(FaultKind::NotFound));
        for fx in [600.0, 700.0] {
            store.put(Kind::Camera, "front", &camera(fx), &Precondition::None).await.expect("stores");
            assert_eq!(focal().await, Ok(fx));
            assert_eq!(focal().await, Ok(fx));
        }
        store.delete(Kind::Camera, "front", &Precondition::None).await.expect("deletes");
        assert_eq!(focal().await, Err(FaultKind::NotFound));
    }
}
