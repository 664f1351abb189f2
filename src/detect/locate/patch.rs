//! The samples around a blob's rim, sector by sector.

use nalgebra::{Matrix2, Vector2};

use super::Seed;
use super::lanes::{LANES, Lanes};
use super::rim::SECTORS;
use crate::frame::{ChromaSampling, Frame, Pixels};

/// Eight pixels of one sector.
#[derive(Clone, Copy)]
pub(super) struct Octet {
    /// From the patch's origin, px.
    pub x: Lanes,
    pub y: Lanes,
    pub luma: Lanes,
    /// Along the marker's hue.
    pub chroma: Lanes,
    /// 1 for a pixel, 0 for a lane that is left over.
    pub there: Lanes,
}

pub(super) struct Patch {
    /// Whole pixel that positions are measured from.
    pub origin: Vector2<f64>,
    /// Sector after sector.
    pub octets: Vec<Octet>,
    /// Where each sector begins in `octets`, and the end of the last.
    pub starts: [usize; SECTORS + 1],
    pub has_chroma: bool,
    /// Variance of the blur by which chroma is softer than luma, px^2.
    pub chroma_blur: f64,
    /// The part of a pixel's chroma that is its own.
    pub chroma_share: f64,
    /// Least deviation of chroma that coding leaves.
    pub min_chroma_noise: f64,
    /// Medians within the rim and beyond it.
    pub inside: Levels,
    pub outside: Levels,
    /// Noise of a pixel beyond the rim, of luma and of chroma.
    pub noise: [f64; 2],
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Levels {
    pub luma: f64,
    pub chroma: f64,
}

/// How far from the rim pixels are looked at, px. What is within belongs to the marker; outwards other things begin.
const INWARDS_PX: f64 = 6.0;
const OUTWARDS_PX: f64 = 3.5;

/// Where four pixels share a sample of chroma: the variance of that blur, px^2, and the part of a pixel's chroma that is its
/// own. That is more than a quarter, as the noise is not the limit.
const SHARED_BLUR: f64 = 1.5;
const OWN_SHARE: f64 = 0.4;

/// Deviation of chroma for each unit of its quantization step.
const CODING_NOISE: f64 = 0.3;

#[derive(Clone, Copy)]
struct Sample {
    x: f32,
    y: f32,
    luma: f32,
    chroma: f32,
}

impl Patch {
    /// `None` where the frame ends too near, or the blob is larger than [`MAX_REACH_PX`].
    pub(super) fn around(frame: &Frame, seed: &Seed, chroma: Option<Vector2<f64>>, matrix: &Matrix2<f64>) -> Option<Self> {
        let origin = seed.pixel.map(f64::round);
        // An ellipse's half axes are twice its root mean square extents.
        let reach = seed.moments.diagonal().map(|v| (2.0 * v.max(0.1).sqrt() + OUTWARDS_PX).ceil());
        let far = Vector2::new(f64::from(frame.width()), f64::from(frame.height())) - reach;
        let near = origin - reach;
        if !(near.min() >= 0.0 && origin.x < far.x && origin.y < far.y && reach.max() < MAX_REACH_PX) {
            return None;
        }
        let direction = chroma.unwrap_or_else(Vector2::zeros);
        let centre = seed.pixel - origin;
        let mut sectors: [Vec<Sample>; SECTORS] = std::array::from_fn(|_| Vec::new());
        let (mut inner, mut outer) = (Vec::new(), Vec::new());
        let reader = Reader { frame, direction };
        for y in -(reach.y as i32)..=reach.y as i32 {
            for x in -(reach.x as i32)..=reach.x as i32 {
                let q = Vector2::new(f64::from(x), f64::from(y)) - centre;
                let g = matrix * q;
                let from_rim = (q.dot(&g) - 1.0) / (2.0 * g.norm()).max(1e-9);
                if !(-INWARDS_PX..OUTWARDS_PX).contains(&from_rim) {
                    continue;
                }
                let (luma, chroma) = reader.at((origin.x as i32 + x) as usize, (origin.y as i32 + y) as usize);
                let sample = Sample { x: x as f32, y: y as f32, luma, chroma };
                sectors[sector(&q)].push(sample);
                if q.dot(&g) < 0.6 {
                    inner.push(sample);
                } else if from_rim > 1.5 {
                    outer.push(sample);
                }
            }
        }
        let has_chroma = chroma.is_some() && !matches!(frame.pixels(), Pixels::Luma(_));
        let reduced = frame.coding().chroma == ChromaSampling::Reduced;
        let (inside, _) = levels(&inner)?;
        let (outside, noise) = levels(&outer)?;
        let mut octets = Vec::new();
        let mut starts = [0; SECTORS + 1];
        for (index, samples) in sectors.iter().enumerate() {
            octets.extend(samples.chunks(LANES).map(Octet::of));
            starts[index + 1] = octets.len();
        }
        Some(Self {
            origin,
            octets,
            starts,
            has_chroma,
            chroma_blur: if reduced { SHARED_BLUR } else { 0.0 },
            chroma_share: if reduced { OWN_SHARE } else { 1.0 },
            min_chroma_noise: CODING_NOISE * frame.coding().chroma_step,
            inside,
            outside,
            noise,
        })
    }
}

/// Half a side of the largest patch, px: beyond it a marker is as well known as it will be.
pub(super) const MAX_REACH_PX: f64 = 160.0;

fn sector(q: &Vector2<f64>) -> usize {
    let turn = q.y.atan2(q.x) / std::f64::consts::TAU + 0.5;
    ((turn * SECTORS as f64) as usize).min(SECTORS - 1)
}

impl Octet {
    fn of(samples: &[Sample]) -> Self {
        let of = |f: fn(&Sample) -> f32| Lanes(std::array::from_fn(|i| samples.get(i).map_or(0.0, f)));
        Self { x: of(|s| s.x), y: of(|s| s.y), luma: of(|s| s.luma), chroma: of(|s| s.chroma), there: of(|_| 1.0) }
    }
}

/// Medians, and the deviations from them.
fn levels(samples: &[Sample]) -> Option<(Levels, [f64; 2])> {
    let of = |f: fn(&Sample) -> f32| {
        let mut values: Vec<f32> = samples.iter().map(f).collect();
        let level = median(&mut values)?;
        let mut deviations: Vec<f32> = values.iter().map(|v| (v - level).abs()).collect();
        Some((f64::from(level), 1.4826 * f64::from(median(&mut deviations)?)))
    };
    let ((luma, luma_noise), (chroma, chroma_noise)) = (of(|s| s.luma)?, of(|s| s.chroma)?);
    Some((Levels { luma, chroma }, [luma_noise, chroma_noise]))
}

fn median(values: &mut [f32]) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

struct Reader<'a> {
    frame: &'a Frame,
    direction: Vector2<f64>,
}

impl Reader<'_> {
    fn at(&self, x: usize, y: usize) -> (f32, f32) {
        let index = y * self.frame.width() as usize + x;
        let (luma, cb, cr) = match self.frame.pixels() {
            Pixels::Luma(s) => return (f32::from(s[index]), 0.0),
            Pixels::YCbCr(s) => {
                let [y, cb, cr] = [s[3 * index], s[3 * index + 1], s[3 * index + 2]].map(f64::from);
                (y, cb - 128.0, cr - 128.0)
            }
            Pixels::Rgb(s) => {
                let [r, g, b] = [s[3 * index], s[3 * index + 1], s[3 * index + 2]].map(f64::from);
                let luma = 0.299 * r + 0.587 * g + 0.114 * b;
                (luma, (b - luma) / 1.772, (r - luma) / 1.402)
            }
        };
        (luma as f32, (cb * self.direction.x + cr * self.direction.y) as f32)
    }
}
