//! The score of every pixel: how far its chroma reaches into the marker's sector of hues.

use nalgebra::{Matrix2x3, Vector2, Vector3};

use super::HueRange;
use crate::frame::{Frame, Pixels, Region};

/// Scores of the region's pixels, 0 to 255, rows without padding; `None` for a frame without colour.
///
/// The score is the smaller of two linear forms of the pixel's three samples. It saturates at chroma 255, which no colour
/// reaches.
pub(super) fn score(frame: &Frame, region: Region, hue: &HueRange) -> Option<Vec<u8>> {
    let edges = hue.edges();
    let (samples, forms) = match frame.pixels() {
        Pixels::Luma(_) => return None,
        Pixels::YCbCr(samples) => (samples, edges.map(of_ycbcr)),
        Pixels::Rgb(samples) => (samples, edges.map(of_rgb)),
    };
    let forms = forms.map(Form::quantized);
    let width = region.width as usize;
    let mut scores = vec![0; region.area()];
    for (y, row) in (region.y..).zip(scores.chunks_exact_mut(width)) {
        let start = (y as usize * frame.width() as usize + region.x as usize) * 3;
        score_row(&samples[start..start + width * 3], forms, row);
    }
    Some(scores)
}

/// The scores of a row. Compiled for wider registers too, and chosen when the program runs.
#[multiversion::multiversion(targets("x86_64+avx2", "x86_64+sse4.1+ssse3"))]
fn score_row(samples: &[u8], [a, b]: [QuantizedForm; 2], scores: &mut [u8]) {
    for (pixel, score) in samples.as_chunks::<3>().0.iter().zip(scores) {
        let least = a.of(*pixel).min(b.of(*pixel));
        #[expect(clippy::cast_sign_loss, reason = "clamped to 0..=255")]
        let clamped = (least >> Form::BITS).clamp(0, 255) as u8;
        *score = clamped;
    }
}

/// `weights . samples + offset`.
struct Form {
    weights: Vector3<f64>,
    offset: f64,
}

/// The same in fixed point.
#[derive(Clone, Copy)]
struct QuantizedForm {
    weights: [i32; 3],
    offset: i32,
}

fn of_ycbcr(edge: Vector2<f64>) -> Form {
    Form { weights: Vector3::new(0.0, edge.x, edge.y), offset: -128.0 * (edge.x + edge.y) }
}

fn of_rgb(edge: Vector2<f64>) -> Form {
    let chroma_of_rgb = Matrix2x3::new(-0.168_736, -0.331_264, 0.5, 0.5, -0.418_688, -0.081_312);
    Form { weights: chroma_of_rgb.tr_mul(&edge), offset: 0.0 }
}

impl Form {
    const BITS: i32 = 12;

    #[expect(clippy::cast_possible_truncation, reason = "weights are below 20, so the product is far below 2^31")]
    fn quantized(self) -> QuantizedForm {
        let one = f64::from(1 << Self::BITS);
        let fixed = |x: f64| (x * one).round() as i32;
        // Half a unit makes the final shift round to nearest.
        QuantizedForm {
            weights: [fixed(self.weights.x), fixed(self.weights.y), fixed(self.weights.z)],
            offset: fixed(self.offset + 0.5),
        }
    }
}

impl QuantizedForm {
    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
    #[inline(always)]
    fn of(self, pixel: [u8; 3]) -> i32 {
        self.weights[0] * i32::from(pixel[0])
            + self.weights[1] * i32::from(pixel[1])
            + self.weights[2] * i32::from(pixel[2])
            + self.offset
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::{Coding, color::ycbcr_of_rgb};

    proptest! {
        #[test]
        fn both_colour_spaces_score_alike_and_as_the_formula_says(pixels in proptest::collection::vec(any::<[u8; 3]>(), 1..40)) {
            let frame = |pixels| {
                let samples = |p: &Pixels| match p { Pixels::Rgb(s) | Pixels::YCbCr(s) | Pixels::Luma(s) => s.len() / 3 };
                Frame::checked(u32::try_from(samples(&pixels)).expect("a row"), 1, pixels, Coding::LOSSLESS).expect("a row")
            };
            let rgb = frame(Pixels::Rgb(pixels.concat()));
            let native = frame(Pixels::YCbCr(pixels.iter().flat_map(|p| ycbcr_of_rgb(*p)).collect()));
            let hue = HueRange::RED;
            let (a, b) = (score(&rgb, rgb.full(), &hue).expect("colour"), score(&native, native.full(), &hue).expect("colour"));
            for ((a, b), rgb) in a.iter().zip(&b).zip(&pixels) {
                let [r, g, bl] = rgb.map(f64::from);
                let chroma = Vector2::new(-0.168_736 * r - 0.331_264 * g + 0.5 * bl, 0.5 * r - 0.418_688 * g - 0.081_312 * bl);
                let exact = hue.edges().iter().map(|e| e.dot(&chroma)).fold(f64::INFINITY, f64::min).clamp(0.0, 255.0);
                prop_assert!((f64::from(*a) - exact).abs() <= 0.6, "{a} {exact}");
                // Chroma is rounded to whole numbers before the edges' weights, which are below 2.
                prop_assert!(a.abs_diff(*b) <= 3, "{a} {b}");
            }
        }
    }
}
