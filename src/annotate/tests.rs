//! The whole overlay.

use image::{Rgb, RgbImage};
use nalgebra::{Matrix6, Vector3};
use proptest::prelude::*;

use super::palette::{NO_TARGET, of_target};
use super::*;
use crate::camera::Pixel;
use crate::detect::{Centroid, Refusal, Refused};
use crate::frame::{Coding, Pixels, Region};
use crate::geometry::{CameraFromTarget, PoseCovariance, rotation};
use crate::pose::PoseAnswer;
use crate::pose::{NoPose, PoseEstimate};
use crate::scene::models;
use crate::solve::Solver;

fn gray(width: u32, height: u32) -> Frame {
    let samples = vec![90; (width * height) as usize];
    Frame::checked(width, height, Pixels::Luma(samples), Coding::LOSSLESS).expect("a frame")
}

fn centroid(u: u32, v: u32) -> Centroid {
    let bounds = Region { x: u - 4, y: v - 3, width: 9, height: 7 };
    let pixel = Pixel::new(u.into(), v.into());
    Centroid { pixel, sigma_px: 0.1, area_px: 50.0, bounds, score: 0.9, class: None, track_id: None }
}

fn possible(turn: Vector3<f64>, translation: [f64; 3], probability: f64) -> PoseEstimate {
    PoseEstimate {
        camera_from_target: CameraFromTarget::new(rotation::exp(&turn), translation.into()),
        covariance: PoseCovariance::checked(Matrix6::identity() * 1e-4).expect("positive definite"),
        covariance_reliable: true,
        reprojection_rms_px: 0.2,
        probability,
    }
}

fn answered(best: &PoseEstimate, alternatives: Vec<PoseEstimate>) -> PoseAnswer {
    PoseAnswer { best: *best, alternatives, solver: Solver::Ippe, noise_scale: 1.0, ln_evidence: 0.0 }
}

fn is_about(pixel: Rgb<u8>, colour: [u8; 3]) -> bool {
    pixel.0.iter().zip(colour).all(|(a, b)| a.abs_diff(b) < 12)
}

/// How often the colour is found in the square about a place.
fn count_near(picture: &RgbImage, (x, y): (u32, u32), reach: u32, colour: [u8; 3]) -> usize {
    let near = |pixel: &(u32, u32, &Rgb<u8>)| pixel.0.abs_diff(x) <= reach && pixel.1.abs_diff(y) <= reach;
    picture.enumerate_pixels().filter(near).filter(|(.., pixel)| is_about(**pixel, colour)).count()
}

#[test]
fn nothing_found_leaves_the_frame_as_it_is() {
    let frame = gray(120, 80);
    let picture = annotate(&frame, Some(&models::demo_camera()), &Overlay::of(&Detection::default(), &[], &[]));
    assert_eq!((picture.width(), picture.height()), (120, 80));
    assert_eq!(picture.as_raw().as_slice(), &*frame.rgb());
}

#[test]
fn a_ring_has_the_colour_of_its_target_or_that_of_none() {
    // Thin rings blend with what is under them; on a tall frame they are thick.
    let detection = Detection { centroids: vec![centroid(100, 120), centroid(220, 120)], refused: vec![] };
    let targets = [models::wing_six(), models::wing_six()];
    let nothing = Err(NoPose::TooFewPoints { given: 1, need: 4 });
    let estimates = [(0, None), (1, Some(0))].map(|(target, first)| TargetEstimate {
        target,
        centroid_of_marker: vec![first, None, None],
        answer: nothing.clone(),
    });
    let picture = annotate(&gray(320, 960), None, &Overlay::of(&detection, &targets, &estimates));
    assert!(count_near(&picture, (100, 120), 20, of_target(1)) > 10);
    assert_eq!(count_near(&picture, (100, 120), 20, NO_TARGET), 0);
    assert!(count_near(&picture, (220, 120), 20, NO_TARGET) > 10);
    // The two lines at the top.
    assert!(count_near(&picture, (0, 0), 90, of_target(0)) > 30);
    assert!(count_near(&picture, (0, 0), 90, of_target(1)) > 30);
}

#[test]
fn the_axes_start_at_the_target_and_an_alternative_adds_to_them() {
    let camera = models::demo_camera();
    let targets = [models::wing_six()];
    let detection = Detection::default();
    let drawn = |alternatives: Vec<PoseEstimate>| {
        let best = possible(Vector3::new(0.5, 0.0, 0.0), [0.0, 0.0, 2.0], 0.7);
        let answer = Ok(answered(&best, alternatives));
        let estimates = [TargetEstimate { target: 0, centroid_of_marker: vec![None; 6], answer }];
        annotate(&gray(1280, 720), Some(&camera), &Overlay::of(&detection, &targets, &estimates))
    };
    let alone = drawn(vec![]);
    // The principal point is the origin's image.
    for axis in palette::AXES {
        assert!(count_near(&alone, (636, 357), 200, axis) > 100, "{axis:?}");
    }
    let changed = |other: &RgbImage| alone.pixels().zip(other.pixels()).filter(|(a, b)| a != b).count();
    let mirrored = |probability| vec![possible(Vector3::new(-0.5, 0.0, 0.0), [0.0, 0.0, 2.0], probability)];
    assert!(changed(&drawn(mirrored(0.3))) > 300);
    assert_eq!(changed(&drawn(mirrored(0.04))), 0, "too improbable to matter");
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        -2000.0..2000.0,
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(-1e300),
        Just(1e300),
        Just(0.0),
        Just(1e-300)
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn no_numbers_make_it_fail(
        places in proptest::collection::vec((any_number(), any_number(), 0..20_usize), 0..6),
        poses in proptest::collection::vec(
            (proptest::array::uniform3(-3.0..3.0), proptest::array::uniform3(any_number()), any_number()), 1..4),
        width in 1..400_u32, height in 1..300_u32, huge in any::<bool>(), name in ".{0,40}"
    ) {
        let blob = |(u, v): (f64, f64)| Centroid { pixel: Pixel::new(u, v), ..centroid(10, 10) };
        let side = if huge { u32::MAX } else { 3 };
        let refusals = places.iter().map(|&(u, v, _)| Refused {
            pixel: Pixel::new(v, u),
            area_px: u,
            bounds: Region { x: side, y: 0, width: side, height: 1 },
            reason: Refusal::LowContrast,
        });
        let mut centroids: Vec<Centroid> = places.iter().map(|&(u, v, _)| blob((u, v))).collect();
        if let Some(first) = centroids.first_mut() {
            first.bounds = Region { x: 0, y: side, width: 1, height: side };
        }
        let detection = Detection { centroids, refused: refusals.collect() };
        // More assignments than markers, some to centroids that do not exist.
        let centroid_of_marker = places.iter().map(|&(.., index)| Some(index).filter(|i| i % 3 > 0)).collect();
        let mut poses = poses.into_iter().map(|(turn, t, p)| possible(turn.into(), t, p));
        let best = poses.next().expect("one at least");
        let answer = Ok(answered(&best, poses.collect()));
        let mut markers = models::wing_six().markers().to_vec();
        markers[0].id = format!("{name}!");
        let targets = [Target::checked(name, markers).expect("a target")];
        let estimates = [TargetEstimate { target: 0, centroid_of_marker, answer }];
        let overlay = Overlay::of(&detection, &targets, &estimates);
        let picture = annotate(&gray(width, height), Some(&models::demo_camera()), &overlay);
        prop_assert_eq!(picture.dimensions(), (width, height));
    }
}
