//! Cameras that ROS 2 has, and how it comes to the network.

use serde::{Deserialize, Serialize};

use super::NAME;
use crate::shell::store::check_name;

/// Robots that speak ROS 2, on the network of [`ZenohSettings`](super::ZenohSettings).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct RosSettings {
    /// How ROS comes to the network.
    pub form: RosForm,
    /// `ROS_DOMAIN_ID`, for `rmw_zenoh`.
    pub domain: u32,
    /// Whether the hash of a type is in its keys, for `rmw_zenoh`: from Iron on. Humble has none.
    pub type_hash: bool,
    /// Name of our node in the graph of ROS, for `rmw_zenoh`.
    pub node: String,
    /// The cameras.
    pub cameras: Vec<RosCamera>,
}

/// How ROS 2 comes to a Zenoh network.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RosForm {
    /// Its nodes speak Zenoh themselves.
    #[default]
    RmwZenoh,
    /// Its nodes speak DDS, and `zenoh-bridge-ros2dds` stands between.
    Bridge,
}

/// A camera that ROS has.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RosCamera {
    /// Name of the stream that says what is looked for in its frames.
    pub camera: String,
    /// Topic of its frames, `sensor_msgs/msg/CompressedImage`.
    pub image: String,
    /// Topic of its intrinsics, `sensor_msgs/msg/CameraInfo`; empty where the stored camera counts alone.
    #[serde(default)]
    pub camera_info: String,
    /// Topic of the poses, `geometry_msgs/msg/PoseWithCovarianceStamped`; `{target}` in it stands for the target's name.
    pub pose: String,
    /// The coordinate system of the poses; empty is that of the frames.
    #[serde(default)]
    pub frame_id: String,
}

impl Default for RosSettings {
    fn default() -> Self {
        Self { form: RosForm::RmwZenoh, domain: 0, type_hash: true, node: "skypose".into(), cameras: Vec::new() }
    }
}

impl RosSettings {
    pub(super) fn faults(&self, network: &str, need: &mut impl FnMut(bool, &str, &str)) {
        need(self.domain <= 232, "ros.domain", "must be at most 232");
        let node = format!("/{}", self.node);
        need(
            is_topic(&node) && !self.node.contains('/'),
            "ros.node",
            "must be letters, digits and '_', no digit first",
        );
        need(self.cameras.is_empty() || !network.is_empty(), "ros.cameras", "need a network: zenoh.network is empty");
        for (index, camera) in self.cameras.iter().enumerate() {
            let is_second = |of: fn(&RosCamera) -> &str| self.cameras[..index].iter().any(|c| of(c) == of(camera));
            need(check_name(&camera.camera).is_ok(), "ros.cameras.camera", NAME);
            need(!is_second(|c| &c.camera), "ros.cameras.camera", "must not be named twice");
            need(!is_second(|c| &c.image), "ros.cameras.image", "must not be named twice");
            need(is_topic(&camera.image), "ros.cameras.image", TOPIC);
            need(camera.camera_info.is_empty() || is_topic(&camera.camera_info), "ros.cameras.camera_info", TOPIC);
            need(is_topic(&camera.pose.replace("{target}", "target")), "ros.cameras.pose", TOPIC);
            let is_frame = camera.frame_id.len() <= 255 && !camera.frame_id.contains(char::is_control);
            need(is_frame, "ros.cameras.frame_id", "must be at most 255 bytes of text");
        }
    }
}

/// What a topic must be.
const TOPIC: &str =
    "must be a topic as /front/image_raw/compressed: a slash before each part, letters, digits and '_', no digit first";

/// Whether this is the full name of a topic.
fn is_topic(name: &str) -> bool {
    let is_part = |part: &str| {
        part.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    name.len() <= 255 && name.strip_prefix('/').is_some_and(|rest| rest.split('/').all(is_part))
}
