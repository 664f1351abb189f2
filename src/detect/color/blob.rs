//! One component: is it a marker, and where exactly?

use nalgebra::Vector2;

use super::ColorOptions;
use crate::detect::components::{Components, Connectivity, Run, area, bounds, mean_position};
use crate::detect::{Centroid, Refusal};
use crate::frame::{ChromaSampling, Coding, Region};

/// The scores of a region.
pub(super) struct Picture<'a> {
    pub score: &'a [u8],
    pub width: u32,
    pub height: u32,
    /// What coding has done to the colours.
    pub coding: Coding,
    /// Area of the whole frame, px.
    pub frame_area: f64,
}

impl Picture<'_> {
    pub(super) const fn window(&self) -> Region {
        Region { x: 0, y: 0, width: self.width, height: self.height }
    }

    pub(super) fn run(&self, run: &Run) -> &[u8] {
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

pub(super) enum Verdict {
    Marker(Centroid),
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

pub(super) fn examine(picture: &Picture<'_>, runs: &[Run], options: &ColorOptions) -> Verdict {
    let whole = bounds(runs);
    let pixels = area(runs) as f64;
    if pixels > 2.0 * options.max_area_ratio * picture.frame_area {
        return Verdict::LookHigher(Refusal::TooLarge);
    }
    let heights = heights(picture, runs, whole);
    if heights.top - heights.ground < options.min_contrast.max(3.0 * heights.noise) {
        return Verdict::LookHigher(Refusal::LowContrast);
    }
    // The part above half height. If there are several of weight, the component is several things.
    #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "a mean of two scores")]
    let half = (0.5 * (heights.ground + heights.top)).ceil().max(1.0) as u8;
    let parts = Components::of(picture.score, picture.width as usize, whole, half, Connectivity::Eight);
    let Some(core) = parts.iter().max_by_key(|part| area(part)) else {
        return Verdict::LookHigher(Refusal::LowContrast);
    };
    let others: usize = parts.iter().map(area).sum::<usize>() - area(core);
    if others * 4 > area(core) {
        return Verdict::LookHigher(Refusal::Ragged);
    }
    let shape = Shape::of(core);
    match shape.refusal(picture, options) {
        Some(reason @ (Refusal::TooSmall | Refusal::AtBorder)) => Verdict::Refused(reason),
        Some(reason) => Verdict::LookHigher(reason),
        None => Verdict::Marker(shape.centroid(picture, &heights)),
    }
}

/// The ground is the median of a frame of pixels around the bounds, the top the mean of the component's upper quarter.
fn heights(picture: &Picture<'_>, runs: &[Run], whole: Region) -> Heights {
    let margin = 2 + (whole.width.max(whole.height)) / 4;
    let around = picture.grown(picture.grown(whole, 1), margin);
    let inner = picture.grown(whole, 1);
    let mut ground: Vec<u8> = Vec::new();
    for (y, row) in picture.rows(around) {
        if y < inner.y || y >= inner.y + inner.height {
            ground.extend_from_slice(row);
        } else {
            let left = (inner.x - around.x) as usize;
            let right = left + inner.width as usize;
            ground.extend_from_slice(&row[..left]);
            ground.extend_from_slice(&row[right..]);
        }
    }
    let mut inside: Vec<u8> = runs.iter().flat_map(|run| picture.run(run)).copied().collect();
    inside.sort_unstable();
    let upper = &inside[inside.len() * 3 / 4..];
    let top = upper.iter().map(|s| f64::from(*s)).sum::<f64>() / upper.len().max(1) as f64;
    if ground.is_empty() {
        return Heights { ground: 0.0, top, noise: 0.0 };
    }
    let middle = ground.len() / 2;
    let (_, median, _) = ground.select_nth_unstable(middle);
    let median = *median;
    let mut deviations: Vec<u8> = ground.iter().map(|s| s.abs_diff(median)).collect();
    let (_, deviation, _) = deviations.select_nth_unstable(middle);
    Heights { ground: f64::from(median), top, noise: 1.4826 * f64::from(*deviation) }
}

/// The part above half height, and the moments of its outline.
struct Shape<'a> {
    core: &'a [Run],
    bounds: Region,
    /// Area, px.
    area: f64,
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
        Self { core, bounds: bounds(core), area, extents }
    }

    /// Area over that of the ellipse of the same moments: `4 pi` times the product of the extents.
    fn fill(&self) -> f64 {
        self.area / (4.0 * std::f64::consts::PI * self.extents[0] * self.extents[1]).max(1e-9)
    }

    fn refusal(&self, picture: &Picture<'_>, options: &ColorOptions) -> Option<Refusal> {
        let (left, top) = (self.bounds.x, self.bounds.y);
        let (right, bottom) = (left + self.bounds.width, top + self.bounds.height);
        if self.area < options.min_area_px || self.core.len() < 2 {
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

    /// The mean position around the core, each pixel weighted by how far it stands out.
    fn centroid(&self, picture: &Picture<'_>, heights: &Heights) -> Centroid {
        // Blur spreads a marker beyond its half height by a pixel or two, more where colour is sampled coarsely.
        let window = picture.grown(self.bounds, if picture.coding.chroma == ChromaSampling::Reduced { 3 } else { 2 });
        let origin = Vector2::new(f64::from(window.x), f64::from(window.y));
        let height = heights.top - heights.ground;
        let (mut sum, mut moment) = (0.0, Vector2::zeros());
        for (y, row) in picture.rows(window) {
            for (x, score) in (window.x..).zip(row) {
                let weight = ((f64::from(*score) - heights.ground) / height).clamp(0.0, 1.0);
                if weight > WEIGHT_FLOOR {
                    sum += weight;
                    moment += (Vector2::new(f64::from(x), f64::from(y)) - origin) * weight;
                }
            }
        }
        // Noise of the scores, white over the blob, moves the mean of a disc of any size alike: by 1 / (2 sqrt(pi)) of noise
        // over height, and twice that where four pixels share a sample. Coding's share of the noise is fitted to frames
        // with truth; the floor is what the shape of blur and sampling leave.
        let share = if picture.coding.chroma == ChromaSampling::Reduced { 2.0 } else { 1.0 };
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
