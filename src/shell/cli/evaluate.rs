//! `skypose evaluate`.

mod recorded;

use clap::Args;

use super::Stop;
pub(super) use recorded::EXAMPLES;

#[derive(Args, Debug)]
pub(super) struct Evaluate {
    #[command(flatten)]
    recorded: recorded::Recorded,
}

impl Evaluate {
    pub(super) fn run(self) -> Result<(), Stop> {
        recorded::run(&self.recorded)
    }
}
