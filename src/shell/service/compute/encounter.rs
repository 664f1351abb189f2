//! How early another aircraft must be seen, and whether a camera can do it.

mod page;

use std::f64::consts::PI;
use std::time::Instant;

use serde_json::Value;

use super::Terms;
use crate::assess::AssessOptions;
use crate::encounter::{
    Airspace, Answer, Course, Delays, EncounterError, Eye, Manoeuvre, Marked, Question, RelativeState, Scenario,
    Situation, pictures, positive,
};
use crate::identify::IdentifyOptions;
use crate::plot::Picture;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::lookup::Lookup;
use crate::shell::wire::encounter::TurnName;
use crate::shell::wire::{EncounterReply, EncounterRequest};

pub(in crate::shell) use page::sentences;

/// An intruder of unknown height is so much less high than wide.
const HEIGHT_RATIO: f64 = 0.2;

/// An encounter that makes sense.
#[derive(Debug)]
pub struct EncounterTask {
    id: Option<Value>,
    question: Question,
    turn: TurnName,
    figures: bool,
}

impl EncounterTask {
    /// Checks everything that can be wrong with a request.
    ///
    /// # Errors
    /// Names the field and the numbers.
    pub async fn checked(request: EncounterRequest, lookup: &Lookup<'_>, terms: &Terms) -> Result<Self, Fault> {
        let situation = situation(&request)?;
        let manoeuvre = manoeuvre(&request)?;
        let d = &request.delays;
        let delays = Delays::checked(d.detection_s, d.track_s, d.link_s, d.decision_s)
            .map_err(|e| fault(e).within("/delays"))?;
        let a = &request.airspace;
        let airspace =
            Airspace::checked(a.length_m, a.width_m, a.height_m).map_err(|e| fault(e).within("/airspace"))?;
        let width_m = positive("target_width_m", request.target_width_m).map_err(fault)?;
        let height_m = request.target_height_m.unwrap_or(HEIGHT_RATIO * width_m);
        let height_m = positive("target_height_m", height_m).map_err(fault)?;
        let eye = eye(&request, lookup).await?;
        let options = assess_options(&request, terms)?;
        let marked = match &request.target {
            Some(_) if eye.is_none() => {
                let detail = "a target without a camera: no camera looks for its markers";
                return Err(Fault::senseless("/target", detail));
            }
            Some(target) => {
                let target = lookup.target(target).await.map_err(|fault| fault.within("/target"))?;
                Some(Marked { target, aspect_rad: request.aspect_rad, options })
            }
            None => None,
        };
        let question = Question {
            situation,
            manoeuvre,
            turn: request.turn.into(),
            delays,
            size_m: [width_m, height_m],
            airspace,
            eye,
            marked,
        };
        Ok(Self { id: request.id, question, turn: request.turn, figures: request.figures })
    }

    /// What is asked, in the core's words.
    #[must_use]
    pub const fn question(&self) -> &Question {
        &self.question
    }

    /// The answer in the core's words.
    ///
    /// # Errors
    /// The distance makes no encounter.
    pub fn answer(&self) -> Result<Answer, Fault> {
        self.question.answer().map_err(fault)
    }

    /// The pictures.
    #[must_use]
    pub fn pictures(&self, answer: &Answer) -> Vec<Picture> {
        pictures(&self.question, answer)
    }

    /// The answer as the API has it, without pictures.
    #[must_use]
    pub fn wire(&self, answer: &Answer) -> EncounterReply {
        let reply = EncounterReply::of(&self.question, self.turn, answer);
        let reply = if self.figures { reply.with_figures(&self.pictures(answer)) } else { reply };
        EncounterReply { id: self.id.clone(), ..reply }
    }

    /// The page about it: one file that needs nothing else.
    ///
    /// # Errors
    /// If it cannot be written, which is our failure.
    pub fn page(&self, answer: &Answer) -> Result<String, Fault> {
        page::page(&self.question, &self.wire(answer), answer)
            .map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))
    }

    /// The reply.
    ///
    /// # Errors
    /// The distance makes no encounter.
    pub fn reply(&self) -> Result<EncounterReply, Fault> {
        let start = Instant::now();
        let reply = self.wire(&self.answer()?);
        Ok(EncounterReply { elapsed_us: start.elapsed().as_secs_f64() * 1e6, ..reply })
    }
}

fn fault(error: EncounterError) -> Fault {
    Fault::senseless(format!("/{}", error.field()), error.to_string())
}

async fn eye(request: &EncounterRequest, lookup: &Lookup<'_>) -> Result<Option<Eye>, Fault> {
    let angles = [request.camera_azimuth_rad, request.camera_elevation_rad];
    if let Some(camera) = &request.camera {
        let camera = lookup.camera(camera).await.map_err(|fault| fault.within("/camera"))?;
        return Eye::checked(camera, angles[0], angles[1]).map(Some).map_err(fault);
    }
    let mut named = ["camera_azimuth_rad", "camera_elevation_rad"].into_iter().zip(angles);
    match named.find(|(_, value)| *value != 0.0) {
        Some((field, value)) => {
            let detail = format!("{field} = {value} without a camera: nothing is turned");
            Err(Fault::senseless(format!("/{field}"), detail))
        }
        None => Ok(None),
    }
}

fn situation(request: &EncounterRequest) -> Result<Situation, Fault> {
    let own_speed_mps = positive("own_speed_mps", request.own_speed_mps).map_err(fault)?;
    if let Some(relative) = &request.relative {
        let also = [
            ("scenario", request.scenario.is_some()),
            ("intruder_course_rad", request.intruder_course_rad.is_some()),
            ("intruder_speed_mps", request.intruder_speed_mps.is_some()),
            ("range_m", request.range_m.is_some()),
        ];
        if let Some((field, _)) = also.into_iter().find(|(_, is_given)| *is_given) {
            return Err(Fault::senseless(
                format!("/{field}"),
                format!("{field} beside relative, which says it already"),
            ));
        }
        let state = RelativeState::checked(relative.position_m.into(), relative.velocity_mps.into())
            .map_err(|error| fault_of_coordinate(&error))?;
        return Ok(Situation::Given { state, own_speed_mps });
    }
    let course_rad = match (request.scenario, request.intruder_course_rad) {
        (Some(_), Some(_)) => {
            let detail = "intruder_course_rad beside scenario, which says it already";
            return Err(Fault::senseless("/intruder_course_rad", detail));
        }
        (None, Some(course_rad)) => course_rad,
        (scenario, None) => scenario.map_or(Scenario::HeadOn, Into::into).course_rad(),
    };
    let intruder_speed_mps = request.intruder_speed_mps.unwrap_or(Scenario::SPEED_MPS);
    let course = Course::checked(own_speed_mps, intruder_speed_mps, course_rad).map_err(fault)?;
    let range_m = request.range_m.map(|range_m| positive("range_m", range_m)).transpose().map_err(fault)?;
    Ok(Situation::Meeting { course, range_m })
}

fn fault_of_coordinate(error: &EncounterError) -> Fault {
    let pointer = match error {
        EncounterError::Coordinate { field, axis, .. } => format!("/relative/{field}/{axis}"),
        other => format!("/relative/{}", other.field()),
    };
    Fault::senseless(pointer, error.to_string())
}

fn manoeuvre(request: &EncounterRequest) -> Result<Manoeuvre, Fault> {
    let turn = Manoeuvre::checked(request.bank_rad, request.miss_distance_m).map_err(fault)?;
    let turn = turn.up_to(request.max_turn_rad).map_err(fault)?.to(request.side.into());
    match (request.roll_rate_radps, request.roll_in_s) {
        (Some(_), Some(_)) => {
            Err(Fault::senseless("/roll_in_s", "roll_in_s beside roll_rate_radps, which says it already"))
        }
        (Some(rate), None) => turn.rolling(rate).map_err(fault),
        (None, Some(0.0) | None) => Ok(turn),
        (None, Some(time_s)) => {
            let detail = format!("roll_in_s = {time_s}: a time from 0 to 86400 s is needed");
            let rate = request.bank_rad / time_s;
            if !(time_s > 0.0 && time_s <= 86_400.0) {
                return Err(Fault::senseless("/roll_in_s", detail));
            }
            turn.rolling(rate).map_err(|_| Fault::senseless("/roll_in_s", detail))
        }
    }
}

fn assess_options(request: &EncounterRequest, terms: &Terms) -> Result<AssessOptions, Fault> {
    let aspect_rad = request.aspect_rad;
    if !(0.0..=PI + 1e-9).contains(&aspect_rad) {
        let detail = format!("aspect_rad = {aspect_rad}: an angle from 0 to pi is needed");
        return Err(Fault::senseless("/aspect_rad", detail));
    }
    let pixel_sigma = request.pixel_sigma;
    if !(1e-3..=100.0).contains(&pixel_sigma) {
        let detail = format!("pixel_sigma = {pixel_sigma}: a standard deviation from 0.001 to 100 px is accepted");
        return Err(Fault::senseless("/pixel_sigma", detail));
    }
    // The caller states the whole uncertainty of the centroids.
    let identify = IdentifyOptions { model_sigma_px: 0.0, ..terms.identify };
    Ok(AssessOptions { pixel_sigma, identify, ..AssessOptions::default() })
}
