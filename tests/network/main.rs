//! The Zenoh door, and what goes through it: bare, guarded, of ROS 2, of a swarm, of MAVLink, over a link that loses.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    dead_code,
    reason = "a test says what it takes for granted, and shows its figures; here not all of the station is used"
)]

mod bus;
mod guard;
mod hosts;
mod links;
#[cfg(feature = "mavlink")]
mod mavlink;
#[path = "../clients/python.rs"]
mod python;
mod ros;
#[path = "../http/station.rs"]
mod station;
mod swarm;

fn free_endpoint() -> String {
    let socket = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    format!("tcp/{}", socket.local_addr().expect("bound"))
}
