//! Skypose.
pub mod camera;
pub mod frame;
pub mod geometry;
pub mod scene;
pub mod solve;
pub mod target;
