//! Evaluations of recorded frames: a folder or an archive with its truth in, figures out.
//!
//! [`Files`] are what was given; [`units()`] checks the truth and cuts the work into pieces, one a picture or a video, that know nothing
//! of each other; [`run_unit`] takes one through the whole pipeline and judges it, as a shard of a job may; [`finish()`] makes the figures of
//! all outcomes in their order.

mod archive;
mod files;
mod finish;
pub mod job;
mod labels;
mod page;
mod run;
mod units;

pub use files::Files;
pub use finish::{Finished, csv, finish};
pub use page::page;
pub use run::run_unit;
pub use units::{Unit, units};
