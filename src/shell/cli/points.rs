//! `skypose pose`.

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use super::requests::Requests;
use super::{Failures, SettingsArgs, Stop, runtime};
use crate::shell::console::print_line;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::compute::{BatchItem, Terms, batch};
use crate::shell::service::lookup::Lookup;
use crate::shell::store::Store;
use crate::shell::wire::{PoseBatch, from_value};

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
        let lookup = Lookup::new(store.as_ref(), std::sync::Arc::default());
        let mut failures = Failures::default();
        for read in Requests::of(std::io::stdin().lock()) {
            let (number, request) = read?;
            let mut check = |request: Result<Value, Fault>| {
                let item = match request {
                    Ok(request) => runtime.block_on(BatchItem::read(request, &lookup, &terms)),
                    Err(fault) => BatchItem::Failed(None, fault),
                };
                if let BatchItem::Failed(_, fault) = &item {
                    failures.add(&format!("line {number}"), fault);
                }
                item
            };
            let line = match request {
                // Many in one, as over HTTP.
                Ok(many) if many.get("requests").is_some() => match from_value::<PoseBatch>(many) {
                    Ok(many) => {
                        let items = many.requests.into_iter().map(|request| check(Ok(request))).collect();
                        json_line(&batch(items, &terms))?
                    }
                    Err(fault) => json_line(&check(Err(fault)).reply(&terms))?,
                },
                one => json_line(&check(one).reply(&terms))?,
            };
            print_line(&line)?;
        }
        failures.into_result()
    }
}

fn json_line<T: Serialize>(reply: &T) -> Result<String, Fault> {
    serde_json::to_string(reply).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))
}
