//! The score of every pixel: how far its chroma reaches into the marker's sector of hues.

use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use super::HueRange;
use crate::detect::bands::{PIXELS, SAMPLES, bands, each_block};
use crate::frame::{Frame, Pixels, Region};

/// Fills `scores` with those of the region's pixels, 0 to 255, rows without padding; `false` for a frame without colour.
///
/// The score is the smaller of two linear forms of the pixel's three samples. It saturates at chroma 255, which no colour
/// reaches.
pub(super) fn score(frame: &Frame, region: Region, hue: &HueRange, scores: &mut Vec<u8>) -> bool {
    let edges = hue.edges();
    let (samples, forms) = match frame.pixels() {
        Pixels::Luma(_) => return false,
        Pixels::YCbCr(samples) => (samples, edges.map(of_ycbcr)),
        Pixels::Rgb(samples) => (samples, edges.map(of_rgb)),
    };
    let scoring = Scoring::of(forms);
    let gate = match frame.pixels() {
        Pixels::YCbCr(_) => Gate::of(edges, scoring.bits),
        Pixels::Rgb(_) | Pixels::Luma(_) => None,
    };
    let width = region.width as usize;
    scores.resize(region.area(), 0);
    for (y, row) in (region.y..).zip(scores.chunks_exact_mut(width)) {
        let start = (y as usize * frame.width() as usize + region.x as usize) * 3;
        score_row(&samples[start..start + width * 3], scoring, gate.as_ref(), row);
    }
    true
}

/// The scores of a row. Compiled for wider registers too, and chosen when the program runs.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512vl+avx512vbmi",
    "x86_64+avx2",
    "x86_64+sse4.1+ssse3"
))]
fn score_row(samples: &[u8], scoring: Scoring, gate: Option<&Gate>, scores: &mut [u8]) {
    each_block(samples, scores, |block, out| {
        if gate.is_none_or(|gate| gate.lets_through(block)) {
            scoring.write(block, out);
        } else {
            out.fill(0);
        }
    });
}

/// `weights . samples + offset`.
struct Form {
    weights: Vector3<f64>,
    offset: f64,
}

fn of_ycbcr(edge: Vector2<f64>) -> Form {
    Form { weights: Vector3::new(0.0, edge.x, edge.y), offset: -128.0 * (edge.x + edge.y) }
}

fn of_rgb(edge: Vector2<f64>) -> Form {
    let chroma_of_rgb = Matrix2x3::new(-0.168_736, -0.331_264, 0.5, 0.5, -0.418_688, -0.081_312);
    Form { weights: chroma_of_rgb.tr_mul(&edge), offset: 0.0 }
}

/// What a block of Y, Cb, Cr must have in one of its pixels for any to score: chroma on the sector's side of gray, above 128 or below it in
/// one band. That is told without taking bands apart, and most of a sky has none.
struct Gate {
    /// Turns samples that are to be low into such that are to be high.
    flip: [u8; SAMPLES],
    /// Samples are to be above this; those of other bands never are.
    limit: [u8; SAMPLES],
}

impl Gate {
    /// `None` where the sector lies on no side of gray alone. Scores have so many fraction bits.
    fn of(edges: [Vector2<f64>; 2], bits: u32) -> Option<Self> {
        // A side that is a sum of both edges with no negative share is at least as high as their smaller product times the shares.
        let shares = |side: &Vector2<f64>| Matrix2::from_columns(&edges).try_inverse().map(|inverse| inverse * side);
        let sides = [Vector2::x(), -Vector2::x(), Vector2::y(), -Vector2::y()];
        let reached =
            |side: &Vector2<f64>| shares(side).filter(|shares| shares.min() >= 0.0).map(|shares| shares.sum());
        let best = sides.iter().filter_map(|side| Some((side, reached(side)?))).max_by(|a, b| a.1.total_cmp(&b.1));
        let (side, height) = best?;
        // A score of one may be half by rounding, and less by what products lose.
        let least = (height * (0.5 - 2.0 / f64::from(1 << bits))).ceil();
        let is_low = side.sum() < 0.0;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "near the middle of a byte")]
        let above = (if is_low { 126.0 } else { 127.0 } + least) as u8;
        let band = if side.x == 0.0 { 2 } else { 1 };
        let of_band = |inside: u8, outside: u8| std::array::from_fn(|i| if i % 3 == band { inside } else { outside });
        Some(Self { flip: of_band(if is_low { 255 } else { 0 }, 0), limit: of_band(above, 255) })
    }

    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
    #[inline(always)]
    fn lets_through(&self, block: &[u8; SAMPLES]) -> bool {
        let mut beyond = 0;
        for ((sample, flip), limit) in block.iter().zip(&self.flip).zip(&self.limit) {
            beyond |= (sample ^ flip).saturating_sub(*limit);
        }
        beyond != 0
    }
}

/// Both forms in 16 bits.
///
/// A sample less 128 and times 256 fills a signed 16-bit number; the upper half of its product with a weight of `8 + bits`
/// fraction bits has `bits` of them. Each product is cut off downwards, by half of its last bit on average.
#[derive(Clone, Copy)]
struct Scoring {
    forms: [Fixed; 2],
    /// Fraction bits of the products: six, or fewer where weights are large, for sectors of a few degrees.
    bits: u32,
}

#[derive(Clone, Copy)]
struct Fixed {
    weights: [i16; 3],
    offset: i16,
}

impl Scoring {
    const MOST_BITS: u32 = 6;

    #[expect(clippy::cast_possible_truncation, reason = "the number of bits is chosen so that weights and sums fit")]
    fn of(forms: [Form; 2]) -> Self {
        let largest = forms.iter().map(|form| form.weights.amax()).fold(0.0, f64::max);
        let fits = |bits: &u32| largest * f64::from(256 << bits) < f64::from(i16::MAX);
        let bits = (0..=Self::MOST_BITS).rev().find(fits).unwrap_or(0);
        let fixed = |form: Form| {
            let weights = [form.weights.x, form.weights.y, form.weights.z];
            let middle = form.offset + 128.0 * form.weights.sum();
            // Half a unit makes the final shift round to nearest; half a last bit for each product makes good what is cut off.
            let cut = 0.5 * weights.iter().filter(|weight| **weight != 0.0).count() as f64;
            Fixed {
                weights: weights.map(|weight| (weight * f64::from(256 << bits)).round() as i16),
                offset: ((middle + 0.5) * f64::from(1 << bits) + cut).round() as i16,
            }
        };
        Self { forms: forms.map(fixed), bits }
    }

    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
    #[inline(always)]
    fn write(self, block: &[u8; SAMPLES], out: &mut [u8; PIXELS]) {
        let [first, second, third] = bands(block);
        let [a, b] = self.forms;
        for i in 0..PIXELS {
            let [first, second, third] = [first[i], second[i], third[i]].map(centred);
            let of = |form: Fixed| {
                let sum = form.offset.saturating_add(high(second, form.weights[1]));
                sum.saturating_add(high(third, form.weights[2])).saturating_add(high(first, form.weights[0]))
            };
            #[expect(clippy::cast_sign_loss, reason = "clamped to 0..=255")]
            let score = (of(a).min(of(b)) >> self.bits).clamp(0, 255) as u8;
            out[i] = score;
        }
    }
}

/// A sample less 128 and times 256.
#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn centred(sample: u8) -> i16 {
    ((u16::from(sample) << 8) ^ 0x8000).cast_signed()
}

/// The upper half of a product.
#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
fn high(a: i16, b: i16) -> i16 {
    ((i32::from(a) * i32::from(b)) >> 16) as i16
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::{Coding, color::ycbcr_of_rgb};

    /// One pixel, the obvious way.
    fn slow_score(scoring: &Scoring, pixel: [u8; 3]) -> u8 {
        let sum = |form: &Fixed| {
            // In the order of the fast one, as sums that saturate depend on it.
            [1, 2, 0].into_iter().fold(i32::from(form.offset), |sum, band| {
                let product = (i32::from(pixel[band]) - 128) * 256 * i32::from(form.weights[band]);
                (sum + product.div_euclid(1 << 16)).clamp(i32::from(i16::MIN), i32::from(i16::MAX))
            })
        };
        let least = sum(&scoring.forms[0]).min(sum(&scoring.forms[1]));
        u8::try_from((least >> scoring.bits).clamp(0, 255)).expect("clamped")
    }

    fn exact_score(hue: &HueRange, rgb: [u8; 3]) -> f64 {
        let [r, g, b] = rgb.map(f64::from);
        let chroma = Vector2::new(-0.168_736 * r - 0.331_264 * g + 0.5 * b, 0.5 * r - 0.418_688 * g - 0.081_312 * b);
        hue.edges().iter().map(|e| e.dot(&chroma)).fold(f64::INFINITY, f64::min).clamp(0.0, 255.0)
    }

    proptest! {
        #[test]
        fn both_colour_spaces_score_alike_and_as_the_formula_says(
            pixels in proptest::collection::vec(any::<[u8; 3]>(), 1..100), centre_deg in 0.0..360.0, narrow in any::<bool>()
        ) {
            let frame = |pixels| {
                let samples = |p: &Pixels| match p { Pixels::Rgb(s) | Pixels::YCbCr(s) | Pixels::Luma(s) => s.len() / 3 };
                Frame::checked(u32::try_from(samples(&pixels)).expect("a row"), 1, pixels, Coding::LOSSLESS).expect("a row")
            };
            let rgb = frame(Pixels::Rgb(pixels.concat()));
            let native = frame(Pixels::YCbCr(pixels.iter().flat_map(|p| ycbcr_of_rgb(*p)).collect()));
            let half_width_deg = if narrow { 5.0 } else { HueRange::NAMED_HALF_WIDTH_DEG };
            let hue = HueRange { centre_deg, half_width_deg };
            let [a, b] = [&rgb, &native].map(|frame| {
                let mut scores = Vec::new();
                assert!(score(frame, frame.full(), &hue, &mut scores), "colour");
                scores
            });
            for ((a, b), rgb) in a.iter().zip(&b).zip(&pixels) {
                let exact = exact_score(&hue, *rgb);
                // Half for rounding, and what three products lose; in sectors of a few degrees weights are ten times larger.
                let most = if narrow { 1.2 } else { 0.6 };
                prop_assert!((f64::from(*a) - exact).abs() <= most, "{a} {exact}");
                // Chroma is rounded to whole numbers before the edges' weights.
                prop_assert!(a.abs_diff(*b) <= if narrow { 14 } else { 3 }, "{a} {b}");
            }
        }

        #[test]
        fn blocks_of_pixels_score_as_one_pixel_does(
            pixels in proptest::collection::vec(any::<[u8; 3]>(), 1..600), centre_deg in 0.0..360.0, half_width_deg in 1.0..60.0,
            is_rgb in any::<bool>(), pale in 0_u32..8
        ) {
            // Pale colours are those that hardly score.
            let paled = |sample: u8| 128_u8.wrapping_add_signed(sample.wrapping_sub(128).cast_signed() >> pale);
            let pixels: Vec<[u8; 3]> = pixels.into_iter().map(|pixel| pixel.map(paled)).collect();
            let edges = HueRange { centre_deg, half_width_deg }.edges();
            let scoring = Scoring::of(if is_rgb { edges.map(of_rgb) } else { edges.map(of_ycbcr) });
            let gate = Gate::of(edges, scoring.bits).filter(|_| !is_rgb);
            // Whatever stood there before.
            let mut scores = vec![9; pixels.len()];
            score_row(&pixels.concat(), scoring, gate.as_ref(), &mut scores);
            let slow: Vec<u8> = pixels.iter().map(|pixel| slow_score(&scoring, *pixel)).collect();
            prop_assert_eq!(scores, slow);
        }
    }
}
