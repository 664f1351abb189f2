//! Skypose.
pub mod camera;
pub mod frame;
pub mod geometry;
pub mod target;
