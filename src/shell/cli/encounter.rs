//! `skypose encounter`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::film::{film, study_of};
use super::inputs::{given, given_camera};
use super::outputs::{one_is_printed, write};
use super::{SettingsArgs, Stop, runtime};
use crate::encounter::KNOT_MPS;
use crate::shell::console::print_line;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::compute::{EncounterTask, Terms, encounter};
use crate::shell::service::lookup::Lookup;
use crate::shell::store::Store;
use crate::shell::wire::encounter::{DelaysWire, ScenarioName, SideName, TurnName};
use crate::shell::wire::{EncounterReply, EncounterRequest};

pub(super) const EXAMPLES: &str = "\
Examples:
  skypose encounter --scenario head-on
  skypose encounter --scenario crossing --bank 30 --roll-rate 60 --detection 0.2 --track 0.5 --decision 1
  skypose encounter --course 135 --intruder-speed 80 --camera camera.json --target target.json --report encounter.html
  skypose encounter --width 4 --own-speed 20 --intruder-speed 20 --miss 6 --roll-rate 90 --video encounter.mp4

Options are in degrees and knots, distances in metres. An aid to evaluate cameras and detectors with: no certified function.";

#[derive(Args, Debug)]
pub(super) struct Encounter {
    /// The thesis' case [default: head-on].
    #[arg(long, value_enum, conflicts_with = "course")]
    scenario: Option<ScenarioArg>,
    /// Instead: the intruder's course turned from ours, degrees, to the right positive; 180 comes towards us.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    course: Option<f64>,
    /// Our speed, knots [default: 50].
    #[arg(long, value_name = "KN", allow_negative_numbers = true)]
    own_speed: Option<f64>,
    /// The intruder's speed, knots [default: 50].
    #[arg(long, value_name = "KN", allow_negative_numbers = true)]
    intruder_speed: Option<f64>,
    /// Distance of the two now, m [default: what the airspace has room for].
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    range: Option<f64>,
    /// Bank of the turn, degrees [default: 45].
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    bank: Option<f64>,
    /// How far the turn has to clear the intruder, m [default: 152.4].
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    miss: Option<f64>,
    /// How the turn is reckoned [default: arc].
    #[arg(long, value_enum)]
    turn: Option<TurnArg>,
    /// To which side it goes [default: either].
    #[arg(long, value_enum)]
    side: Option<SideArg>,
    /// How far it turns before it flies straight on, degrees [default: 90].
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    max_turn: Option<f64>,
    /// How fast the bank grows, degrees a second [default: at once].
    #[arg(long, value_name = "DEG/S", allow_negative_numbers = true)]
    roll_rate: Option<f64>,
    /// Time until the detector has found it, s [default: 0].
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    detection: Option<f64>,
    /// Time until a track is believed, s [default: 0].
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    track: Option<f64>,
    /// Time on the way to who decides and back, s [default: 0].
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    link: Option<f64>,
    /// Time until it is decided, s [default: 0].
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    decision: Option<f64>,
    /// Width of the intruder, m [default: 1.4].
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    width: Option<f64>,
    /// Its height, m [default: a fifth of its width].
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    height: Option<f64>,
    /// Our camera: a file (JSON, ROS' YAML, OpenCV's YAML or XML), or with --data the name of a stored one.
    #[arg(long, value_name = "CAMERA")]
    camera: Option<PathBuf>,
    /// How far it is turned to the right of our course, degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, requires = "camera")]
    camera_azimuth: Option<f64>,
    /// How far it is turned up, degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, requires = "camera")]
    camera_elevation: Option<f64>,
    /// The markers on the intruder: a JSON file, or with --data the name of a stored target.
    #[arg(long, value_name = "TARGET", requires = "camera")]
    target: Option<PathBuf>,
    /// Between the line of sight and the front of the target, degrees [default: 30].
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, requires = "target")]
    aspect: Option<f64>,
    /// Standard deviation of a marker's centroid per axis, px [default: 0.3].
    #[arg(long, value_name = "S", allow_negative_numbers = true, requires = "target")]
    pixel_sigma: Option<f64>,
    /// Write the frames of this encounter as the camera sees them, with what is found in them drawn in, to a video (.mp4, .mkv, ...) or a folder.
    #[arg(long, value_name = "OUT")]
    video: Option<PathBuf>,
    /// Print the reply of the API, or write it to FILE.
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-")]
    json: Option<PathBuf>,
    /// Write a page with tables and pictures, which needs nothing else; - prints it instead of the text.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    settings: SettingsArgs,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ScenarioArg {
    HeadOn,
    Crossing,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum TurnArg {
    Arc,
    Parabolic,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum SideArg {
    Left,
    Right,
    Either,
}

impl Encounter {
    pub(super) fn run(self) -> Result<(), Stop> {
        let is_other_printed =
            one_is_printed([("--json", self.json.as_deref()), ("--report", self.report.as_deref())])?;
        let terms = Terms::of(&self.settings.load(Vec::new())?);
        let runtime = runtime()?;
        let store = match &self.settings.data {
            Some(folder) => Some(runtime.block_on(Store::open(folder)).map_err(Fault::from)?),
            None => None,
        };
        let lookup = Lookup::new(store.as_ref(), std::sync::Arc::default());
        let task = runtime.block_on(EncounterTask::checked(self.request()?, &lookup, &terms))?;
        if let Some(out) = &self.video {
            return film(&study_of(task.question())?, 0, out);
        }
        let answer = task.answer()?;
        let reply = task.wire(&answer);
        if let Some(path) = &self.report {
            write(path, &task.page(&answer)?)?;
        }
        if let Some(path) = &self.json {
            let json =
                serde_json::to_string(&reply).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))?;
            write(path, &json)?;
        }
        if !is_other_printed {
            print_line(&text(&reply))?;
        }
        Ok(())
    }

    fn request(&self) -> Result<EncounterRequest, Fault> {
        let stored = self.settings.data.is_some();
        let default = EncounterRequest::default();
        let radians = |degrees: Option<f64>, default: f64| degrees.map_or(default, f64::to_radians);
        let knots = |speed: f64| speed * KNOT_MPS;
        Ok(EncounterRequest {
            scenario: self.scenario.map(|scenario| match scenario {
                ScenarioArg::HeadOn => ScenarioName::HeadOn,
                ScenarioArg::Crossing => ScenarioName::Crossing,
            }),
            intruder_course_rad: self.course.map(f64::to_radians),
            own_speed_mps: self.own_speed.map_or(default.own_speed_mps, knots),
            intruder_speed_mps: self.intruder_speed.map(knots),
            range_m: self.range,
            bank_rad: radians(self.bank, default.bank_rad),
            miss_distance_m: self.miss.unwrap_or(default.miss_distance_m),
            turn: match self.turn {
                Some(TurnArg::Parabolic) => TurnName::Parabolic,
                Some(TurnArg::Arc) | None => TurnName::Arc,
            },
            side: match self.side {
                Some(SideArg::Left) => SideName::Left,
                Some(SideArg::Right) => SideName::Right,
                Some(SideArg::Either) | None => SideName::Either,
            },
            max_turn_rad: radians(self.max_turn, default.max_turn_rad),
            roll_rate_radps: self.roll_rate.map(f64::to_radians),
            delays: DelaysWire {
                detection_s: self.detection.unwrap_or_default(),
                track_s: self.track.unwrap_or_default(),
                link_s: self.link.unwrap_or_default(),
                decision_s: self.decision.unwrap_or_default(),
            },
            target_width_m: self.width.unwrap_or(default.target_width_m),
            target_height_m: self.height,
            camera: self.camera.as_deref().map(|path| given_camera(path, stored)).transpose()?,
            camera_azimuth_rad: radians(self.camera_azimuth, 0.0),
            camera_elevation_rad: radians(self.camera_elevation, 0.0),
            target: self.target.as_deref().map(|path| given(path, stored)).transpose()?,
            aspect_rad: radians(self.aspect, default.aspect_rad),
            pixel_sigma: self.pixel_sigma.unwrap_or(default.pixel_sigma),
            ..default
        })
    }
}

/// Where an azimuth is, in whole degrees.
fn aside(azimuth_rad: f64) -> String {
    let degrees = azimuth_rad.to_degrees().round();
    if degrees > 0.0 {
        format!("{degrees}° to the right")
    } else if degrees < 0.0 {
        format!("{}° to the left", -degrees)
    } else {
        "straight ahead".to_owned()
    }
}

/// For people: what it comes to, then the numbers in degrees and knots.
fn text(reply: &EncounterReply) -> String {
    let kn = |speed_mps: f64| speed_mps / KNOT_MPS;
    let mut lines = vec![
        format!(
            "Our speed {:.0} kn, the intruder's {:.0} kn, closing at {:.1} m/s ({:.0} kn); it is seen {}.",
            kn(reply.own_speed_mps),
            kn(reply.intruder_speed_mps),
            reply.closing_speed_mps,
            kn(reply.closing_speed_mps),
            aside(reply.azimuth_rad)
        ),
        format!(
            "The turn has a radius of {:.0} m at {:.1}°/s and {:.2} g, its bank after {:.2} s.",
            reply.manoeuvre.radius_m,
            reply.manoeuvre.turn_rate_radps.to_degrees(),
            reply.manoeuvre.load_factor,
            reply.manoeuvre.roll_in_s
        ),
        String::new(),
    ];
    lines.extend(encounter::sentences(reply).into_iter().map(|(words, _)| words));
    if let Some(arc) = reply.arc_width_rad {
        lines.push(format!("There its width fills {:.4}°.", arc.to_degrees()));
    }
    lines.push(String::new());
    let turn = |turn: Option<f64>| turn.map_or_else(|| "none".to_owned(), |time_s| format!("{time_s:.2} s"));
    lines.push(format!(
        "The last moment by the exact arc to the left {}, to the right {}; by the thesis' parabola {:.2} s.",
        turn(reply.turns.left.map(|t| t.time_s)),
        turn(reply.turns.right.map(|t| t.time_s)),
        reply.turns.parabolic.time_s
    ));
    if let Some(view) = &reply.view {
        lines.push(format!(
            "In the picture it is {:.1} x {:.1} px there; a silhouette of {:.1} px.",
            view.width_px, view.height_px, view.area_px
        ));
        lines.push(String::new());
        lines.push("Of the directions in which guidance asks to look the camera covers".into());
        lines.extend(view.field_of_regard.guidance.iter().map(|guidance| {
            let of = if guidance.elevation_rad.is_some() { "of the solid angle" } else { "of the horizon" };
            format!("    {:<28}{:>4.0} % {of}", guidance.source, 100.0 * guidance.covered_ratio)
        }));
    }
    lines.push(String::new());
    lines.push("An aid to evaluate with, no certified function; what is assumed stands in docs/encounter.md.".into());
    lines.join("\n")
}
