//! Frame to centroids and poses: requests and replies of `POST /v1/detections` and `POST /v1/estimates`.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use super::pose::{Answer, SolverName};
use super::reference::{CameraOrName, TargetOrName};
use super::{CameraWire, Ref, TargetWire};
use crate::detect::gray::Gray;
use crate::detect::median::Window;
use crate::detect::{self, ColorOptions, Detection, Detector, EdgeOptions, HueRange};
use crate::frame::{Frame, RawFormat, Region};
use crate::pipeline::TargetEstimate;
use crate::shell::fault::Fault;
use crate::target::Target;

/// How a frame is to be looked at. The frame itself comes beside it.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default)]
pub struct FrameRequest {
    /// Copied to the reply.
    pub id: Option<Value>,
    /// The camera, or the name of a stored one. Estimates need it; for detections only its size is checked.
    #[schema(value_type = Option<CameraOrName>)]
    pub camera: Option<Ref<CameraWire>>,
    /// The targets to look for, or the names of stored ones.
    #[schema(value_type = Vec<TargetOrName>)]
    pub targets: Vec<Ref<TargetWire>>,
    /// Most of each target that are looked for: with more than 1, several of one target in view are several entries of the
    /// reply under its name.
    #[schema(default = 1, minimum = 1, maximum = 16)]
    pub max_instances: usize,
    /// The detector.
    pub detector: DetectorWire,
    /// Region of interest x, y, width, height in whole pixels; the whole frame if left out.
    pub region_px: Option<[u32; 4]>,
    /// The method for the pose.
    pub solver: SolverName,
    /// Minimise the reprojection error from the method's pose.
    #[schema(default = true)]
    pub refine: bool,
    /// When the frame was taken, microseconds since the Unix epoch; copied to the reply.
    pub timestamp_us: Option<i64>,
    /// What to do with an orientation that the file states (EXIF).
    pub orientation: OrientationHandling,
    /// Width of a raw frame.
    pub width: Option<u32>,
    /// Height of a raw frame.
    pub height: Option<u32>,
    /// Pixel format of a raw frame; none for encoded pictures.
    pub format: Option<RawFormatName>,
}

/// What to do with an orientation that the file states (EXIF).
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum OrientationHandling {
    /// Take the pixels as they are stored, and state the orientation in the reply: intrinsics belong to the sensor's grid.
    #[default]
    Ignore,
    /// Turn the frame upright first; the camera must be that of the turned frame.
    Apply,
}

/// Raw pixel formats, 8 bits a sample, rows without padding.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the names of the formats are their documentation")]
pub enum RawFormatName {
    Rgb8,
    Bgr8,
    Mono8,
    BayerRggb8,
    BayerBggr8,
    BayerGbrg8,
    BayerGrbg8,
    Yuyv,
    Nv12,
}

impl RawFormatName {
    /// The core's name for it.
    #[must_use]
    pub const fn format(self) -> RawFormat {
        use crate::frame::bayer::Mosaic;
        match self {
            Self::Rgb8 => RawFormat::Rgb8,
            Self::Bgr8 => RawFormat::Bgr8,
            Self::Mono8 => RawFormat::Mono8,
            Self::BayerRggb8 => RawFormat::Bayer(Mosaic::Rggb),
            Self::BayerBggr8 => RawFormat::Bayer(Mosaic::Bggr),
            Self::BayerGbrg8 => RawFormat::Bayer(Mosaic::Gbrg),
            Self::BayerGrbg8 => RawFormat::Bayer(Mosaic::Grbg),
            Self::Yuyv => RawFormat::Yuyv,
            Self::Nv12 => RawFormat::Nv12,
        }
    }
}

impl Default for FrameRequest {
    fn default() -> Self {
        Self {
            id: None,
            camera: None,
            targets: Vec::new(),
            max_instances: 1,
            detector: DetectorWire::default(),
            region_px: None,
            solver: SolverName::default(),
            refine: true,
            timestamp_us: None,
            orientation: OrientationHandling::default(),
            width: None,
            height: None,
            format: None,
        }
    }
}

/// The detector and its options. What is left out has its default.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = Detector)]
pub struct DetectorWire {
    /// The method.
    pub method: Method,
    /// A preset; `thesis` is the method of the seed thesis step for step. That of `color` takes no options; that of `edge` has
    /// the seed's numbers, and each may be changed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// `color`: the markers' colour: red, orange, yellow, green, cyan, blue or magenta. Red if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub color: Option<String>,
    /// `color`: the markers' hues instead of a named colour: from, to in degrees of the HSV circle (0 red, 120 green, 240 blue), at
    /// most 120 apart; across 0 as in [340, 20].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hue_range_deg: Option<[f64; 2]>,
    /// `color`: chroma, of 255, by which a marker must stand out from what surrounds it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_contrast: Option<f64>,
    /// Smallest area, px. `edge`: of the edges that hang together, their area as Matlab's `bwarea` has it, and it must be more
    /// than this; 10 if left out, 210 in the preset `thesis`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_area_px: Option<f64>,
    /// `color`: largest area as a share of the frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_area_ratio: Option<f64>,
    /// `color`: largest ratio of length to width.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_elongation: Option<f64>,
    /// `color`: smallest ratio of the area to that of the ellipse of the same moments: 1 for a disc however tilted, 0.83 for a
    /// triangle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_fill: Option<f64>,
    /// Most centroids returned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_centroids: Option<usize>,
    /// `edge`: how colour becomes gray. `luminosity` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gray: Option<GrayName>,
    /// `edge`: rows and columns of the median's window, 1 to 255 each; [1, 1] is no median. [3, 3] if left out, [9, 10] in the
    /// preset `thesis`. The more, the less noise, and the larger what is lost.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub median_px: Option<[usize; 2]>,
    /// `edge`: magnitude of Sobel's gradient above which a pixel is an edge, as a share of full scale: from 0, below 1. The
    /// weights are 1, 2, 1, so a step of 13 of 255 gray levels is an edge at 0.2, which it is if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threshold: Option<f64>,
}

/// How colour becomes gray.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum GrayName {
    /// 0.21 R + 0.71 G + 0.07 B.
    Luminosity,
    /// (R + G + B) / 3.
    Average,
    /// (max + min) / 2.
    Lightness,
}

impl From<GrayName> for Gray {
    fn from(name: GrayName) -> Self {
        match name {
            GrayName::Luminosity => Self::Luminosity,
            GrayName::Average => Self::Average,
            GrayName::Lightness => Self::Lightness,
        }
    }
}

/// The methods of detection.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Markers of one colour.
    #[default]
    Color,
    /// Things without markers, by their edges against the sky: gray, median, Sobel's gradient, threshold, connected edges of some
    /// area. It finds where something is, not how it is turned, and not what it is.
    Edge,
}

/// The presets of a method.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The defaults.
    Default,
    /// The method of the seed thesis.
    Thesis,
}

impl TryFrom<&DetectorWire> for Detector {
    type Error = Fault;

    fn try_from(wire: &DetectorWire) -> Result<Self, Fault> {
        let of_color = [
            ("color", wire.color.is_some()),
            ("hue_range_deg", wire.hue_range_deg.is_some()),
            ("min_contrast", wire.min_contrast.is_some()),
            ("max_area_ratio", wire.max_area_ratio.is_some()),
            ("max_elongation", wire.max_elongation.is_some()),
            ("min_fill", wire.min_fill.is_some()),
        ];
        let of_edge = [
            ("gray", wire.gray.is_some()),
            ("median_px", wire.median_px.is_some()),
            ("threshold", wire.threshold.is_some()),
        ];
        let (method, foreign): (_, &[_]) = match wire.method {
            Method::Color => ("color", &of_edge),
            Method::Edge => ("edge", &of_color),
        };
        if let Some((name, _)) = foreign.iter().find(|(_, is_given)| *is_given) {
            return Err(Fault::senseless(format!("/{name}"), format!("the method {method} has no option {name}")));
        }
        match (wire.method, wire.preset) {
            (Method::Edge, Some(Preset::Thesis)) => edge_of(wire, EdgeOptions::THESIS).map(Self::Edge),
            (Method::Edge, _) => edge_of(wire, EdgeOptions::default()).map(Self::Edge),
            (Method::Color, Some(Preset::Thesis)) => {
                let bare = DetectorWire { method: wire.method, preset: wire.preset, ..DetectorWire::default() };
                if *wire != bare {
                    return Err(Fault::senseless("/preset", "the preset thesis of color takes no options"));
                }
                Ok(Self::Thesis)
            }
            (Method::Color, _) => color_of(wire).map(Self::Color),
        }
    }
}

fn color_of(wire: &DetectorWire) -> Result<ColorOptions, Fault> {
    let default = ColorOptions::default();
    Ok(ColorOptions {
        hue: hue_of(wire)?,
        min_contrast: within("min_contrast", wire.min_contrast, default.min_contrast, [1.0, 255.0])?,
        min_area_px: within("min_area_px", wire.min_area_px, default.min_area_px, [1.0, 1e9])?,
        max_area_ratio: within("max_area_ratio", wire.max_area_ratio, default.max_area_ratio, [1e-6, 1.0])?,
        max_elongation: within("max_elongation", wire.max_elongation, default.max_elongation, [1.0, 1e3])?,
        min_fill: within("min_fill", wire.min_fill, default.min_fill, [0.0, 1.0])?,
        max_centroids: count_of(wire, default.max_centroids)?,
    })
}

fn edge_of(wire: &DetectorWire, default: EdgeOptions) -> Result<EdgeOptions, Fault> {
    let window = match wire.median_px {
        None => default.window,
        Some([rows, columns]) => Window::checked(rows, columns).ok_or_else(|| {
            let most = Window::MAX_SIDE;
            let detail = format!("median_px = [{rows}, {columns}]: from 1 to {most} rows and columns are accepted");
            Fault::senseless("/median_px", detail)
        })?,
    };
    let threshold_ratio = within("threshold", wire.threshold, default.threshold_ratio, [0.0, 1.0])?;
    if threshold_ratio >= 1.0 {
        let detail = "threshold = 1: nothing is above full scale; from 0 to less than 1 is accepted";
        return Err(Fault::senseless("/threshold", detail));
    }
    Ok(EdgeOptions {
        gray: wire.gray.map_or(default.gray, Gray::from),
        window,
        threshold_ratio,
        min_area_px: within("min_area_px", wire.min_area_px, default.min_area_px, [0.0, 1e9])?,
        max_centroids: count_of(wire, default.max_centroids)?,
        ..default
    })
}

fn within(name: &str, value: Option<f64>, default: f64, [least, most]: [f64; 2]) -> Result<f64, Fault> {
    match value {
        None => Ok(default),
        Some(value) if (least..=most).contains(&value) => Ok(value),
        Some(value) => {
            let detail = format!("{name} = {value}: from {least} to {most} is accepted");
            Err(Fault::senseless(format!("/{name}"), detail))
        }
    }
}

fn count_of(wire: &DetectorWire, default: usize) -> Result<usize, Fault> {
    match wire.max_centroids {
        None => Ok(default),
        Some(count @ 1..=1024) => Ok(count),
        Some(count) => {
            let detail = format!("max_centroids = {count}: from 1 to 1024 is accepted");
            Err(Fault::senseless("/max_centroids", detail))
        }
    }
}

fn hue_of(wire: &DetectorWire) -> Result<HueRange, Fault> {
    match (&wire.color, wire.hue_range_deg) {
        (None, None) => Ok(HueRange::RED),
        (Some(_), Some(_)) => Err(Fault::senseless("/hue_range_deg", "give a color or a hue range, not both")),
        (Some(name), None) => HueRange::named(name).ok_or_else(|| {
            let known: Vec<&str> = detect::color::NAMED_HUES.iter().map(|(name, _)| *name).collect();
            Fault::senseless("/color", format!("no colour {name:?}; known are {}", known.join(", ")))
        }),
        (None, Some([from, to])) => {
            let width = (to - from).rem_euclid(360.0);
            if !(width > 0.0 && width <= 120.0) {
                let detail =
                    format!("hues from {from} to {to} degrees span {width}: more than 0, at most 120 is accepted");
                return Err(Fault::senseless("/hue_range_deg", detail));
            }
            Ok(HueRange { centre_deg: (from + 0.5 * width).rem_euclid(360.0), half_width_deg: 0.5 * width })
        }
    }
}

/// What is known of the frame.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
pub struct FrameInfo {
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
    /// The request's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timestamp_us: Option<i64>,
    /// The orientation that the file states and that was not applied: EXIF, 2 to 8.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<u8>,
}

impl FrameInfo {
    /// Of a frame.
    #[must_use]
    pub fn of(frame: &Frame, timestamp_us: Option<i64>) -> Self {
        let orientation = frame.orientation().exif();
        Self {
            width: frame.width(),
            height: frame.height(),
            timestamp_us,
            orientation: (orientation != 1).then_some(orientation),
        }
    }
}

/// A blob that may be a marker.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Centroid)]
pub struct CentroidWire {
    /// Position, to the right.
    pub u_px: f64,
    /// Position, down.
    pub v_px: f64,
    /// Standard deviation of the position per axis.
    pub sigma_px: f64,
    /// Area.
    pub area_px: f64,
    /// x, y, width, height of the pixels that it spans.
    pub box_px: [u32; 4],
    /// How much it looks like a marker, 0 to 1.
    pub score: f64,
    /// The marker that it was identified with; null where it belongs to no target.
    #[schema(required = true)]
    pub marker: Option<String>,
    /// The target of that marker, where several were looked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target: Option<String>,
    /// Which of several like it that target is, from 0, where more than one of each was looked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub instance: Option<usize>,
}

/// A blob that was looked at and is no marker.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RefusedBlob)]
pub struct RefusedWire {
    /// Middle of its box, to the right.
    pub u_px: f64,
    /// Middle of its box, down.
    pub v_px: f64,
    /// Area.
    pub area_px: f64,
    /// x, y, width, height of the pixels that it spans.
    pub box_px: [u32; 4],
    /// What speaks against it: `too_small`, `too_large`, `elongated`, `ragged`, `low_contrast`, `at_border`,
    /// `crowded`, `not_persistent`.
    pub reason: String,
}

const fn box_of(region: Region) -> [u32; 4] {
    [region.x, region.y, region.width, region.height]
}

/// The centroids of a detection, none of them identified.
#[must_use]
pub fn centroids_of(detection: &Detection) -> Vec<CentroidWire> {
    let centroid = |c: &detect::Centroid| CentroidWire {
        u_px: c.pixel.x,
        v_px: c.pixel.y,
        sigma_px: c.sigma_px,
        area_px: c.area_px,
        box_px: box_of(c.bounds),
        score: c.score,
        marker: None,
        target: None,
        instance: None,
    };
    detection.centroids.iter().map(centroid).collect()
}

/// The refused blobs of a detection.
#[must_use]
pub fn refused_of(detection: &Detection) -> Vec<RefusedWire> {
    let refused = |r: &detect::Refused| RefusedWire {
        u_px: r.pixel.x,
        v_px: r.pixel.y,
        area_px: r.area_px,
        box_px: box_of(r.bounds),
        reason: r.reason.name().into(),
    };
    detection.refused.iter().map(refused).collect()
}

/// Time taken by each stage, whole microseconds.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
pub struct Timing {
    /// Bytes to pixels.
    pub decode: u64,
    /// Pixels to centroids.
    pub detect: u64,
    /// Centroids to markers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identify: Option<u64>,
    /// Markers to poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solve: Option<u64>,
    /// All together.
    pub total: u64,
}

/// Reply to a detection request.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct DetectionReply {
    /// The request's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<Value>,
    /// The frame.
    pub frame: FrameInfo,
    /// Candidates for markers, the best first.
    pub centroids: Vec<CentroidWire>,
    /// What was refused and why, the largest first, at most 64.
    pub refused: Vec<RefusedWire>,
    /// Time taken.
    pub timing_us: Timing,
}

/// What a frame tells of one target.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = TargetEstimate)]
pub struct TargetEstimateWire {
    /// The target's name.
    pub name: String,
    /// Which of several like it, from 0, where more than one of each was looked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub instance: Option<usize>,
    /// At least four of its markers were found and identified.
    pub detected: bool,
    /// The pose.
    #[serde(flatten)]
    pub answer: Answer,
}

impl TargetEstimateWire {
    /// Of a target, or of one of several.
    #[must_use]
    pub fn of(target: &Target, estimate: &TargetEstimate, instance: Option<usize>) -> Self {
        Self {
            name: target.name().into(),
            instance,
            detected: estimate.is_detected(),
            answer: Answer::from(&estimate.answer),
        }
    }
}

/// Reply to an estimate request.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
pub struct EstimateReply {
    /// The request's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<Value>,
    /// The frame.
    pub frame: FrameInfo,
    /// Candidates for markers, the best first, each with the marker that it was identified with.
    pub centroids: Vec<CentroidWire>,
    /// One for each target asked for, in that order; with `max_instances`, where several of a target are in view, one for each
    /// of them, the most probable first.
    pub targets: Vec<TargetEstimateWire>,
    /// Time taken.
    pub timing_us: Timing,
}
