//! `skypose assess`.

mod report;

use std::path::PathBuf;

use clap::Args;

use super::inputs::{given, given_camera};
use super::outputs::{one_is_printed, write};
use super::{SettingsArgs, Stop, runtime};
use crate::assess::AssessOptions;
use crate::shell::console::print_line;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::compute::{AssessmentTask, Terms};
use crate::shell::service::lookup::Lookup;
use crate::shell::store::Store;
use crate::shell::wire::{AssessmentReply, AssessmentRequest, TargetWire};

#[derive(Args, Debug)]
pub(super) struct Assess {
    /// The target: a JSON file, or with --data the name of a stored one.
    #[arg(value_name = "TARGET")]
    target: PathBuf,
    /// The camera: a file (JSON, ROS' YAML, OpenCV's YAML or XML), or with --data the name of a stored one.
    #[arg(long, value_name = "CAMERA")]
    camera: PathBuf,
    /// Standard deviation of a centroid per axis, px, with all that camera and target model add [default: 0.3].
    #[arg(long, value_name = "S")]
    pixel_sigma: Option<f64>,
    /// Advise only moves of markers within their plane.
    #[arg(long)]
    flat: bool,
    /// Another target that flies in the same sky. May be given several times.
    #[arg(long = "other", value_name = "TARGET")]
    others: Vec<PathBuf>,
    /// Write the reply of the API; - prints it instead of the report.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the figures over range and aspect (SVG); - prints the drawing instead of the report.
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    settings: SettingsArgs,
}

impl Assess {
    pub(super) fn run(self) -> Result<(), Stop> {
        let is_other_printed = one_is_printed([("--json", self.json.as_deref()), ("--plot", self.plot.as_deref())])?;
        let terms = Terms::of(&self.settings.load(Vec::new())?);
        let stored = self.settings.data.is_some();
        let others: Result<Vec<_>, Fault> = self.others.iter().map(|path| given::<TargetWire>(path, stored)).collect();
        let request = AssessmentRequest {
            id: None,
            camera: given_camera(&self.camera, stored)?,
            target: given(&self.target, stored)?,
            pixel_sigma: self.pixel_sigma.unwrap_or(AssessOptions::default().pixel_sigma),
            ranges_m: None,
            aspects_rad: None,
            flat: self.flat,
            others: others?,
            plot: false,
        };
        let runtime = runtime()?;
        let store = match &self.settings.data {
            Some(folder) => Some(runtime.block_on(Store::open(folder)).map_err(Fault::from)?),
            None => None,
        };
        let lookup = Lookup::new(store.as_ref(), std::sync::Arc::default());
        let task = runtime.block_on(AssessmentTask::checked(request, &lookup, &terms))?;
        let assessment = task.assessment();
        if let Some(path) = &self.plot {
            write(path, &task.plot(&assessment))?;
        }
        if let Some(path) = &self.json {
            let json = serde_json::to_string(&AssessmentReply::from(&assessment))
                .map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))?;
            write(path, &json)?;
        }
        if !is_other_printed {
            print_line(&report::of(task.target(), task.camera(), task.pixel_sigma(), &assessment))?;
        }
        Ok(())
    }
}
