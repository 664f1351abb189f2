//! What the detectors cost, step by step, in ms, at three sizes, frame after frame in the same memory; single steps of the seed's edges and
//! a single frame of the sky in their own. The least of many runs, as others on the machine only ever add to the time.
//!
//! Colour and beacon: a wing with six discs before clouds (for the beacon six LEDs at night), the same among forty red things,
//! and a frame of red noise, each through a JPEG. `locate` is the ellipse fit of what was found; `search` is the rest, score and
//! blobs. The seed's edges: with its window and with a small one, for a clear sky with an aircraft and for a frame of noise; the steps
//! one by one, and `whole`, which for the small window takes them in one walk. The sky detector: for a single frame and for the next
//! frame of a sequence, from luma as a video has it.

#![allow(clippy::print_stdout, reason = "a benchmark prints its table")]
#![allow(clippy::expect_used, reason = "a benchmark of a frame that cannot be made must stop")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use nalgebra::{Matrix2, Vector2, Vector3};
use rand::{Rng, RngExt};
use skypose::camera::{Camera, Distortion};
use skypose::detect::edge::{blobs, sifted};
use skypose::detect::gray::gray;
use skypose::detect::locate::{Locator, Seed};
use skypose::detect::median::median;
use skypose::detect::sobel::sobel;
use skypose::detect::{
    BeaconOptions, ColorOptions, Detector, EdgeOptions, SkyOptions, Stamp, Watch, Workspace, detect, detect_with,
};
use skypose::frame::{Coding, Decoding, Frame, Pixels};
use skypose::geometry::{CameraFromTarget, rotation};
use skypose::random;
use skypose::scene::encode;
use skypose::scene::models::wing;
use skypose::scene::render::{Distractor, Model, Optics, Shape, Sky, render};

const SIZES_PX: [[u32; 2]; 3] = [[640, 480], [1280, 720], [1920, 1080]];
/// Time for each figure.
const EACH: Duration = Duration::from_millis(400);

fn main() {
    // `cargo bench` hands on its own options and filters; only a run of the tests wants no table.
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    println!("{:<12} {:<8} {:<9}   found  whole  locate  search", "frame", "method", "shows");
    for size_px in SIZES_PX {
        for shows in ["clear", "clutter", "red noise"] {
            let size = format!("{}x{}", size_px[0], size_px[1]);
            for (method, detector) in [
                ("color", Detector::Color(ColorOptions::default())),
                ("beacon", Detector::Beacon(BeaconOptions::default())),
            ] {
                println!("{size:<12} {method:<8} {shows:<9}{}", marker_row(size_px, method, shows, &detector));
            }
        }
    }
    println!();
    println!("{:<12} {:<8} {:<7}    gray  median   Sobel   blobs  filter   whole", "frame", "options", "shows");
    for [width, height] in SIZES_PX {
        for (name, options) in [("thesis", EdgeOptions::THESIS), ("default", EdgeOptions::default())] {
            for (shows, frame) in [("clear", clear(width, height)), ("noise", noise(width, height))] {
                let size = format!("{width}x{height}");
                println!("{size:<12} {name:<8} {shows:<7}{}", row(&frame, &options));
            }
        }
    }
    println!("\n{:<12} {:<7}  single    next", "sky", "shows");
    for [width, height] in [[640, 512], [1280, 720], [1920, 1080]] {
        for (shows, frame) in [("clear", clear(width, height)), ("noise", noise(width, height))] {
            println!("{:<12} {shows:<7}{}", format!("{width}x{height}"), sky_row(&frame));
        }
    }
}

fn sky_row(frame: &Frame) -> String {
    let luma = gray(frame, frame.full(), skypose::detect::gray::Gray::Average);
    let frame = Frame::checked(frame.width(), frame.height(), Pixels::Luma(luma.samples), Coding::LOSSLESS);
    let frame = frame.expect("a frame");
    let (region, options) = (frame.full(), SkyOptions::default());
    let mut watch = Watch::new();
    let detector = Detector::Sky(options);
    [
        least_ms(|| drop(black_box(detect(black_box(&frame), region, &detector)))),
        least_ms(|| drop(black_box(watch.observe(black_box(&frame), region, Stamp::default(), &options)))),
    ]
    .map(|ms| format!("{ms:8.3}"))
    .concat()
}

fn marker_row(size_px: [u32; 2], method: &str, shows: &str, detector: &Detector) -> String {
    let mut rng = random::named(&format!("bench detect {method} {shows}"));
    let frame = match shows {
        "red noise" => red_noise(size_px, &mut rng),
        _ => rendered(size_px, method == "beacon", if shows == "clutter" { 40 } else { 0 }, &mut rng),
    };
    let jpeg = encode::jpeg(&frame, 90).expect("fits a JPEG");
    let frame = Frame::decode(&jpeg, &Decoding::default()).expect("a JPEG");
    let (mut workspace, mut locator) = (Workspace::default(), Locator::default());
    let found = detect(&frame, frame.full(), detector).centroids;
    let chroma = matches!(detector, Detector::Color(_)).then(|| Vector2::new(-0.31, 0.95));
    let seeds: Vec<Seed> = found
        .iter()
        .map(|c| {
            let moments = Matrix2::identity() * (c.area_px / (4.0 * std::f64::consts::PI));
            Seed { pixel: c.pixel, moments, sigma_px: c.sigma_px }
        })
        .collect();
    let whole = least_ms(|| drop(black_box(detect_with(&mut workspace, black_box(&frame), frame.full(), detector))));
    let fits = least_ms(|| {
        for seed in &seeds {
            black_box(if chroma.is_some() {
                locator.locate(&frame, seed, chroma)
            } else {
                locator.locate_light(&frame, seed)
            });
        }
    });
    format!("{:8}{whole:7.3}{fits:8.3}{:8.3}", found.len(), (whole - fits).max(0.0))
}

/// Six discs under a wing before clouds, or six LEDs in the dark.
fn rendered([width, height]: [u32; 2], at_night: bool, things: u32, rng: &mut impl Rng) -> Frame {
    let (w, h) = (f64::from(width), f64::from(height));
    let lens = Distortion::PlumbBob([-0.12, 0.05, 4e-4, -3e-4, 0.0]);
    let camera = Camera::checked([width, height], [w / 1.28; 2], [w / 2.0 - 3.5, h / 2.0 - 3.0], lens).expect("good");
    let pose = CameraFromTarget::new(rotation::exp(&Vector3::new(0.35, -0.25, 0.6)), Vector3::new(0.4, -0.2, 4.5));
    let distractors = (0..things).map(|_| Distractor {
        shape: if rng.random_bool(0.5) { Shape::Ellipse } else { Shape::Rectangle },
        centre_px: [rng.random_range(0.0..w), rng.random_range(0.0..h)],
        half_px: [rng.random_range(2.0..12.0), rng.random_range(2.0..12.0)],
        turn_rad: rng.random_range(0.0..3.0),
        rgb: [rng.random_range(100..230), rng.random_range(15..120), rng.random_range(15..120)],
    });
    let distractors = distractors.collect();
    let (sky, model) = if at_night {
        let dark = Model { body_rgb: [16, 16, 18], paint: Vec::new(), marker_gain: 12.0, ..wing() };
        (Sky { distractors, ..Sky::plain([9, 10, 14]) }, dark)
    } else {
        (Sky { distractors, ..Sky::fair(1, [0.0; 2]) }, wing())
    };
    render(&camera, &pose, &model, &sky, &Optics::default(), rng)
}

/// Every pixel a red of its own.
fn red_noise([width, height]: [u32; 2], rng: &mut impl Rng) -> Frame {
    let samples = (0..width * height)
        .flat_map(|_| [rng.random_range(60..=255), rng.random_range(0..80), rng.random_range(0..80)])
        .collect();
    Frame::checked(width, height, Pixels::Rgb(samples), Coding::LOSSLESS).expect("a frame")
}

fn row(frame: &Frame, options: &EdgeOptions) -> String {
    let region = frame.full();
    let plane = gray(frame, region, options.gray);
    let smooth = median(&plane, options.window, options.border);
    let edges = sobel(&smooth, options.threshold_ratio);
    let found = blobs(&edges);
    let detector = Detector::Edge(*options);
    let mut workspace = Workspace::default();
    [
        least_ms(|| drop(black_box(gray(black_box(frame), region, options.gray)))),
        least_ms(|| drop(black_box(median(black_box(&plane), options.window, options.border)))),
        least_ms(|| drop(black_box(sobel(black_box(&smooth), options.threshold_ratio)))),
        least_ms(|| drop(black_box(blobs(black_box(&edges))))),
        least_ms(|| drop(black_box(sifted(black_box(found.clone()), region, options)))),
        least_ms(|| drop(black_box(detect_with(&mut workspace, black_box(frame), region, &detector)))),
    ]
    .map(|ms| format!("{ms:8.3}"))
    .concat()
}

fn least_ms(mut work: impl FnMut()) -> f64 {
    let begin = Instant::now();
    let mut least = Duration::MAX;
    while begin.elapsed() < EACH {
        let start = Instant::now();
        work();
        least = least.min(start.elapsed());
    }
    1e3 * least.as_secs_f64()
}

/// A sky that brightens downwards, with a little noise, and a dark aircraft an eighth of the width wide.
fn clear(width: u32, height: u32) -> Frame {
    let mut rng = random::named("bench detect clear");
    let pixel = |x: u32, y: u32, noise: u8| {
        let (u, v) =
            (f64::from(x) / f64::from(width) - 0.5, (f64::from(y) - 0.5 * f64::from(height)) / f64::from(width));
        let is_wing = (v / 0.005).abs() < 1.0 - (u / 0.0625).abs();
        let is_body = (u / 0.008).powi(2) + (v / 0.02).powi(2) < 1.0;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a colour")]
        let sky = (150.0 + 60.0 * f64::from(y) / f64::from(height)) as u8;
        if is_wing || is_body {
            [40 + noise, 42 + noise, 45 + noise]
        } else {
            [sky - 30 + noise, sky + noise, 220 + noise]
        }
    };
    let samples = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .flat_map(|(x, y)| pixel(x, y, rng.random_range(0..6)));
    Frame::checked(width, height, Pixels::Rgb(samples.collect()), Coding::LOSSLESS).expect("a frame")
}

fn noise(width: u32, height: u32) -> Frame {
    let mut rng = random::named("bench detect noise");
    let samples = (0..width * height * 3).map(|_| rng.random()).collect();
    Frame::checked(width, height, Pixels::Rgb(samples), Coding::LOSSLESS).expect("a frame")
}
