//! Tracks: what targets do over time, as one camera sees them.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::act::ToActWire;
use super::pose::RotationWire;
use crate::encounter::{Means, to_act};
use crate::geometry::{Direction, Point};
use crate::track::{Hypothesis, Life, Loss, NoApproach, Track, Uncertain};

/// What is followed in a camera's frames, after one of them.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Tracks)]
pub struct TracksWire {
    /// When the frame was taken, as the camera says, or else when it came; microseconds since the Unix epoch.
    pub timestamp_us: i64,
    /// All tracks; one that ends is told of once more.
    pub tracks: Vec<TrackWire>,
}

/// One target over time.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Track)]
pub struct TrackWire {
    /// Names it among those of its target and camera as long as the service runs; never given twice.
    pub id: u64,
    /// The target.
    pub target: String,
    /// Where it stands in its life.
    pub life: LifeName,
    /// Why it is over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lost_because: Option<LossName>,
    /// Frames in which it was seen.
    pub seen_count: u32,
    /// Frames since it was last seen.
    pub coasted_count: u32,
    /// The most probable motion.
    pub motion: MotionWire,
    /// The others that the frames so far leave possible, by falling probability.
    pub alternatives: Vec<MotionWire>,
    /// What is left to do about it, by the most probable motion; where our speed is known, and the track not over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_act: Option<ToActWire>,
}

/// Where a track stands in its life.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = TrackLife)]
pub enum LifeName {
    /// Seen, but not often enough to be believed.
    Tentative,
    /// Believed, and seen in this frame.
    Confirmed,
    /// Believed, but not seen in this frame: what is told of it is predicted.
    Coasting,
    /// Over; told once.
    Lost,
}

/// Why a track is over.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = TrackLoss)]
pub enum LossName {
    /// Not seen often enough in its first frames.
    Unconfirmed,
    /// Not seen for too long.
    Unseen,
    /// Its position has become too uncertain.
    Uncertain,
    /// Too long a time between two frames.
    Gap,
    /// Its motion has left what numbers can tell.
    Diverged,
}

/// A pose and how it changes. What the camera itself does is in it.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Motion)]
pub struct MotionWire {
    /// That this motion and none of the alternatives is the right one.
    pub probability: f64,
    /// Attitude.
    pub rotation: RotationWire,
    /// Origin of the target frame in the camera frame.
    pub translation_m: [f64; 3],
    /// Length of the translation.
    pub range_m: f64,
    /// atan2(x, z), positive to the right.
    pub azimuth_rad: f64,
    /// atan2(-y, hypot(x, z)), positive up.
    pub elevation_rad: f64,
    /// 6 x 6 of the pose, as that of a pose without track.
    pub covariance: [[f64; 6]; 6],
    /// Velocity of the target's origin along the camera's axes.
    pub velocity_mps: [f64; 3],
    /// 3 x 3 of the velocity, (m/s)^2.
    pub velocity_covariance: [[f64; 3]; 3],
    /// Angular velocity about the camera's axes.
    pub angular_velocity_radps: [f64; 3],
    /// 3 x 3 of the angular velocity, (rad/s)^2.
    pub angular_velocity_covariance: [[f64; 3]; 3],
    /// Shrinking of the range, m/s.
    pub closing_speed_mps: Option<UncertainWire>,
    /// The closest approach if both velocities stay as they are; null where it is none or not known yet.
    pub closest_approach: Option<ApproachWire>,
    /// Why there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_approach: Option<NoApproachName>,
}

/// A number and its standard deviation.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Uncertain)]
pub struct UncertainWire {
    /// The number.
    pub value: f64,
    /// Its standard deviation, in the same unit.
    pub sigma: f64,
}

impl From<Uncertain> for UncertainWire {
    fn from(Uncertain { value, sigma }: Uncertain) -> Self {
        Self { value, sigma }
    }
}

/// The closest approach of target and camera.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = ClosestApproach)]
pub struct ApproachWire {
    /// Time until then.
    pub time_s: UncertainWire,
    /// Distance of the target's origin from the camera then.
    pub miss_m: UncertainWire,
}

/// Why no closest approach is told.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = NoApproach)]
pub enum NoApproachName {
    /// The target goes away.
    Receding,
    /// Whether it comes nearer is not known yet, or not at what speed.
    Undetermined,
}

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

impl From<&Hypothesis> for MotionWire {
    fn from(hypothesis: &Hypothesis) -> Self {
        let motion = &hypothesis.motion;
        let pose = motion.camera_from_target();
        let direction = Direction::of(Point::from(pose.translation));
        let covariance = motion.pose_covariance().matrix();
        let (closest_approach, no_approach) = match motion.closest_approach() {
            Ok(approach) => {
                (Some(ApproachWire { time_s: approach.time_s.into(), miss_m: approach.miss_m.into() }), None)
            }
            Err(NoApproach::Receding { .. }) => (None, Some(NoApproachName::Receding)),
            Err(NoApproach::Undetermined { .. }) => (None, Some(NoApproachName::Undetermined)),
        };
        Self {
            probability: hypothesis.probability,
            rotation: RotationWire::from(&pose.rotation),
            translation_m: pose.translation.into(),
            range_m: direction.range_m,
            azimuth_rad: direction.azimuth_rad,
            elevation_rad: direction.elevation_rad,
            covariance: std::array::from_fn(|row| std::array::from_fn(|column| covariance[(row, column)])),
            velocity_mps: (*motion.velocity_mps()).into(),
            velocity_covariance: rows(&motion.velocity_covariance()),
            angular_velocity_radps: (*motion.angular_velocity_radps()).into(),
            angular_velocity_covariance: rows(&motion.angular_velocity_covariance()),
            closing_speed_mps: motion.closing_speed_mps().map(Into::into),
            closest_approach,
            no_approach,
        }
    }
}

impl TrackWire {
    /// A track of this target, with what is left to do about it by these means.
    #[must_use]
    pub fn of(target: &str, track: &Track, means: Option<&Means>) -> Self {
        let means = means.filter(|_| !track.is_lost());
        let to_act = means.map(|means| ToActWire::of(&to_act(&track.best().motion, means), means));
        let (life, lost_because) = match track.life() {
            Life::Tentative => (LifeName::Tentative, None),
            Life::Confirmed => (LifeName::Confirmed, None),
            Life::Coasting => (LifeName::Coasting, None),
            Life::Lost(loss) => {
                let name = match loss {
                    Loss::Unconfirmed { .. } => LossName::Unconfirmed,
                    Loss::Unseen { .. } => LossName::Unseen,
                    Loss::Uncertain { .. } => LossName::Uncertain,
                    Loss::Gap { .. } => LossName::Gap,
                    Loss::Diverged => LossName::Diverged,
                };
                (LifeName::Lost, Some(name))
            }
        };
        Self {
            id: track.id().0,
            target: target.into(),
            life,
            lost_because,
            seen_count: track.seen_count(),
            coasted_count: track.coasted_count(),
            motion: track.best().into(),
            alternatives: track.alternatives().iter().map(Into::into).collect(),
            to_act,
        }
    }
}
