//! From what the pictures show to a camera, the contract's result, and the page for people.

use std::collections::BTreeMap;

use super::page;
use super::sighting::{Sighting, nothing_seen};
use crate::calibrate::SeenPoint;
use crate::calibrate::coverage::CELLS;
use crate::calibrate::estimate::{CalibrateError, Calibration, calibrate_watched};
use crate::calibrate::held_out::Fit;
use crate::calibrate::report::{Report, Weakness, report};
use crate::calibrate::watch::Watch;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::calibration::{CalibrationView, CalibrationWire, CoverageWire, ModelTrialWire, NextViewWire};
use crate::shell::wire::{CalibrationRequest, CameraWire};

/// Share of all of it that the camera takes; the rest is its judgement, which makes some forty others.
const FIT_SHARE: f64 = 0.1;

/// A camera with all that is said of it.
#[derive(Clone, Debug)]
pub struct Estimated {
    /// The contract's result.
    pub wire: CalibrationWire,
    /// The page for people, self-contained HTML.
    pub page: String,
}

/// Why there is no camera.
#[derive(Clone, Debug)]
pub struct Refusal {
    /// In a word: `no_board`, `weak_geometry`, `no_fit`, `cancelled`.
    pub reason: &'static str,
    /// What is missing.
    pub missing: Vec<String>,
    /// In a sentence.
    pub fault: Fault,
}

/// The camera of these pictures, of which the usual one has this size. `watch` is told which share is done, and says
/// whether it is still wanted.
///
/// # Errors
/// Why there is no camera, or none to trust.
pub fn estimated(
    size: Option<[u32; 2]>,
    sightings: &[Sighting],
    request: &CalibrationRequest,
    watch: &Watch<'_>,
) -> Result<Estimated, Refusal> {
    let plain = |reason, fault| Refusal { reason, missing: Vec::new(), fault };
    let board = request.board().map_err(|fault| plain("no_board", fault))?;
    let Some(size) = size.filter(|_| sightings.iter().any(|sighting| sighting.reason.is_none())) else {
        return Err(plain("no_board", nothing_seen(sightings)));
    };
    let views: Vec<Vec<SeenPoint>> =
        sightings.iter().map(|seen| if seen.reason.is_none() { seen.seen() } else { Vec::new() }).collect();
    let options = request.options();
    let found = calibrate_watched(size, &board, &views, &options, &watch.part(0.0, FIT_SHARE))
        .map_err(|error| refusal_of(&error))?;
    let judged = report(&board, &views, &options, &found, &watch.part(FIT_SHARE, 1.0));
    if !watch.is_wanted() {
        return Err(refusal_of(&CalibrateError::Unwanted));
    }
    if !judged.weaknesses.is_empty() && !request.force {
        let missing = judged.weaknesses.iter().map(ToString::to_string).collect();
        let reason = match judged.weaknesses[0] {
            Weakness::Lens { .. } => "no_fit",
            _ => "weak_geometry",
        };
        return Err(refused(reason, missing, ". \"force\" takes the camera all the same"));
    }
    let wire = wire_of(sightings, &found, &judged);
    let page = page::page(&board, request, sightings, &found, &judged, &wire)
        .map_err(|error| plain("no_fit", Fault::new(FaultKind::Internal, error.to_string())))?;
    Ok(Estimated { wire, page })
}

fn refused(reason: &'static str, missing: Vec<String>, hint: &str) -> Refusal {
    let detail = format!("{reason}: {}{hint}", missing.join("; "));
    Refusal { reason, missing, fault: Fault::new(FaultKind::Senseless, detail) }
}

fn refusal_of(error: &CalibrateError) -> Refusal {
    match error {
        CalibrateError::TooFewViews { .. } | CalibrateError::Open => {
            refused("weak_geometry", vec![error.to_string()], "")
        }
        CalibrateError::Unwanted => Refusal {
            reason: "cancelled",
            missing: Vec::new(),
            fault: Fault::new(FaultKind::Conflict, error.to_string()),
        },
        CalibrateError::NoFit { .. } | CalibrateError::GuessSize { .. } | CalibrateError::Camera(_) => Refusal {
            reason: "no_fit",
            missing: Vec::new(),
            fault: Fault::new(FaultKind::Senseless, error.to_string()),
        },
    }
}

fn wire_of(sightings: &[Sighting], found: &Calibration, report: &Report) -> CalibrationWire {
    let views: Vec<CalibrationView> = sightings
        .iter()
        .zip(&found.views)
        .zip(&report.stances)
        .map(|((seen, fitted), stance)| CalibrationView {
            name: seen.name.clone(),
            points: seen.points.len(),
            inliers: fitted.inliers.iter().filter(|counts| **counts).count(),
            counts: fitted.counts(),
            reason: seen.reason.clone().or_else(|| fitted.left_out.map(|reason| reason.to_string())),
            rms_px: fitted.camera_from_board.map(|_| fitted.rms_px),
            range_m: stance.map(|stance| stance.range_m),
            tilt_rad: stance.map(|stance| stance.tilt_rad),
            camera_from_board: fitted.camera_from_board.as_ref().map(Into::into),
        })
        .collect();
    let names = ["fx", "fy", "cx", "cy"].iter().chain(found.camera.distortion().coefficient_names());
    let standard_deviations: BTreeMap<String, f64> =
        names.zip(&found.standard_deviations).map(|(name, sigma)| ((*name).to_owned(), *sigma)).collect();
    let models = report
        .trials
        .all
        .iter()
        .map(|trial| ModelTrialWire { name: trial.name.clone(), held_out_rms_px: trial.held_out_rms_px });
    let next_view = report.next_view.as_ref().map(|next| NextViewWire {
        camera_from_board: (&next.camera_from_board).into(),
        outline_px: next.outline_px.iter().map(|pixel| [pixel.x, pixel.y]).collect(),
        range_m: next.stance.range_m,
        tilt_rad: next.stance.tilt_rad,
        ray_sigma_px: next.ray_sigma_px,
    });
    let drop: Vec<String> = report.drop.iter().map(|index| sightings[*index].name.clone()).collect();
    CalibrationWire {
        camera: CameraWire { pixel_sigma_px: Some(found.pixel_sigma_px), ..CameraWire::from(&found.camera) },
        reprojection_rms_px: found.rms_px,
        pixel_sigma_px: found.pixel_sigma_px,
        noise_ratio: found.noise_ratio,
        model_error_px: found.model_error_px,
        design_effect: found.design_effect,
        standard_deviations,
        views,
        coverage: CoverageWire {
            columns: CELLS[0],
            rows: CELLS[1],
            points: report.coverage.points.clone(),
            share: report.coverage.share,
            ray_sigma_px: report.ray_sigmas_px.clone(),
        },
        widest_turn_rad: report.widest_turn_rad,
        models: models.collect(),
        model_fit: match report.trials.fit {
            Fit::Right => "right",
            Fit::TooSmall { .. } => "too_small",
            Fit::OtherKind { .. } => "other_kind",
            Fit::TooLarge { .. } => "too_large",
            Fit::Unknown => "unknown",
        },
        advice: advice(found, report, &drop),
        drop,
        next_view,
        weaknesses: report.weaknesses.iter().map(ToString::to_string).collect(),
    }
}

/// Errors this many times the pictures' noise are told of.
const MUCH_NOISE: f64 = 3.0;

/// Points of the board that have more than this share of their squared errors in common in all pictures are not where it is said.
const MUCH_IN_COMMON: f64 = 0.5;

/// What to do, the most pressing first.
fn advice(found: &Calibration, report: &Report, drop: &[String]) -> Vec<String> {
    let mut advice: Vec<String> = report.weaknesses.iter().map(ToString::to_string).collect();
    let is_told = report.weaknesses.iter().any(|weakness| matches!(weakness, Weakness::Lens { .. }));
    advice.extend(of_lens(&report.trials.fit).filter(|_| report.lacks_other_lens() && !is_told));
    // What a wrong lens leaves says nothing about the board.
    if !report.lacks_other_lens() {
        advice.extend(of_noise(found, report));
        advice.extend(of_lens(&report.trials.fit));
    }
    if !drop.is_empty() {
        advice.push(format!("leave out {}: the error stands out", drop.join(", ")));
    }
    if let Some(next) = &report.next_view {
        let [before, after] = next.ray_sigma_px;
        advice.push(format!(
            "of all further views one {:.2} m away and tilted by {:.0} degrees, where the report draws it, helps most: rays are then known to {after:.3} px, now {before:.3} px",
            next.stance.range_m,
            next.stance.tilt_rad.to_degrees()
        ));
    }
    advice
}

fn of_noise(found: &Calibration, report: &Report) -> Option<String> {
    if found.noise_ratio <= MUCH_NOISE {
        return None;
    }
    let ratio = found.noise_ratio;
    if let Some(error) = report.pattern_error.filter(|error| error.share > MUCH_IN_COMMON) {
        return Some(format!(
            "the pattern's description may be wrong: errors are {ratio:.0} times what the noise of the pictures explains, and in all pictures the same points are off, by {:.2} mm. Compare its numbers with the board, and measure the print",
            1e3 * error.rms_m
        ));
    }
    let widened = if found.design_effect > 1.0 {
        format!(
            "within a picture they go together, so that deviations are {:.1} times those of independent errors",
            found.design_effect.sqrt()
        )
    } else {
        "within a picture they do not go together".into()
    };
    Some(format!(
        "errors are {ratio:.1} times what the noise of the pictures explains, as of a board that is not flat or not true: {widened}; what all pictures have in common is not in them"
    ))
}

fn of_lens(fit: &Fit) -> Option<String> {
    match fit {
        Fit::TooSmall { better, ratio } => Some(format!(
            "the lens model is too small: {better} predicts other views with {:.0} % of the error",
            100.0 * ratio
        )),
        Fit::OtherKind { better, ratio } => Some(format!(
            "the lens model does not fit, the lens is of another kind: {better} predicts other views with {:.0} % of the error",
            100.0 * ratio
        )),
        Fit::TooLarge { enough, .. } => {
            Some(format!("the lens model is larger than these views need: {enough} predicts other views as well"))
        }
        Fit::Unknown => Some("too few views to tell whether the lens model is right: take more".into()),
        Fit::Right => None,
    }
}
