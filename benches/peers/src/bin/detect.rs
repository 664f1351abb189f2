//! Skypose's detectors and decoding against OpenCV and libjpeg-turbo: the same frames, one run, in turn round by round.
//!
//!     cargo run --release --manifest-path benches/peers/Cargo.toml --bin detect [-- ROUNDS]
//!
//! The others run beside, as their wheels of `PyPI` (`pip install opencv-python simplejpeg`). What it prints is Markdown: for each
//! frame and method the median over the rounds, and the least.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use nalgebra::Vector3;
use rand::{Rng, RngExt};
use skypose::camera::{Camera, Distortion};
use skypose::detect::{BeaconOptions, Detector, EdgeOptions, Workspace, detect_with};
use skypose::frame::{Coding, Decoding, Frame, Pixels, Wanted};
use skypose::geometry::{CameraFromTarget, rotation};
use skypose::random;
use skypose::scene::encode;
use skypose::scene::models::wing;
use skypose::scene::render::{Distractor, Optics, Shape, Sky, render};

const SIZES_PX: [[u32; 2]; 3] = [[640, 480], [1280, 720], [1920, 1080]];
const SHOWS: [&str; 3] = ["clear", "clutter", "red noise"];
/// Rounds, unless told otherwise.
const ROUNDS: usize = 31;
/// Names the interpreter, `python3` if it is not set.
const INTERPRETER: &str = "SKYPOSE_PEERS_PYTHON";

/// Times of each method on each frame, ms.
type Times = BTreeMap<String, BTreeMap<String, Vec<f64>>>;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rounds = std::env::args().nth(1).map_or(Ok(ROUNDS), |word| word.parse())?;
    let folder = std::env::temp_dir().join(format!("skypose-peers-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let times = run(&folder, rounds);
    std::fs::remove_dir_all(&folder)?;
    print(&times?);
    Ok(())
}

fn run(folder: &Path, rounds: usize) -> Result<Times, Box<dyn std::error::Error>> {
    let mut shots = Vec::new();
    for size in SIZES_PX {
        for shows in SHOWS {
            let shot = Shot::of(size, shows)?;
            std::fs::write(folder.join(&shot.name), &shot.jpeg)?;
            shots.push(shot);
        }
    }
    let interpreter = std::env::var(INTERPRETER).unwrap_or_else(|_| "python3".to_owned());
    let program: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("frames.py");
    let mut child =
        Command::new(interpreter).arg(program).arg(folder).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
    let mut say = child.stdin.take().ok_or("no pipe")?;
    let mut hear = BufReader::new(child.stdout.take().ok_or("no pipe")?).lines();
    println!("Against {}; {rounds} rounds.\n", hear.next().ok_or("frames.py says nothing")??);
    let mut ours = Times::new();
    // Frame after frame in the same memory, as the service has it.
    let mut workspace = Workspace::default();
    // The first round warms up and is not counted.
    for round in 0..=rounds {
        for shot in &shots {
            let found = shot.times(&mut workspace)?;
            if round > 0 {
                let known = ours.entry(shot.name.clone()).or_default();
                found.into_iter().for_each(|(method, ms)| known.entry(method.to_owned()).or_default().push(ms));
            }
            writeln!(say, "{}", shot.name)?;
            hear.next().ok_or("frames.py went away")??;
        }
    }
    drop(say);
    let mut all: Times = serde_json::from_str(&hear.next().ok_or("frames.py went away")??)?;
    child.wait()?;
    for methods in all.values_mut() {
        for times in methods.values_mut() {
            times.remove(0);
        }
    }
    for (frame, methods) in ours {
        all.entry(frame).or_default().extend(methods);
    }
    Ok(all)
}

/// A frame as file and decoded in the ways that our detectors want.
struct Shot {
    name: String,
    jpeg: Vec<u8>,
    native: Frame,
    rgb: Frame,
}

const NATIVE: Wanted = Wanted::Native;

fn decoded(jpeg: &[u8], wanted: Wanted) -> Result<Frame, skypose::frame::FrameError> {
    Frame::decode(jpeg, &Decoding { wanted, ..Decoding::default() })
}

impl Shot {
    fn of([width, height]: [u32; 2], shows: &str) -> Result<Self, Box<dyn std::error::Error>> {
        let mut rng = random::named(&format!("peers detect {shows}"));
        let frame = match shows {
            "clear" => rendered([width, height], Vec::new(), &mut rng)?,
            "clutter" => {
                let things = (0..40).map(|_| distractor([width, height], &mut rng)).collect();
                rendered([width, height], things, &mut rng)?
            }
            _ => red_noise(width, height, &mut rng)?,
        };
        let jpeg = encode::jpeg(&frame, 90)?;
        let (native, rgb) = (decoded(&jpeg, NATIVE)?, decoded(&jpeg, Wanted::Rgb)?);
        Ok(Self { name: format!("{width}x{height} {shows}"), jpeg, native, rgb })
    }

    fn times(&self, workspace: &mut Workspace) -> Result<Vec<(&'static str, f64)>, Box<dyn std::error::Error>> {
        let (native, rgb, jpeg) = (&self.native, &self.rgb, &self.jpeg);
        let mut run =
            |frame: &Frame, detector: Detector| timed(|| detect_with(workspace, frame, frame.full(), &detector));
        decoded(jpeg, NATIVE)?;
        Ok(vec![
            ("colour: Skypose of YCbCr", run(native, Detector::default())),
            ("colour: Skypose of RGB", run(rgb, Detector::default())),
            ("beacon: Skypose", run(native, Detector::Beacon(BeaconOptions::default()))),
            ("edge 3x3: Skypose", run(rgb, Detector::Edge(EdgeOptions::default()))),
            ("edge thesis: Skypose", run(rgb, Detector::Edge(EdgeOptions::THESIS))),
            ("decode: Skypose to YCbCr", timed(|| decoded(jpeg, NATIVE))),
            ("decode: Skypose to RGB", timed(|| decoded(jpeg, Wanted::Rgb))),
            ("decode: Skypose to luma", timed(|| decoded(jpeg, Wanted::Luma))),
        ])
    }
}

/// Milliseconds of one call.
fn timed<T>(work: impl FnOnce() -> T) -> f64 {
    let start = Instant::now();
    let _answer = black_box(work());
    1e3 * start.elapsed().as_secs_f64()
}

/// Six red discs under a wing before clouds, and things that are none.
fn rendered(
    [width, height]: [u32; 2],
    distractors: Vec<Distractor>,
    rng: &mut impl Rng,
) -> Result<Frame, Box<dyn std::error::Error>> {
    let (w, h) = (f64::from(width), f64::from(height));
    let lens = Distortion::PlumbBob([-0.12, 0.05, 4e-4, -3e-4, 0.0]);
    let camera = Camera::checked([width, height], [w / 1.28; 2], [w / 2.0 - 3.5, h / 2.0 - 3.0], lens)?;
    let pose = CameraFromTarget::new(rotation::exp(&Vector3::new(0.35, -0.25, 0.6)), Vector3::new(0.4, -0.2, 4.5));
    let sky = Sky { distractors, ..Sky::fair(1, [0.0; 2]) };
    Ok(render(&camera, &pose, &wing(), &sky, &Optics::default(), rng))
}

fn distractor([width, height]: [u32; 2], rng: &mut impl Rng) -> Distractor {
    Distractor {
        shape: if rng.random_bool(0.5) { Shape::Ellipse } else { Shape::Rectangle },
        centre_px: [rng.random_range(0.0..f64::from(width)), rng.random_range(0.0..f64::from(height))],
        half_px: [rng.random_range(2.0..12.0), rng.random_range(2.0..12.0)],
        turn_rad: rng.random_range(0.0..3.0),
        rgb: [rng.random_range(100..230), rng.random_range(15..120), rng.random_range(15..120)],
    }
}

/// Every pixel a red of its own.
fn red_noise(width: u32, height: u32, rng: &mut impl Rng) -> Result<Frame, skypose::frame::FrameError> {
    let samples = (0..width * height)
        .flat_map(|_| [rng.random_range(60..=255), rng.random_range(0..80), rng.random_range(0..80)])
        .collect();
    Frame::checked(width, height, Pixels::Rgb(samples), Coding::LOSSLESS)
}

/// A table for each thing that is done, in ms: median and least.
fn print(times: &Times) {
    for what in ["colour", "beacon", "edge 3x3", "edge thesis", "decode"] {
        let is_of = |method: &str| method.split(':').next() == Some(what);
        let Some(names) = times.values().next() else { return };
        let names: Vec<&String> = names.keys().filter(|method| is_of(method)).collect();
        let heads: Vec<&str> = names.iter().map(|name| name.split(": ").nth(1).unwrap_or(name)).collect();
        println!("### {what}\n\n| frame | {} |", heads.join(" | "));
        println!("| --- |{}", " ---: |".repeat(heads.len()));
        for size in SIZES_PX {
            for shows in SHOWS {
                let frame = format!("{}x{} {shows}", size[0], size[1]);
                let figure = |name: &&String| {
                    let mut list = times[&frame][*name].clone();
                    list.sort_by(f64::total_cmp);
                    format!("{:.2} ({:.2})", list[list.len() / 2], list[0])
                };
                println!("| {frame} | {} |", names.iter().map(figure).collect::<Vec<_>>().join(" | "));
            }
        }
        println!();
    }
}
