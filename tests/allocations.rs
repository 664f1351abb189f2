//! In steady state a frame takes no more memory than what is reported of it: whatever it shows, to every detector that has a workspace.

#![allow(clippy::expect_used, reason = "a test says what it takes for granted")]

use allocation_counter::measure;
use nalgebra::{Matrix2, Matrix3};
use skypose::detect::edge::EdgeOptions;
use skypose::detect::locate::Shape;
use skypose::detect::median::Window;
use skypose::detect::{
    BeaconOptions, ColorOptions, Detection, Detector, HueRange, SkyOptions, Stamp, Watch, Workspace, detect,
    detect_with,
};
use skypose::frame::{Coding, Decoding, Frame, Pixels, Region};
use skypose::random;
use skypose::scene::encode;
use skypose::scene::flight::Flight;
use skypose::scene::models::{demo_camera, wing};
use skypose::scene::render::{Optics, Sky, render};

/// What frames show, and how they store it: a wing with markers, the same in `YCbCr`, as luma, and noise of all reds.
fn frames() -> [Frame; 4] {
    let rng = &mut random::named("allocations");
    let wing =
        render(&demo_camera(), &Flight::HeadOn.pose(150), &wing(), &Sky::fair(1, [0.3, 0.1]), &Optics::default(), rng);
    let coded = Frame::decode(&encode::jpeg(&wing, 90).expect("fits a JPEG"), &Decoding::default()).expect("a JPEG");
    let (width, height) = (wing.width(), wing.height());
    let frame = |pixels| Frame::checked(width, height, pixels, Coding::LOSSLESS).expect("a frame");
    let luma = frame(Pixels::Luma(wing.rgb().iter().skip(1).step_by(3).copied().collect()));
    let mut noise = vec![0; 3 * wing.full().area()];
    rand::Rng::fill_bytes(rng, &mut noise);
    noise.chunks_exact_mut(3).for_each(|pixel| pixel.sort_unstable_by(|a, b| b.cmp(a)));
    [wing, coded, luma, frame(Pixels::Rgb(noise))]
}

fn detectors() -> [(&'static str, Detector); 9] {
    let edge = |rows, columns| {
        let window = Window::checked(rows, columns).expect("a window");
        Detector::Edge(EdgeOptions { window, ..EdgeOptions::THESIS })
    };
    [
        ("color", Detector::Color(ColorOptions::default())),
        ("beacon", Detector::Beacon(BeaconOptions::default())),
        ("red beacon", Detector::Beacon(BeaconOptions { hue: Some(HueRange::RED), ..BeaconOptions::default() })),
        ("thesis", Detector::Thesis),
        ("edge", Detector::Edge(EdgeOptions::default())),
        ("edge, the seed's window", edge(9, 10)),
        ("edge, a window with a network of its own", edge(5, 4)),
        ("edge, a window of histograms", edge(21, 33)),
        ("sky", Detector::Sky(SkyOptions::default())),
    ]
}

/// Allocations that a detection cannot do without: one for each list that has room.
fn needed(detection: &Detection) -> u64 {
    u64::from(detection.centroids.capacity() > 0) + u64::from(detection.refused.capacity() > 0)
}

/// The part of each frame that is looked at: a quarter, with the wing in it.
const PART: Region = Region { x: 320, y: 180, width: 640, height: 360 };

#[test]
fn in_steady_state_only_what_is_reported_is_allocated() {
    let frames = frames();
    let mut found = 0;
    for (name, detector) in detectors() {
        let mut workspace = Workspace::default();
        // Room for what each of them shows.
        for frame in &frames {
            drop(detect_with(&mut workspace, frame, PART, &detector));
        }
        for (index, frame) in frames.iter().enumerate() {
            let mut detection = Detection::default();
            let taken = measure(|| detection = detect_with(&mut workspace, frame, PART, &detector));
            assert_eq!(taken.count_total, needed(&detection), "{name}, frame {index}");
            assert_eq!(detection, detect(frame, PART, &detector), "{name}, frame {index}: nothing is left of others");
            found += detection.centroids.len();
        }
    }
    assert!(found > 100, "{found} found");
}

#[test]
fn markers_are_located_again_in_memory_that_is_there() {
    let (detector, mut workspace) = (Detector::default(), Workspace::default());
    let [frame, ..] = frames();
    let centroids = detect_with(&mut workspace, &frame, PART, &detector).centroids;
    let mut look_again = || {
        let again = centroids.iter().filter_map(|centroid| {
            let moments = Matrix2::identity() * (centroid.area_px / (4.0 * std::f64::consts::PI));
            let shape = Shape { moments, covariance: Matrix3::identity() * 0.02 };
            detector.located_again(&mut workspace, &frame, centroid, &shape)
        });
        again.count()
    };
    // Room for the largest of them.
    let again = look_again();
    assert!(again >= 4, "{again} of {}", centroids.len());
    assert_eq!(measure(|| _ = look_again()).count_total, 0);
}

#[test]
fn a_sequence_of_the_sky_takes_memory_for_what_it_reports_alone() {
    let rng = &mut random::named("allocations of a sequence");
    let frames: Vec<Frame> = (0..10)
        .map(|step| {
            let (pose, sky) = (Flight::HeadOn.pose(100 + step), Sky::fair(1, [0.3, 0.1]));
            render(&demo_camera(), &pose, &wing(), &sky, &Optics::default(), rng)
        })
        .collect();
    let mut watch = Watch::new();
    let mut observe = |frame: &Frame| {
        let mut detection = Detection::default();
        let taken = measure(|| {
            detection = watch.observe(frame, PART, Stamp::default(), &SkyOptions::default());
        });
        let is_first = watch.beginning().is_some();
        if std::ptr::eq(frame, &raw const frames[9]) {
            watch.forget();
            assert!(watch.tracks().is_empty() && watch.beginning().is_none(), "nothing is left");
        }
        (taken.count_total, is_first, detection)
    };
    // Room for all that the sequence shows, and once more from its beginning.
    let once: Vec<_> = frames.iter().map(&mut observe).collect();
    let again: Vec<_> = frames.iter().map(&mut observe).collect();
    for (index, ((_, _, once), (taken, is_first, again))) in once.iter().zip(&again).enumerate() {
        assert_eq!(*taken, needed(again), "frame {index}");
        assert_eq!(*is_first, index == 0, "frame {index}");
        let places =
            |detection: &Detection| -> Vec<_> { detection.centroids.iter().map(|found| found.pixel).collect() };
        assert_eq!(places(once), places(again), "frame {index}: what was forgotten is found as at first");
    }
    assert!(once.last().is_some_and(|(_, _, last)| !last.centroids.is_empty()));
}
