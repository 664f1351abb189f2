//! OpenCV and PoseLib: the program `peers.py` beside this one, spoken with through pipes.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};
use skypose::geometry::CameraFromTarget;

use crate::method::{All, Results, median};
use crate::study::{Study, Task};

/// Names the interpreter, `python3` if it is not set.
pub const INTERPRETER: &str = "SKYPOSE_PEERS_PYTHON";

/// What to do where something is missing.
const INSTALL: &str = "pip install opencv-python poselib";

/// The running program, which has had its studies.
pub struct Python {
    child: Child,
    say: ChildStdin,
    hear: BufReader<ChildStdout>,
    /// What is measured, with versions.
    pub versions: Versions,
}

/// Of the packages that are installed.
#[derive(Deserialize)]
pub struct Versions {
    pub opencv: Option<String>,
    pub poselib: Option<String>,
}

#[derive(Serialize)]
struct SentStudy {
    planar: bool,
    outliers: bool,
    speed_count: Option<usize>,
    tasks: Vec<SentTask>,
}

/// Matrices are given row by row.
#[derive(Serialize)]
struct SentTask {
    points_m: Vec<[f64; 3]>,
    pixels_px: Vec<[f64; 2]>,
    sigma_px: f64,
    focal_px: [f64; 2],
    principal_px: [f64; 2],
    size_px: [u32; 2],
    start_rotation: [[f64; 3]; 3],
    start_translation_m: [f64; 3],
}

#[derive(Deserialize)]
struct HeardResults {
    poses: Vec<Option<[f64; 12]>>,
    ns: Vec<f64>,
}

impl Python {
    /// Starts it with these studies. Where there is no Python or no peer, says how to get them.
    pub fn start(studies: &[Study]) -> Result<Self, String> {
        let interpreter = std::env::var(INTERPRETER).unwrap_or_else(|_| "python3".to_owned());
        let missing = |what: &str| format!("{what}: without OpenCV and PoseLib ({INSTALL})");
        let mut child = Command::new(&interpreter)
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("peers.py"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| missing(&format!("{interpreter}: {error}")))?;
        let (Some(mut say), Some(stdout)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(missing("no pipes"));
        };
        let mut hear = BufReader::new(stdout);
        let versions: Versions = heard(&mut hear).map_err(|error| missing(&error))?;
        match (&versions.opencv, &versions.poselib) {
            (None, None) => return Err(missing(&interpreter)),
            (None, _) => eprintln!("without OpenCV (pip install opencv-python)"),
            (_, None) => eprintln!("without PoseLib (pip install poselib)"),
            _ => {}
        }
        let sent: BTreeMap<&str, SentStudy> =
            studies.iter().map(|study| (study.name.as_str(), SentStudy::of(study))).collect();
        send(&mut say, &sent)?;
        Ok(Self { child, say, hear, versions })
    }

    /// Has every task of the study solved once.
    pub fn round(&mut self, study: &Study) -> Result<(), String> {
        send(&mut self.say, &study.name)?;
        heard::<String>(&mut self.hear).map(|_| ())
    }

    /// Ends it and takes what it has.
    pub fn results(self) -> Result<All, String> {
        let Self { mut child, say, mut hear, .. } = self;
        drop(say);
        let heard: BTreeMap<String, BTreeMap<String, HeardResults>> = heard(&mut hear)?;
        child.wait().map_err(|error| error.to_string())?;
        let of_study = |methods: BTreeMap<String, HeardResults>| {
            methods.into_iter().map(|(method, heard)| (method, Results::from(heard))).collect()
        };
        Ok(heard.into_iter().map(|(study, methods)| (study, of_study(methods))).collect())
    }
}

fn send(say: &mut ChildStdin, what: &impl Serialize) -> Result<(), String> {
    let line = serde_json::to_string(what).map_err(|error| error.to_string())?;
    writeln!(say, "{line}").and_then(|()| say.flush()).map_err(|error| format!("peers.py went away: {error}"))
}

fn heard<T: for<'a> Deserialize<'a>>(hear: &mut impl BufRead) -> Result<T, String> {
    let mut line = String::new();
    hear.read_line(&mut line).map_err(|error| error.to_string())?;
    serde_json::from_str(&line).map_err(|error| format!("peers.py said \"{line:.80}\": {error}"))
}

impl SentStudy {
    fn of(study: &Study) -> Self {
        let speed_count = match study.purpose {
            crate::study::Purpose::Speed(count) => Some(count),
            crate::study::Purpose::Accuracy(_) => None,
        };
        let tasks = study.tasks.iter().map(SentTask::of).collect();
        Self { planar: study.is_planar(), outliers: study.has_outliers(), speed_count, tasks }
    }
}

impl SentTask {
    fn of(task: &Task) -> Self {
        let case = &task.trial.case;
        Self {
            points_m: case.points.iter().map(|point| point.coords.into()).collect(),
            pixels_px: case.pixels.iter().map(|pixel| (*pixel).into()).collect(),
            sigma_px: task.trial.sigma_px,
            focal_px: case.camera.focal_lengths(),
            principal_px: case.camera.principal_point(),
            size_px: [case.camera.width(), case.camera.height()],
            // Columns of the transposed matrix are rows.
            start_rotation: task.start.rotation.matrix().transpose().into(),
            start_translation_m: task.start.translation.into(),
        }
    }
}

impl From<HeardResults> for Results {
    fn from(heard: HeardResults) -> Self {
        let pose = |numbers: [f64; 12]| {
            let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(&numbers[..9]));
            let pose = CameraFromTarget::new(rotation, Vector3::from_column_slice(&numbers[9..]));
            pose.is_finite().then_some(pose)
        };
        Self {
            answers: heard.poses.into_iter().map(|answer| answer.and_then(pose)).collect(),
            time_us: median(heard.ns) * 1e-3,
        }
    }
}
