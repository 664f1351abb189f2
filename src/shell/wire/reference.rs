//! An object, or the name of a stored one.

use std::fmt;
use std::marker::PhantomData;

use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use super::{CameraWire, TargetWire};

/// Where a request takes a camera or a target, it takes the object or the name of a stored one.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Ref<T> {
    /// Name of a stored one.
    Name(String),
    /// The object itself.
    Object(T),
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Ref<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        // Not an untagged enum: that would forget which field of the object was at fault.
        struct Either<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Either<T> {
            type Value = Ref<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object, or the name of a stored one")
            }

            fn visit_str<E>(self, name: &str) -> Result<Self::Value, E> {
                Ok(Ref::Name(name.into()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(Ref::Object)
            }
        }
        deserializer.deserialize_any(Either(PhantomData))
    }
}

/// A camera, or the name of a stored one: what the API document calls it.
#[derive(ToSchema)]
#[serde(untagged)]
pub enum CameraOrName {
    /// Name of a stored camera.
    Name(String),
    /// The camera itself.
    Object(CameraWire),
}

/// A target, or the name of a stored one: what the API document calls it.
#[derive(ToSchema)]
#[serde(untagged)]
pub enum TargetOrName {
    /// Name of a stored target.
    Name(String),
    /// The target itself.
    Object(TargetWire),
}
