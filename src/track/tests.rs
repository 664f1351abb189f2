//! Tracks against flights with truth.

mod consistency;
mod flights;
mod life;
mod wild;
