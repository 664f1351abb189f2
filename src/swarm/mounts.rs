//! What sits where on which body.

use std::collections::BTreeMap;

use crate::geometry::UncertainTransform;
use crate::geometry::space::{Body, Camera, Peer, Target};

/// Where our cameras sit, and what others wear.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mounts {
    /// Our cameras, by name.
    pub cameras: BTreeMap<String, UncertainTransform<Body, Camera>>,
    /// Others, by name.
    pub peers: BTreeMap<String, Worn>,
}

/// The target that another body wears.
#[derive(Clone, Debug, PartialEq)]
pub struct Worn {
    /// Name of the target.
    pub target: String,
    /// Where it sits.
    pub peer_from_target: UncertainTransform<Peer, Target>,
}
