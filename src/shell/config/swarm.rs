//! Where cameras sit on this node's vehicle, what others wear, and how views are compared.

use std::collections::BTreeSet;
use std::time::Duration;

use nalgebra::{Matrix6, Vector3};
use serde::{Deserialize, Serialize};

use super::NAME;
use crate::geometry::space::{Peer, Target};
use crate::geometry::{EulerAngles, Transform, UncertainTransform, mount};
use crate::shell::store::check_name;
use crate::swarm::{Mounts, SwarmOptions, Worn};

/// Nodes that see each other.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct SwarmSettings {
    /// Share of comparisons that are called disagreements although nothing is wrong.
    pub significance: f64,
    /// Frames further apart in time are not compared.
    pub max_apart_ms: u64,
    /// Standard deviation of other nodes' clocks against ours.
    pub clock_sigma_ms: f64,
    /// Where our cameras sit.
    pub cameras: Vec<SwarmCamera>,
    /// What others wear.
    pub bodies: Vec<SwarmBody>,
}

/// A camera on this node's vehicle.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SwarmCamera {
    /// Name of its stream.
    pub camera: String,
    /// Roll, pitch and yaw of the camera on the vehicle; all zero looks forward.
    #[serde(default)]
    pub turned_rad: [f64; 3],
    /// Forward, right, down of the vehicle's origin.
    #[serde(default)]
    pub position_m: [f64; 3],
    /// Standard deviation of each angle; 0 is exact.
    #[serde(default)]
    pub turned_sigma_rad: f64,
    /// Standard deviation of each coordinate; 0 is exact.
    #[serde(default)]
    pub position_sigma_m: f64,
}

/// The target that another node's vehicle wears.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SwarmBody {
    /// The other node.
    pub node: String,
    /// Name of the stored target.
    pub target: String,
    /// Roll, pitch and yaw of the target's axes on the vehicle; all zero: x is forward, y right, z down.
    #[serde(default)]
    pub turned_rad: [f64; 3],
    /// The target's origin forward, right, down of the vehicle's.
    #[serde(default)]
    pub position_m: [f64; 3],
    /// Standard deviation of each angle; 0 is exact.
    #[serde(default)]
    pub turned_sigma_rad: f64,
    /// Standard deviation of each coordinate; 0 is exact.
    #[serde(default)]
    pub position_sigma_m: f64,
}

impl Default for SwarmSettings {
    fn default() -> Self {
        let core = SwarmOptions::default();
        Self {
            significance: core.significance,
            max_apart_ms: 200,
            clock_sigma_ms: core.clock_sigma.as_secs_f64() * 1e3,
            cameras: Vec::new(),
            bodies: Vec::new(),
        }
    }
}

impl SwarmSettings {
    /// For the core.
    #[must_use]
    pub fn options(&self) -> SwarmOptions {
        SwarmOptions {
            significance: self.significance,
            max_apart: Duration::from_millis(self.max_apart_ms),
            clock_sigma: Duration::try_from_secs_f64(self.clock_sigma_ms / 1e3).unwrap_or_default(),
        }
    }

    /// What sits where.
    #[must_use]
    pub fn mounts(&self) -> Mounts {
        let camera = |camera: &SwarmCamera| {
            let transform = mount::body_from_camera(angles(camera.turned_rad), camera.position_m);
            let covariance = covariance(camera.position_sigma_m, camera.turned_sigma_rad);
            (camera.camera.clone(), UncertainTransform { transform, covariance })
        };
        let peer = |body: &SwarmBody| {
            let turn = angles(body.turned_rad).to_rotation();
            let transform = Transform::<Peer, Target>::new(turn, Vector3::from(body.position_m));
            let covariance = covariance(body.position_sigma_m, body.turned_sigma_rad);
            let peer_from_target = UncertainTransform { transform, covariance };
            (body.node.clone(), Worn { target: body.target.clone(), peer_from_target })
        };
        Mounts { cameras: self.cameras.iter().map(camera).collect(), peers: self.bodies.iter().map(peer).collect() }
    }

    pub(super) fn faults(&self, need: &mut impl FnMut(bool, &str, &str)) {
        need(self.significance >= 1e-12 && self.significance <= 0.5, "swarm.significance", "must be from 1e-12 to 0.5");
        need((1..=10_000).contains(&self.max_apart_ms), "swarm.max_apart_ms", "must be from 1 to 10000");
        need((0.0..=10_000.0).contains(&self.clock_sigma_ms), "swarm.clock_sigma_ms", "must be from 0 to 10000");
        need(self.bodies.is_empty() || !self.cameras.is_empty(), "swarm.cameras", "must be told where bodies are");
        let mut check = |at: &str, [turned_rad, position_m]: [&[f64; 3]; 2], [turned, position]: [f64; 2]| {
            let within = |most: f64, values: &[f64; 3]| values.iter().all(|value| value.abs() <= most);
            need(within(6.3, turned_rad), &format!("{at}.turned_rad"), "must be from -6.3 to 6.3 each");
            need(within(1000.0, position_m), &format!("{at}.position_m"), "must be from -1000 to 1000 each");
            need((0.0..=0.5).contains(&turned), &format!("{at}.turned_sigma_rad"), "must be from 0 to 0.5");
            need((0.0..=100.0).contains(&position), &format!("{at}.position_sigma_m"), "must be from 0 to 100");
        };
        for c in &self.cameras {
            check("swarm.cameras", [&c.turned_rad, &c.position_m], [c.turned_sigma_rad, c.position_sigma_m]);
        }
        for b in &self.bodies {
            check("swarm.bodies", [&b.turned_rad, &b.position_m], [b.turned_sigma_rad, b.position_sigma_m]);
        }
        let (mut cameras, mut nodes) = (BTreeSet::new(), BTreeSet::new());
        for camera in &self.cameras {
            need(check_name(&camera.camera).is_ok(), "swarm.cameras.camera", NAME);
            need(cameras.insert(&camera.camera), "swarm.cameras.camera", "must not be named twice");
        }
        for body in &self.bodies {
            need(check_name(&body.node).is_ok(), "swarm.bodies.node", NAME);
            need(nodes.insert(&body.node), "swarm.bodies.node", "must not be named twice");
            need(check_name(&body.target).is_ok(), "swarm.bodies.target", NAME);
        }
    }
}

const fn angles([roll_rad, pitch_rad, yaw_rad]: [f64; 3]) -> EulerAngles {
    EulerAngles { roll_rad, pitch_rad, yaw_rad }
}

/// The same in all directions.
fn covariance(position_sigma_m: f64, turned_sigma_rad: f64) -> Matrix6<f64> {
    let mut covariance = Matrix6::zeros();
    covariance.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(position_sigma_m.powi(2));
    covariance.fixed_view_mut::<3, 3>(3, 3).fill_diagonal(turned_sigma_rad.powi(2));
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::config::load;

    #[test]
    fn the_defaults_are_those_of_the_core() {
        assert_eq!(SwarmSettings::default().options(), SwarmOptions::default());
        assert_eq!(SwarmSettings::default().mounts(), Mounts::default());
    }

    #[test]
    fn mounts_are_read_and_nonsense_is_named() {
        let file = "[swarm]\nmax_apart_ms = 50\n[[swarm.cameras]]\ncamera = \"front\"\nposition_m = [0.2, 0, 0.1]\n\
                    turned_sigma_rad = 0.01\n[[swarm.bodies]]\nnode = \"beta\"\ntarget = \"wing\"\nturned_rad = [0, -1.5, 0]\n";
        let settings = load(Some(file), [], &[]).expect("good settings").swarm;
        let mounts = settings.mounts();
        let camera = &mounts.cameras["front"];
        assert!((camera.transform.translation - Vector3::new(0.2, 0.0, 0.1)).norm() < 1e-15);
        assert!((camera.covariance[(4, 4)] - 1e-4).abs() < 1e-15 && camera.covariance[(0, 0)].abs() < 1e-15);
        assert_eq!(mounts.peers["beta"].target, "wing");
        assert_eq!(settings.options().max_apart, Duration::from_millis(50));
        let file = "[swarm]\nsignificance = 0\n[[swarm.bodies]]\nnode = \"a b\"\ntarget = \"wing\"\nposition_sigma_m = -1\n\
                    [[swarm.bodies]]\nnode = \"a b\"\ntarget = \"\"\n";
        let faults = load(Some(file), [], &[]).expect_err("faults");
        for setting in [
            "swarm.significance",
            "swarm.cameras",
            "swarm.bodies.node",
            "swarm.bodies.target",
            "swarm.bodies.position_sigma_m",
        ] {
            assert!(faults.iter().any(|fault| fault.setting == setting), "{setting}: {faults:?}");
        }
    }
}
