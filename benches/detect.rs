//! What detection without markers costs, in ms: the seed's edge detector step by step, at three sizes, with its window and with a small
//! one; the sky detector for a single frame and for the next frame of a sequence, from luma as a video has it. For a clear sky with an
//! aircraft and for a frame of noise. The least of many runs, as others on the machine only ever add to the time.

#![allow(clippy::print_stdout, reason = "a benchmark prints its table")]
#![allow(clippy::expect_used, reason = "a benchmark of a frame that cannot be made must stop")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use rand::RngExt;
use skypose::detect::edge::{blobs, sifted};
use skypose::detect::gray::gray;
use skypose::detect::median::median;
use skypose::detect::sobel::sobel;
use skypose::detect::{Detector, EdgeOptions, SkyOptions, Stamp, Watch, detect};
use skypose::frame::{Coding, Frame, Pixels};
use skypose::random;

const SIZES_PX: [[u32; 2]; 3] = [[640, 480], [1280, 720], [1920, 1080]];
/// Time for each figure.
const EACH: Duration = Duration::from_millis(400);

fn main() {
    // `cargo bench` hands on its own options and filters; only a run of the tests wants no table.
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
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

fn row(frame: &Frame, options: &EdgeOptions) -> String {
    let region = frame.full();
    let plane = gray(frame, region, options.gray);
    let smooth = median(&plane, options.window, options.border);
    let edges = sobel(&smooth, options.threshold_ratio);
    let found = blobs(&edges);
    let detector = Detector::Edge(*options);
    [
        least_ms(|| drop(black_box(gray(black_box(frame), region, options.gray)))),
        least_ms(|| drop(black_box(median(black_box(&plane), options.window, options.border)))),
        least_ms(|| drop(black_box(sobel(black_box(&smooth), options.threshold_ratio)))),
        least_ms(|| drop(black_box(blobs(black_box(&edges))))),
        least_ms(|| drop(black_box(sifted(black_box(found.clone()), region, options)))),
        least_ms(|| drop(black_box(detect(black_box(frame), region, &detector)))),
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
