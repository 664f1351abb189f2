//! The rendered frame against geometry.

#![expect(clippy::cast_possible_truncation, reason = "the pictures are small")]
#![expect(clippy::float_cmp, reason = "light that was copied, not computed")]

use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;
use rand::RngExt;

use super::light::{Light, of_srgb};
use super::radiance::offsets;
use super::*;
use crate::camera::distortion::tests::REAL;
use crate::camera::{Camera, Distortion, Pixel};
use crate::frame::bayer::Mosaic;
use crate::frame::{Decoding, Frame};
use crate::geometry::{CameraFromTarget, rotation};
use crate::random::{case, named};
use crate::scene::models;
use crate::scene::truth::{Sight, truth};
use crate::target::{Marker, Target};

fn small_camera(lens: Distortion) -> Camera {
    Camera::checked([160, 120], [150.0; 2], [80.3, 58.8], lens).expect("a camera")
}

fn tilted(tilt_rad: f64, turn_rad: f64, spin_rad: f64, translation: [f64; 3]) -> CameraFromTarget {
    let tilt = rotation::exp(&(Vector3::new(turn_rad.cos(), turn_rad.sin(), 0.0) * tilt_rad));
    CameraFromTarget::new(tilt * rotation::exp(&(Vector3::z() * spin_rad)), translation.into())
}

/// Markers of one unit of light on black.
fn glowing() -> Model {
    Model { marker_rgb: [255; 3], ..Model::bare(models::wing_six()) }
}

/// The same with all markers but one turned away.
fn glowing_alone(index: usize) -> Model {
    let target = models::wing_six();
    let turned = |(i, marker): (usize, &Marker)| {
        let normal = marker.normal.map(|normal| if i == index { normal } else { -normal });
        Marker { normal, ..marker.clone() }
    };
    let markers = target.markers().iter().enumerate().map(turned).collect();
    Model { marker_rgb: [255; 3], ..Model::bare(Target::checked("alone", markers).expect("a good target")) }
}

/// Light and its centre within `reach_px` of `about`.
fn blob(picture: &Radiance, about: &Pixel, reach_px: f64) -> (f64, Pixel) {
    let (mut sum, mut moment) = (0.0, Vector2::zeros());
    for (i, light) in picture.light.iter().enumerate() {
        let pixel = Vector2::new((i % picture.width) as f64, (i / picture.width) as f64);
        if (pixel - about).amax() <= reach_px {
            sum += f64::from(light[0]);
            moment += pixel * f64::from(light[0]);
        }
    }
    (sum, moment / sum)
}

fn linear(frame: &Frame) -> Radiance {
    let light: Vec<Light> = frame.rgb().chunks_exact(3).map(|p| of_srgb([p[0], p[1], p[2]])).collect();
    Radiance { width: frame.width() as usize, height: frame.height() as usize, light }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn the_centroid_of_a_rendered_disc_is_that_of_the_camera(
        lens in 0..REAL.len(), index in 0_usize..6, tilt in 0.0..1.1, turn in 0.0..6.2, spin in 0.0..6.2,
        x in -0.2..0.2, y in -0.15..0.15, z in 0.7..1.3
    ) {
        // Discs of 7 to 30 px radius. Rays at random from a sharp edge place it to 1e-3 px, and once in some thousands, where
        // an edge runs along the lattice of the rays, to 1e-2 px.
        let camera = Camera::checked([640, 480], [600.0; 2], [321.3, 235.2], REAL[lens]).expect("a camera");
        let pose = tilted(tilt, turn, spin, [x * z, y * z, z]);
        let model = glowing_alone(index);
        let marker = truth(&camera, &pose, &model)[index];
        prop_assume!(marker.sight == Sight::Whole && marker.area_px > 300.0);
        let picture = Radiance::of(&camera, &pose, &model, &Sky::plain([0; 3]), 16);
        let (area, found) = blob(&picture, &marker.centroid.expect("seen"), 60.0);
        let error = found - marker.centroid.expect("seen");
        prop_assert!(error.norm() < 0.02, "{error}");
        prop_assert!((area / marker.area_px - 1.0).abs() < 0.005, "{area} for {}", marker.area_px);
    }

    #[test]
    fn cutting_the_picture_into_squares_changes_nothing(
        lens in 0..REAL.len(), tilt in 0.0..1.4, turn in 0.0..6.2, spin in 0.0..6.2,
        x in -0.6..0.6, y in -0.5..0.5, z in 0.15..2.5
    ) {
        // The slow obvious way: every ray of every pixel.
        let camera = small_camera(REAL[lens]);
        let pose = tilted(tilt, turn, spin, [x * z, y * z, z]);
        let model = models::wing();
        let fast = Radiance::of(&camera, &pose, &model, &Sky::plain([0; 3]), 2);
        let surfaces = Surfaces::of(&model, &pose);
        let (mut differ, mut worst) = (0, 0.0_f32);
        for (i, light) in fast.light.iter().enumerate() {
            let mut sum = [0.0_f32; 3];
            for offset in offsets(2) {
                let ray = camera.unproject(&(Vector2::new((i % 160) as f64, (i / 160) as f64) + offset));
                let seen = ray.map_or(Seen::Sky, |ray| surfaces.seen_by(&ray));
                let light = surfaces.light_of(seen, [0.0; 3]);
                (0..3).for_each(|c| sum[c] += 0.25 * light[c]);
            }
            let difference = (0..3).map(|c| (sum[c] - light[c]).abs()).fold(0.0, f32::max);
            differ += usize::from(difference > 1e-4);
            worst = worst.max(difference);
        }
        // The lens is taken as linear within a pixel, to 1e-3 px, so of the thousands of rays near an edge a few see its
        // other side; a square that was filled wrongly would show as whole pixels.
        prop_assert!(differ <= 40 && worst < 0.3, "{differ} pixels differ by up to {worst}");
    }
}

#[test]
fn with_the_default_rays_the_centroid_of_a_disc_is_right_to_a_hundredth_of_a_pixel() {
    let camera = small_camera(REAL[1]);
    let mut squares = Vec::new();
    for index in 0..200 {
        let mut rng = case("right to a hundredth", index);
        let mut draw = |reach: f64| rng.random_range(-reach..reach);
        let pose = tilted(draw(1.0), draw(3.0), draw(3.0), [draw(0.15), draw(0.15), 1.0 + draw(0.3)]);
        let marker = index as usize % 6;
        let model = glowing_alone(marker);
        let seen = truth(&camera, &pose, &model)[marker];
        if let (Sight::Whole, Some(centroid)) = (seen.sight, seen.centroid) {
            let picture = Radiance::of(&camera, &pose, &model, &Sky::plain([0; 3]), Optics::default().supersampling);
            squares.push((blob(&picture, &centroid, 11.0).1 - centroid).norm_squared());
        }
    }
    let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!(squares.len() > 100 && rms < 0.008, "{rms} over {}", squares.len());
}

#[test]
fn blur_noise_free_coding_and_a_mosaic_keep_the_centroid() {
    let camera = small_camera(REAL[1]);
    let pose = tilted(0.4, 1.0, 0.3, [0.05, 0.02, 1.2]);
    let model = glowing();
    for (optics, limit_px) in [
        (Optics::ideal(), 0.01),
        (Optics { blur_sigma_px: 0.8, ..Optics::ideal() }, 0.01),
        (Optics { motion_px: [3.0, -2.0], ..Optics::ideal() }, 0.01),
        // Filling in colours costs some accuracy.
        (Optics { blur_sigma_px: 0.8, bayer: Some(Mosaic::Gbrg), ..Optics::ideal() }, 0.1),
    ] {
        let frame = render(&camera, &pose, &model, &Sky::plain([0; 3]), &optics, &mut named("kept"));
        for marker in truth(&camera, &pose, &model) {
            let centroid = marker.centroid.expect("seen");
            let (_, found) = blob(&linear(&frame), &centroid, 9.0);
            assert!((found - centroid).norm() < limit_px, "{optics:?}: {found} for {centroid}");
        }
    }
}

#[test]
fn a_target_seen_from_behind_or_behind_the_camera_shows_nothing() {
    let camera = small_camera(REAL[1]);
    let black = Sky::plain([0; 3]);
    for pose in [
        tilted(3.0, 0.0, 0.0, [0.0, 0.0, 1.0]),
        tilted(0.0, 0.0, 0.0, [0.0, 0.0, -1.0]),
        tilted(0.0, 0.0, 0.0, [9.0, 0.0, 1.0]),
    ] {
        let frame = render(&camera, &pose, &glowing(), &black, &Optics::ideal(), &mut named("nothing"));
        assert!(frame.rgb().iter().all(|&sample| sample == 0), "{pose:?}");
    }
}

#[test]
fn from_behind_the_airframe_is_seen_without_its_paint_and_markers() {
    let pose = tilted(3.0, 0.0, 0.0, [0.0, 0.0, 1.5]);
    let model = models::wing();
    let camera = small_camera(REAL[1]);
    let picture = Radiance::of(&camera, &pose, &model, &Sky::plain([0; 3]), 1);
    let (bare, seen): (Light, Vec<&Light>) =
        (of_srgb(model.body_rgb), picture.light.iter().filter(|light| **light != [0.0; 3]).collect());
    assert!(seen.len() > 500);
    assert!(seen.iter().all(|light| **light == bare));
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_other_noise() {
    let camera = small_camera(REAL[1]);
    let pose = tilted(0.4, 1.0, 0.3, [0.05, 0.02, 0.9]);
    let take = |name: &str| {
        render(&camera, &pose, &models::wing(), &Sky::fair(5, [0.0; 2]), &Optics::default(), &mut named(name))
    };
    assert_eq!(take("one"), take("one"));
    assert_ne!(take("one"), take("two"));
}

#[test]
fn a_rendered_frame_survives_its_jpeg() {
    let camera = small_camera(REAL[1]);
    let pose = tilted(0.4, 1.0, 0.3, [0.05, 0.02, 0.9]);
    let frame = render(&camera, &pose, &models::wing(), &Sky::default(), &Optics::default(), &mut named("jpeg"));
    let bytes = crate::scene::encode::jpeg(&frame, 90).expect("fits");
    let back = Frame::decode(&bytes, &Decoding::default()).expect("decodes");
    assert_eq!(back.check_camera(&camera), Ok(()));
    let mean = |frame: &Frame| frame.rgb().iter().map(|&s| f64::from(s)).sum::<f64>() / (160.0 * 120.0 * 3.0);
    assert!((mean(&back) - mean(&frame)).abs() < 1.0);
}

#[test]
fn senseless_poses_and_optics_make_a_frame_all_the_same() {
    let camera = small_camera(REAL[1]);
    let optics = Optics {
        supersampling: 0,
        blur_sigma_px: f64::NAN,
        glare_ratio: 0.5,
        glare_sigma_px: f64::INFINITY,
        motion_px: [f64::INFINITY, 0.0],
        exposure_ratio: f64::NAN,
        shot_noise_ratio: f64::INFINITY,
        read_noise_ratio: -1.0,
        bayer: Some(Mosaic::Bggr),
    };
    for translation in [[f64::NAN; 3], [0.0; 3], [1e300, 0.0, 1e-300], [0.0, 0.0, 1e-12]] {
        let pose = tilted(0.4, 1.0, 0.3, translation);
        let frame = render(&camera, &pose, &models::wing(), &Sky::fair(1, [f64::NAN; 2]), &optics, &mut named("odd"));
        assert_eq!(frame.check_camera(&camera), Ok(()));
    }
}
