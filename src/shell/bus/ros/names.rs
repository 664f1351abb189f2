//! Topics of ROS as keys of Zenoh, in the two ways in which ROS 2 comes there, and what tells others that we are there.
//!
//! `rmw_zenoh`: `<domain>/<topic>/<type>/<hash of the type>`, an attachment, liveliness tokens under `@ros2_lv` (its
//! `liveliness_utils.cpp`). `zenoh-bridge-ros2dds`: the topic alone.

use xxhash_rust::xxh3::xxh3_128;

use super::messages::MessageType;
use crate::shell::config::{RosForm, RosSettings};
use crate::shell::fault::{Fault, FaultKind};

/// What stands for the hash where there is none: in Humble.
const NO_HASH: &str = "TypeHashNotSupported";
/// Reliable, volatile, the last ten: as rmw_zenoh writes what differs from its defaults.
const QOS: &str = "::,10:,:,:,,";

/// Key on which a message of this topic is sent.
#[must_use]
pub fn sent_on(settings: &RosSettings, topic: &str, of: MessageType) -> String {
    match settings.form {
        RosForm::RmwZenoh => format!("{}/{}", typed(settings, topic, of), hash(settings, of)),
        RosForm::Bridge => without_slash(topic).to_owned(),
    }
}

/// Key under which messages of this topic are waited for: with any hash, so that one that is not ours is told of.
#[must_use]
pub fn heard_on(settings: &RosSettings, topic: &str, of: MessageType) -> String {
    match settings.form {
        RosForm::RmwZenoh => format!("{}/*", typed(settings, topic, of)),
        RosForm::Bridge => without_slash(topic).to_owned(),
    }
}

/// That a message on this key has the type's own definition.
///
/// # Errors
/// One of another.
pub fn check_hash(settings: &RosSettings, key: &str, of: MessageType) -> Result<(), Fault> {
    let found = key.rsplit('/').next().unwrap_or_default();
    if settings.form == RosForm::Bridge || found == of.hash || found == NO_HASH {
        return Ok(());
    }
    let shown: String = found.chars().take(80).collect();
    let detail = format!("type hash {shown}: {} has {}, or {NO_HASH} from Humble", of.dds_name, of.hash);
    Err(Fault::new(FaultKind::Senseless, detail))
}

fn typed(settings: &RosSettings, topic: &str, of: MessageType) -> String {
    format!("{}/{}/{}", settings.domain, without_slash(topic), of.dds_name)
}

fn hash(settings: &RosSettings, of: MessageType) -> &'static str {
    if settings.type_hash { of.hash } else { NO_HASH }
}

fn without_slash(topic: &str) -> &str {
    topic.trim_start_matches('/')
}

/// A name as a part of a topic: what may not stand there becomes `_`.
#[must_use]
pub fn as_part(name: &str) -> String {
    let part: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if part.starts_with(|c: char| c.is_ascii_digit()) { format!("_{part}") } else { part }
}

/// Who we are in the graph of ROS: one node on one session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    domain: u32,
    session: String,
    name: String,
    type_hash: bool,
}

impl Node {
    /// The settings' node on the session of this id.
    #[must_use]
    pub fn new(settings: &RosSettings, session: &str) -> Self {
        Self {
            domain: settings.domain,
            session: session.into(),
            name: settings.node.clone(),
            type_hash: settings.type_hash,
        }
    }

    /// Token of the node itself.
    #[must_use]
    pub fn token(&self) -> String {
        format!("@ros2_lv/{}/{}/0/0/NN/%/%/{}", self.domain, self.session, self.name)
    }

    /// Token of a publisher, which has the number `entity` on the session.
    #[must_use]
    pub fn publisher_token(&self, entity: u32, topic: &str, of: MessageType) -> String {
        self.entity_token("MP", entity, topic, of)
    }

    /// Token of a subscription.
    #[must_use]
    pub fn subscription_token(&self, entity: u32, topic: &str, of: MessageType) -> String {
        self.entity_token("MS", entity, topic, of)
    }

    fn entity_token(&self, kind: &str, entity: u32, topic: &str, of: MessageType) -> String {
        let hash = if self.type_hash { of.hash } else { NO_HASH };
        let topic = topic.replace('/', "%");
        format!(
            "@ros2_lv/{}/{}/0/{entity}/{kind}/%/%/{}/{topic}/{}/{hash}/{QOS}",
            self.domain, self.session, self.name, of.dds_name
        )
    }
}

/// What stands beside a message of `rmw_zenoh`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Number of the message, from 1.
    pub sequence: i64,
    /// When it was sent, nanoseconds since the Unix epoch.
    pub source_ns: i64,
    /// Who has sent it.
    pub gid: [u8; 16],
}

/// Length of an attachment.
const ATTACHMENT_BYTES: usize = 33;

impl Attachment {
    /// Name of the publisher with this token: its XXH3 of 128 bits, the lower half first.
    #[must_use]
    pub fn gid_of(token: &str) -> [u8; 16] {
        xxh3_128(token.as_bytes()).to_le_bytes()
    }

    /// As bytes.
    #[must_use]
    pub fn bytes(&self) -> Vec<u8> {
        [&self.sequence.to_le_bytes()[..], &self.source_ns.to_le_bytes(), &[16], &self.gid].concat()
    }

    /// Of bytes; nothing where they are no attachment.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; ATTACHMENT_BYTES] = bytes.try_into().ok()?;
        let (sequence, rest) = bytes.split_first_chunk()?;
        let (source_ns, rest) = rest.split_first_chunk()?;
        let gid = rest.strip_prefix(&[16])?.try_into().ok()?;
        Some(Self { sequence: i64::from_le_bytes(*sequence), source_ns: i64::from_le_bytes(*source_ns), gid })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::messages::{COMPRESSED_IMAGE, POSE};
    use super::*;

    #[test]
    fn keys_are_those_of_rmw_zenoh_and_of_the_bridge() {
        let mut settings = RosSettings { domain: 7, ..RosSettings::default() };
        let image = "/front/image_raw/compressed";
        let base = "7/front/image_raw/compressed/sensor_msgs::msg::dds_::CompressedImage_";
        assert_eq!(sent_on(&settings, image, COMPRESSED_IMAGE), format!("{base}/{}", COMPRESSED_IMAGE.hash));
        assert_eq!(heard_on(&settings, image, COMPRESSED_IMAGE), format!("{base}/*"));
        settings.type_hash = false;
        assert_eq!(sent_on(&settings, image, COMPRESSED_IMAGE), format!("{base}/TypeHashNotSupported"));
        for (hash, is_good) in [(COMPRESSED_IMAGE.hash, true), (NO_HASH, true), (POSE.hash, false), ("", false)] {
            assert_eq!(check_hash(&settings, &format!("{base}/{hash}"), COMPRESSED_IMAGE).is_ok(), is_good, "{hash}");
        }
        settings.form = RosForm::Bridge;
        assert_eq!(sent_on(&settings, image, COMPRESSED_IMAGE), "front/image_raw/compressed");
        assert!(check_hash(&settings, "front/image_raw/compressed", COMPRESSED_IMAGE).is_ok());
    }

    #[test]
    fn tokens_are_those_of_rmw_zenoh() {
        let node = Node::new(&RosSettings { domain: 2, ..RosSettings::default() }, "abc123");
        assert_eq!(node.token(), "@ros2_lv/2/abc123/0/0/NN/%/%/skypose");
        let hash = POSE.hash;
        assert_eq!(
            node.publisher_token(4, "/skypose/front/pose", POSE),
            format!(
                "@ros2_lv/2/abc123/0/4/MP/%/%/skypose/%skypose%front%pose/geometry_msgs::msg::dds_::PoseWithCovarianceStamped_/{hash}/::,10:,:,:,,"
            )
        );
        assert!(node.subscription_token(1, "/x", COMPRESSED_IMAGE).contains("/0/1/MS/%/%/skypose/%x/"));
    }

    #[test]
    fn names_of_publishers_are_xxh3_of_their_tokens() {
        // XXH3 of nothing, from its reference implementation: 99aa06d3014798d86001c324468d497f.
        let mut known = 0x99aa_06d3_0147_98d8_6001_c324_468d_497f_u128.to_be_bytes();
        known.reverse();
        assert_eq!(Attachment::gid_of(""), known);
    }

    #[test]
    fn what_is_named_otherwise_becomes_a_part_of_a_topic() {
        assert_eq!((as_part("wing-six"), as_part("6.b"), as_part("ä")), ("wing_six".into(), "_6_b".into(), "_".into()));
    }

    proptest! {
        #[test]
        fn attachments_come_back_and_others_are_none(
            sequence in any::<i64>(), source_ns in any::<i64>(), gid in any::<[u8; 16]>(),
            other in proptest::collection::vec(any::<u8>(), 0..40)
        ) {
            let attachment = Attachment { sequence, source_ns, gid };
            prop_assert_eq!(attachment.bytes().len(), ATTACHMENT_BYTES);
            prop_assert_eq!(Attachment::read(&attachment.bytes()), Some(attachment));
            let is_one = other.len() == ATTACHMENT_BYTES && other[16] == 16;
            prop_assert_eq!(Attachment::read(&other).is_some(), is_one);
        }
    }
}
