//! Cameras and targets, given or named.

use std::collections::HashMap;

use crate::camera::Camera;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store::{Kind, Store};
use crate::shell::wire::{CameraWire, Ref, TargetWire, from_json};
use crate::target::Target;

/// Finds what a request names; each name is looked up once.
pub struct Lookup<'a> {
    store: Option<&'a Store>,
    cameras: HashMap<String, Camera>,
}

impl<'a> Lookup<'a> {
    /// In `store`, if there is one.
    #[must_use]
    pub fn new(store: Option<&'a Store>) -> Self {
        Self { store, cameras: HashMap::new() }
    }

    /// The camera.
    ///
    /// # Errors
    /// None of that name, or numbers that are no camera.
    pub async fn camera(&mut self, wanted: &Ref<CameraWire>) -> Result<Camera, Fault> {
        match wanted {
            Ref::Object(wire) => Camera::try_from(wire),
            Ref::Name(name) => {
                if let Some(known) = self.cameras.get(name) {
                    return Ok(*known);
                }
                let camera = Camera::try_from(&self.stored::<CameraWire>(Kind::Camera, name).await?)?;
                self.cameras.insert(name.clone(), camera);
                Ok(camera)
            }
        }
    }

    /// The target.
    ///
    /// # Errors
    /// None of that name, or markers that are no target.
    pub async fn target(&mut self, wanted: &Ref<TargetWire>) -> Result<Target, Fault> {
        match wanted {
            Ref::Object(wire) => Target::try_from(wire),
            Ref::Name(name) => Target::try_from(&self.stored::<TargetWire>(Kind::Target, name).await?),
        }
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
