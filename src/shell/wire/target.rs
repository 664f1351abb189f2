//! The target of the contract.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::shell::fault::Fault;
use crate::target::{Marker, Target};

/// A constellation of four or more markers, coplanar or not.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Target)]
pub struct TargetWire {
    /// Its name.
    #[serde(default = "TargetWire::unnamed")]
    pub name: String,
    /// Its markers.
    #[schema(min_items = 4, max_items = 64)]
    pub markers: Vec<MarkerWire>,
}

/// One marker of a constellation.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Marker)]
pub struct MarkerWire {
    /// Its name, unique within the target.
    pub id: String,
    /// Where its centre sits in the target frame.
    pub position_m: [f64; 3],
    /// Radius of the disc or LED.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0)]
    pub radius_m: Option<f64>,
    /// The direction that it faces in the target frame; it can be seen only from that side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f64; 3]>,
}

impl TargetWire {
    /// The name of a target that was given none.
    #[must_use]
    pub fn unnamed() -> String {
        "target".into()
    }
}

impl TryFrom<&TargetWire> for Target {
    type Error = Fault;

    fn try_from(wire: &TargetWire) -> Result<Self, Fault> {
        let markers = wire
            .markers
            .iter()
            .map(|marker| Marker {
                id: marker.id.clone(),
                position: marker.position_m.into(),
                radius_m: marker.radius_m,
                normal: marker.normal.map(Vector3::from),
            })
            .collect();
        Self::checked(wire.name.clone(), markers).map_err(|error| Fault::of_target(&error))
    }
}

impl From<&Target> for TargetWire {
    fn from(target: &Target) -> Self {
        let marker = |marker: &Marker| MarkerWire {
            id: marker.id.clone(),
            position_m: marker.position.coords.into(),
            radius_m: marker.radius_m,
            // A negative zero would be written as -0.0.
            normal: marker.normal.map(|normal| normal.add_scalar(0.0).into()),
        };
        Self { name: target.name().into(), markers: target.markers().iter().map(marker).collect() }
    }
}
