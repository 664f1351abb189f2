//! The frames of one encounter with what was found in them, as a video or as pictures.

use std::path::{Path, PathBuf};

use image::RgbImage;

use super::Stop;
use crate::annotate::{Overlay, annotate, caption};
use crate::encounter::{NoTurn, Question, RelativeState, Situation, latest_turn};
use crate::evaluate::encounters::{Alarm, Alert, EncounterStudy, Look, Lookout, Sensing};
use crate::scene::encounters::Traffic;
use crate::scene::encounters::intruder::{plate, wing};
use crate::shell::console::{note, progress};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::grab::film::{Film, is_video_name};
use crate::shell::grab::{GrabError, is_interrupted};
use crate::shell::wire::encounters::fault_of_study;
use crate::track::Life;

/// Colours of the lines, sRGB.
const PLAIN: [u8; 3] = [235, 238, 242];
const ALARM: [u8; 3] = [255, 110, 96];

/// Span of the flying wing, m.
const WING_SPAN_M: f64 = 1.4;

/// The encounter of a question, to be flown: the two meet, the markers asked for (or those of a flying wing of that width) at the intruder's nose.
/// Without a camera it is the demo's, turned to where the intruder comes from.
///
/// # Errors
/// Of what cannot be flown.
pub(super) fn study_of(question: &Question) -> Result<EncounterStudy, Fault> {
    let standard = EncounterStudy::standard(1, 0);
    let Situation::Meeting { course, .. } = &question.situation else {
        return Err(Fault::new(FaultKind::Senseless, "frames are drawn of two that meet, by a scenario or a course"));
    };
    let intruder = match &question.marked {
        Some(marked) => plate(marked.target.clone()),
        None => wing(question.size_m[0] / WING_SPAN_M).unwrap_or(standard.intruder),
    };
    let (camera, [azimuth_rad, elevation_rad]) = match &question.eye {
        Some(eye) => (*eye.camera(), eye.axis_rad()),
        None => (standard.camera, course.at_range(1e3).map_or([0.0; 2], |state| state.bearing_rad())),
    };
    let [.., link, decision] = question.delays.named();
    let study = EncounterStudy {
        camera,
        camera_azimuth_rad: azimuth_rad,
        camera_elevation_rad: elevation_rad,
        intruder,
        traffic: Traffic {
            own_speed_mps: [course.own_speed_mps(); 2],
            intruder_speed_mps: [course.intruder_speed_mps(); 2],
            course_rad: [course.course_rad(); 2],
            miss_m: [0.0; 2],
            attitude_sigma_rad: 0.0,
        },
        manoeuvre: question.manoeuvre,
        alarm: Alarm { delay_s: link.1 + decision.1, ..standard.alarm },
        nmac_m: standard.nmac_m.min(question.manoeuvre.miss_distance_m()),
        ..standard
    };
    study.check().map_err(|error| Fault { pointer: None, ..fault_of_study(&error) })?;
    Ok(study)
}

/// Writes encounter number `number` of a study to `out`: a video if it has the name of one, a folder of pictures otherwise.
pub(super) fn film(study: &EncounterStudy, number: u64, out: &Path) -> Result<(), Stop> {
    let study = EncounterStudy { sensing: Sensing::Frames, ..study.clone() };
    let lookout = Lookout::of(&study, number)
        .ok_or_else(|| Fault::new(FaultKind::Senseless, format!("encounter {number}: none could be drawn")))?;
    let frames = usize::try_from(lookout.frame_count()).unwrap_or(usize::MAX);
    let needed_s = needed_s(&lookout, &study);
    let size = [study.camera.width(), study.camera.height()];
    let mut reel = Reel::create(out, size, study.rate_hz)?;
    let bar = progress(frames, "frames");
    let mut written = 0_u32;
    for look in lookout {
        if is_interrupted() {
            return Err(Stop::Interrupted);
        }
        let Some(picture) = drawn(&study, &look, needed_s) else { continue };
        reel.push(&picture, out)?;
        written += 1;
        bar.inc(1);
    }
    reel.finish(out)?;
    bar.finish_and_clear();
    note(&format!("{written} frames: {}", out.display()));
    Ok(())
}

/// The last moment for the alarm, s before the closest approach, or why there is none.
fn needed_s(lookout: &Lookout<'_>, study: &EncounterStudy) -> Result<f64, NoTurn> {
    /// The same from any distance.
    const FAR_S: f64 = 1_000.0;
    let encounter = lookout.encounter();
    let far = RelativeState::checked(encounter.position_m(-FAR_S), encounter.velocity_mps)
        .map_err(|_| NoTurn::NeverClosing { closing_speed_mps: 0.0 })?;
    latest_turn(&far, encounter.own_speed_mps, &study.manoeuvre).map(|turn| turn.time_s + study.alarm.delay_s)
}

/// The frame with what was found, what the tracks say, and what is true.
fn drawn(study: &EncounterStudy, look: &Look, needed_s: Result<f64, NoTurn>) -> Option<RgbImage> {
    let frame = look.frame.as_ref()?;
    let targets = [study.intruder.target.clone()];
    let overlay = Overlay::of(&look.estimate.detection, &targets, &look.estimate.targets);
    let picture = annotate(frame, Some(&study.camera), &overlay);
    let left_s = -look.time_s;
    let needed = match needed_s {
        Ok(needed_s) => format!("a turn clears it until {needed_s:.1} s before"),
        Err(NoTurn::NotNeeded { miss_m, .. }) => format!("they pass at {miss_m:.1} m, no turn is needed"),
        Err(reason) => reason.to_string(),
    };
    let truth = format!("truth  {:.1} m, closest approach in {left_s:.1} s; {needed}", look.truth.translation.norm());
    let mut lines = vec![(truth, PLAIN), (track_line(look), PLAIN)];
    if let Some(alert) = &look.alert {
        lines.push((alert_line(alert, needed_s), ALARM));
    }
    Some(caption(picture, &lines))
}

fn track_line(look: &Look) -> String {
    let Some(track) = look.report.tracks.iter().find(|track| !track.is_lost()) else { return "no track".into() };
    let life = match track.life() {
        Life::Tentative => "tentative",
        Life::Confirmed => "confirmed",
        Life::Coasting => "coasting",
        Life::Lost(_) => "lost",
    };
    let motion = &track.best().motion;
    let range_m = motion.camera_from_target().translation.norm();
    let approach = motion.closest_approach().map_or_else(
        |_| "closest approach not known yet".into(),
        |found| {
            format!(
                "closest approach in {:.1} \u{b1}{:.1} s at {:.1} \u{b1}{:.1} m",
                found.time_s.value, found.time_s.sigma, found.miss_m.value, found.miss_m.sigma
            )
        },
    );
    format!("track {life}  {range_m:.1} m, {approach}")
}

fn alert_line(alert: &Alert, needed_s: Result<f64, NoTurn>) -> String {
    let given_s = -alert.time_s;
    let verdict = match needed_s {
        Ok(needed_s) if given_s >= needed_s => format!("{:.1} s before it had to be", given_s - needed_s),
        Ok(needed_s) => format!("{:.1} s too late", needed_s - given_s),
        Err(_) => "for nothing".into(),
    };
    format!("ALARM {given_s:.1} s before the closest approach, {verdict}: turn {}", alert.side.name())
}

/// Where pictures go.
enum Reel {
    Video(Film),
    Folder { folder: PathBuf, next: u32 },
}

impl Reel {
    fn create(out: &Path, size: [u32; 2], rate_hz: f64) -> Result<Self, Fault> {
        if is_video_name(out) && !out.is_dir() {
            return Film::create(out, size, rate_hz).map(Self::Video).map_err(|error| named(out, error));
        }
        if out.extension().is_some() && !out.is_dir() {
            let detail = format!(
                "{}: no name of a video that is written (.mp4, .mkv, .mov, .m4v, .avi, .webm, .ts), nor of a folder",
                out.display()
            );
            return Err(Fault::new(FaultKind::Senseless, detail));
        }
        std::fs::create_dir_all(out).map_err(|error| super::inputs::unwritable(out, &error))?;
        Ok(Self::Folder { folder: out.to_owned(), next: 0 })
    }

    fn push(&mut self, picture: &RgbImage, out: &Path) -> Result<(), Fault> {
        match self {
            Self::Video(film) => film.push(picture).map_err(|error| named(out, error)),
            Self::Folder { folder, next } => {
                let path = folder.join(format!("{next:05}.png"));
                *next += 1;
                picture
                    .save(&path)
                    .map_err(|error| Fault::new(FaultKind::Unreadable, format!("{}: {error}", path.display())))
            }
        }
    }

    fn finish(self, out: &Path) -> Result<(), Fault> {
        match self {
            Self::Video(film) => film.finish().map_err(|error| named(out, error)),
            Self::Folder { .. } => Ok(()),
        }
    }
}

fn named(out: &Path, error: GrabError) -> Fault {
    let fault = Fault::from(error);
    Fault { detail: format!("{}: {}", out.display(), fault.detail), ..fault }
}
