//! Synthetic truth: named random cases, flights, and rendered frames.

pub mod cases;
