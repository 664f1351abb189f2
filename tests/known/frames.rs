//! Frames with truth: a folder of pictures and `truth.json`.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use serde_json::Value;
use skypose::camera::{Camera, Distortion, Pixel};
use skypose::detect::{BeaconOptions, Detector};
use skypose::frame::{Decoding, Frame};
use skypose::geometry::CameraFromTarget;
use skypose::pipeline::Options;
use skypose::target::{Marker, Target};

/// A frame with truth.
pub struct Known {
    /// Of its file.
    pub name: String,
    /// What kind it is.
    #[allow(dead_code, reason = "not every test asks")]
    pub suite: String,
    /// Whether its markers are LEDs.
    is_lit: bool,
    /// The picture.
    pub frame: Frame,
    /// What it was taken with.
    pub camera: Camera,
    /// What may be in it.
    pub target: Target,
    /// `None` without a target in it.
    pub pose: Option<CameraFromTarget>,
    /// Whether the marked side can be seen.
    pub facing: bool,
    /// Centroids of the visible markers' light.
    centroids: BTreeMap<String, Pixel>,
    /// Where covered markers are.
    hidden: Vec<Pixel>,
}

impl Known {
    /// How to look for its markers.
    pub fn options(&self) -> Options {
        let detector = if self.is_lit { Detector::Beacon(BeaconOptions::default()) } else { Detector::default() };
        Options { detector, ..Options::default() }
    }

    /// Where the marker's light is, if it is seen.
    pub fn centroid(&self, marker: usize) -> Option<&Pixel> {
        self.centroids.get(&self.target.markers()[marker].id)
    }

    /// Where covered markers are.
    #[allow(dead_code, reason = "not every test asks")]
    pub fn hidden(&self) -> &[Pixel] {
        &self.hidden
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::new(number(&value[0]), number(&value[1]), number(&value[2]))
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

/// The frames of a folder with `truth.json`.
pub fn frames(folder: &Path) -> Vec<Known> {
    let text = std::fs::read_to_string(folder.join("truth.json")).expect("the truth is beside the frames");
    let truth: Value = serde_json::from_str(&text).expect("JSON");
    list(&truth["frames"]).iter().map(|entry| known(folder, entry)).collect()
}

fn known(folder: &Path, entry: &Value) -> Known {
    let name = entry["frame"].as_str().expect("a name").to_owned();
    let bytes = std::fs::read(folder.join(&name)).expect("a frame");
    let pose = entry.get("pose").filter(|pose| !pose.is_null()).map(|pose| {
        let matrix = Matrix3::from_fn(|row, column| number(&pose["rotation"]["matrix"][row][column]));
        CameraFromTarget::new(Rotation3::from_matrix_unchecked(matrix), vector(&pose["translation_m"]))
    });
    let pixel = |marker: &Value| Vector2::new(number(&marker["u_px"]), number(&marker["v_px"]));
    let centroid = |marker: &Value| {
        (marker["state"] == "visible").then(|| (marker["marker"].as_str().expect("an id").to_owned(), pixel(marker)))
    };
    let hidden = |marker: &&Value| marker["state"] != "visible";
    Known {
        suite: entry["suite"].as_str().expect("a suite").to_owned(),
        is_lit: entry["mode"] == "led",
        frame: Frame::decode(&bytes, &Decoding::default()).expect("decodes"),
        camera: camera(&entry["camera"]),
        target: target(&entry["target"]),
        pose,
        facing: entry["front_facing"] == true,
        centroids: list(&entry["markers"]).iter().filter_map(centroid).collect(),
        hidden: list(&entry["markers"]).iter().filter(hidden).map(pixel).collect(),
        name,
    }
}

fn camera(value: &Value) -> Camera {
    let size = ["width", "height"].map(|side| u32::try_from(value[side].as_u64().expect("px")).expect("small"));
    let pair = |names: [&str; 2]| names.map(|name| number(&value[name]));
    let k = |index: usize| number(&value["distortion"]["coefficients"][index]);
    let lens = Distortion::PlumbBob(std::array::from_fn(k));
    Camera::checked(size, pair(["fx", "fy"]), pair(["cx", "cy"]), lens).expect("a good camera")
}

fn target(value: &Value) -> Target {
    let marker = |marker: &Value| Marker {
        id: marker["id"].as_str().expect("an id").into(),
        position: vector(&marker["position_m"]).into(),
        radius_m: marker["radius_m"].as_f64(),
        normal: marker.get("normal").map(vector),
    };
    Target::checked("known", list(&value["markers"]).iter().map(marker).collect()).expect("a good target")
}
