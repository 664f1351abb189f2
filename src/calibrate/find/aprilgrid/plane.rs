//! A picture of one channel.

use nalgebra::Vector2;

use super::super::Luma;
use super::super::tone::Tone;

/// Light, rows from the top.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    pub width: usize,
    pub height: usize,
    pub samples: Vec<f32>,
}

impl Plane {
    pub(super) fn of(picture: &Luma) -> Self {
        Self::in_tone(picture, Tone::Straight)
    }

    /// The light of a picture's codes.
    pub(super) fn in_tone(picture: &Luma, tone: Tone) -> Self {
        let lights = tone.lights();
        let samples = picture.samples.iter().map(|code| lights[usize::from(*code)]).collect();
        Self { width: picture.width, height: picture.height, samples }
    }

    pub(super) fn row(&self, y: usize) -> &[f32] {
        &self.samples[y * self.width..(y + 1) * self.width]
    }

    /// Between four pixels; `None` beyond the middles of the outermost.
    pub(super) fn at(&self, place: &Vector2<f64>) -> Option<f64> {
        let inside = |c: f64, size: usize| c >= 0.0 && c < size as f64 - 1.0;
        if !(inside(place.x, self.width) && inside(place.y, self.height)) {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the picture")]
        let (column, row) = (place.x as usize, place.y as usize);
        let (right, down) = (place.x - column as f64, place.y - row as f64);
        let along = |row: usize| {
            let [left, next] = [column, column + 1].map(|column| f64::from(self.samples[row * self.width + column]));
            left + right * (next - left)
        };
        let (above, below) = (along(row), along(row + 1));
        Some(above + down * (below - above))
    }

    /// Through a Gaussian of this standard deviation, px. The border is as if the outermost pixels went on.
    pub(super) fn blurred(&self, sigma_px: f64) -> Self {
        let kernel = kernel(sigma_px);
        let reach = kernel.len() - 1;
        let (width, height) = (self.width, self.height);
        let mut across = vec![0.0; width * height];
        let mut padded = vec![0.0; width + 2 * reach];
        for (row, out) in self.samples.chunks_exact(width).zip(across.chunks_exact_mut(width)) {
            padded[..reach].fill(row[0]);
            padded[reach..reach + width].copy_from_slice(row);
            padded[reach + width..].fill(row[width - 1]);
            for (offset, weight) in (0..=2 * reach).map(|offset| (offset, kernel[offset.abs_diff(reach)])) {
                out.iter_mut().zip(&padded[offset..]).for_each(|(sum, sample)| *sum += weight * sample);
            }
        }
        let mut samples = vec![0.0; width * height];
        for (y, out) in samples.chunks_exact_mut(width).enumerate() {
            for (offset, weight) in (0..=2 * reach).map(|offset| (offset, kernel[offset.abs_diff(reach)])) {
                let from = (y + offset).saturating_sub(reach).min(height - 1);
                let row = &across[from * width..(from + 1) * width];
                out.iter_mut().zip(row).for_each(|(sum, sample)| *sum += weight * sample);
            }
        }
        Self { width, height, samples }
    }
}

/// The right half of a Gaussian, its middle first; both halves sum to one.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few pixels")]
fn kernel(sigma_px: f64) -> Vec<f32> {
    let reach = (3.0 * sigma_px).ceil() as usize;
    let weight = |offset: usize| (-0.5 * (offset as f64 / sigma_px).powi(2)).exp();
    let sum = weight(0) + 2.0 * (1..=reach).map(weight).sum::<f64>();
    (0..=reach).map(|offset| (weight(offset) / sum) as f32).collect()
}
