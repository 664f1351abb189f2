//! The command line.

mod assess;
mod calibrate;
mod camera;
mod demo;
mod encounter;
mod evaluate;
mod film;
mod frames;
mod grab;
mod inputs;
mod moving;
#[cfg(feature = "zenoh")]
mod network;
mod outputs;
mod pattern;
mod pictures;
mod points;
mod replay;

mod requests;
mod serve;
mod watch;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

use super::config::{Settings, load};
use super::fault::{Fault, FaultKind};

/// Where is that UAV, and how is it turned? Six-degree-of-freedom pose of a marked target from camera frames.
///
/// Try `skypose demo` first: it flies a target past a camera, posts the frames to a service of its own and tells how well the
/// poses fit the truth.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const POSE_EXAMPLE: &str = r#"Example:
  echo '{"camera": {"width": 640, "height": 480, "fx": 600, "fy": 600, "cx": 320, "cy": 240},
         "object_points_m": [[0,0,0],[1,0,0],[1,1,0],[0,1,0]],
         "image_points_px": [[320,240],[440,240],[440,360],[320,360]]}' | skypose pose"#;

#[derive(Debug, Subcommand)]
enum Command {
    /// Serve detections, estimates and poses over HTTP.
    Serve(serve::Serve),
    /// Find markers in frames: one JSON reply a line.
    Detect(frames::Detect),
    /// Find targets and their poses in frames: one JSON reply a line.
    Estimate(frames::Estimate),
    /// Take frames out of a video, a stream or a webcam, as pictures with their times.
    #[command(after_help = grab::EXAMPLES)]
    Grab(grab::Grab),
    /// Play a video, a stream or pictures against a running server, at their own pace: one JSON reply a line.
    #[command(after_help = replay::EXAMPLES)]
    Replay(replay::Replay),
    /// Print what a server or a Zenoh network sees in the frames of cameras, as it comes.
    #[command(after_help = watch::EXAMPLES)]
    Watch(watch::Watch),
    /// Compute poses from points: JSON requests on standard input, one JSON reply a line.
    #[command(after_help = POSE_EXAMPLE)]
    Pose(points::Pose),
    /// Tell what a constellation of markers is good for before a camera, and which marker to move.
    Assess(assess::Assess),
    /// Tell how early another aircraft must be seen so that a turn clears it, and whether a camera can do it.
    #[command(after_help = encounter::EXAMPLES)]
    Encounter(Box<encounter::Encounter>),
    /// Make a camera of pictures of a calibration board, with a report of how far to trust it.
    #[command(after_help = calibrate::EXAMPLES)]
    Calibrate(calibrate::Calibrate),
    /// Hold solvers against many simulated cases, as the study of the 2012 thesis does, or the whole pipeline against recorded frames
    /// of which the truth is known.
    #[command(after_help = evaluate::EXAMPLES)]
    Evaluate(evaluate::Evaluate),
    /// Convert a camera between JSON and the files of ROS and OpenCV, or derive that of cut-out or scaled pictures.
    Camera(camera::CameraFile),
    /// Draw a calibration board at true scale, as SVG or PDF.
    #[command(after_help = pattern::EXAMPLES)]
    Pattern(pattern::PatternSheet),
    /// Print the API document (OpenAPI, JSON).
    Openapi,
    /// Print the document of the Zenoh side (AsyncAPI, YAML).
    #[cfg(feature = "zenoh")]
    Asyncapi,
    /// Fly a target past a camera and watch it being measured, over real HTTP.
    Demo(demo::Demo),
}

/// Where settings come from.
#[derive(Args, Clone, Debug, Default)]
struct SettingsArgs {
    /// Settings file (TOML); deploy/skypose.toml shows all settings. SKYPOSE_* variables go over it, options over both.
    #[arg(long, value_name = "FILE", env = "SKYPOSE_CONFIG")]
    config: Option<PathBuf>,
    /// Folder under which everything is stored [default: skypose-data].
    #[arg(long, value_name = "FOLDER")]
    data: Option<PathBuf>,
}

impl SettingsArgs {
    fn load(&self, mut options: Vec<(&'static str, String)>) -> Result<Settings, Fault> {
        let file = match &self.config {
            Some(path) => Some(std::fs::read_to_string(path).map_err(|error| inputs::unreadable(path, &error))?),
            None => None,
        };
        if let Some(folder) = &self.data {
            options.push(("store.data", folder.display().to_string()));
        }
        let variables = std::env::vars().filter(|(name, _)| name != "SKYPOSE_CONFIG");
        load(file.as_deref(), variables, &options).map_err(|faults| {
            let list: Vec<String> = faults.iter().map(ToString::to_string).collect();
            Fault::new(FaultKind::Senseless, format!("settings: {}", list.join("; ")))
        })
    }
}

/// How a command ended short of success.
#[derive(Debug)]
enum Stop {
    /// Something is wrong with what was given, or with us.
    Fault(Fault),
    /// Some of many inputs failed; each has been told of. The worst of it.
    SomeFailed(FaultKind),
    /// The reader of our output has gone.
    NobodyReads,
    /// Somebody pressed Ctrl-C, or something asked us to end.
    Interrupted,
}

impl From<Fault> for Stop {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

impl From<std::io::Error> for Stop {
    fn from(error: std::io::Error) -> Self {
        if super::console::is_closed(&error) {
            Self::NobodyReads
        } else {
            Self::Fault(Fault::new(FaultKind::Internal, error.to_string()))
        }
    }
}

/// Help that was asked for, or in one line what is wrong with the words.
fn not_understood(error: &clap::Error) -> ExitCode {
    use clap::error::ErrorKind::{DisplayHelp, DisplayHelpOnMissingArgumentOrSubcommand, DisplayVersion};
    if matches!(error.kind(), DisplayHelp | DisplayVersion | DisplayHelpOnMissingArgumentOrSubcommand) {
        error.exit();
    }
    let text = error.render().to_string();
    let said = text.strip_prefix("error: ").unwrap_or(&text).lines().map(str::trim);
    let said = said.take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more information"));
    super::console::complain(&said.filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" "));
    ExitCode::from(2)
}

/// Runs the command line. Exit code 2 for bad input, 1 for a failure of ours.
#[must_use]
pub fn run() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return not_understood(&error),
    };
    let result = match cli.command {
        Command::Serve(command) => command.run(),
        Command::Detect(command) => command.run(),
        Command::Estimate(command) => command.run(),
        Command::Grab(command) => command.run(),
        Command::Replay(command) => command.run(),
        Command::Watch(command) => command.run(),
        Command::Pose(command) => command.run(),
        Command::Assess(command) => command.run(),
        Command::Encounter(command) => command.run(),
        Command::Calibrate(command) => command.run(),
        Command::Evaluate(command) => command.run(),
        Command::Camera(command) => command.run(),
        Command::Pattern(command) => command.run(),
        Command::Openapi => print_openapi(),
        #[cfg(feature = "zenoh")]
        Command::Asyncapi => {
            super::console::print_line(super::bus::asyncapi::document().trim_end()).map_err(Stop::from)
        }
        Command::Demo(command) => command.run(),
    };
    match result {
        Ok(()) | Err(Stop::NobodyReads) => ExitCode::SUCCESS,
        // As a shell has it: 128 and the number of the signal.
        Err(Stop::Interrupted) => ExitCode::from(130),
        Err(Stop::SomeFailed(worst)) => exit_code(worst),
        Err(Stop::Fault(fault)) => {
            super::console::complain(&fault.to_string());
            exit_code(fault.kind)
        }
    }
}

fn exit_code(kind: FaultKind) -> ExitCode {
    ExitCode::from(if matches!(kind, FaultKind::Internal | FaultKind::Unreachable) { 1 } else { 2 })
}

/// What of many inputs failed.
#[derive(Default)]
struct Failures(Option<FaultKind>);

impl Failures {
    /// Tells of one.
    fn add(&mut self, place: &str, fault: &Fault) {
        super::console::complain(&format!("{place}: {fault}"));
        if self.0 != Some(FaultKind::Internal) {
            self.0 = Some(fault.kind);
        }
    }

    fn into_result(self) -> Result<(), Stop> {
        self.0.map_or(Ok(()), |worst| Err(Stop::SomeFailed(worst)))
    }
}

fn print_openapi() -> Result<(), Stop> {
    let text =
        super::http::openapi().to_pretty_json().map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))?;
    Ok(super::console::print_line(&text)?)
}

/// A runtime for a command that is no server.
fn runtime() -> Result<tokio::runtime::Runtime, Fault> {
    tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))
}
