//! Frame to centroids.
//!
//! Two ways to find coloured markers: [`thesis`], the seed's method step for step, and [`color`], the default; one to find LEDs
//! in the dark: [`beacon`]; and two to find a thing without markers: [`edge`], the seed's, and [`sky`], the default. The steps
//! they share are rooms of their own.

mod bands;
pub mod beacon;
mod bits;
pub mod blob;
pub mod color;
pub mod components;
pub mod edge;
pub mod gray;
mod ground;
pub mod locate;
pub mod luma;
pub mod median;
pub mod morphology;
pub mod sky;
pub mod sobel;
pub mod thesis;
pub mod threshold;

use std::sync::LazyLock;

use fearless_simd::Level;
use nalgebra::Vector2;

use crate::camera::Pixel;
use crate::frame::{Frame, Region, Wanted};
use locate::{Located, Seed, Shape};

pub use beacon::BeaconOptions;
pub use blob::BlobOptions;
pub use color::{ColorOptions, HueRange};
pub use edge::{EdgeOptions, Persistence, PersistenceOptions};
pub use sky::{SkyOptions, Stamp, Watch};

/// A blob that may be a marker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Centroid {
    /// Where it is, px.
    pub pixel: Pixel,
    /// Standard deviation of the position per axis, px.
    pub sigma_px: f64,
    /// Its area, px; with sub-pixel accuracy where the detector has that.
    pub area_px: f64,
    /// The pixels that it spans.
    pub bounds: Region,
    /// How much it looks like a marker, 0 to 1; of [`sky`], the probability that it is something that flies.
    pub score: f64,
    /// What it is, where that is known.
    pub class: Option<Class>,
    /// Its number in a sequence: the same thing has the same in every frame.
    pub track_id: Option<u32>,
}

impl Centroid {
    /// The same with bounds that hold the pixel that it lies on: of a small blob in noise, what stands out may be beside the middle of the
    /// marker.
    fn within_bounds(self) -> Self {
        let [(x, width), (y, height)] =
            [(self.pixel.x, self.bounds.x, self.bounds.width), (self.pixel.y, self.bounds.y, self.bounds.height)].map(
                |(at, start, length)| {
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "on the frame")]
                    let at = at.round().max(0.0) as u32;
                    let first = start.min(at);
                    (first, (start + length).max(at.saturating_add(1)) - first)
                },
            );
        Self { bounds: Region { x, y, width, height }, ..self }
    }
}

/// What a thing in the sky is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Class {
    /// Aeroplane, helicopter, drone: what has wings that do not flap.
    Aircraft,
    /// Bird.
    Bird,
}

impl Class {
    /// The contract's word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Aircraft => "aircraft",
            Self::Bird => "bird",
        }
    }
}

/// A blob that was looked at and is not a marker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refused {
    /// Middle of its bounds, px.
    pub pixel: Pixel,
    /// Its area, px.
    pub area_px: f64,
    /// The pixels that it spans.
    pub bounds: Region,
    /// What speaks against it.
    pub reason: Refusal,
}

impl Refused {
    const fn of(centroid: &Centroid, reason: Refusal) -> Self {
        Self { pixel: centroid.pixel, area_px: centroid.area_px, bounds: centroid.bounds, reason }
    }
}

/// What speaks against a blob.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Refusal {
    /// Fewer pixels than a marker.
    TooSmall,
    /// More pixels than a marker.
    TooLarge,
    /// Too long for its width.
    Elongated,
    /// Its outline is not that of an ellipse: hollow, angular, or several things in one.
    Ragged,
    /// It hardly stands out from what surrounds it.
    LowContrast,
    /// Cut off by the border of the frame or the region, so that its centre is unknown.
    AtBorder,
    /// Better candidates filled the list.
    Crowded,
    /// Light of another colour.
    OtherColor,
    /// Not seen in enough frames in a row.
    NotPersistent,
}

impl Refusal {
    /// The contract's word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::TooSmall => "too_small",
            Self::TooLarge => "too_large",
            Self::Elongated => "elongated",
            Self::Ragged => "ragged",
            Self::LowContrast => "low_contrast",
            Self::AtBorder => "at_border",
            Self::Crowded => "crowded",
            Self::OtherColor => "other_color",
            Self::NotPersistent => "not_persistent",
        }
    }
}

/// What a detector found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Detection {
    /// Candidates for markers, the best first.
    pub centroids: Vec<Centroid>,
    /// What was refused and why, the largest first; at most [`MAX_REFUSED`].
    pub refused: Vec<Refused>,
}

/// Refused blobs that are reported; a frame of noise has thousands.
pub const MAX_REFUSED: usize = 64;

impl Detection {
    /// One more that was refused, in its place among those that are reported: the larger before the smaller, and of equals the earlier
    /// before the later.
    fn refuse(&mut self, refused: Refused) {
        let place = self.refused.partition_point(|other| other.area_px >= refused.area_px);
        if place < MAX_REFUSED {
            self.refused.truncate(MAX_REFUSED - 1);
            self.refused.reserve_exact(MAX_REFUSED - self.refused.len());
            self.refused.insert(place, refused);
        }
    }
}

/// Which detector, with its options.
#[derive(Clone, Debug, PartialEq)]
pub enum Detector {
    /// Markers of one hue, located to a fraction of a pixel.
    Color(ColorOptions),
    /// LEDs in the dark.
    Beacon(BeaconOptions),
    /// The seed's method for markers.
    Thesis,
    /// The seed's method for silhouettes, without markers.
    Edge(EdgeOptions),
    /// Things in the sky, without markers.
    Sky(SkyOptions),
}

impl Default for Detector {
    fn default() -> Self {
        Self::Color(ColorOptions::default())
    }
}

impl Detector {
    /// The colour space in which the detector works without conversion.
    #[must_use]
    pub const fn wanted(&self) -> Wanted {
        match self {
            Self::Beacon(BeaconOptions { hue: None, .. }) | Self::Sky(_) => Wanted::Luma,
            Self::Color(_) | Self::Beacon(_) => Wanted::Native,
            Self::Thesis | Self::Edge(_) => Wanted::Rgb,
        }
    }
}

impl Detector {
    /// Whether a centroid's area is that of the marker's image. Light that blooms is not.
    #[must_use]
    pub const fn measures_area(&self) -> bool {
        !matches!(self, Self::Beacon(_))
    }
}

impl Detector {
    /// The same for markers of another hue; `None` for a method to which hues are nothing.
    #[must_use]
    pub fn with_hue(&self, hue: HueRange) -> Option<Self> {
        match self {
            Self::Color(options) => Some(Self::Color(ColorOptions { hue, ..*options })),
            Self::Beacon(options) => Some(Self::Beacon(BeaconOptions { hue: Some(hue), ..*options })),
            Self::Thesis | Self::Edge(_) | Self::Sky(_) => None,
        }
    }
}

impl Detector {
    /// `centroid` located once more in the frame that it was found in, now that its shape is known. `None` for a method that fits no
    /// discs, or where this one does not fit.
    #[must_use]
    pub fn located_again(
        &self,
        workspace: &mut Workspace,
        frame: &Frame,
        centroid: &Centroid,
        shape: &Shape,
    ) -> Option<Centroid> {
        let Self::Color(options) = self else { return None };
        let seed = Seed { pixel: centroid.pixel, moments: shape.moments, sigma_px: centroid.sigma_px };
        let hue = Some(options.hue.direction());
        let Located { pixel, sigma_px, area_px } = workspace.color.locator().locate_shaped(frame, &seed, shape, hue)?;
        Some(Centroid { pixel, sigma_px, area_px, ..*centroid }.within_bounds())
    }
}

/// The memory of a detector, which every frame fills anew: of the frames before nothing is left in it but room. In steady state, frame
/// after frame of a size, a frame takes no more memory than what is reported of it.
#[derive(Default)]
pub struct Workspace {
    color: color::Finder,
    beacon: beacon::Finder,
    thesis: thesis::Finder,
    edge: edge::Finder,
    sky: Watch,
}

/// The centroids in `region`, in pixels of the whole frame. The region must lie on the frame.
#[must_use]
pub fn detect(frame: &Frame, region: Region, detector: &Detector) -> Detection {
    detect_with(&mut Workspace::default(), frame, region, detector)
}

/// As [`detect`], in memory that is there already. To the sky too each frame is one of its own here; frames that follow each other have a
/// [`Watch`].
#[must_use]
pub fn detect_with(workspace: &mut Workspace, frame: &Frame, region: Region, detector: &Detector) -> Detection {
    let detection = match detector {
        Detector::Color(options) => workspace.color.detect(frame, region, options),
        Detector::Beacon(options) => workspace.beacon.detect(frame, region, options),
        Detector::Thesis => workspace.thesis.detect(frame, region),
        Detector::Edge(options) => workspace.edge.detect(frame, region, options),
        Detector::Sky(options) => sky::detect(&mut workspace.sky, frame, region, options),
    };
    if region.area() > MOST_KEPT_PX {
        *workspace = Workspace::default();
    }
    detection
}

/// Frames come one after the other from videos; what is larger than theirs is a picture, whose memory is given back.
const MOST_KEPT_PX: usize = 7680 * 4320;

/// What of a frame of this size [`detect`] looks at for what lies in `region`: a marker at its border is fitted with what is around it.
#[must_use]
pub fn looked_at(region: Region, width: u32, height: u32) -> Region {
    region.grown(locate::reach_px(region.width.max(region.height)), width, height)
}

/// What the machine can do, asked once.
static MACHINE: LazyLock<Level> = LazyLock::new(Level::new);

/// Rounded down; 0 for what is below.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "that is what it is for")]
const fn whole(number: f64) -> usize {
    number.max(0.0) as usize
}

/// In single precision, whose seven digits are enough for what eight bits say.
#[expect(clippy::cast_possible_truncation, reason = "what is lost is far below a pixel or a gray level")]
const fn single(number: f64) -> f32 {
    number as f32
}

/// A position inside a region as a pixel of the whole frame.
fn in_frame(region: Region, x: f64, y: f64) -> Pixel {
    Vector2::new(x + f64::from(region.x), y + f64::from(region.y))
}

/// Whether a place lies on the pixels of `bounds`: the first one's middle is at its coordinates.
#[cfg(test)]
fn spans(bounds: Region, at: &Pixel) -> bool {
    let within = |at: f64, start: u32, length: u32| {
        let along = at + 0.5 - f64::from(start);
        (0.0..=f64::from(length)).contains(&along)
    };
    within(at.x, bounds.x, bounds.width) && within(at.y, bounds.y, bounds.height)
}

/// Bounds inside a region as pixels of the whole frame.
const fn bounds_in_frame(region: Region, inner: Region) -> Region {
    Region { x: inner.x + region.x, y: inner.y + region.y, ..inner }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Coding, Limits, Pixels, RawFormat};
    use crate::random;
    use crate::scene::flight::Flight;
    use crate::scene::models::{demo_camera, wing};
    use crate::scene::render::{Optics, Sky, render};

    #[test]
    fn the_largest_that_were_refused_are_told_and_of_equals_the_first() {
        let mut detection = Detection::default();
        let bounds = Region { x: 0, y: 0, width: 1, height: 1 };
        let refused = |index: u32| Refused {
            pixel: Pixel::new(f64::from(index), 0.0),
            area_px: f64::from(index * 37 % 50),
            bounds,
            reason: Refusal::Ragged,
        };
        let mut slow: Vec<Refused> = (0..200).map(refused).collect();
        for refused in &slow {
            detection.refuse(*refused);
        }
        slow.sort_by(|a, b| b.area_px.total_cmp(&a.area_px));
        assert_eq!(detection.refused, slow[..MAX_REFUSED]);
    }

    #[test]
    fn what_is_not_looked_at_changes_nothing() {
        let camera = demo_camera();
        let detectors = [
            Detector::Color(ColorOptions::default()),
            Detector::Beacon(BeaconOptions::default()),
            Detector::Thesis,
            Detector::Edge(EdgeOptions::default()),
            Detector::Sky(SkyOptions::default()),
        ];
        let mut found = 0;
        for step in [0, 60, 110, 160, 190] {
            let pose = Flight::HeadOn.pose(step);
            let sky = Sky::fair(1, [0.3, 0.1]);
            let rng = &mut random::case("looked at", step as u64);
            let rendered = render(&camera, &pose, &wing(), &sky, &Optics::default(), rng);
            let (width, height) = (rendered.width(), rendered.height());
            let whole = Frame::checked(width, height, Pixels::Rgb(rendered.rgb().into_owned()), Coding::LOSSLESS);
            let whole = whole.expect("a frame");
            for region in [
                Region { x: 500, y: 250, width: 180, height: 160 },
                Region { x: 560, y: 300, width: 60, height: 40 },
                Region { x: 0, y: 0, width: 700, height: 400 },
                Region { x: 600, y: 310, width: 680, height: 410 },
            ] {
                let part = looked_at(region, width, height);
                let bytes = rendered.rgb();
                let partly = Frame::from_raw_within(RawFormat::Rgb8, width, height, &bytes, part, Limits::default());
                let partly = partly.expect("a frame");
                for detector in &detectors {
                    let wanted = detect(&whole, region, detector);
                    assert_eq!(detect(&partly, region, detector), wanted, "{detector:?} in {region} at step {step}");
                    found += wanted.centroids.len();
                }
            }
        }
        assert!(found > 50, "{found} found");
    }
}
