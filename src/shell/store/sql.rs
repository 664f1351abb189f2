//! The queries. They are the same for SQLite and PostgreSQL, so this module is compiled for each of the two; what differs stands in
//! `sqlite.rs` and `postgres.rs`, which bring the types, the locks and the queue.

#[path = "sql/changes.rs"]
mod changes;
#[path = "sql/jobs.rs"]
mod jobs;
#[path = "sql/rows.rs"]
mod rows;
#[path = "sql/things.rs"]
mod things;

use super::{Backend, Connection, files, locks, queue};
