//! Cameras as other programs write them.

use std::fmt::Write;

use super::CameraFormat;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::CameraWire;
use crate::shell::wire::camera::DistortionModel;

/// The camera as a text in this format. `name` is what ROS calls it.
///
/// # Errors
/// [`FaultKind::Internal`] if it cannot be written, which does not happen.
pub fn write_camera(camera: &CameraWire, name: &str, format: CameraFormat) -> Result<String, Fault> {
    match format {
        CameraFormat::Json => serde_json::to_string_pretty(camera)
            .map(|json| json + "\n")
            .map_err(|error| Fault::new(FaultKind::Internal, error.to_string())),
        CameraFormat::Ros => Ok(ros(camera, name)),
        CameraFormat::OpencvYaml => Ok(opencv_yaml(camera)),
        CameraFormat::OpencvXml => Ok(opencv_xml(camera)),
    }
}

/// Model and coefficients; both formats have no pinhole without any.
fn lens(camera: &CameraWire) -> (&'static str, Vec<f64>) {
    let coefficients = camera.distortion.coefficients.clone();
    match camera.distortion.model {
        DistortionModel::None => ("plumb_bob", vec![0.0; 5]),
        DistortionModel::PlumbBob => ("plumb_bob", coefficients),
        DistortionModel::RationalPolynomial => ("rational_polynomial", coefficients),
        DistortionModel::Equidistant => ("equidistant", coefficients),
    }
}

const fn matrix(camera: &CameraWire) -> [f64; 9] {
    [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
}

fn ros(camera: &CameraWire, name: &str) -> String {
    let CameraWire { width, height, fx, fy, cx, cy, .. } = camera;
    let (model, coefficients) = lens(camera);
    let mut text = format!("image_width: {width}\nimage_height: {height}\n");
    // A JSON string is a YAML one.
    let name = serde_json::Value::from(name);
    _ = writeln!(text, "camera_name: {name}");
    let mut add = |field: &str, rows: usize, data: &[f64]| {
        let columns = data.len() / rows;
        let data: Vec<String> = data.iter().map(|value| number(*value)).collect();
        // Writing to a string never fails.
        _ = writeln!(text, "{field}:\n  rows: {rows}\n  cols: {columns}\n  data: [{}]", data.join(", "));
        if field == "camera_matrix" {
            _ = writeln!(text, "distortion_model: {model}");
        }
    };
    add("camera_matrix", 3, &matrix(camera));
    add("distortion_coefficients", 1, &coefficients);
    add("rectification_matrix", 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    add("projection_matrix", 3, &[*fx, 0.0, *cx, 0.0, 0.0, *fy, *cy, 0.0, 0.0, 0.0, 1.0, 0.0]);
    text
}

fn opencv_yaml(camera: &CameraWire) -> String {
    let (model, coefficients) = lens(camera);
    let fisheye = u8::from(model == "equidistant");
    let mut text = format!("%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\n", camera.width, camera.height);
    for (field, rows, data) in [
        ("camera_matrix", 3, matrix(camera).as_slice()),
        ("distortion_coefficients", coefficients.len(), &coefficients),
    ] {
        let columns = data.len() / rows;
        let data: Vec<String> = data.iter().map(|value| number(*value)).collect();
        _ = writeln!(text, "{field}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d");
        _ = writeln!(text, "   data: [ {} ]", data.join(", "));
    }
    _ = writeln!(text, "distortion_model: {model}\nfisheye_model: {fisheye}");
    text
}

fn opencv_xml(camera: &CameraWire) -> String {
    let (model, coefficients) = lens(camera);
    let fisheye = u8::from(model == "equidistant");
    let mut text = String::from("<?xml version=\"1.0\"?>\n<opencv_storage>\n");
    _ = writeln!(text, "<image_width>{}</image_width>\n<image_height>{}</image_height>", camera.width, camera.height);
    for (field, rows, data) in [
        ("camera_matrix", 3, matrix(camera).as_slice()),
        ("distortion_coefficients", coefficients.len(), &coefficients),
    ] {
        let columns = data.len() / rows;
        let data: Vec<String> = data.iter().map(|value| number(*value)).collect();
        _ = writeln!(text, "<{field} type_id=\"opencv-matrix\">\n  <rows>{rows}</rows>\n  <cols>{columns}</cols>");
        _ = writeln!(text, "  <dt>d</dt>\n  <data>\n    {}</data></{field}>", data.join(" "));
    }
    _ = writeln!(text, "<distortion_model>{model}</distortion_model>\n<fisheye_model>{fisheye}</fisheye_model>");
    text.push_str("</opencv_storage>\n");
    text
}

/// The shortest text that is this number again, with a point and a signed exponent: to YAML 1.1 `1e-5` is a word.
fn number(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        Some((digits, exponent)) => {
            let point = if digits.contains('.') { "" } else { ".0" };
            let sign = if exponent.starts_with('-') { "" } else { "+" };
            format!("{digits}{point}e{sign}{exponent}")
        }
        None => text,
    }
}
