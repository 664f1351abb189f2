//! `skypose evaluate`: solvers on simulated cases, the whole pipeline on recorded frames, or on encounters that are flown.

mod encounters;
mod recorded;
mod study;
mod table;

use std::path::{Path, PathBuf};

use clap::Args;

use super::outputs::{is_printed, one_is_printed};
use super::{SettingsArgs, Stop};
use crate::detect::Detector;
use crate::shell::console::note;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::recorded::Files;
use crate::shell::wire::encounters::SensingName;
use crate::shell::wire::{DetectorWire, from_json};

pub(super) const EXAMPLES: &str = "Examples:
  skypose evaluate thesis-2012
  skypose evaluate thesis-2012 --solvers epnp,epnp+refine,auto --runs 1000 --report report.html
  skypose evaluate thesis-2012 --sweep pixel_sigma_px=0.1,0.3,1,3 --report noise.html
  skypose evaluate study.json --json figures.json --cases cases.csv
  skypose evaluate recordings --report report.html
  skypose evaluate encounters --runs 2000 --report encounters.html
  skypose evaluate encounters --sensing frames --runs 20 --cases encounters.csv
  skypose evaluate encounters.json --json figures.json
  skypose evaluate encounters --video encounter.mp4 --encounter 17
  skypose evaluate recordings.zip --detector '{\"method\": \"edge\", \"preset\": \"thesis\"}'

A folder or archive holds frames or videos and truth.json, which says what they show (docs/recorded.md).
`encounters` flies random encounters of two aircraft and tells the risk ratio (docs/encounters.md).";

#[derive(Args, Debug)]
pub(super) struct Evaluate {
    /// `thesis-2012`, `encounters`, or the JSON file of a study or of encounters as POST /v1/evaluations takes it; or a folder or an archive (zip, tar) of frames or
    /// videos with truth.json, or that file itself.
    #[arg(value_name = "STUDY|FOLDER|ARCHIVE")]
    what: PathBuf,
    /// Cases of a study, at each value of its sweep [default: 100]; encounters [default: 1000].
    #[arg(long, value_name = "N")]
    runs: Option<u64>,
    /// Names the cases of a study, or the encounters: the same seed has the same figures to the last digit [default: 2012].
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// What a study compares, with commas between: a solver alone (epnp), the service's answer with it (epnp+covariance, epnp+refine,
    /// epnp+robust), or what the service does when it is free to choose (auto, auto+robust).
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    solvers: Option<Vec<String>>,
    /// One parameter of a study at several values: `points`, `range_m`, `tilt_rad`, `max_angle_rad`, `pixel_sigma_px`, `outlier_ratio`,
    /// `missing_ratio`, `quantisation_px`, `focal_error_ratio` or `center_error_px`.
    #[arg(long, value_name = "PARAMETER=V,V,...")]
    sweep: Option<String>,
    /// Take this detector for all recorded frames, whatever their truth names, or for encounters: JSON as in the API, such as
    /// '{"method": "edge", "preset": "thesis"}'.
    #[arg(long, value_name = "JSON", value_parser = detector)]
    detector: Option<DetectorWire>,
    /// Where encounters get their centroids: simulated as the detector was measured (centroids), or from rendered frames (frames).
    #[arg(long, value_name = "HOW", value_parser = super::frames::named::<SensingName>)]
    sensing: Option<SensingName>,
    /// Write the frames of one encounter with what was found in them to a video (.mp4, .mkv, ...) or a folder, and evaluate nothing.
    #[arg(long, value_name = "OUT")]
    video: Option<PathBuf>,
    /// Number of the encounter that --video shows, as in the table of --cases.
    #[arg(long, value_name = "N", default_value_t = 0, requires = "video")]
    encounter: u64,
    /// Threads that compute [default: one for each core]. With 1 no frame waits for another, and latencies are those of a frame alone.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Write the figures as JSON; - prints them instead of the tables.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the report with pictures as a page that needs nothing else; - prints it instead of the tables.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Write a table with a row for every case and solver, every frame or every encounter: CSV; that of a study or of encounters also, where the name ends in .json or
    /// .jsonl, one JSON object a line. - prints it instead of the tables.
    #[arg(long, value_name = "FILE.csv")]
    cases: Option<PathBuf>,
    #[command(flatten)]
    settings: SettingsArgs,
}

fn detector(text: &str) -> Result<DetectorWire, String> {
    let wire: DetectorWire = from_json(text.as_bytes()).map_err(|fault| fault.to_string())?;
    Detector::try_from(&wire).map(|_| wire).map_err(|fault| fault.to_string())
}

impl Evaluate {
    /// Whether one of the files is standard output, so that the tables are not printed.
    fn is_other_printed(&self) -> Result<bool, Fault> {
        one_is_printed([
            ("--json", self.json.as_deref()),
            ("--report", self.report.as_deref()),
            ("--cases", self.cases.as_deref()),
        ])
    }

    /// Tells where the report is.
    fn note_report(&self) {
        if let Some(path) = self.report.as_deref().filter(|path| !is_printed(path)) {
            note(&format!("The report: {}", path.display()));
        }
    }

    pub(super) fn run(self) -> Result<(), Stop> {
        let of_studies = [
            ("--runs", self.runs.is_some()),
            ("--seed", self.seed.is_some()),
            ("--solvers", self.solvers.is_some()),
            ("--sweep", self.sweep.is_some()),
        ];
        let of_solvers = &of_studies[2..];
        let of_frames = [("--detector", self.detector.is_some())];
        let of_encounters = [("--sensing", self.sensing.is_some()), ("--video", self.video.is_some())];
        let asked = if is_recorded(&self.what) { None } else { encounters::asked(&self.what)? };
        if let Some(request) = asked {
            refuse(of_solvers, "studies", &self.what)?;
            encounters::run(&self, request)
        } else if is_recorded(&self.what) {
            refuse(&of_studies, "studies", &self.what)?;
            refuse(&of_encounters, "encounters", &self.what)?;
            recorded::run(&self)
        } else {
            refuse(&of_frames, "recorded frames and encounters", &self.what)?;
            refuse(&of_encounters, "encounters", &self.what)?;
            study::run(&self)
        }
    }
}

fn is_recorded(what: &Path) -> bool {
    what.is_dir() || Files::is_truth(what) || what.is_file() && what.extension().is_none_or(|ending| ending != "json")
}

fn refuse(options: &[(&str, bool)], of: &str, what: &Path) -> Result<(), Fault> {
    options.iter().find(|(_, given)| *given).map_or(Ok(()), |(option, _)| {
        Err(Fault::new(FaultKind::Senseless, format!("{option} is for {of}, which {} is not", what.display())))
    })
}
