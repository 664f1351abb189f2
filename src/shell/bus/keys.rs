//! Keys: declared here once, written and read by the same declaration.

use zenoh::key_expr::format::KeFormat;
use zenoh::key_expr::{KeyExpr, OwnedKeyExpr, keyexpr};

use crate::shell::config::ZenohSettings;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store::check_name;

/// What a camera sends and what is sent about it.
pub const CAMERA: &str = "${prefix:**}/${group:*}/${node:*}/camera/${camera:*}/${topic:*}";
/// What may be asked.
pub const RPC: &str = "${prefix:**}/${group:*}/${node:*}/rpc/${call:*}";
/// What a node tells of another's body.
pub const BODY: &str = "${prefix:**}/${group:*}/${node:*}/body/${other:*}/${topic:*}";
/// That a node is there.
pub const ALIVE_NODE: &str = "${prefix:**}/@alive/${group:*}/${node:*}";
/// That a node listens to a camera.
pub const ALIVE_CAMERA: &str = "${prefix:**}/@alive/${group:*}/${node:*}/${camera:*}";

/// What stands under a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// Frames, from the camera.
    Frame,
    /// What they show.
    Estimate,
    /// What targets do over time.
    Track,
    /// What has become of them.
    Status,
}

impl Topic {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Frame, Self::Estimate, Self::Track, Self::Status];

    /// Its place in the key.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Frame => "frame",
            Self::Estimate => "estimate",
            Self::Track => "track",
            Self::Status => "status",
        }
    }
}

/// What a node tells of another's body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyTopic {
    /// Where its cameras see it.
    Relative,
    /// How that agrees with what the other says.
    Agreement,
}

impl BodyTopic {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Relative, Self::Agreement];

    /// Its place in the key.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Relative => "relative",
            Self::Agreement => "agreement",
        }
    }
}

/// What may be asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// As `POST /v1/poses`.
    Poses,
    /// As `POST /v1/detections`.
    Detections,
    /// As `POST /v1/estimates`.
    Estimates,
    /// As `GET /v1/cameras`.
    Cameras,
    /// As `GET /v1/targets`.
    Targets,
    /// As `GET /readyz`.
    Health,
}

impl Call {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Poses, Self::Detections, Self::Estimates, Self::Cameras, Self::Targets, Self::Health];

    /// Its place in the key.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Poses => "poses",
            Self::Detections => "detections",
            Self::Estimates => "estimates",
            Self::Cameras => "cameras",
            Self::Targets => "targets",
            Self::Health => "health",
        }
    }
}

/// A key under a camera, read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraKey {
    /// The node that listens.
    pub node: String,
    /// The camera.
    pub camera: String,
}

/// A key of what a node tells of another's body, read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BodyKey {
    /// The node that tells it.
    pub node: String,
    /// The other.
    pub other: String,
}

/// All keys of a group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Keys {
    prefix: String,
    group: String,
}

impl Keys {
    /// Of the settings.
    #[must_use]
    pub fn of(settings: &ZenohSettings) -> Self {
        Self { prefix: settings.prefix.clone(), group: settings.group.clone() }
    }

    /// A camera's key; `*` is any node or camera.
    ///
    /// # Errors
    /// A name that is none.
    pub fn camera(&self, node: &str, camera: &str, topic: Topic) -> Result<KeyExpr<'static>, Fault> {
        self.build(CAMERA, &[("node", node), ("camera", camera), ("topic", topic.name())])
    }

    /// What may be asked of a node.
    ///
    /// # Errors
    /// A name that is none.
    pub fn rpc(&self, node: &str, call: Call) -> Result<KeyExpr<'static>, Fault> {
        self.build(RPC, &[("node", node), ("call", call.name())])
    }

    /// What a node tells of another's body; `*` is any node.
    ///
    /// # Errors
    /// A name that is none.
    pub fn body(&self, node: &str, other: &str, topic: BodyTopic) -> Result<KeyExpr<'static>, Fault> {
        self.build(BODY, &[("node", node), ("other", other), ("topic", topic.name())])
    }

    /// That a node is there.
    ///
    /// # Errors
    /// A name that is none.
    pub fn alive_node(&self, node: &str) -> Result<KeyExpr<'static>, Fault> {
        self.build(ALIVE_NODE, &[("node", node)])
    }

    /// That a node listens to a camera.
    ///
    /// # Errors
    /// A name that is none.
    pub fn alive_camera(&self, node: &str, camera: &str) -> Result<KeyExpr<'static>, Fault> {
        self.build(ALIVE_CAMERA, &[("node", node), ("camera", camera)])
    }

    /// Node and camera of a key under a camera; nothing if it is no such key, or if names in it are none.
    #[must_use]
    pub fn read_camera(&self, key: &keyexpr) -> Option<CameraKey> {
        let [node, camera] = self.read(CAMERA, key, ["node", "camera"])?;
        Some(CameraKey { node, camera })
    }

    /// Node and camera of what tells that a node listens to a camera.
    #[must_use]
    pub fn read_alive_camera(&self, key: &keyexpr) -> Option<CameraKey> {
        let [node, camera] = self.read(ALIVE_CAMERA, key, ["node", "camera"])?;
        Some(CameraKey { node, camera })
    }

    /// The nodes of a key of what one tells of the other's body.
    #[must_use]
    pub fn read_body(&self, key: &keyexpr) -> Option<BodyKey> {
        let [node, other] = self.read(BODY, key, ["node", "other"])?;
        Some(BodyKey { node, other })
    }

    fn build(&self, format: &str, parts: &[(&str, &str)]) -> Result<KeyExpr<'static>, Fault> {
        let internal = |error: &dyn std::fmt::Display| Fault::new(FaultKind::Internal, format!("a key: {error}"));
        let format = KeFormat::new(format).map_err(|error| internal(&error))?;
        let mut key = format.formatter();
        for (part, value) in [("prefix", self.prefix.as_str()), ("group", self.group.as_str())].iter().chain(parts) {
            // The prefix is checked with the settings.
            if *part != "prefix" && *value != "*" {
                check_name(value)?;
            }
            key.set(part, value).map_err(|_| internal(&format!("{part} cannot be {value:?}")))?;
        }
        let key: OwnedKeyExpr = key.build().map_err(|error| internal(&error))?;
        Ok(key.into())
    }

    fn read(&self, format: &str, key: &keyexpr, [first, second]: [&str; 2]) -> Option<[String; 2]> {
        let format = KeFormat::new(format).ok()?;
        let parsed = format.parse(key).ok()?;
        let name = |part: &str| parsed.get(part).ok().filter(|name| check_name(name).is_ok()).map(str::to_owned);
        if parsed.get("prefix").ok()? != self.prefix || parsed.get("group").ok()? != self.group {
            return None;
        }
        Some([name(first)?, name(second)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys() -> Keys {
        Keys::of(&ZenohSettings::default())
    }

    #[test]
    fn they_are_those_of_the_contract() {
        let keys = keys();
        let text = |key: Result<KeyExpr<'static>, Fault>| key.expect("a key").to_string();
        assert_eq!(text(keys.camera("alpha", "front", Topic::Frame)), "skypose/v1/default/alpha/camera/front/frame");
        assert_eq!(text(keys.rpc("alpha", Call::Poses)), "skypose/v1/default/alpha/rpc/poses");
        assert_eq!(text(keys.alive_node("alpha")), "skypose/v1/@alive/default/alpha");
        assert_eq!(text(keys.alive_camera("alpha", "front")), "skypose/v1/@alive/default/alpha/front");
        let body = keys.body("alpha", "beta", BodyTopic::Relative);
        assert_eq!(text(body), "skypose/v1/default/alpha/body/beta/relative");
        assert_eq!(text(keys.camera("*", "*", Topic::Estimate)), "skypose/v1/default/*/camera/*/estimate");
    }

    #[test]
    fn what_is_written_is_read() {
        let keys = keys();
        let found = CameraKey { node: "alpha".into(), camera: "front.left-2".into() };
        for topic in Topic::ALL {
            let key = keys.camera(&found.node, &found.camera, topic).expect("a key");
            assert_eq!(keys.read_camera(&key), Some(found.clone()));
        }
        let key = keys.alive_camera(&found.node, &found.camera).expect("a key");
        assert_eq!(keys.read_alive_camera(&key), Some(found));
        let found = BodyKey { node: "alpha".into(), other: "beta-2".into() };
        for topic in BodyTopic::ALL {
            let key = keys.body(&found.node, &found.other, topic).expect("a key");
            assert_eq!((keys.read_body(&key), keys.read_camera(&key)), (Some(found.clone()), None));
        }
    }

    #[test]
    fn what_is_no_name_stands_in_no_key() {
        let keys = keys();
        for name in ["", "**", "$*", "a/b", "@alive", "a b", "-x", "a?b", "a#b", &"x".repeat(65)] {
            assert!(keys.camera("alpha", name, Topic::Frame).is_err(), "{name}");
            assert!(keys.alive_node(name).is_err(), "{name}");
        }
    }

    #[test]
    fn foreign_keys_are_none_of_ours() {
        let keys = keys();
        for key in [
            "skypose/v1/other/alpha/camera/front/frame",
            "skypose/v2/default/alpha/camera/front/frame",
            "skypose/v1/default/alpha/camera/fr nt/frame",
            "skypose/v1/default/alpha/camera/@x/frame",
            "skypose/v1/default/alpha/camera/*/frame",
            "skypose/v1/default/alpha/rpc/poses",
            "a",
        ] {
            assert_eq!(keys.read_camera(keyexpr::new(key).expect("a key")), None, "{key}");
        }
    }
}
