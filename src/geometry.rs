//! Spaces, points, rigid transforms, rotations and the covariance of a pose.
//!
//! Every point and transform carries the space it lives in as a type, so `camera_from_target * point_in_target` compiles
//! and `camera_from_target * point_in_camera` does not. What the types do *not* protect: two targets share one space
//! type, so a point of one target can be moved by the transform of another.

pub mod bearing;
pub mod covariance;
pub mod left_jacobian;
pub mod mount;
pub mod point;
pub mod rotation;
pub mod space;
pub mod transform;
pub mod uncertain;

pub use bearing::Direction;
pub use covariance::PoseCovariance;
pub use mount::BodyFromCamera;
pub use point::Point;
pub use rotation::EulerAngles;
pub use transform::{CameraFromBoard, CameraFromTarget, Transform};
pub use uncertain::UncertainTransform;
