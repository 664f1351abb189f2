//! Skypose.
pub mod annotate;
pub mod camera;
pub mod detect;
pub mod frame;
pub mod geometry;
pub mod identify;
pub mod pipeline;
pub mod pose;
pub mod random;
pub mod refine;
pub mod scene;
pub mod shell;
pub mod solve;
pub mod target;
