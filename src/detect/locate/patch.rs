//! The samples around a blob's rim, sector by sector.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x8};
use nalgebra::{Matrix2, Vector2};

use super::border::{Border, Finder};
use super::lanes::{LANES, Lanes};
use super::pass::{Light, Model};
use super::reader::Reader;
use super::rim::{GROUPS, SECTORS, seat};
use super::{Likeness, MAX_REACH_PX, Seed};
use crate::detect::ground::{Sample, median, middle, shortest_half, slope};
use crate::detect::{MACHINE, single};
use crate::frame::{ChromaSampling, Frame, Siting};

/// Eight samples of one channel: in a channel's groups one of each of eight sectors.
#[derive(Clone, Copy)]
pub(super) struct Octet {
    /// From the patch's origin, px.
    pub x: Lanes,
    pub y: Lanes,
    pub value: Lanes,
    /// 1 for a sample, 0 where the sector has no more.
    pub there: Lanes,
    /// The same for samples that are not of something else.
    pub free: Lanes,
}

/// The samples of one channel: each lane of a group is a sector, so that what a pass sums stays in its lane.
pub(super) struct Channel<'a> {
    groups: &'a mut [Vec<Octet>; GROUPS],
    /// Medians within the rim and beyond it.
    pub inside: f64,
    pub outside: f64,
    /// Noise of a sample beyond the rim.
    pub noise: f64,
}

pub(super) struct Patch<'a> {
    /// Whole pixel that positions are measured from.
    pub origin: Vector2<f64>,
    /// No sample is farther from it in x or y, px.
    pub reach: usize,
    pub luma: Channel<'a>,
    /// Where another ground begins.
    pub border: Option<Border>,
    /// Along the marker's hue; none for a frame without colour, or a marker without a hue.
    pub chroma: Option<Channel<'a>>,
    /// Variance of the blur by which chroma is softer than luma, px^2.
    pub chroma_blur: f64,
    /// What a sample of chroma counts.
    pub chroma_weight: f64,
    /// What a mosaic hides of a small disc between its pixels: px times the disc's area.
    pub mosaic_px3: f64,
    /// What no number of pixels improves, px.
    pub floor_px: f64,
    /// Quantization steps of luma and chroma; 0 where nothing was quantized but single samples.
    steps: [f64; 2],
    /// Deviations of luma and chroma that coding leaves, also where it leaves the ground flat.
    pub luma_coding_noise: f64,
    pub chroma_coding_noise: f64,
}

/// How far from the rim pixels are looked at, px. What is within belongs to the marker; outwards other things begin.
const INWARDS_PX: f32 = 6.0;
const OUTWARDS_PX: f32 = 3.5;

/// As far within the rim it is the disc that is seen, however blurred, px.
const DEEP_PX: f32 = 4.0;

/// What is this near to the rim of another, and nearer than to the own, belongs to the other, px.
const OTHERS_PX: f32 = 3.0;

/// Where four pixels share a sample of chroma, one of them is looked at. The variance of that blur, px^2, and what the sample
/// counts: more than once, as its noise is not the limit.
const SHARED_BLUR: f64 = 1.5;
const SHARED_WEIGHT: f64 = 2.2;

/// What is added to that where the samples lie between columns, or rows, px^2.
const BETWEEN_BLUR: f64 = 0.15;

/// Where colours were filled in from a mosaic and coded at half the rate, what luma alone is bent by, px.
const MOSAIC_SIGMA_PX: f64 = 0.04;

/// The same of a small coloured disc: px times its area.
const MOSAIC_PX3: f64 = 0.6;

/// Deviation of a channel for each unit of its quantization step.
const CODING_NOISE: f64 = 0.3;

/// What coding's noise counts more than its variance, and what it takes of a disc of a square pixel that is one step high, px. Both are
/// fitted to rendered discs of all hues and qualities from 50 to 95, and to the markers of whole frames.
const CODED_TOGETHER: f64 = 1.4;
const LOST_BY_CODING: f64 = 6.5;

/// Steps of height below which there is nothing that could be drawn worse.
const LEAST_CLARITY: f64 = 0.3;

/// Where a sample lies.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Inside,
    /// Within the rim, but not in the middle.
    Deep,
    Rim,
    Outside,
}

/// Samples of a channel as they come, patch after patch in the same memory.
#[derive(Default)]
struct Gathered {
    groups: [Vec<Octet>; GROUPS],
    /// Samples of each sector so far.
    counts: [usize; SECTORS],
    inside: Vec<f32>,
    /// Where there is no middle, if that is looked for.
    deep: Vec<f32>,
    is_large: bool,
    outside: Vec<Sample>,
    /// Values of those, or what is left of them.
    values: Vec<f32>,
}

impl Gathered {
    fn begin(&mut self, capacity: usize, is_large: bool) {
        for group in &mut self.groups {
            group.clear();
            group.reserve(capacity);
        }
        self.counts.fill(0);
        self.inside.clear();
        self.inside.reserve(4 * capacity);
        self.deep.clear();
        self.is_large = is_large;
        self.outside.clear();
        self.outside.reserve(8 * capacity);
    }

    fn push(&mut self, sector: usize, side: Side, sample: Sample) {
        let (group, lane) = seat(sector);
        let (octets, at) = (&mut self.groups[group], self.counts[sector]);
        if at == octets.len() {
            octets.push(Octet::EMPTY);
        }
        octets[at].put(lane, &sample);
        self.counts[sector] += 1;
        match side {
            Side::Inside => self.inside.push(sample.value),
            Side::Deep if self.is_large => self.deep.push(sample.value),
            Side::Outside => self.outside.push(sample),
            Side::Deep | Side::Rim => (),
        }
    }

    /// Levels the ground: a sky's hue changes with height and at clouds, and would pull the rim to where it is more like the
    /// marker's. Waves that coding has left of the marker itself would look like slopes.
    fn level(&mut self) {
        let Some(slope) = slope(&self.outside, &mut self.values) else { return };
        let (right, down) = (single(slope.x), single(slope.y));
        for sample in &mut self.outside {
            sample.value -= right * sample.x + down * sample.y;
        }
        for octet in self.groups.iter_mut().flatten() {
            for lane in 0..LANES {
                octet.value.0[lane] -= right * octet.x.0[lane] + down * octet.y.0[lane];
            }
        }
    }

    /// The channel, and what of it is beyond the rim. `None` if there is nothing within the rim or beyond it.
    fn channel(&mut self, amid_others: bool) -> Option<(Channel<'_>, &[Sample])> {
        let inside = median(&mut self.inside).or_else(|| median(&mut self.deep))?;
        let ground = if amid_others { shortest_half } else { middle };
        self.values.clear();
        self.values.extend(self.outside.iter().map(|sample| sample.value));
        let (outside, noise) = ground(&mut self.values)?;
        let [inside, outside, noise] = [inside, outside, noise].map(f64::from);
        Some((Channel { groups: &mut self.groups, inside, outside, noise }, &self.outside))
    }
}

impl Channel<'_> {
    /// Group by group.
    pub(super) fn octets(&self) -> impl Iterator<Item = &Octet> {
        self.groups.iter().flatten()
    }

    pub(super) fn octets_mut(&mut self) -> impl Iterator<Item = &mut Octet> {
        self.groups.iter_mut().flatten()
    }

    /// The octets of a group.
    pub(super) fn group(&self, index: usize) -> &[Octet] {
        &self.groups[index]
    }
}

/// Gathers patches, one after the other in the same memory.
#[derive(Default)]
pub(super) struct Gatherer {
    luma: Gathered,
    colour: Gathered,
    borders: Finder,
    row: Vec<Spots>,
    /// Middles of others, from the patch's origin, px, and the matrices of their ellipses.
    others: Vec<(Vector2<f64>, Matrix2<f64>)>,
}

impl Gatherer {
    /// `None` where the frame ends too near, or the blob is larger than [`MAX_REACH_PX`].
    pub(super) fn around(
        &mut self,
        frame: &Frame,
        seed: &Seed,
        others: &[Seed],
        chroma: Option<Vector2<f64>>,
        likeness: &Likeness,
    ) -> Option<Patch<'_>> {
        let matrix = &seed.form()?;
        let origin = seed.pixel.map(f64::round);
        // An ellipse's half axes are twice its root mean square extents.
        let reach = seed.moments.diagonal().map(|v| (2.0 * v.max(0.1).sqrt() + f64::from(OUTWARDS_PX)).ceil());
        let far = Vector2::new(f64::from(frame.width()), f64::from(frame.height())) - reach;
        let near = origin - reach;
        if !(near.min() >= 0.0 && origin.x < far.x && origin.y < far.y && reach.max() < f64::from(MAX_REACH_PX)) {
            return None;
        }
        let Self { luma, colour, borders, row, others: around } = self;
        around.clear();
        around.extend(others.iter().filter_map(|other| Some((other.pixel - origin, other.form()?))));
        let reader = Reader::of(frame, chroma);
        let siting = match frame.coding().chroma {
            ChromaSampling::Full => None,
            ChromaSampling::Reduced(siting) => Some(siting),
        };
        let shared = siting.is_some();
        let coded = frame.coding().chroma_step > 1.0;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the frame, as was checked")]
        let [left, top, right, bottom] =
            [origin.x - reach.x, origin.y - reach.y, origin.x + reach.x, origin.y + reach.y].map(|edge| edge as usize);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
        let whole_reach = reach.max() as usize;
        let capacity = 2 + 2 * (right - left + 1) * (bottom - top + 1) / SECTORS;
        luma.begin(capacity, likeness.large);
        let mut colour = reader.direction.map(|_| colour);
        if let Some(colour) = &mut colour {
            colour.begin(if shared { capacity / 4 } else { capacity }, likeness.large);
        }
        row.resize((right - left + 1).div_ceil(LANES), Spots::EMPTY);
        for y in top..=bottom {
            look(row, Vector2::new(left as f64, y as f64) - seed.pixel, matrix);
            for x in left..=right {
                let (spots, lane) = (&row[(x - left) / LANES], (x - left) % LANES);
                let from_rim = spots.from_rim.0[lane];
                if !(-INWARDS_PX..OUTWARDS_PX).contains(&from_rim) {
                    continue;
                }
                let at = Vector2::new(x as f64, y as f64) - origin;
                let is_theirs = |(middle, matrix): &(Vector2<f64>, Matrix2<f64>)| {
                    self::from_rim(&(at - middle), matrix) < f64::from(from_rim.min(OTHERS_PX))
                };
                if from_rim > 0.0 && around.iter().any(is_theirs) {
                    continue;
                }
                let side = match () {
                    () if spots.squared.0[lane] < 0.6 => Side::Inside,
                    () if from_rim < -DEEP_PX => Side::Deep,
                    () if from_rim > 1.5 => Side::Outside,
                    () => Side::Rim,
                };
                let sample = |value| Sample { x: single(at.x), y: single(at.y), value };
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a sector's number")]
                let sector = spots.sector.0[lane] as usize;
                luma.push(sector, side, sample(reader.luma(x, y)));
                if let (Some(colour), Some(direction)) = (&mut colour, &reader.direction)
                    && !(shared && (x % 2 == 1 || y % 2 == 1))
                {
                    let (off, value) = siting.map_or_else(
                        || (Vector2::zeros(), reader.chroma(x, y, direction)),
                        |siting| reader.shared_chroma(x, y, direction, siting),
                    );
                    let at = at + off;
                    colour.push(sector, side, Sample { x: single(at.x), y: single(at.y), value });
                }
            }
        }
        if let (Some(colour), false) = (&mut colour, coded) {
            colour.level();
        }
        let (mut luma, beyond) = luma.channel(likeness.amid_others)?;
        let luma_coding_noise = CODING_NOISE * frame.coding().luma_step;
        // Of what is small a border is seen from too few places to tell where it is.
        let is_small =
            seed.moments.determinant().max(0.0).sqrt() * 4.0 * std::f64::consts::PI < likeness.sectored_area_px;
        let looks = likeness.amid_others && !is_small;
        let border = if looks { borders.find(beyond, luma_coding_noise) } else { None };
        if let Some((_, ground)) = border {
            luma.outside = ground;
        }
        Some(Patch {
            origin,
            reach: whole_reach,
            luma,
            border: border.map(|(border, _)| border),
            chroma: colour.and_then(|colour| colour.channel(likeness.amid_others)).map(|(channel, _)| channel),
            chroma_blur: siting.map_or(0.0, blur_of),
            chroma_weight: if shared { SHARED_WEIGHT } else { 1.0 },
            mosaic_px3: if shared && reader.direction.is_some() { MOSAIC_PX3 } else { 0.0 },
            floor_px: if shared && reader.direction.is_none() { MOSAIC_SIGMA_PX } else { 0.0 },
            steps: [frame.coding().luma_step, frame.coding().chroma_step]
                .map(|step| if step > 1.0 { step } else { 0.0 }),
            luma_coding_noise,
            chroma_coding_noise: CODING_NOISE * frame.coding().chroma_step,
        })
    }
}

impl Patch<'_> {
    /// By how much errors of neighbouring pixels that are the same add to the variance of a place, as a factor: those of coding are of whole
    /// waves, those of a sensor each pixel's own.
    pub(super) fn together(&self, model: &Model) -> f64 {
        let coding = CODING_NOISE * self.steps[0];
        1.0 + CODED_TOGETHER * (coding / model.noise.luma.max(1e-9)).powi(2).min(1.0)
    }

    /// Opposite sides may agree by chance, the less so the worse the rim as a whole fits; this part of its misfit's variance counts at
    /// least. Coding's waves are wider than a marker, and what they do to both of its sides alike is not all that they do.
    pub(super) fn least_unevenness(&self) -> f64 {
        if self.steps[0] > 0.0 { 0.4 } else { 0.25 }
    }

    /// What coding takes of a small disc, px: waves that are lower than half a step are dropped, and they are what it is drawn by.
    pub(super) fn lost_px(&self, light: &Light, area_px: f64) -> f64 {
        let [luma, chroma] = self.steps;
        if luma == 0.0 && chroma == 0.0 {
            return 0.0;
        }
        // Heights in steps.
        let clarity = (light.luma.x / luma.max(1.0)).hypot(light.chroma.x / chroma.max(1.0));
        LOST_BY_CODING / (clarity.max(LEAST_CLARITY) * area_px.max(1.0).powf(0.75))
    }
}

/// Variance of the blur of what is sampled like that, px^2.
fn blur_of(siting: Siting) -> f64 {
    let axes = [siting.between_columns, siting.between_rows].into_iter().filter(|is_between| *is_between).count();
    SHARED_BLUR + BETWEEN_BLUR * axes as f64
}

impl Seed {
    /// The matrix of its ellipse: second moments are a quarter of the squared half axes; of a pixel they are a twelfth.
    pub(super) fn form(&self) -> Option<Matrix2<f64>> {
        ((self.moments + Matrix2::identity() / 12.0) * 4.0).try_inverse()
    }
}

/// Where eight pixels of a row lie against an ellipse.
#[derive(Clone, Copy)]
struct Spots {
    /// The square of the way from its middle, in its half axes.
    squared: Lanes,
    /// How far beyond its rim, px.
    from_rim: Lanes,
    /// The sector of the direction from its middle, a whole number.
    sector: Lanes,
}

impl Spots {
    const EMPTY: Self = Self { squared: Lanes::ZERO, from_rim: Lanes::ZERO, sector: Lanes::ZERO };
}

/// The pixels of a row of which the first lies `start` from the ellipse's middle.
fn look(row: &mut [Spots], start: Vector2<f64>, matrix: &Matrix2<f64>) {
    dispatch!(*MACHINE, simd => look_by(simd, row, start, matrix));
}

#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn look_by<S: Simd>(simd: S, row: &mut [Spots], start: Vector2<f64>, matrix: &Matrix2<f64>) {
    let [m11, m12, m22] = [matrix.m11, matrix.m12, matrix.m22].map(single);
    let y = f32x8::splat(simd, single(start.y));
    let mut x = f32x8::from_fn(simd, |lane| single(start.x) + lane as f32);
    for spots in row {
        let (gx, gy) = (x * m11 + y * m12, x * m12 + y * m22);
        let squared = x * gx + y * gy;
        let from_rim = (squared - 1.0) / ((gx * gx + gy * gy).sqrt() * 2.0).max(1e-9);
        // Sectors are even along a square, not along a circle, which saves an arc tangent a pixel.
        let along = x / (x.abs() + y.abs()).max(1e-12);
        let turn = y.simd_lt(0.0).select(along + 1.0, -along + 3.0);
        let sector = (turn * (SECTORS as f32 / 4.0)).floor().min(SECTORS as f32 - 1.0);
        *spots = Spots { squared: Lanes(*squared), from_rim: Lanes(*from_rim), sector: Lanes(*sector) };
        x += LANES as f32;
    }
}

/// How far beyond the rim of an ellipse a way from its middle leads, px.
fn from_rim(q: &Vector2<f64>, matrix: &Matrix2<f64>) -> f64 {
    let g = matrix * q;
    (q.dot(&g) - 1.0) / (2.0 * g.norm()).max(1e-9)
}

impl Octet {
    /// The lanes that hold a sample.
    pub(super) fn lanes(&self) -> impl Iterator<Item = usize> + use<> {
        let there = self.there;
        (0..LANES).filter(move |lane| there.0[*lane] > 0.0)
    }

    const EMPTY: Self =
        Self { x: Lanes::ZERO, y: Lanes::ZERO, value: Lanes::ZERO, there: Lanes::ZERO, free: Lanes::ZERO };

    /// A sample for each lane; those that are too few leave the last lanes empty.
    pub(super) fn of(samples: &[Sample]) -> Self {
        let mut octet = Self::EMPTY;
        samples.iter().enumerate().for_each(|(lane, sample)| octet.put(lane, sample));
        octet
    }

    fn put(&mut self, lane: usize, sample: &Sample) {
        (self.x.0[lane], self.y.0[lane], self.value.0[lane]) = (sample.x, sample.y, sample.value);
        (self.there.0[lane], self.free.0[lane]) = (1.0, 1.0);
    }
}
