//! Poses as messages.

use ::mavlink::MavHeader;
use ::mavlink::dialects::common::{
    HEARTBEAT_DATA, LANDING_TARGET_DATA, LandingTargetType, MavAutopilot, MavBool, MavEstimatorType, MavFrame,
    MavMessage, MavModeFlag, MavState, MavType, ODOMETRY_DATA,
};
use nalgebra::{Matrix6, Quaternion, UnitQuaternion, Vector3};

use crate::geometry::space::{Body, Target};
use crate::geometry::{BodyFromCamera, CameraFromTarget, PoseCovariance, Transform, rotation};
use crate::shell::wire::PoseWire;

/// That we are there: a computer on board, no autopilot.
pub(super) fn heartbeat() -> MavMessage {
    MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        base_mode: MavModeFlag::empty(),
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: 3,
    })
}

fn camera_from_target(pose: &PoseWire) -> CameraFromTarget {
    let [x, y, z, w] = pose.rotation.quaternion_xyzw;
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    CameraFromTarget::new(rotation::from_quaternion(&turn), Vector3::from(pose.translation_m))
}

#[expect(clippy::cast_possible_truncation, reason = "messages have single precision")]
const fn single(number: f64) -> f32 {
    number as f32
}

fn quaternion_wxyz(body_from_target: &Transform<Body, Target>) -> [f32; 4] {
    let turn = rotation::to_quaternion(&body_from_target.rotation);
    [turn.w, turn.i, turn.j, turn.k].map(single)
}

/// Whether all is a number.
fn is_sound(numbers: &[f32]) -> bool {
    numbers.iter().all(|number| number.is_finite())
}

/// The target from the vehicle. `angle_x` and `angle_y` are those of the picture, right and down of its optical axis, as the first version
/// of the message has them; place and attitude are in the body's axes, forward, right, down. How large it looks is left at 0.
pub(super) fn landing_target(
    time_us: u64,
    number: u8,
    pose: &PoseWire,
    body_from_camera: &BodyFromCamera,
) -> Option<MavMessage> {
    let seen = camera_from_target(pose);
    let body_from_target = *body_from_camera * seen;
    let place = body_from_target.translation;
    let [x, y, z] = [place.x, place.y, place.z].map(single);
    let (sight, q) = (seen.translation, quaternion_wxyz(&body_from_target));
    let [angle_x, angle_y] = [sight.x.atan2(sight.z), sight.y.atan2(sight.z)].map(single);
    // From the vehicle, as x, y and z are: receivers divide these by it for the line of sight.
    let distance = single(place.norm());
    is_sound(&[x, y, z, angle_x, angle_y, distance, q[0], q[1], q[2], q[3]]).then_some(MavMessage::LANDING_TARGET(
        LANDING_TARGET_DATA {
            time_usec: time_us,
            angle_x,
            angle_y,
            distance,
            size_x: 0.0,
            size_y: 0.0,
            target_num: number,
            frame: MavFrame::MAV_FRAME_BODY_FRD,
            x,
            y,
            z,
            q,
            mavtype: LandingTargetType::LANDING_TARGET_TYPE_VISION_OTHER,
            position_valid: MavBool::MAV_BOOL_TRUE,
        },
    ))
}

/// The target's pose in the body's axes, with its covariance. Speeds are not known, which NaN says here.
pub(super) fn odometry(time_us: u64, pose: &PoseWire, body_from_camera: &BodyFromCamera) -> Option<MavMessage> {
    let covariance = PoseCovariance::checked(Matrix6::from_fn(|row, column| pose.covariance[row][column]))?;
    let covariance = covariance.turned(&body_from_camera.rotation);
    let body_from_target = *body_from_camera * camera_from_target(pose);
    let place = body_from_target.translation;
    let [x, y, z] = [place.x, place.y, place.z].map(single);
    let q = quaternion_wxyz(&body_from_target);
    let upper = (0..6).flat_map(|row| (row..6).map(move |column| (row, column)));
    let mut pose_covariance = [0.0; 21];
    for (entry, place) in pose_covariance.iter_mut().zip(upper) {
        *entry = single(covariance.matrix()[place]);
    }
    let is_sound = is_sound(&[x, y, z, q[0], q[1], q[2], q[3]]) && is_sound(&pose_covariance);
    is_sound.then_some(MavMessage::ODOMETRY(ODOMETRY_DATA {
        time_usec: time_us,
        x,
        y,
        z,
        q,
        vx: f32::NAN,
        vy: f32::NAN,
        vz: f32::NAN,
        rollspeed: f32::NAN,
        pitchspeed: f32::NAN,
        yawspeed: f32::NAN,
        pose_covariance,
        velocity_covariance: [f32::NAN; 21],
        frame_id: MavFrame::MAV_FRAME_BODY_FRD,
        child_frame_id: MavFrame::MAV_FRAME_BODY_FRD,
        reset_counter: 0,
        estimator_type: MavEstimatorType::MAV_ESTIMATOR_TYPE_VISION,
        quality: 0,
    }))
}

/// One message in one datagram, MAVLink 2.
pub(super) fn datagram(header: MavHeader, message: &MavMessage) -> Vec<u8> {
    let mut datagram = Vec::with_capacity(280);
    // Nothing can go wrong in memory.
    let _ = ::mavlink::write_v2_msg(&mut datagram, header, message);
    datagram
}
