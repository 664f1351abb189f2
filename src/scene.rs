//! Synthetic truth: named random cases, flights, and rendered frames.

pub mod boards;
pub mod cases;
pub mod encode;
pub mod encounters;
pub mod flight;
pub mod models;
pub mod protocols;
pub mod render;
pub mod truth;
pub mod verdict;
