//! The HTTP door, knocked at by a real client over a real socket.

mod api;
mod faults;
mod frames;
mod life;
mod poses;
mod station;
mod things;
