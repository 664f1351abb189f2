//! Cases with known truth to figures that can be printed: of recorded frames ([`recorded`]), of encounters that are flown
//! ([`encounters`]), and of solvers, side by side.
//!
//! A [`Study`] is a rule for drawing cases; [`Shard::run`] puts every method of it to a contiguous part of the runs, and adds up
//! what came of them in a [`Tally`]. Tallies are merged in the order of their shards, and how a study is cut into shards is a
//! property of the study alone, so its [`Figures`] are the same to the last digit whoever computes them, on however many
//! threads or machines. Only times differ; they are kept apart.

pub mod compare;
pub mod draw;
pub mod encounters;
pub mod figures;
pub mod judge;
pub mod method;
pub mod moments;
pub mod numbers;
pub mod plots;
pub mod quantiles;
pub mod recorded;
pub mod resample;
pub mod row;
pub mod shard;
pub mod study;
pub mod tally;

pub use figures::Figures;
pub use method::Method;
pub use row::Row;
pub use shard::Shard;
pub use study::{Disturbance, Layout, Parameter, Poses, Study, StudyError, Sweep};
pub use tally::Tally;
