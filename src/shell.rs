//! The wall: only behind this door is the world touched. Clocks, files, sockets, logs, threads and child processes live
//! here, and every serialised shape.

#[cfg(feature = "zenoh")]
pub mod bus;
pub mod cli;
pub mod config;
pub mod console;
pub mod fault;
pub mod grab;
pub mod http;
#[cfg(feature = "mavlink")]
pub mod mavlink;
pub mod service;
pub mod store;
pub mod telemetry;
pub mod wire;
