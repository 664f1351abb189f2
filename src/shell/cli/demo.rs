//! `skypose demo`.
use super::Stop;
use clap::Args;
#[derive(Args, Debug)]
pub(super) struct Demo {}
impl Demo {
    pub(super) fn run(self) -> Result<(), Stop> {
        Ok(())
    }
}
