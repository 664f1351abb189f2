//! `skypose demo`.
use clap::Args;
use super::Stop;
#[derive(Args, Debug)]
pub(super) struct Demo {}
impl Demo { pub(super) fn run(self) -> Result<(), Stop> { Ok(()) } }
