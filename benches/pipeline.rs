//! What a frame costs, stage by stage, at three sizes.
//!
//! Six red discs under a flying wing before clouds, rendered and coded as a camera does it (JPEG, quality 90, 4:2:0). One
//! group for each size, so that shares can be read off:
//!
//! - `frame` is the whole way from bytes to estimate: `decode` + `detect` + `identify` + `solve`.
//! - `decode` gives `YCbCr`, which the colour detector wants; `decode-rgb` gives RGB, which preset `thesis` wants.
//!   `peer-zune-ycbcr` and `peer-zune-rgb` are the JPEG decoder alone: what our reading of the header adds is the difference.
//! - `detect-of-rgb` is the colour detector on an RGB frame, as a PNG gives it; `detect-thesis` is the seed's method.

#![allow(clippy::expect_used, reason = "a benchmark of a scene that does not come out as planned must stop")]

use std::hint::black_box;
use std::time::Duration;

use criterion::Criterion;
use nalgebra::Vector3;
use skypose::camera::{Camera, Distortion};
use skypose::detect::{Detector, detect};
use skypose::frame::{Decoding, Frame, Limits, Wanted};
use skypose::geometry::{CameraFromTarget, rotation};
use skypose::identify::{Blob, identify};
use skypose::pipeline::{Options, answer_of_all, estimate};
use skypose::random;
use skypose::scene::encode;
use skypose::scene::models::wing;
use skypose::scene::render::{Optics, Sky, render};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

const SIZES_PX: [[u32; 2]; 3] = [[640, 480], [1280, 720], [1920, 1080]];

const RGB: Decoding = Decoding { wanted: Wanted::Rgb, ..NATIVE };
const NATIVE: Decoding =
    Decoding { wanted: Wanted::Native, apply_orientation: false, limits: Limits { max_pixels: 1 << 25 } };

fn main() {
    let mut criterion = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(1200))
        .configure_from_args();
    for size_px in SIZES_PX {
        bench_size(&mut criterion, size_px);
    }
    criterion.final_summary();
}

fn bench_size(criterion: &mut Criterion, size_px: [u32; 2]) {
    let camera = camera(size_px);
    let jpeg = jpeg(&camera);
    let targets = [wing().target];
    let options = Options::default();
    let frame = Frame::decode(&jpeg, &NATIVE).expect("a frame");
    let rgb_frame = Frame::decode(&jpeg, &RGB).expect("a frame");
    let blobs: Vec<Blob> = detect(&frame, frame.full(), &options.detector)
        .centroids
        .iter()
        .map(|c| Blob { pixel: c.pixel, sigma_px: c.sigma_px, area_px: Some(c.area_px) })
        .collect();
    let identified = identify(&camera, &targets[0], &blobs, &options.identify).expect("identified");
    check(&camera, &frame, &options);

    let mut group = criterion.benchmark_group(format!("{}x{}", size_px[0], size_px[1]));
    group.bench_function("frame", |b| {
        b.iter(|| {
            let frame = Frame::decode(black_box(&jpeg), &NATIVE).expect("a frame");
            estimate(&frame, &camera, &targets, &options, |_| {}).expect("of the camera's size")
        });
    });
    group.bench_function("decode", |b| b.iter(|| Frame::decode(black_box(&jpeg), &NATIVE)));
    group.bench_function("detect", |b| b.iter(|| detect(black_box(&frame), frame.full(), &options.detector)));
    group.bench_function("identify", |b| {
        b.iter(|| identify(&camera, &targets[0], black_box(&blobs), &options.identify));
    });
    group.bench_function("solve", |b| {
        b.iter(|| {
            answer_of_all(&camera, &targets[0], &blobs, black_box(&identified), &options.pose, options.model_sigma_px)
        });
    });
    group.bench_function("decode-rgb", |b| b.iter(|| Frame::decode(black_box(&jpeg), &RGB)));
    group.bench_function("detect-of-rgb", |b| {
        b.iter(|| detect(black_box(&rgb_frame), rgb_frame.full(), &options.detector));
    });
    group.bench_function("detect-thesis", |b| {
        b.iter(|| detect(black_box(&rgb_frame), rgb_frame.full(), &Detector::Thesis));
    });
    group.bench_function("peer-zune-ycbcr", |b| b.iter(|| decode_by_peer(black_box(&jpeg), ColorSpace::YCbCr)));
    group.bench_function("peer-zune-rgb", |b| b.iter(|| decode_by_peer(black_box(&jpeg), ColorSpace::RGB)));
    group.finish();
}

/// The demo's camera (65 degrees wide, a lens that bends a little) with more or fewer pixels.
fn camera([width, height]: [u32; 2]) -> Camera {
    let (w, h) = (f64::from(width), f64::from(height));
    let lens = Distortion::PlumbBob([-0.12, 0.05, 4e-4, -3e-4, 0.0]);
    Camera::checked([width, height], [w / 1.28; 2], [w / 2.0 - 3.5, h / 2.0 - 3.0], lens).expect("a good camera")
}

/// Where the target is in every frame: it fills a quarter of the width.
fn truth() -> CameraFromTarget {
    CameraFromTarget::new(rotation::exp(&Vector3::new(0.35, -0.25, 0.6)), Vector3::new(0.4, -0.2, 4.5))
}

fn jpeg(camera: &Camera) -> Vec<u8> {
    let sky = Sky::fair(1, [0.0; 2]);
    let frame = render(camera, &truth(), &wing(), &sky, &Optics::default(), &mut random::named("bench pipeline"));
    encode::jpeg(&frame, 90).expect("fits a JPEG")
}

/// What is timed is the right answer.
fn check(camera: &Camera, frame: &Frame, options: &Options) {
    let found = estimate(frame, camera, &[wing().target], options, |_| {}).expect("of the camera's size");
    let markers = found.targets[0].centroid_of_marker.iter().flatten().count();
    assert_eq!(markers, 6, "all markers are found");
    let pose = found.targets[0].answer.as_ref().expect("a pose").best.camera_from_target;
    assert!((pose.translation - truth().translation).norm() < 0.05, "{pose:?}");
}

fn decode_by_peer(bytes: &[u8], color: ColorSpace) -> Vec<u8> {
    let options = DecoderOptions::new_fast().jpeg_set_out_colorspace(color);
    JpegDecoder::new_with_options(ZCursor::new(bytes), options).decode().expect("a JPEG")
}
