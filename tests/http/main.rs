//! The HTTP door, knocked at by a real client over a real socket.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test says what it takes for granted, and shows its figures"
)]

mod api;
mod assessments;
mod calibrations;
mod encounters;
mod evaluations;
mod faults;
mod following;
mod frames;
mod killed;
mod life;
mod live;
mod poses;
mod postgres;
mod sequences;
#[path = "../known/spoiled.rs"]
mod spoiled;
mod station;
mod things;
