//! Renders the frames of `tests/data/frames` with their truth: `cargo run --release --example render_frames -- FOLDER`.
//!
//! The same bytes each time: every frame has a name for a seed. `truth.json` states for each the camera, the target, its pose
//! (`camera_from_target`) and where the markers are; pixel centres are at integers.

#![allow(clippy::expect_used, clippy::print_stderr, reason = "a tool that cannot do its work stops and says so")]

use std::path::PathBuf;

use nalgebra::{Vector2, Vector3};
use rand::{Rng, RngExt};
use serde_json::{Value, json};
use skypose::camera::{Camera, Distortion};
use skypose::geometry::{CameraFromTarget, rotation};
use skypose::random;
use skypose::scene::encode;
use skypose::scene::models::wing;
use skypose::scene::render::{Distractor, Model, Optics, Shape, Sky, render};
use skypose::scene::truth::{MarkerTruth, Sight, truth};
use skypose::target::{Marker, Target};

/// A kind of frames.
struct Suite {
    name: &'static str,
    frames: u64,
    range_m: [f64; 2],
    quality: u8,
    /// Changes to optics, sky and model, and markers that are left out.
    change: fn(u64, &mut dyn Rng, &mut Setting),
}

/// What a frame is taken of, and with.
struct Setting {
    optics: Optics,
    sky: Sky,
    model: Model,
    left_out: Option<usize>,
    is_there: bool,
}

const SUITES: [Suite; 9] = [
    Suite { name: "lab", frames: 2, range_m: [1.2, 2.5], quality: 95, change: lab },
    Suite { name: "easy", frames: 2, range_m: [1.5, 4.0], quality: 90, change: |_, _, _| {} },
    Suite { name: "light", frames: 3, range_m: [1.5, 4.0], quality: 90, change: light },
    Suite { name: "clutter", frames: 3, range_m: [1.5, 4.0], quality: 85, change: clutter },
    Suite { name: "motion", frames: 2, range_m: [1.5, 3.5], quality: 90, change: motion },
    Suite { name: "occlusion", frames: 2, range_m: [1.5, 4.0], quality: 90, change: occlusion },
    Suite { name: "range", frames: 3, range_m: [6.0, 10.0], quality: 92, change: |_, _, _| {} },
    Suite { name: "led_night", frames: 3, range_m: [2.0, 6.0], quality: 85, change: night },
    Suite { name: "negatives", frames: 2, range_m: [2.0, 4.0], quality: 90, change: negative },
];

fn lab(_: u64, _: &mut dyn Rng, setting: &mut Setting) {
    setting.sky = Sky::plain([96, 99, 104]);
}

fn light(index: u64, _: &mut dyn Rng, setting: &mut Setting) {
    setting.optics.exposure_ratio = [0.2, 0.6, 2.0][usize::try_from(index % 3).expect("small")];
}

fn clutter(_: u64, mut rng: &mut dyn Rng, setting: &mut Setting) {
    setting.sky.distractors = (0..10).map(|_| distractor(&mut rng)).collect();
}

fn motion(_: u64, rng: &mut dyn Rng, setting: &mut Setting) {
    let way = rng.random_range(0.0..std::f64::consts::TAU);
    let length = rng.random_range(3.0..6.0);
    setting.optics.motion_px = [length * way.cos(), length * way.sin()];
    setting.optics.blur_sigma_px = 0.8;
}

fn occlusion(_: u64, rng: &mut dyn Rng, setting: &mut Setting) {
    setting.left_out = Some(rng.random_range(0..6));
}

/// LEDs that outshine the sensor, with a halo, on an aircraft that is hardly seen.
fn night(_: u64, rng: &mut dyn Rng, setting: &mut Setting) {
    setting.sky = Sky::plain([9, 10, 14]);
    setting.optics.glare_ratio = 0.03;
    setting.optics.glare_sigma_px = 5.0;
    let dark = Model { body_rgb: [16, 16, 18], paint: Vec::new(), marker_gain: rng.random_range(6.0..20.0), ..wing() };
    setting.model = Model { target: with_radius(&dark.target, 0.012), ..dark };
}

fn negative(_: u64, mut rng: &mut dyn Rng, setting: &mut Setting) {
    setting.is_there = false;
    setting.sky.distractors = (0..8).map(|_| distractor(&mut rng)).collect();
}

fn main() {
    let folder = PathBuf::from(std::env::args().nth(1).expect("FOLDER"));
    std::fs::create_dir_all(&folder).expect("a folder");
    let mut frames = Vec::new();
    for suite in &SUITES {
        for index in 0..suite.frames {
            let name = format!("{}_{index:02}.jpg", suite.name);
            let (jpeg, entry) = taken(suite, index, &name);
            std::fs::write(folder.join(&name), &jpeg).expect("written");
            eprintln!("{name}: {} bytes", jpeg.len());
            frames.push(entry);
        }
    }
    let text = serde_json::to_string(&json!({ "frames": frames })).expect("JSON");
    std::fs::write(folder.join("truth.json"), text + "\n").expect("written");
}

/// A frame as JPEG and its truth.
fn taken(suite: &Suite, index: u64, name: &str) -> (Vec<u8>, Value) {
    let mut rng = random::case(&format!("frames {}", suite.name), index);
    let lens = Distortion::PlumbBob([-0.12, 0.05, 4e-4, -3e-4, 0.0]);
    let camera = Camera::checked([640, 480], [616.0, 617.0], [322.3, 237.8], lens).expect("a good camera");
    let sky = Sky::fair(index, [0.0; 2]);
    let mut setting = Setting { optics: Optics::default(), sky, model: wing(), left_out: None, is_there: true };
    (suite.change)(index, &mut rng, &mut setting);
    let pose = pose(&mut rng, suite.range_m, &camera, &setting.model);
    let behind = CameraFromTarget::new(rotation::exp(&Vector3::zeros()), Vector3::new(0.0, 0.0, -5.0));
    let seen = Model { target: without(&setting.model.target, setting.left_out), ..setting.model.clone() };
    let shown = if setting.is_there { &pose } else { &behind };
    let frame = render(&camera, shown, &seen, &setting.sky, &setting.optics, &mut rng);
    let entry = entry(suite, name, &camera, &setting, &pose);
    (encode::jpeg(&frame, suite.quality).expect("fits a JPEG"), entry)
}

/// Tilted by 20 to 60 degrees, where an attitude can be told from its mirror image; all markers in view.
fn pose(rng: &mut impl Rng, range_m: [f64; 2], camera: &Camera, model: &Model) -> CameraFromTarget {
    loop {
        let about: f64 = rng.random_range(0.0..std::f64::consts::TAU);
        let tilt = rng.random_range(20.0..60.0_f64).to_radians();
        let spin: f64 = rng.random_range(0.0..std::f64::consts::TAU);
        let turn = rotation::exp(&(Vector3::new(about.cos(), about.sin(), 0.0) * tilt))
            * rotation::exp(&(Vector3::z() * spin));
        let depth = rng.random_range(range_m[0]..range_m[1]);
        let middle = Vector2::new(rng.random_range(0.0..640.0), rng.random_range(0.0..480.0));
        let Some(ray) = camera.unproject(&middle) else { continue };
        let pose = CameraFromTarget::new(turn, Vector3::new(ray.x, ray.y, 1.0) * depth);
        if truth(camera, &pose, model).iter().all(|marker| marker.sight == Sight::Whole) {
            return pose;
        }
    }
}

/// A red disc or plate, about as large as a marker, anywhere.
fn distractor(rng: &mut impl Rng) -> Distractor {
    Distractor {
        shape: if rng.random_bool(0.6) { Shape::Ellipse } else { Shape::Rectangle },
        centre_px: [rng.random_range(0.0..640.0), rng.random_range(0.0..480.0)],
        half_px: [rng.random_range(2.0..10.0), rng.random_range(2.0..10.0)],
        turn_rad: rng.random_range(0.0..3.0),
        rgb: [rng.random_range(150..230), rng.random_range(15..40), rng.random_range(15..40)],
    }
}

fn without(target: &Target, left_out: Option<usize>) -> Target {
    let kept = target.markers().iter().enumerate().filter(|(index, _)| Some(*index) != left_out);
    Target::checked(target.name(), kept.map(|(_, marker)| marker.clone()).collect()).expect("five are left")
}

fn with_radius(target: &Target, radius_m: f64) -> Target {
    let small = |marker: &Marker| Marker { radius_m: Some(radius_m), ..marker.clone() };
    Target::checked(target.name(), target.markers().iter().map(small).collect()).expect("a good target")
}

fn entry(suite: &Suite, name: &str, camera: &Camera, setting: &Setting, pose: &CameraFromTarget) -> Value {
    let ([fx, fy], [cx, cy]) = (camera.focal_lengths(), camera.principal_point());
    let target = &setting.model.target;
    let markers: Vec<Value> = target
        .markers()
        .iter()
        .map(|marker| {
            let [x, y, z]: [f64; 3] = marker.position.coords.into();
            let normal: Option<[f64; 3]> = marker.normal.map(Into::into);
            json!({ "id": marker.id, "position_m": [x, y, z], "radius_m": marker.radius_m, "normal": normal })
        })
        .collect();
    let m = pose.rotation.matrix();
    let rows: Vec<[f64; 3]> = (0..3).map(|row| [m[(row, 0)], m[(row, 1)], m[(row, 2)]]).collect();
    let translation: [f64; 3] = pose.translation.into();
    let stated = json!({ "rotation": { "matrix": rows }, "translation_m": translation });
    let images: Vec<Value> = truth(camera, pose, &setting.model)
        .iter()
        .enumerate()
        .filter(|_| setting.is_there)
        .map(|(index, image)| image_entry(&target.markers()[index].id, image, setting.left_out == Some(index)))
        .collect();
    json!({
        "frame": name,
        "suite": suite.name,
        "mode": if suite.name == "led_night" { "led" } else { "disc" },
        "camera": {
            "width": camera.width(), "height": camera.height(), "fx": fx, "fy": fy, "cx": cx, "cy": cy,
            "distortion": { "model": "plumb_bob", "coefficients": [-0.12, 0.05, 4e-4, -3e-4, 0.0] },
        },
        "target": { "name": target.name(), "markers": markers },
        "target_present": setting.is_there,
        "front_facing": setting.is_there,
        "pose": setting.is_there.then_some(stated),
        "markers": images,
    })
}

fn image_entry(id: &str, image: &MarkerTruth, is_left_out: bool) -> Value {
    let state = if is_left_out { "hidden" } else { "visible" };
    let [u, v]: [Option<f64>; 2] = [image.centroid.map(|c| c.x), image.centroid.map(|c| c.y)];
    json!({ "marker": id, "state": state, "u_px": u, "v_px": v, "area_px": image.area_px })
}
