//! Calibrations: pictures in, a camera with its report out. As a job one shard a picture, in which the board is found.

pub mod estimated;
mod page;
pub mod sighting;
mod thumbnail;

use serde_json::{Value, json};

use super::jobs::{Attachment, Cancel, Input, Kind, Outcome, REPORT, Shard, Thing};
use crate::calibrate::watch::Watch;
use crate::frame::Limits;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store;
use crate::shell::wire::{CalibrationRequest, from_value};
use estimated::{Refusal, estimated};
use sighting::{Sighting, look, refuse_other_sizes, usual_size};

/// The kind, as it stands in the store and in the API.
pub const CALIBRATION: &str = "calibration";

/// Calibrations.
#[derive(Clone, Copy, Debug)]
pub struct CalibrationKind {
    /// What a picture may cost.
    pub limits: Limits,
}

impl Kind for CalibrationKind {
    fn name(&self) -> &'static str {
        CALIBRATION
    }

    fn shard_count(&self, input: &Input) -> Result<u32, Fault> {
        u32::try_from(input.files.names().len()).map_err(|error| Fault::new(FaultKind::TooLarge, error.to_string()))
    }

    /// From 48 pictures of 640 x 480 the camera takes three times as long as to find chessboards, fourteen times as long as dots; from
    /// pictures of 12 million pixels a third.
    fn finish_shards(&self, shards: u32) -> u32 {
        shards
    }

    fn run_shard(&self, input: &Input, number: u32, _cancel: &Cancel) -> Result<Shard, Fault> {
        let request: CalibrationRequest = from_value(input.request.clone())?;
        let board = request.board()?;
        let name = input.files.names().nth(number as usize).unwrap_or_default().to_owned();
        let bytes = input.files.read(number)?;
        let sighting = look(name, &bytes, &board, self.limits);
        Ok(Shard { message: sighting.to_string(), result: json!(sighting) })
    }

    fn finish(&self, input: &Input, shards: Vec<Value>, cancel: &Cancel) -> Result<Outcome, Fault> {
        let request: CalibrationRequest = from_value(input.request.clone())?;
        let mut sightings: Vec<Sighting> =
            shards.into_iter().map(serde_json::from_value).collect::<Result<_, _>>().map_err(|error| {
                Fault::new(FaultKind::Internal, format!("a stored picture cannot be read: {error}"))
            })?;
        let size = usual_size(&sightings);
        refuse_other_sizes(&mut sightings, size);
        let (is_wanted, tell) = (|| !cancel.is_cancelled(), |share| cancel.done(share));
        let watch = Watch::new(&is_wanted, &tell);
        let estimated = match estimated(size, &sightings, &request, &watch) {
            Ok(estimated) => estimated,
            Err(Refusal { reason, missing, fault }) => {
                let views: Vec<Value> = sightings
                    .iter()
                    .map(|seen| json!({"name": seen.name, "points": seen.points.len(), "reason": seen.reason}))
                    .collect();
                let result = json!({"reason": reason, "missing": missing, "views": views});
                return Ok(Outcome { result, problem: Some(fault), ..Outcome::default() });
            }
        };
        let body = json!(estimated.wire.camera).to_string();
        let things = request.name.into_iter().map(|name| Thing { kind: store::Kind::Camera, name, body: body.clone() });
        Ok(Outcome {
            result: json!(estimated.wire),
            problem: None,
            attachments: vec![Attachment { name: REPORT, content: estimated.page.into_bytes() }],
            things: things.collect(),
        })
    }
}
