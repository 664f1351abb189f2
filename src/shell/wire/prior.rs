//! What is known of a pose before it is seen.

use nalgebra::{Matrix6, Quaternion, Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::geometry::space::Space;
use crate::geometry::{CameraFromTarget, PoseCovariance, Transform, rotation};
use crate::pose::PosePrior;
use crate::shell::fault::Fault;

/// What is known of a pose beforehand; it enters by Bayes' rule. Everything may be left out.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Prior)]
#[serde(deny_unknown_fields)]
pub struct PriorWire {
    /// The camera sees the target from this side: a direction in the target frame, of any length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visible_side: Option<[f64; 3]>,
    /// Least and greatest roll.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roll_rad: Option<[f64; 2]>,
    /// Least and greatest pitch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pitch_rad: Option<[f64; 2]>,
    /// Least and greatest yaw.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yaw_rad: Option<[f64; 2]>,
    /// The pose as predicted, for instance that of the last reply with the covariance grown since.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<PredictedWire>,
}

/// A predicted pose: the same fields as in a reply, of which the others are ignored.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = PredictedPose)]
pub struct PredictedWire {
    /// Attitude.
    pub rotation: QuaternionWire,
    /// Origin of the target frame in the camera frame.
    pub translation_m: [f64; 3],
    /// 6 x 6, order x, y, z, rotation about camera x, y, z; m and rad.
    pub covariance: [[f64; 6]; 6],
}

/// An attitude.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Quaternion)]
pub struct QuaternionWire {
    /// x, y, z, w.
    pub quaternion_xyzw: [f64; 4],
}

impl TryFrom<&PriorWire> for PosePrior {
    type Error = Fault;

    fn try_from(wire: &PriorWire) -> Result<Self, Fault> {
        let visible_side = wire
            .visible_side
            .map(|side| {
                let side = Vector3::from(side);
                Unit::try_new(side, 1e-12).filter(|unit| unit.iter().all(|x| x.is_finite())).ok_or_else(|| {
                    Fault::senseless("/visible_side", "a direction that is finite and not zero is expected")
                })
            })
            .transpose()?;
        let limits = |name: &str, limits: Option<[f64; 2]>| match limits {
            Some([from, to]) if !(from.is_finite() && to.is_finite() && from < to) => {
                Err(Fault::senseless(format!("/{name}"), format!("[{from}, {to}]: the least comes first, both finite")))
            }
            // A whole turn forbids nothing.
            Some([from, to]) if to - from >= std::f64::consts::TAU => Ok(None),
            limits => Ok(limits),
        };
        let euler_limits_rad = [
            limits("roll_rad", wire.roll_rad)?,
            limits("pitch_rad", wire.pitch_rad)?,
            limits("yaw_rad", wire.yaw_rad)?,
        ];
        let predicted = wire.pose.as_ref().map(predicted).transpose().map_err(|fault| fault.within("/pose"))?;
        Ok(Self { visible_side, euler_limits_rad, predicted })
    }
}

fn predicted(wire: &PredictedWire) -> Result<(CameraFromTarget, PoseCovariance), Fault> {
    sound_pose(wire.rotation.quaternion_xyzw, wire.translation_m, &wire.covariance)
}

/// A pose with its covariance, if both are.
///
/// # Errors
/// Names the field.
pub(super) fn sound_pose<To: Space, From: Space>(
    [x, y, z, w]: [f64; 4],
    translation_m: [f64; 3],
    covariance: &[[f64; 6]; 6],
) -> Result<(Transform<To, From>, PoseCovariance), Fault> {
    let quaternion = Quaternion::new(w, x, y, z);
    // Written with six digits, a unit quaternion is one to some 1e-6.
    if !((quaternion.norm() - 1.0).abs() < 1e-3) {
        let detail = format!("a quaternion of length {}: a rotation has length 1", quaternion.norm());
        return Err(Fault::senseless("/rotation/quaternion_xyzw", detail));
    }
    let translation = Vector3::from(translation_m);
    if !translation.iter().all(|x| x.abs() <= 1e6) {
        return Err(Fault::senseless("/translation_m", "three finite numbers within 1000000 are expected"));
    }
    let covariance = PoseCovariance::checked(Matrix6::from_fn(|row, column| covariance[row][column]))
        .ok_or_else(|| Fault::senseless("/covariance", "a symmetric positive definite matrix is expected"))?;
    let rotation = rotation::from_quaternion(&UnitQuaternion::new_normalize(quaternion));
    Ok((Transform::new(rotation, translation), covariance))
}
