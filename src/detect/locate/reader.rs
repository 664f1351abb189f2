//! What a pixel of a frame is in luma and chroma, whatever the frame holds.

use nalgebra::Vector2;

use crate::detect::single;
use crate::frame::{Frame, Pixels, Siting};

/// Reads luma, and chroma along a hue.
pub(super) struct Reader<'a> {
    frame: &'a Frame,
    /// In the plane of (Cb, Cr); none where there is no colour to read.
    pub direction: Option<Vector2<f64>>,
}

impl<'a> Reader<'a> {
    pub(super) fn of(frame: &'a Frame, hue: Option<Vector2<f64>>) -> Self {
        Self { frame, direction: hue.filter(|_| !matches!(frame.pixels(), Pixels::Luma(_))) }
    }

    pub(super) fn luma(&self, x: usize, y: usize) -> f32 {
        let index = y * self.frame.width() as usize + x;
        match self.frame.pixels() {
            Pixels::Luma(s) => f32::from(s[index]),
            Pixels::YCbCr(s) => f32::from(s[3 * index]),
            Pixels::Rgb(s) => single(luma_of([s[3 * index], s[3 * index + 1], s[3 * index + 2]])),
        }
    }

    /// Chroma along a direction, and how far from the pixel it lies, px.
    ///
    /// A decoder has the colour that lies between two pixels drawn to each of them from more of the one side than of the other. Such a blur
    /// moves both sides of a disc alike; the mean of both pixels has as much of either side, and lies between them.
    pub(super) fn shared_chroma(
        &self,
        x: usize,
        y: usize,
        direction: &Vector2<f64>,
        siting: Siting,
    ) -> (Vector2<f64>, f32) {
        let columns = if siting.between_columns { [x, (x + 1).min(self.frame.width() as usize - 1)] } else { [x; 2] };
        let rows = if siting.between_rows { [y, (y + 1).min(self.frame.height() as usize - 1)] } else { [y; 2] };
        let half = |is_between| if is_between { 0.5 } else { 0.0 };
        let off = Vector2::new(half(siting.between_columns), half(siting.between_rows));
        let all = rows.into_iter().flat_map(|y| columns.map(|x| self.chroma(x, y, direction)));
        (off, 0.25 * all.sum::<f32>())
    }

    /// Chroma along a direction.
    pub(super) fn chroma(&self, x: usize, y: usize, direction: &Vector2<f64>) -> f32 {
        let index = 3 * (y * self.frame.width() as usize + x);
        let chroma = match self.frame.pixels() {
            Pixels::Luma(_) => Vector2::zeros(),
            Pixels::YCbCr(s) => Vector2::new(f64::from(s[index + 1]) - 128.0, f64::from(s[index + 2]) - 128.0),
            Pixels::Rgb(s) => {
                let rgb = [s[index], s[index + 1], s[index + 2]];
                let luma = luma_of(rgb);
                Vector2::new((f64::from(rgb[2]) - luma) / 1.772, (f64::from(rgb[0]) - luma) / 1.402)
            }
        };
        single(chroma.dot(direction))
    }
}

/// Luma of BT.601, not rounded.
fn luma_of(rgb: [u8; 3]) -> f64 {
    let [r, g, b] = rgb.map(f64::from);
    0.299 * r + 0.587 * g + 0.114 * b
}
