//! Camera files of other programs: ROS' `camera_calibration` (YAML) and OpenCV's `FileStorage` (YAML and XML).
//!
//! They hold the image's size, the camera matrix and the distortion. What they have no place for, the covariance of the parameters above
//! all, is in JSON only. Rectification and projection, which ROS adds, are of rectified pictures; here pictures are raw, so they are
//! neither read nor other than trivial when written.

mod tree;
mod write;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use self::tree::Node;
pub use self::write::write_camera;
use super::camera::DistortionModel;
use super::{CameraWire, DistortionWire, from_json};
use crate::shell::fault::{Fault, FaultKind};

/// How a camera is written down.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CameraFormat {
    /// The contract's JSON, the only one with the covariance of the parameters.
    #[default]
    Json,
    /// YAML of ROS' `camera_calibration`.
    Ros,
    /// YAML of OpenCV's `FileStorage`.
    OpencvYaml,
    /// XML of OpenCV's `FileStorage`.
    OpencvXml,
}

impl CameraFormat {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Json, Self::Ros, Self::OpencvYaml, Self::OpencvXml];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Json => "json",
            Self::Ros => "ros",
            Self::OpencvYaml => "opencv-yaml",
            Self::OpencvXml => "opencv-xml",
        }
    }

    /// Its media type.
    #[must_use]
    pub const fn media_type(self) -> &'static str {
        match self {
            Self::Json => "application/json",
            Self::Ros | Self::OpencvYaml => "application/yaml",
            Self::OpencvXml => "application/xml",
        }
    }

    /// The format of this name.
    ///
    /// # Errors
    /// [`FaultKind::Senseless`] with all names.
    pub fn of_name(name: &str) -> Result<Self, Fault> {
        Self::ALL.into_iter().find(|format| format.name() == name).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|format| format.name()).collect();
            Fault::new(FaultKind::Senseless, format!("{name:?} is no format of cameras: {}", names.join(", ")))
        })
    }
}

/// The camera in a file of any of the formats, told by what is in it.
///
/// # Errors
/// What cannot be read, or what of it is no camera.
pub fn read_camera(bytes: &[u8]) -> Result<CameraWire, Fault> {
    let text = bytes.trim_ascii_start();
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    match text.first() {
        Some(b'<') => from_xml(text),
        Some(b'{') | None => from_json(text),
        Some(_) => from_yaml(text).map_err(|fault| match fault.kind {
            FaultKind::Unreadable => Fault { detail: format!("not JSON, and {}", fault.detail), ..fault },
            _ => fault,
        }),
    }
}

/// The camera in YAML of ROS or of OpenCV.
///
/// # Errors
/// What is no YAML, or what of it is no camera.
pub fn from_yaml(bytes: &[u8]) -> Result<CameraWire, Fault> {
    camera_of(&Node::of_yaml(text_of(bytes)?)?)
}

/// The camera in XML of OpenCV.
///
/// # Errors
/// What is no XML, or what of it is no camera.
pub fn from_xml(bytes: &[u8]) -> Result<CameraWire, Fault> {
    camera_of(&Node::of_xml(text_of(bytes)?)?)
}

fn text_of(bytes: &[u8]) -> Result<&str, Fault> {
    std::str::from_utf8(bytes).map_err(|error| Fault::new(FaultKind::Unreadable, format!("not UTF-8: {error}")))
}

/// Names of what a camera needs, as ROS, OpenCV's samples and people write them; case and underscores do not count.
const MATRIX: [&str; 4] = ["cameramatrix", "intrinsicmatrix", "k", "mtx"];
const DISTORTION: [&str; 5] = ["distortioncoefficients", "distcoeffs", "distortioncoeffs", "d", "dist"];
const WIDTH: [&str; 2] = ["imagewidth", "width"];
const HEIGHT: [&str; 2] = ["imageheight", "height"];

fn camera_of(root: &Node) -> Result<CameraWire, Fault> {
    let [width, height] = match root.get(&["imagesize"]) {
        Some((name, size)) => match numbers(name, size)?[..] {
            [width, height] => [side(name, width)?, side(name, height)?],
            _ => return Err(Fault::senseless(format!("/{name}"), "an image has a width and a height")),
        },
        None => [single(root, &WIDTH, "image_width")?, single(root, &HEIGHT, "image_height")?],
    };
    let (name, matrix) = needed(root, &MATRIX, "camera_matrix")?;
    if let Some(shape) = shape_of(name, matrix)?
        && shape != [3, 3]
    {
        return Err(Fault::senseless(
            format!("/{name}"),
            format!("a camera matrix is 3 x 3, not {} x {}", shape[0], shape[1]),
        ));
    }
    let matrix: [f64; 9] = numbers(name, matrix)?.try_into().map_err(|found: Vec<f64>| {
        Fault::senseless(format!("/{name}"), format!("a camera matrix has 3 x 3 numbers, not {}", found.len()))
    })?;
    let [fx, skew, cx, zero, fy, cy, first, second, scale] = matrix;
    if [skew, zero, first, second, scale - 1.0].iter().any(|zero| *zero != 0.0) {
        let detail = "a camera matrix is [fx, 0, cx, 0, fy, cy, 0, 0, 1]: no skew, and no scale";
        return Err(Fault::senseless(format!("/{name}"), detail));
    }
    let (name, given) =
        root.get(&DISTORTION).map_or(("distortion_coefficients", None), |(name, node)| (name, Some(node)));
    let coefficients = given.map(|node| numbers(name, node)).transpose()?.unwrap_or_default();
    let distortion = distortion_of(root, name, coefficients)?;
    let camera = CameraWire { distortion, ..CameraWire::pinhole([width, height], [fx, fy], [cx, cy]) };
    camera.of_sensor(roi_of(root)?, [optional(root, "binningx")?, optional(root, "binningy")?])
}

/// The part of the sensor that ROS' `CameraInfo` states.
fn roi_of(root: &Node) -> Result<[u32; 4], Fault> {
    let Some((name, roi)) = root.get(&["roi"]) else { return Ok([0; 4]) };
    if !matches!(roi, Node::Map(_)) {
        let detail = "a region has x_offset, y_offset, width and height";
        return Err(Fault::senseless(format!("/{name}"), detail));
    }
    let within = |fault: Fault| fault.within(&format!("/{name}"));
    let [x, y, width, height] =
        ["xoffset", "yoffset", "width", "height"].map(|side| optional(roi, side).map_err(within));
    Ok([x?, y?, width?, height?])
}

/// The lens. ROS names its model, OpenCV's calibration sample says whether it is its fisheye, and otherwise the number of
/// coefficients tells.
fn distortion_of(root: &Node, name: &str, coefficients: Vec<f64>) -> Result<DistortionWire, Fault> {
    let model = match root.get(&["distortionmodel"]) {
        Some((_, Node::Text(model))) => model.to_ascii_lowercase(),
        _ => String::new(),
    };
    let is_set = |(_, node): (&str, &Node)| matches!(node, Node::Text(text) if text != "0" && text != "false");
    let is_fisheye = root.get(&["fisheyemodel", "fisheye"]).is_some_and(is_set);
    let pointer = format!("/{name}");
    let count = coefficients.len();
    match model.as_str() {
        "equidistant" | "fisheye" => {}
        "" if is_fisheye => {}
        "" | "none" | "plumb_bob" | "rational_polynomial" | "thin_prism" | "tilted" => {
            let model = match count {
                0 => DistortionModel::None,
                4 | 5 => DistortionModel::PlumbBob,
                8 | 12 | 14 => DistortionModel::RationalPolynomial,
                _ => {
                    let detail = format!("{count} coefficients: OpenCV and ROS have 4, 5, 8, 12 or 14");
                    return Err(Fault::senseless(pointer, detail));
                }
            };
            if coefficients.iter().skip(8).any(|k| *k != 0.0) {
                let detail = "the coefficients from the ninth on, of a thin prism (s1 s2 s3 s4) and of a tilted sensor (tx ty), \
                              are not zero: these models are not among those that are computed here";
                return Err(Fault::senseless(pointer, detail));
            }
            return Ok(DistortionWire { model, coefficients: coefficients.into_iter().take(8).collect() });
        }
        _ => {
            let detail =
                format!("{model}: plumb_bob, rational_polynomial, equidistant (or fisheye) and none are read here");
            return Err(Fault::senseless("/distortion_model", detail));
        }
    }
    if count != 4 {
        return Err(Fault::senseless(pointer, format!("a fisheye has 4 coefficients, not {count}")));
    }
    Ok(DistortionWire { model: DistortionModel::Equidistant, coefficients })
}

fn needed<'a>(root: &'a Node, names: &[&str], usual: &str) -> Result<(&'a str, &'a Node), Fault> {
    root.get(names).ok_or_else(|| Fault::senseless(format!("/{usual}"), format!("{usual} is missing")))
}

/// The numbers of a list or of a matrix, as many as it has by its rows and columns.
fn numbers(name: &str, node: &Node) -> Result<Vec<f64>, Fault> {
    let data = node.get(&["data"]).map_or(node, |(_, data)| data);
    let not_number = |word| Fault::senseless(format!("/{name}"), format!("{word:?} is no number"));
    let numbers = data.numbers().map_err(not_number)?;
    match shape_of(name, node)? {
        Some([rows, columns]) if u64::from(rows) * u64::from(columns) != numbers.len() as u64 => {
            let detail = format!("a matrix of {rows} x {columns} with {} numbers", numbers.len());
            Err(Fault::senseless(format!("/{name}"), detail))
        }
        _ => Ok(numbers),
    }
}

/// Rows and columns of a matrix, where they are stated.
fn shape_of(name: &str, node: &Node) -> Result<Option<[u32; 2]>, Fault> {
    let [rows, columns] =
        ["rows", "cols"].map(|side| node.get(&[side]).is_some().then(|| optional(node, side)).transpose());
    let within = |fault: Fault| fault.within(&format!("/{name}"));
    match (rows.map_err(within)?, columns.map_err(within)?) {
        (Some(rows), Some(columns)) => Ok(Some([rows, columns])),
        (None, None) => Ok(None),
        _ => Err(Fault::senseless(format!("/{name}"), "a matrix has rows and cols, or neither")),
    }
}

/// A whole number, 0 if left out.
fn optional(node: &Node, name: &str) -> Result<u32, Fault> {
    node.get(&[name]).map_or(Ok(0), |_| single(node, &[name], name))
}

fn single(root: &Node, names: &[&str], usual: &str) -> Result<u32, Fault> {
    let (name, node) = needed(root, names, usual)?;
    match numbers(name, node)?[..] {
        [value] => side(name, value),
        _ => Err(Fault::senseless(format!("/{name}"), "one number is needed")),
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
fn side(name: &str, value: f64) -> Result<u32, Fault> {
    let is_side = value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0;
    let fault = || Fault::senseless(format!("/{name}"), format!("{value} is no number of pixels"));
    is_side.then_some(value as u32).ok_or_else(fault)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;

    const ROS: &[u8] = include_bytes!("../../../tests/data/cameras/ros.yaml");
    const OPENCV_YAML: &[u8] = include_bytes!("../../../tests/data/cameras/opencv.yaml");
    const OPENCV_XML: &[u8] = include_bytes!("../../../tests/data/cameras/opencv_fisheye.xml");
    const OPENCV_4_YAML: &[u8] = include_bytes!("../../../tests/data/cameras/opencv4.yaml");

    fn lens_of(camera: &CameraWire) -> (DistortionModel, &[f64]) {
        (camera.distortion.model, &camera.distortion.coefficients)
    }

    #[test]
    #[expect(clippy::float_cmp, reason = "numbers are read exactly")]
    fn files_of_other_programs_are_read() {
        let ros = read_camera(ROS).expect("a camera");
        assert_eq!((ros.width, ros.height), (640, 480));
        assert_eq!([ros.fx, ros.fy, ros.cx, ros.cy], [608.7, 611.2, 314.25, 240.5]);
        assert_eq!(lens_of(&ros), (DistortionModel::PlumbBob, &[-0.281, 0.0712, 5e-5, -0.00041, 0.0][..]));
        for bytes in [OPENCV_YAML, OPENCV_4_YAML] {
            let opencv = read_camera(bytes).expect("a camera");
            assert_eq!([opencv.fx, opencv.fy, opencv.cx, opencv.cy], [608.7, 611.2, 314.25, 240.5]);
            let eight = [-0.281, 0.0712, 5e-5, -0.00041, -0.009, 0.1, -0.02, 0.003];
            assert_eq!(
                lens_of(&opencv),
                (DistortionModel::RationalPolynomial, &eight[..]),
                "fourteen, six of them zero"
            );
        }
        let fisheye = read_camera(OPENCV_XML).expect("a camera");
        assert_eq!((fisheye.width, fisheye.height, fisheye.cx), (960, 720, 470.25));
        assert_eq!(lens_of(&fisheye), (DistortionModel::Equidistant, &[0.02, -0.01, 0.002, 1e-5][..]));
    }

    /// As `ros2 topic echo` prints a message.
    #[test]
    #[expect(clippy::float_cmp, reason = "halves and whole numbers")]
    fn a_part_of_the_sensor_and_binning_make_another_camera() {
        let info = "height: 480\nwidth: 640\ndistortion_model: plumb_bob\nd: [-0.2, 0.05, 0.0, 0.0, 0.0]\n\
                    k: [600.0, 0.0, 320.0, 0.0, 610.0, 240.0, 0.0, 0.0, 1.0]\n";
        let read = |more: &str| read_camera(format!("{info}{more}").as_bytes()).expect(more);
        let roi = |text: &str| format!("roi:\n  {}\n  do_rectify: false\n", text.replace(", ", "\n  "));
        let whole = read("");
        for same in [
            format!("binning_x: 0\nbinning_y: 0\n{}", roi("x_offset: 0, y_offset: 0, height: 0, width: 0")),
            format!("binning_x: 1\nbinning_y: 1\n{}", roi("x_offset: 0, y_offset: 0, height: 480, width: 640")),
        ] {
            assert_eq!(read(&same), whole, "{same}");
        }
        let part = roi("x_offset: 100, y_offset: 40, height: 240, width: 320");
        let cut = read(&part);
        assert_eq!([cut.width, cut.height], [320, 240]);
        assert_eq!([cut.fx, cut.fy, cut.cx, cut.cy], [600.0, 610.0, 220.0, 200.0]);
        let binned = read(&format!("binning_x: 2\nbinning_y: 4\n{part}"));
        assert_eq!([binned.width, binned.height], [160, 60]);
        // Of the part, and the centre of a pixel is the middle of those that make it.
        assert_eq!([binned.fx, binned.fy], [300.0, 152.5]);
        assert_eq!([binned.cx, binned.cy], [220.5 / 2.0 - 0.5, 200.5 / 4.0 - 0.5]);
        assert_eq!(binned.distortion, whole.distortion);
    }

    #[test]
    fn every_camera_goes_out_and_in() {
        let lenses = [
            (DistortionModel::None, vec![]),
            (DistortionModel::PlumbBob, vec![-0.281, 0.0712, 5e-7, -0.00041, 1e-300]),
            (DistortionModel::RationalPolynomial, vec![0.1, -0.2, 1e-4, 2e-4, 0.3, 0.4, 1e22, 0.6]),
            (DistortionModel::Equidistant, vec![0.02, -0.01, 0.002, 1e-5]),
        ];
        for (model, coefficients) in lenses {
            let camera = CameraWire {
                distortion: DistortionWire { model, coefficients },
                ..CameraWire::pinhole([640, 480], [608.7, 1.0 / 3.0 + 600.0], [314.0, 1e-7])
            };
            for format in CameraFormat::ALL {
                let text = write_camera(&camera, "front: \"left\"", format).expect("a text");
                let back = read_camera(text.as_bytes()).unwrap_or_else(|fault| panic!("{fault}: {text}"));
                let expected = match (model, format) {
                    (DistortionModel::None, CameraFormat::Ros | CameraFormat::OpencvYaml | CameraFormat::OpencvXml) => {
                        DistortionWire { model: DistortionModel::PlumbBob, coefficients: vec![0.0; 5] }
                    }
                    _ => camera.distortion.clone(),
                };
                assert_eq!(back, CameraWire { distortion: expected, ..camera.clone() }, "{text}");
            }
        }
    }

    #[test]
    fn what_is_no_camera_says_where() {
        let ros = |from: &str, to: &str| {
            let text = std::str::from_utf8(ROS).expect("text").replacen(from, to, 1);
            read_camera(text.as_bytes()).and_then(|wire| Camera::try_from(&wire)).expect_err(to)
        };
        for (from, to, pointer) in [
            ("image_width: 640\n", "", "/image_width"),
            ("640", "640.5", "/image_width"),
            ("640", "-640", "/image_width"),
            ("camera_matrix", "matrix", "/camera_matrix"),
            ("608.7  ", "many", "/camera_matrix"),
            ("608.7  ,   0.    ", "608.7, 1.5", "/camera_matrix"),
            ("0.000000]", "0.0, 1.0]", "/distortion_coefficients"),
            ("plumb_bob", "scaramuzza", "/distortion_model"),
            ("plumb_bob", "equidistant", "/distortion_coefficients"),
            ("608.7  ", ".nan", "/camera_matrix"),
            ("608.7  ", "-608.7", "/fx"),
            ("rows: 3", "rows: 7", "/camera_matrix"),
            ("rows: 3", "rows: 1", "/camera_matrix"),
            ("rows: 3", "rows: many", "/camera_matrix/rows"),
            ("rows: 1", "rows: 7", "/distortion_coefficients"),
            ("cols: 5", "columns: 5", "/distortion_coefficients"),
            ("image_width", "binning_x: 1000\nimage_width", "/binning_x"),
            ("image_width", "binning_y: -2\nimage_width", "/binning_y"),
            ("image_width", "roi: whole\nimage_width", "/roi"),
            ("image_width", "roi: {x_offset: 1.5}\nimage_width", "/roi/x_offset"),
            ("image_width", "roi: {x_offset: 600, width: 100, height: 100}\nimage_width", "/roi"),
        ] {
            let fault = ros(from, to);
            assert_eq!((fault.kind, fault.pointer.as_deref()), (FaultKind::Senseless, Some(pointer)), "{to}: {fault}");
        }
        let prism = std::str::from_utf8(OPENCV_YAML).expect("text").replace("0., 0. ]", "0., 1e-3 ]");
        let fault = read_camera(prism.as_bytes()).expect_err("a tilted sensor");
        assert!(fault.to_string().contains("tilted sensor"), "{fault}");
    }

    #[test]
    fn what_cannot_be_read_says_so() {
        let deep = "[".repeat(10_000);
        let aliases = "a: &a [1, 1]\nb: [*a, *a]\n";
        let xml_deep = format!("<opencv_storage>{}</opencv_storage>", "<a>".repeat(30) + &"</a>".repeat(30));
        let entities = "<?xml version=\"1.0\"?><!DOCTYPE x [<!ENTITY a \"aaaa\">]><opencv_storage>&a;</opencv_storage>";
        for text in
            ["%", "a: [1", "<a", "<html></html>", "{", "", "\u{0}", "- - -\n:::", &deep, aliases, &xml_deep, entities]
        {
            let fault = read_camera(text.as_bytes()).expect_err(text);
            assert!(matches!(fault.kind, FaultKind::Unreadable | FaultKind::Senseless), "{text}: {fault}");
        }
        assert_eq!(read_camera(b"image_width: \xff").expect_err("no UTF-8").kind, FaultKind::Unreadable);
    }
}
