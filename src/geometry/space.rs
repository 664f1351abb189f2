//! The coordinate systems. A *space* is a coordinate system; a *frame*, in this project, is a picture.

use std::fmt::Debug;

/// A right-handed, metric coordinate system, used as a type parameter only.
pub trait Space: Copy + Debug + PartialEq + Send + Sync + 'static {}

/// Fixed to the ground or to the start of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct World;

/// x right, y down, z forward along the optical axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Camera;

/// Fixed by the marker positions that the user gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Target;

/// Fixed to a calibration board: x right, y down along its rows, z away from the viewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Board;

/// Fixed to a vehicle: x forward, y right, z down (FRD, as `MAV_FRAME_BODY_FRD`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Body;

/// Fixed to another vehicle, with axes as those of [`Body`]: so that what we see of it and what it sees of us are not mistaken for
/// each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer;

impl Space for World {}
impl Space for Camera {}
impl Space for Target {}
impl Space for Board {}
impl Space for Body {}
impl Space for Peer {}
