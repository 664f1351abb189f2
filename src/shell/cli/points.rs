//! `skypose pose`.

use clap::Args;

use super::requests::Requests;
use super::{SettingsArgs, Stop, runtime};
use crate::shell::console::{complain, print_line};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::compute::{BatchItem, Terms};
use crate::shell::service::lookup::Lookup;
use crate::shell::store::Store;
use crate::shell::wire::pose::PoseReplyOrError;

#[derive(Args, Debug)]
pub(super) struct Pose {
    #[command(flatten)]
    settings: SettingsArgs,
}

impl Pose {
    /// One reply a line, also for a request that fails; each failure is told on standard error too.
    pub(super) fn run(self) -> Result<(), Stop> {
        let settings = self.settings.load(Vec::new())?;
        let terms = Terms::of(&settings);
        let runtime = runtime()?;
        let store = match self.settings.data {
            Some(folder) => Some(runtime.block_on(Store::open(&folder)).map_err(Fault::from)?),
            None => None,
        };
        let mut lookup = Lookup::new(store.as_ref());
        let mut failed = false;
        for read in Requests::of(std::io::stdin().lock()) {
            let (number, request) = read?;
            let item = match request {
                Ok(request) => runtime.block_on(BatchItem::read(request, &mut lookup, &terms)),
                Err(fault) => BatchItem::Failed(None, fault),
            };
            if let BatchItem::Failed(_, fault) = &item {
                complain(&format!("line {number}: {fault}"));
                failed = true;
            }
            print_line(&json_line(&item.reply(&terms))?)?;
        }
        if failed { Err(Stop::SomeFailed) } else { Ok(()) }
    }
}

fn json_line(reply: &PoseReplyOrError) -> Result<String, Fault> {
    serde_json::to_string(reply).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))
}
