//! Calibrations as jobs: one shard a picture, in which the board is found; of all of them a camera is estimated.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::jobs::{Cancel, Input, Kind, Outcome, Shard, Thing};
use crate::board::Board;
use crate::calibrate::SeenPoint;
use crate::calibrate::find::find;
use crate::camera::Pixel;
use crate::frame::{Decoding, Frame, Limits, Wanted};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store;
use crate::shell::wire::{CalibrationRequest, CameraWire, from_value};

/// The kind, as it stands in the store and in the API.
pub const CALIBRATION: &str = "calibration";

/// Calibrations.
#[derive(Clone, Copy, Debug)]
pub struct CalibrationKind {
    /// What a picture may cost.
    pub limits: Limits,
}

/// One picture, as it is stored.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Sighting {
    /// Name of its file.
    pub name: String,
    /// Its size, if it could be read.
    pub size: Option<[u32; 2]>,
    /// What is seen of the board: position in the board's points, u, v, standard deviation, px.
    pub points: Vec<(usize, f64, f64, f64)>,
    /// Why nothing is seen, or why what is seen does not count.
    pub reason: Option<String>,
}

/// What is estimated of the pictures in which the board is seen.
#[derive(Clone, Debug)]
pub struct Estimated {
    /// The camera.
    pub camera: CameraWire,
    /// The contract's result: `camera`, `reprojection_rms_px`, `standard_deviations`, `views`, ...
    pub result: Value,
    /// The page for people, self-contained HTML.
    pub report: String,
}

impl Kind for CalibrationKind {
    fn name(&self) -> &'static str {
        CALIBRATION
    }

    fn shard_count(&self, input: &Input) -> Result<u32, Fault> {
        u32::try_from(input.files.names().len()).map_err(|error| Fault::new(FaultKind::TooLarge, error.to_string()))
    }

    fn run_shard(&self, input: &Input, number: u32, _cancel: &Cancel) -> Result<Shard, Fault> {
        let request: CalibrationRequest = from_value(input.request.clone())?;
        let board = request.board()?;
        let name = input.files.names().nth(number as usize).unwrap_or_default().to_owned();
        let bytes = input.files.read(number)?;
        let sighting = look(name, &bytes, &board, self.limits);
        let message = match &sighting.reason {
            Some(reason) => format!("{}: {reason}", sighting.name),
            None => format!("{}: {} points", sighting.name, sighting.points.len()),
        };
        Ok(Shard { result: json!(sighting), message })
    }

    fn finish(&self, input: &Input, shards: Vec<Value>, cancel: &Cancel) -> Result<Outcome, Fault> {
        let request: CalibrationRequest = from_value(input.request.clone())?;
        let board = request.board()?;
        let mut sightings: Vec<Sighting> =
            shards.into_iter().map(serde_json::from_value).collect::<Result<_, _>>().map_err(|error| {
                Fault::new(FaultKind::Internal, format!("a stored picture cannot be read: {error}"))
            })?;
        let size = usual_size(&sightings);
        refuse_other_sizes(&mut sightings, size);
        let estimated = match size.filter(|_| sightings.iter().any(|sighting| sighting.reason.is_none())) {
            Some(size) => estimate(size, &board, &sightings, &request, cancel),
            None => Err(nothing_seen(&sightings)),
        };
        let estimated = match estimated {
            Ok(estimated) => estimated,
            Err(fault) => {
                let result = json!({"views": views(&sightings)});
                return Ok(Outcome { result, problem: Some(fault), ..Outcome::default() });
            }
        };
        let body = json!(estimated.camera).to_string();
        let things = request.name.into_iter().map(|name| Thing { kind: store::Kind::Camera, name, body: body.clone() });
        Ok(Outcome {
            result: estimated.result,
            problem: None,
            report: Some(estimated.report),
            things: things.collect(),
        })
    }
}

/// The camera of these pictures, its report, and the page for people. Pictures with a `reason` do not count but belong into the
/// report; `cancel` is to be asked between iterations.
///
/// # Errors
/// Why there is no camera.
fn estimate(
    _size: [u32; 2],
    _board: &Board,
    _sightings: &[Sighting],
    _request: &CalibrationRequest,
    _cancel: &Cancel,
) -> Result<Estimated, Fault> {
    Err(Fault::new(FaultKind::Internal, "cameras are not estimated yet"))
}

impl Sighting {
    /// What is seen, for the estimate.
    #[must_use]
    pub fn seen(&self) -> Vec<SeenPoint> {
        let seen = |&(point, u, v, sigma_px)| SeenPoint { point, pixel: Pixel::new(u, v), sigma_px };
        self.points.iter().map(seen).collect()
    }
}

/// The board in one picture.
fn look(name: String, bytes: &[u8], board: &Board, limits: Limits) -> Sighting {
    let none = |size, reason: String| Sighting { name: name.clone(), size, points: Vec::new(), reason: Some(reason) };
    let frame = match Frame::decode(bytes, &Decoding { wanted: Wanted::Luma, limits, ..Decoding::default() }) {
        Ok(frame) => frame,
        Err(error) => return none(None, error.to_string()),
    };
    let size = Some([frame.width(), frame.height()]);
    match find(&frame, board) {
        Ok(seen) => {
            let points = seen.iter().map(|seen| (seen.point, seen.pixel.x, seen.pixel.y, seen.sigma_px)).collect();
            Sighting { name, size, points, reason: None }
        }
        Err(error) => none(size, error.to_string()),
    }
}

/// The size that most pictures have; of two that are as frequent the one that comes first.
fn usual_size(sightings: &[Sighting]) -> Option<[u32; 2]> {
    let mut counts: HashMap<[u32; 2], usize> = HashMap::new();
    for size in sightings.iter().filter_map(|sighting| sighting.size) {
        *counts.entry(size).or_default() += 1;
    }
    let most = counts.values().max()?;
    sightings.iter().filter_map(|sighting| sighting.size).find(|size| counts.get(size) == Some(most))
}

/// A camera has one size.
fn refuse_other_sizes(sightings: &mut [Sighting], usual: Option<[u32; 2]>) {
    for sighting in sightings {
        if let (Some([width, height]), Some([usual_width, usual_height])) = (sighting.size, usual)
            && sighting.size != usual
            && sighting.reason.is_none()
        {
            let reason = format!("it is {width} x {height} px, most pictures are {usual_width} x {usual_height} px");
            sighting.reason = Some(reason);
        }
    }
}

fn nothing_seen(sightings: &[Sighting]) -> Fault {
    let first = sightings.iter().find_map(|sighting| Some((&sighting.name, sighting.reason.as_ref()?)));
    let example = first.map(|(name, reason)| format!(" ({name}: {reason})")).unwrap_or_default();
    let detail = format!("the board is seen in none of {} pictures{example}", sightings.len());
    Fault::new(FaultKind::Senseless, detail)
}

fn views(sightings: &[Sighting]) -> Value {
    sightings
        .iter()
        .map(|sighting| json!({"name": sighting.name, "points": sighting.points.len(), "reason": sighting.reason}))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sighting(name: &str, size: Option<[u32; 2]>) -> Sighting {
        let reason = size.is_none().then(|| "not a picture".into());
        Sighting { name: name.into(), size, points: vec![(0, 1.5, 2.5, 0.1)], reason }
    }

    #[test]
    fn a_picture_of_another_size_does_not_count() {
        let (wide, tall) = (Some([640, 480]), Some([480, 640]));
        let mut sightings =
            [sighting("a", None), sighting("b", tall), sighting("c", wide), sighting("d", wide), sighting("e", tall)];
        assert_eq!(usual_size(&sightings), tall, "as many of each: the first");
        sightings[4].size = wide;
        let usual = usual_size(&sightings);
        assert_eq!(usual, wide);
        refuse_other_sizes(&mut sightings, usual);
        let reasons: Vec<Option<&str>> = sightings.iter().map(|sighting| sighting.reason.as_deref()).collect();
        let other = Some("it is 480 x 640 px, most pictures are 640 x 480 px");
        assert_eq!(reasons, [Some("not a picture"), other, None, None, None]);
    }

    #[test]
    fn what_cannot_be_read_is_told() {
        let board = "chessboard:9x6:0.025".parse().expect("a board");
        let sighting = look("a.jpg".into(), b"I am a text", &board, Limits::default());
        assert_eq!((sighting.size, sighting.points.len()), (None, 0));
        assert!(sighting.reason.is_some_and(|reason| reason.contains("not a picture")));
        let tiny = look("b.pgm".into(), b"P5 1 1 255\n\0", &board, Limits::default());
        assert!(tiny.reason.is_some_and(|reason| reason.contains("1 x 1")));
    }
}
