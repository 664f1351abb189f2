//! The detector and its options.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::detect::gray::Gray;
use crate::detect::median::Window;
use crate::detect::{self, BeaconOptions, BlobOptions, ColorOptions, Detector, EdgeOptions, HueRange, SkyOptions};
use crate::shell::fault::Fault;

/// The detector and its options. What is left out has its default.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = Detector)]
pub struct DetectorWire {
    /// The method.
    pub method: Method,
    /// A preset; `thesis` is the method of the seed thesis step for step. That of `color` takes no options; that of `edge` has
    /// the seed's numbers, each of which may be changed with options that only it has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// `color`, `beacon`: the markers' colour: red, orange, yellow, green, cyan, blue or magenta. If left out, red for `color`, any
    /// for `beacon`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub color: Option<String>,
    /// `color`, `beacon`: the markers' hues instead of a named colour: from, to in degrees of the HSV circle (0 red, 120 green,
    /// 240 blue), at most 120 apart; across 0 as in [340, 20].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hue_range_deg: Option<[f64; 2]>,
    /// `color`, `beacon`: the markers' hue is that of this place in the frame: x, y, width, height of some pixels on a marker, as a
    /// click gives them. The reply has the hues, for later frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample_px: Option<[u32; 4]>,
    /// `color`: chroma, of 255, by which a marker must stand out from what surrounds it; `beacon`: luma, of 255.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_contrast: Option<f64>,
    /// Smallest area, px. `edge`: 1 if left out; in the preset `thesis` that of the edges that hang together, as Matlab's `bwarea`
    /// has it, and it must be more than this, 210 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_area_px: Option<f64>,
    /// `color`, `beacon`: largest area as a share of the frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_area_ratio: Option<f64>,
    /// `color`, `beacon`: largest ratio of length to width.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_elongation: Option<f64>,
    /// `color`, `beacon`: smallest ratio of the area to that of the ellipse of the same moments: 1 for a disc however tilted,
    /// 0.83 for a triangle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_fill: Option<f64>,
    /// Most centroids returned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_centroids: Option<usize>,
    /// `edge`: least probability of what is reported, 0 to 1; 0.02 if left out. Not in the preset `thesis`, which knows none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_score: Option<f64>,
    /// `edge`, preset `thesis`: how colour becomes gray. `luminosity` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gray: Option<GrayName>,
    /// `edge`, preset `thesis`: rows and columns of the median's window, 1 to 255 each; [1, 1] is no median. [9, 10] if left out.
    /// The more, the less noise, and the larger what is lost.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub median_px: Option<[usize; 2]>,
    /// `edge`, preset `thesis`: magnitude of Sobel's gradient above which a pixel is an edge, as a share of full scale: from 0, below 1. The
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
    /// LEDs on a dark ground, of any colour or of one.
    Beacon,
    /// Things in the sky without markers: contrast over local clutter at every size, and in a sequence what moves against the
    /// camera's own motion, as tracks. It finds where something is, with the probability that it flies, not how it is turned. The
    /// preset `thesis` is the seed's: gray, median, Sobel's gradient, threshold, connected edges of some area.
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
            ("sample_px", wire.sample_px.is_some()),
            ("min_contrast", wire.min_contrast.is_some()),
            ("max_area_ratio", wire.max_area_ratio.is_some()),
            ("max_elongation", wire.max_elongation.is_some()),
            ("min_fill", wire.min_fill.is_some()),
        ];
        let of_edge = [
            ("gray", wire.gray.is_some()),
            ("median_px", wire.median_px.is_some()),
            ("threshold", wire.threshold.is_some()),
            ("min_score", wire.min_score.is_some()),
        ];
        let (method, foreign): (_, &[_]) = match wire.method {
            Method::Color => ("color", &of_edge),
            Method::Beacon => ("beacon", &of_edge),
            Method::Edge => ("edge", &of_color),
        };
        if let Some((name, _)) = foreign.iter().find(|(_, is_given)| *is_given) {
            return Err(Fault::senseless(format!("/{name}"), format!("the method {method} has no option {name}")));
        }
        if wire.sample_px.is_some() && (wire.color.is_some() || wire.hue_range_deg.is_some()) {
            return Err(Fault::senseless("/sample_px", "give a colour, a hue range or a sample, only one of them"));
        }
        let of_seed = wire.preset == Some(Preset::Thesis);
        if wire.method == Method::Edge
            && !of_seed
            && let Some((name, _)) = of_edge.iter().find(|(name, is_given)| *is_given && *name != "min_score")
        {
            let detail = format!("{name} is an option of a step of the seed's method: give the preset thesis with it");
            return Err(Fault::senseless(format!("/{name}"), detail));
        }
        if wire.method == Method::Edge && of_seed && wire.min_score.is_some() {
            return Err(Fault::senseless("/min_score", "the preset thesis of edge knows no probabilities"));
        }
        match (wire.method, wire.preset) {
            (Method::Edge, Some(Preset::Thesis)) => edge_of(wire, EdgeOptions::THESIS).map(Self::Edge),
            (Method::Edge, _) => sky_of(wire).map(Self::Sky),
            (Method::Color, Some(Preset::Thesis)) => {
                let bare = DetectorWire { method: wire.method, preset: wire.preset, ..DetectorWire::default() };
                if *wire != bare {
                    return Err(Fault::senseless("/preset", "the preset thesis of color takes no options"));
                }
                Ok(Self::Thesis)
            }
            (Method::Color, _) => color_of(wire).map(Self::Color),
            (Method::Beacon, Some(Preset::Thesis)) => {
                Err(Fault::senseless("/preset", "the seed thesis has no method for beacons"))
            }
            (Method::Beacon, _) => beacon_of(wire).map(Self::Beacon),
        }
    }
}

fn color_of(wire: &DetectorWire) -> Result<ColorOptions, Fault> {
    let default = ColorOptions::default();
    let hue = hue_of(wire)?.unwrap_or(default.hue);
    Ok(ColorOptions { hue, blobs: blobs_of(wire, &default.blobs)? })
}

fn beacon_of(wire: &DetectorWire) -> Result<BeaconOptions, Fault> {
    Ok(BeaconOptions { hue: hue_of(wire)?, blobs: blobs_of(wire, &BeaconOptions::default().blobs)? })
}

fn blobs_of(wire: &DetectorWire, default: &BlobOptions) -> Result<BlobOptions, Fault> {
    Ok(BlobOptions {
        min_contrast: within("min_contrast", wire.min_contrast, default.min_contrast, [1.0, 255.0])?,
        min_area_px: within("min_area_px", wire.min_area_px, default.min_area_px, [1.0, 1e9])?,
        max_area_ratio: within("max_area_ratio", wire.max_area_ratio, default.max_area_ratio, [1e-6, 1.0])?,
        max_elongation: within("max_elongation", wire.max_elongation, default.max_elongation, [1.0, 1e3])?,
        min_fill: within("min_fill", wire.min_fill, default.min_fill, [0.0, 1.0])?,
        max_centroids: count_of(wire, default.max_centroids)?,
    })
}

fn sky_of(wire: &DetectorWire) -> Result<SkyOptions, Fault> {
    let default = SkyOptions::default();
    Ok(SkyOptions {
        min_score: within("min_score", wire.min_score, default.min_score, [0.0, 1.0])?,
        min_area_px: within("min_area_px", wire.min_area_px, default.min_area_px, [0.0, 1e9])?,
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

fn hue_of(wire: &DetectorWire) -> Result<Option<HueRange>, Fault> {
    match (&wire.color, wire.hue_range_deg) {
        (None, None) => Ok(None),
        (Some(_), Some(_)) => Err(Fault::senseless("/hue_range_deg", "give a color or a hue range, not both")),
        (Some(name), None) => HueRange::named(name).map(Some).ok_or_else(|| {
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
            let centre_deg = (from + 0.5 * width).rem_euclid(360.0);
            Ok(Some(HueRange { centre_deg, half_width_deg: 0.5 * width }))
        }
    }
}
