//! `skypose evaluate`.

mod study;
mod table;

use std::path::PathBuf;

use clap::Args;

use super::{SettingsArgs, Stop};

pub(super) const EXAMPLES: &str = "Examples:
  skypose evaluate thesis-2012
  skypose evaluate thesis-2012 --solvers epnp,epnp+refine,auto --runs 1000 --report report.html
  skypose evaluate thesis-2012 --sweep pixel_sigma_px=0.1,0.3,1,3 --report noise.html
  skypose evaluate study.json --json figures.json --cases cases.csv";

#[derive(Args, Debug)]
pub(super) struct Evaluate {
    /// `thesis-2012`, or the JSON file of a study as POST /v1/evaluations takes it.
    #[arg(value_name = "STUDY")]
    what: PathBuf,
    /// Cases, at each value of the sweep [default: 100].
    #[arg(long, value_name = "N")]
    runs: Option<u64>,
    /// Names the cases: the same seed has the same figures to the last digit [default: 2012].
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// What is compared, with commas between: a solver alone (epnp), the service's answer with it (epnp+covariance, epnp+refine,
    /// epnp+robust), or what the service does when it is free to choose (auto, auto+robust).
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    solvers: Option<Vec<String>>,
    /// One parameter at several values: points, range_m, tilt_rad, max_angle_rad, pixel_sigma_px, outlier_ratio, missing_ratio,
    /// quantisation_px, focal_error_ratio or center_error_px.
    #[arg(long, value_name = "PARAMETER=V,V,...")]
    sweep: Option<String>,
    /// Threads that compute [default: one for each core].
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Write the figures as JSON; - prints them instead of the tables.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the report with pictures as a page that needs nothing else.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Write what every solver said of every case: CSV, or where the name ends in .json or .jsonl one JSON object a line.
    #[arg(long, value_name = "FILE.csv")]
    cases: Option<PathBuf>,
    #[command(flatten)]
    settings: SettingsArgs,
}

impl Evaluate {
    pub(super) fn run(self) -> Result<(), Stop> {
        study::run(&self)
    }
}
