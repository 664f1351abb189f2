//! `skypose calibrate`.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

use clap::Args;

use super::inputs::{frames_of, pattern_of, unreadable, unreadable_source};
use super::outputs::{is_printed, one_is_printed, write};
use super::{SettingsArgs, Stop, runtime};
use crate::board::Board;
use crate::calibrate::watch::Watch;
use crate::frame::Limits;
use crate::shell::console::{complain, note, print_line, progress};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::calibration::estimated::{Estimated, estimated};
use crate::shell::service::calibration::sighting::{Sighting, look, refuse_other_sizes, usual_size};
use crate::shell::store::{Kind, Precondition, Store, check_name};
use crate::shell::wire::CalibrationRequest;
use crate::shell::wire::calibration::{CalibrationWire, FixedWire};
use crate::shell::wire::camera::DistortionModel;

pub(super) const EXAMPLES: &str = "Examples:
  skypose pattern chessboard:9x6:0.025 --out board.pdf
  skypose calibrate pictures --pattern chessboard:9x6:0.025 --report report.html --camera-out camera.json";

#[derive(Args, Debug)]
pub(super) struct Calibrate {
    /// Pictures of the board, or folders of them.
    #[arg(value_name = "FOLDER|PICTURE", required = true)]
    inputs: Vec<PathBuf>,
    /// The board: chessboard:9x6:0.025 (inner corners, side of a square in metres), circles:7x5:0.03, asymmetric-circles:4x11:0.02,
    /// dots:..., aprilgrid:6x6:0.03, or a description file of `skypose pattern`.
    #[arg(long, value_name = "PATTERN")]
    pattern: String,
    /// The lens: `none`, `plumb_bob`, `rational_polynomial` or `equidistant` (fisheye).
    #[arg(long, value_name = "MODEL", default_value = "plumb_bob", value_parser = named::<DistortionModel>)]
    model: DistortionModel,
    /// Hold at their usual values: `aspect_ratio`, `principal_point`, and coefficients as `k3`; several with commas between.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = named::<FixedWire>)]
    fix: Vec<FixedWire>,
    /// Take the camera also from pictures that say too little.
    #[arg(long)]
    force: bool,
    /// Write the result with its report as JSON; - prints it instead of the summary.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the report as a page that needs nothing else; - prints it instead of the summary.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Write the camera alone, for --camera of other commands; - prints it instead of the summary.
    #[arg(long, value_name = "FILE.json")]
    camera_out: Option<PathBuf>,
    /// Store the camera under this name in the folder that --data names.
    #[arg(long, value_name = "NAME", requires = "data")]
    name: Option<String>,
    #[command(flatten)]
    settings: SettingsArgs,
}

fn named<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, String> {
    serde_json::from_value(serde_json::Value::String(text.into())).map_err(|error| error.to_string())
}

impl Calibrate {
    pub(super) fn run(self) -> Result<(), Stop> {
        let settings = self.settings.load(Vec::new())?;
        let is_other_printed = one_is_printed([
            ("--json", self.json.as_deref()),
            ("--report", self.report.as_deref()),
            ("--camera-out", self.camera_out.as_deref()),
        ])?;
        if let Some(name) = &self.name {
            check_name(name)?;
        }
        let (pattern, board) = pattern_of(&self.pattern)?;
        let request =
            CalibrationRequest { pattern, model: self.model, fixed: self.fix.clone(), force: self.force, name: None };
        request.check().map_err(|fault| Fault { pointer: None, ..fault })?;
        let paths = frames_of(&self.inputs)?;
        // What was named and is not there is no picture without a board.
        for path in &paths {
            path.metadata().map_err(|error| unreadable(path, &error))?;
        }
        let mut sightings = looked(&paths, &board, settings.frames.limits(), settings.workers.thread_count());
        let size = usual_size(&sightings);
        refuse_other_sizes(&mut sightings, size);
        for sighting in sightings.iter().filter(|sighting| sighting.reason.is_some()) {
            complain(&sighting.to_string());
        }
        let bar = progress(100, "judging");
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a hundred")]
        let tell = |share: f64| bar.set_position((100.0 * share) as u64);
        let done = estimated(size, &sightings, &request, &Watch::new(&|| true, &tell));
        bar.finish_and_clear();
        let Estimated { wire, page } = done.map_err(|refusal| refusal.fault)?;
        // Those that the estimate leaves out; the others have been named.
        for (view, sighting) in wire.views.iter().zip(&sightings) {
            if let (Some(reason), None) = (&view.reason, &sighting.reason) {
                complain(&format!("{}: {reason}", view.name));
            }
        }
        self.write(&wire, &page)?;
        if !is_other_printed {
            print_summary(&wire)?;
        }
        if let Some(path) = self.report.as_deref().filter(|path| !is_printed(path)) {
            note(&format!("The report: {}", path.display()));
        }
        Ok(())
    }

    fn write(&self, wire: &CalibrationWire, page: &str) -> Result<(), Stop> {
        let json = json_of(wire)?;
        let camera = json_of(&wire.camera)?;
        if let (Some(name), Some(folder)) = (&self.name, &self.settings.data) {
            runtime()?
                .block_on(async {
                    let store = Store::open(folder).await?;
                    let stored = store.put(Kind::Camera, name, &camera, &Precondition::None).await;
                    store.close().await;
                    stored
                })
                .map_err(Fault::from)?;
        }
        for (path, text) in [(&self.report, page), (&self.camera_out, &camera), (&self.json, &json)] {
            if let Some(path) = path {
                write(path, text)?;
            }
        }
        Ok(())
    }
}

fn json_of(value: &impl serde::Serialize) -> Result<String, Fault> {
    serde_json::to_string(value).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))
}

/// What pictures are called: by their files' names, or, where two have the same in different folders, as they were given.
fn names_of(paths: &[PathBuf]) -> Vec<String> {
    let short = |path: &Path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let mut counts: HashMap<String, usize> = HashMap::new();
    for path in paths {
        *counts.entry(short(path)).or_default() += 1;
    }
    let name = |path: &PathBuf| match short(path) {
        name if counts.get(&name) == Some(&1) => name,
        _ => path.display().to_string(),
    };
    paths.iter().map(name).collect()
}

/// The board in every picture, several at a time, in their order.
fn looked(paths: &[PathBuf], board: &Board, limits: Limits, threads: usize) -> Vec<Sighting> {
    let bar = progress(paths.len(), "pictures");
    let names = names_of(paths);
    let next = AtomicUsize::new(0);
    let (send, receive) = mpsc::channel();
    let mut found: Vec<(usize, Sighting)> = std::thread::scope(|scope| {
        for _ in 0..threads.min(paths.len()) {
            let (send, next, names) = (send.clone(), &next, &names);
            scope.spawn(move || {
                while let Some((index, path, name)) = Some(next.fetch_add(1, Ordering::Relaxed))
                    .and_then(|index| Some((index, paths.get(index)?, names.get(index)?.clone())))
                {
                    let sighting = match std::fs::read(path) {
                        Ok(bytes) => look(name, &bytes, board, limits),
                        // The name stands before the reason.
                        Err(error) => Sighting::unreadable(name, unreadable_source(&error).detail),
                    };
                    if send.send((index, sighting)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(send);
        receive.into_iter().inspect(|_| bar.inc(1)).collect()
    });
    bar.finish_and_clear();
    found.sort_by_key(|(index, _)| *index);
    found.into_iter().map(|(_, sighting)| sighting).collect()
}

fn print_summary(wire: &CalibrationWire) -> Result<(), Stop> {
    let counted = wire.views.iter().filter(|view| view.counts).count();
    let held_out = wire.models.first().and_then(|chosen| chosen.held_out_rms_px);
    let held_out = held_out.map(|rms| format!(", {rms:.3} px in pictures held out")).unwrap_or_default();
    print_line(&format!(
        "{counted} of {} pictures, reprojection error {:.3} px{held_out}",
        wire.views.len(),
        wire.reprojection_rms_px
    ))?;
    let camera = &wire.camera;
    let lens = crate::camera::Distortion::from(camera.distortion.model);
    let names = ["fx", "fy", "cx", "cy"].iter().chain(lens.coefficient_names());
    let values = [camera.fx, camera.fy, camera.cx, camera.cy];
    for (name, value) in names.zip(values.iter().chain(&camera.distortion.coefficients)) {
        let sigma = wire.standard_deviations.get(*name).copied().unwrap_or_default();
        let held = if sigma > 0.0 { format!(" +- {sigma:.2e}") } else { " (held)".into() };
        print_line(&format!("  {name:<3}{value:>14.6}{held}"))?;
    }
    for line in &wire.advice {
        print_line(&format!("- {line}"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_one_name_are_told_apart_by_their_folders() {
        let names = |paths: &[&str]| names_of(&paths.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(names(&["a/1.jpg", "b/2.jpg"]), ["1.jpg", "2.jpg"]);
        assert_eq!(names(&["a/1.jpg", "b/1.jpg", "b/2.jpg"]), ["a/1.jpg", "b/1.jpg", "2.jpg"]);
    }
}
