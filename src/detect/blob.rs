//! Blobs of a score: is a component a marker, and where is it?
//!
//! Blobs are sought level by level, so that a marker is found on a ground of its own colour as well as on any other; each is
//! cut at half its own height, and shape and size decide. So dim and bright markers of one frame are found alike.

mod levels;
mod tiles;

use nalgebra::{Matrix2, Vector2};

use super::components::{Connectivity, Labeling, Run, area, bounds, holds, mean_position};
use super::locate::{Located, Locator, Seed};
use super::threshold::{distance_at, histogram, level_at, mean_from};
use super::{Centroid, Detection, Refusal, Refused, bounds_in_frame, in_frame};
use crate::frame::{ChromaSampling, Coding, Frame, Region};
use levels::{Marker, Search};

/// What counts as a blob.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlobOptions {
    /// Score, of 255, by which it must stand out from what surrounds it.
    pub min_contrast: f64,
    /// Smallest area, px. Of frames of which each pixel has a colour of its own, also half of that if a disc fits it: a lens leaves no more
    /// of 1 px radius.
    pub min_area_px: f64,
    /// Largest area as a share of the frame.
    pub max_area_ratio: f64,
    /// Largest ratio of length to width. A disc tilted by 75 degrees has 3.9.
    pub max_elongation: f64,
    /// Smallest ratio of the area to that of the ellipse of the same moments. 1 for a disc however tilted, 0.95 for a
    /// rectangle, 0.83 for a triangle, less for a ring.
    pub min_fill: f64,
    /// Most centroids returned.
    pub max_centroids: usize,
}

/// Finds blobs, frame after frame, in the same memory.
#[derive(Default)]
pub(super) struct Finder {
    search: Search,
    locator: Locator,
}

impl Finder {
    /// The blobs of a score over `region`, a byte a pixel, the best first; `chroma` is the direction of their hue, by which discs are
    /// located; without it they are lights.
    pub(super) fn detect(
        &mut self,
        frame: &Frame,
        region: Region,
        score: &[u8],
        coding: Coding,
        chroma: Option<Vector2<f64>>,
        options: &BlobOptions,
    ) -> Detection {
        let picture = Picture {
            score,
            width: region.width,
            height: region.height,
            coding,
            frame_area: f64::from(frame.width()) * f64::from(frame.height()),
        };
        let mut detection = Detection::default();
        let mut refuse = |refused: Refused| {
            let pixel = in_frame(region, refused.pixel.x, refused.pixel.y);
            detection.refuse(Refused { pixel, bounds: bounds_in_frame(region, refused.bounds), ..refused });
        };
        let markers = self.search.markers(&picture, options, &mut refuse);
        markers.sort_unstable_by(|a, b| b.centroid.score.total_cmp(&a.centroid.score).then(a.number.cmp(&b.number)));
        // A crowd is texture or noise; to locate all of it exactly would be most of the cost.
        let is_crowd = markers.len() > options.max_centroids.min(CROWD);
        let located_count = if is_crowd { MAX_LOCATED_IN_A_CROWD } else { markers.len() };
        let (markers, extra) = markers.split_at(options.max_centroids.min(markers.len()));
        for extra in extra {
            refuse(Refused::of(&extra.centroid, Refusal::Crowded));
        }
        detection.centroids.reserve_exact(markers.len());
        for (index, Marker { centroid, moments, .. }) in markers.iter().enumerate() {
            let pixel = in_frame(region, centroid.pixel.x, centroid.pixel.y);
            let rough = Centroid { pixel, bounds: bounds_in_frame(region, centroid.bounds), ..*centroid };
            let seed = Seed { pixel, moments: *moments, sigma_px: centroid.sigma_px };
            let exact = match chroma {
                _ if index >= located_count => None,
                Some(_) => self.locator.locate(frame, &seed, chroma),
                None => self.locator.locate_light(frame, &seed),
            };
            match exact {
                // Two blobs may be parts of one thing, to which both lead.
                Some(found) if detection.centroids.iter().any(|other| is_one(&found, other)) => {}
                Some(Located { pixel, sigma_px, area_px }) => {
                    let exact = Centroid { pixel, sigma_px, area_px, ..rough };
                    detection.centroids.push(exact.within_bounds());
                }
                // Of so few pixels it is a marker only if they are those of a disc.
                None if rough.area_px < options.min_area_px => {
                    detection.refuse(Refused::of(&rough, Refusal::TooSmall));
                }
                None => detection.centroids.push(rough.within_bounds()),
            }
        }
        detection
    }

    /// What the blobs are located in.
    pub(super) const fn locator(&mut self) -> &mut Locator {
        &mut self.locator
    }
}

/// Whether what was located is what another is the centroid of: no two things lie within half of the radius of one.
fn is_one(found: &Located, other: &Centroid) -> bool {
    (found.pixel - other.pixel).norm_squared() < 0.25 * found.area_px / std::f64::consts::PI
}

/// More blobs than this are a crowd, even where the list would hold them.
const CROWD: usize = 64;

/// Where there are more blobs than the list holds, or a crowd, only so many, the best, are located exactly; the others stay as rough as their
/// deviations say.
const MAX_LOCATED_IN_A_CROWD: usize = 16;

/// The scores of a region.
struct Picture<'a> {
    pub score: &'a [u8],
    pub width: u32,
    pub height: u32,
    /// What coding has done to the colours.
    pub coding: Coding,
    /// Area of the whole frame, px.
    pub frame_area: f64,
}

impl Picture<'_> {
    const fn window(&self) -> Region {
        Region { x: 0, y: 0, width: self.width, height: self.height }
    }

    fn run(&self, run: &Run) -> &[u8] {
        let row = run.y as usize * self.width as usize;
        &self.score[row + run.start as usize..row + run.end as usize]
    }

    fn rows(&self, region: Region) -> impl Iterator<Item = (u32, &[u8])> {
        (region.y..region.y + region.height)
            .map(move |y| (y, self.run(&Run { y, start: region.x, end: region.x + region.width })))
    }

    /// `region` grown by `margin` on all sides, inside the picture.
    fn grown(&self, region: Region, margin: u32) -> Region {
        let (x, y) = (region.x.saturating_sub(margin), region.y.saturating_sub(margin));
        let right = (region.x + region.width + margin).min(self.width);
        let bottom = (region.y + region.height + margin).min(self.height);
        Region { x, y, width: right - x, height: bottom - y }
    }
}

enum Verdict {
    /// A centroid, and the second moments of its area, px^2.
    Marker(Centroid, Matrix2<f64>),
    /// Not as it is; parts of it may be.
    LookHigher(Refusal),
    Refused(Refusal),
}

/// Score of what surrounds a component, and of its top.
struct Heights {
    ground: f64,
    top: f64,
    /// Spread of the ground's scores: noise, and texture.
    noise: f64,
}

impl Heights {
    /// By what a blob must stand out.
    fn least(&self, options: &BlobOptions) -> f64 {
        options.min_contrast.max(MIN_SIGNAL * self.noise)
    }
}

/// What examination works with, and what it leaves.
#[derive(Default)]
struct Bench {
    /// What of a component is above a level.
    parts: Labeling,
    /// Of a marker, what is above half its height.
    core: Vec<Run>,
}

/// What a component of a level is.
fn examine(picture: &Picture<'_>, runs: &[Run], level: u8, options: &BlobOptions, bench: &mut Bench) -> Verdict {
    let Bench { parts, core } = bench;
    let whole = bounds(runs);
    let pixels = area(runs) as f64;
    if pixels > 2.0 * options.max_area_ratio * picture.frame_area {
        return Verdict::LookHigher(Refusal::TooLarge);
    }
    let heights = heights(picture, runs, whole);
    if heights.top - heights.ground < heights.least(options) {
        return Verdict::LookHigher(Refusal::LowContrast);
    }
    // The part above half height, or above the level, below which it may be one with what lies beside it. If there are several of weight, the
    // component is several things.
    #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "a mean of two scores")]
    let half = ((0.5 * (heights.ground + heights.top)).ceil() as u8).max(level);
    let parts_of = parts.of(picture.score, picture.width as usize, whole, half, Connectivity::Eight);
    let own = parts_of.iter().filter(|part| holds(runs, part));
    if are_several(own.clone().map(area)) {
        return Verdict::LookHigher(Refusal::Ragged);
    }
    let Some(largest) = own.max_by_key(|part| area(part)) else {
        return Verdict::LookHigher(Refusal::LowContrast);
    };
    core.clear();
    core.extend_from_slice(largest);
    let shape = Shape::of(core);
    match shape.refusal(picture, options) {
        Some(reason @ (Refusal::TooSmall | Refusal::AtBorder)) => Verdict::Refused(reason),
        Some(reason) => Verdict::LookHigher(reason),
        None if comes_apart(picture, &shape, half, &heights, options, parts) => Verdict::LookHigher(Refusal::Ragged),
        None => Verdict::Marker(shape.centroid(picture, runs, &heights), shape.moments),
    }
}

/// Whether what beside the largest has weight.
fn are_several(areas: impl Iterator<Item = usize>) -> bool {
    let (sum, largest) = areas.fold((0, 0), |(sum, largest), area| (sum + area, largest.max(area)));
    (sum - largest) * 4 > largest
}

/// Whether what is one above half its height is several blobs further up, each of which stands out from what joins them: lights whose glows
/// flow together are parted only near their peaks.
fn comes_apart(
    picture: &Picture<'_>,
    shape: &Shape<'_>,
    half: u8,
    heights: &Heights,
    options: &BlobOptions,
    parts: &mut Labeling,
) -> bool {
    let least = heights.least(options);
    let rise = heights.top - f64::from(half);
    LEVELS_ABOVE_HALF.iter().map(|share| f64::from(half) + share * rise).any(|level| {
        if level + least > heights.top {
            return false;
        }
        #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "between two scores")]
        let threshold = level.ceil() as u8;
        let parts = parts.of(picture.score, picture.width as usize, shape.bounds, threshold, Connectivity::Eight);
        if parts.len() < 2 {
            return false;
        }
        let is_blob = |part: &&[Run]| {
            holds(shape.core, part)
                && f64::from(peak(picture, part)) >= level + least
                && Shape::of(part).refusal(picture, options).is_none()
        };
        are_several(parts.iter().filter(is_blob).map(area))
    })
}

/// Where between half its height and its top a blob may come apart.
const LEVELS_ABOVE_HALF: [f64; 3] = [0.25, 0.5, 0.75];

fn peak(picture: &Picture<'_>, runs: &[Run]) -> u8 {
    runs.iter().flat_map(|run| picture.run(run)).copied().max().unwrap_or(0)
}

/// Deviations of the ground's noise by which a blob must stand out: the highest that chance lifts one of a frame's 230,000 colour
/// samples is `sqrt(2 ln 230,000)`.
const MIN_SIGNAL: f64 = 5.0;

/// The ground is the median of a frame of pixels around the bounds, the top the mean of the component's upper quarter.
fn heights(picture: &Picture<'_>, runs: &[Run], whole: Region) -> Heights {
    let margin = 2 + (whole.width.max(whole.height)) / 4;
    let around = picture.grown(picture.grown(whole, 1), margin);
    let inner = picture.grown(whole, 1);
    let beside = picture.rows(around).flat_map(|(y, row)| {
        let is_beside = y < inner.y || y >= inner.y + inner.height;
        let (left, right) = row.split_at((inner.x - around.x) as usize);
        let skipped = if is_beside { 0 } else { inner.width as usize };
        left.iter().chain(&right[skipped..])
    });
    let ground = histogram(beside.copied());
    let inside = histogram(runs.iter().flat_map(|run| picture.run(run)).copied());
    let top = mean_from(&inside, area(runs) * 3 / 4);
    let count = around.area() - inner.area();
    if count == 0 {
        return Heights { ground: 0.0, top, noise: 0.0 };
    }
    let median = level_at(&ground, count / 2);
    let noise = 1.4826 * distance_at(&ground, median, count / 2) as f64;
    Heights { ground: median as f64, top, noise }
}

/// The part above half height, and the moments of its outline.
struct Shape<'a> {
    core: &'a [Run],
    bounds: Region,
    /// Area, px.
    area: f64,
    /// Second moments, px^2.
    moments: Matrix2<f64>,
    /// Root mean square extents of the outline, the longer first, px.
    extents: [f64; 2],
}

impl<'a> Shape<'a> {
    fn of(core: &'a [Run]) -> Self {
        let (mean_x, mean_y) = mean_position(core);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for run in core {
            let length = f64::from(run.end - run.start);
            let x = 0.5 * f64::from(run.start + run.end - 1) - mean_x;
            let y = f64::from(run.y) - mean_y;
            // A run of whole pixels has the variance of a stretch of its length.
            xx += length * (x * x + length * length / 12.0);
            xy += length * x * y;
            yy += length * (y * y + 1.0 / 12.0);
        }
        let area = area(core) as f64;
        let (half_trace, half_gap) = (0.5 * (xx + yy) / area, (0.5 * (xx - yy)).hypot(xy) / area);
        let extents = [half_trace + half_gap, half_trace - half_gap].map(|v| v.max(0.0).sqrt());
        Self { core, bounds: bounds(core), area, moments: Matrix2::new(xx, xy, xy, yy) / area, extents }
    }

    /// Area over that of the ellipse of the same moments: `4 pi` times the product of the extents.
    fn fill(&self) -> f64 {
        self.area / (4.0 * std::f64::consts::PI * self.extents[0] * self.extents[1]).max(1e-9)
    }

    fn refusal(&self, picture: &Picture<'_>, options: &BlobOptions) -> Option<Refusal> {
        let (left, top) = (self.bounds.x, self.bounds.y);
        let (right, bottom) = (left + self.bounds.width, top + self.bounds.height);
        if self.area < least_area_px(picture.coding, options) || (self.core.len() < 2 && options.min_area_px > 1.0) {
            Some(Refusal::TooSmall)
        } else if self.area > options.max_area_ratio * picture.frame_area {
            Some(Refusal::TooLarge)
        } else if left == 0 || top == 0 || right == picture.width || bottom == picture.height {
            Some(Refusal::AtBorder)
        } else if self.extents[0] > options.max_elongation * self.extents[1] {
            Some(Refusal::Elongated)
        } else if self.fill() < options.min_fill && self.area > SMALL_AREA {
            Some(Refusal::Ragged)
        } else {
            None
        }
    }

    /// The mean position of what of its component lies around the core, each pixel weighted by how far it stands out. What is not of the
    /// component may be of a neighbour.
    fn centroid(&self, picture: &Picture<'_>, runs: &[Run], heights: &Heights) -> Centroid {
        // Blur spreads a marker beyond its half height by a pixel or two, more where colour is sampled coarsely.
        let window = picture.grown(self.bounds, if picture.coding.chroma.is_reduced() { 3 } else { 2 });
        let origin = Vector2::new(f64::from(window.x), f64::from(window.y));
        let height = heights.top - heights.ground;
        let (mut sum, mut moment) = (0.0, Vector2::zeros());
        for run in runs.iter().filter_map(|run| run.within(window)) {
            for (x, score) in (run.start..).zip(picture.run(&run)) {
                let weight = ((f64::from(*score) - heights.ground) / height).clamp(0.0, 1.0);
                if weight > WEIGHT_FLOOR {
                    sum += weight;
                    moment += (Vector2::new(f64::from(x), f64::from(run.y)) - origin) * weight;
                }
            }
        }
        // Noise of the scores, white over the blob, moves the mean of a disc of any size alike: by 1 / (2 sqrt(pi)) of noise
        // over height, and twice that where four pixels share a sample. Coding's share of the noise is fitted to frames
        // with truth; the floor is what the shape of blur and sampling leave.
        let share = if picture.coding.chroma.is_reduced() { 2.0 } else { 1.0 };
        let noise = heights.noise.hypot(CODING_NOISE * picture.coding.chroma_step);
        let random = share * 0.5 * std::f64::consts::FRAC_1_PI.sqrt() * noise / height;
        let radius = (self.area / std::f64::consts::PI).sqrt();
        let floor = FLOOR_SIGMA_PX.hypot(SAMPLING_SIGMA_PX / radius);
        let clarity = height / (height + 20.0 + 4.0 * heights.noise);
        Centroid {
            pixel: origin + moment / sum,
            sigma_px: random.hypot(share * floor),
            area_px: self.area,
            bounds: self.bounds,
            score: clarity * self.fill().clamp(0.0, 1.0),
            class: None,
            track_id: None,
        }
    }
}

/// Area of the core, px, of which it may be a marker of the smallest area: half of that, where every pixel has a colour of its own. The core
/// is what stands out by more than half, and a lens leaves that of few pixels of a disc of 1 px radius.
fn least_area_px(coding: Coding, options: &BlobOptions) -> f64 {
    let is_whole = coding.chroma == ChromaSampling::Full && coding.chroma_step <= 1.0;
    if is_whole { 0.5 * options.min_area_px } else { options.min_area_px }
}

/// Noise of a score for each unit of the chroma's quantization step.
const CODING_NOISE: f64 = 1.0;

/// Standard deviation that remains without noise at the full rate of sampling, px: of any blob, and of one of radius 1 px,
/// whose outline meets few samples.
const FLOOR_SIGMA_PX: f64 = 0.01;
const SAMPLING_SIGMA_PX: f64 = 0.18;

/// Weights below this are noise, which would pull the centroid towards the middle of the window.
const WEIGHT_FLOOR: f64 = 0.1;

/// Below this area, px, blur rounds every outline and the fill says nothing.
const SMALL_AREA: f64 = 30.0;

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::detect::{ColorOptions, color, spans};
    use crate::frame::Pixels;
    use crate::random;

    #[test]
    fn a_centroid_lies_on_its_own_pixels_however_large_the_noise() {
        let mut rng = random::named("discs in noise");
        let mut found = 0;
        for index in 0..60_u32 {
            let [u, v] = [0.37, 0.71].map(|step| 24.0 + (step * f64::from(index)).fract());
            let samples = (0..48 * 48_u32).flat_map(|at| {
                let away = (f64::from(at % 48) - u).hypot(f64::from(at / 48) - v);
                let share = (2.2 - away).clamp(0.0, 1.0);
                let mut code = |ground: f64, marker: f64| {
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a colour")]
                    let code = (ground + share * (marker - ground) + 16.0 * noise).round().clamp(0.0, 255.0) as u8;
                    code
                };
                [code(120.0, 190.0), code(124.0, 60.0), code(128.0, 60.0)]
            });
            let frame = Frame::checked(48, 48, Pixels::Rgb(samples.collect()), Coding::LOSSLESS).expect("a frame");
            for centroid in color::Finder::default().detect(&frame, frame.full(), &ColorOptions::default()).centroids {
                assert!(spans(centroid.bounds, &centroid.pixel), "{index}: {centroid:?}");
                found += 1;
            }
        }
        assert!(found > 30, "{found}");
    }
}
