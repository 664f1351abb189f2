//! The picture at several sizes.

use std::borrow::Cow;
use std::cell::OnceCell;

use nalgebra::Vector2;

use super::super::Luma;
use crate::camera::Pixel;

/// A picture of luma.
#[derive(Clone, Debug)]
pub(super) struct Plane<'a> {
    pub width: usize,
    pub height: usize,
    pub samples: Cow<'a, [u8]>,
}

/// One size of it.
pub(super) struct Level<'a> {
    pub plane: Plane<'a>,
    smooth: OnceCell<Plane<'static>>,
    /// Side of one of its pixels, px of the picture.
    pub scale: f64,
}

/// The picture, its half, its quarter, and so on.
pub(super) struct Pyramid<'a> {
    pub levels: Vec<Level<'a>>,
}

/// Least side of a level, px.
const MIN_SIDE: usize = 48;

impl<'a> Pyramid<'a> {
    pub(super) fn of(picture: &'a Luma) -> Self {
        let full = Plane { width: picture.width, height: picture.height, samples: Cow::Borrowed(&picture.samples) };
        let mut levels = vec![Level::of(full, 1.0)];
        while let Some(last) = levels.last().filter(|last| last.plane.width.min(last.plane.height) >= 2 * MIN_SIDE) {
            let next = Level::of(last.plane.halved(), 2.0 * last.scale);
            levels.push(next);
        }
        Self { levels }
    }

    /// The coarsest level on which a length in the picture still has `need_px`; the full size where none does.
    pub(super) fn level_with(&self, length_px: f64, need_px: f64) -> &Level<'a> {
        let coarser = self.levels.iter().rev().find(|level| length_px >= need_px * level.scale);
        coarser.unwrap_or(&self.levels[0])
    }
}

impl<'a> Level<'a> {
    pub(super) const fn of(plane: Plane<'a>, scale: f64) -> Self {
        Self { plane, smooth: OnceCell::new(), scale }
    }

    /// The level with less noise: through the binomial kernel of three by three.
    pub(super) fn smooth(&self) -> &Plane<'static> {
        self.smooth.get_or_init(|| self.plane.smoothed())
    }

    /// Where a place of this level lies in the picture. Pixels' corners coincide, not their middles.
    pub(super) fn to_picture(&self, place: &Vector2<f64>) -> Pixel {
        place.map(|c| (c + 0.5) * self.scale - 0.5)
    }

    /// Where a place of the picture lies on this level.
    pub(super) fn of_picture(&self, pixel: &Pixel) -> Vector2<f64> {
        pixel.map(|c| (c + 0.5) / self.scale - 0.5)
    }
}

impl Plane<'_> {
    pub(super) fn row(&self, y: usize) -> &[u8] {
        &self.samples[y * self.width..(y + 1) * self.width]
    }

    /// Between four pixels; `None` beyond the middles of the outermost.
    pub(super) fn at(&self, x: f64, y: f64) -> Option<f64> {
        let inside = x >= 0.0 && y >= 0.0 && x < (self.width - 1) as f64 && y < (self.height - 1) as f64;
        if !inside {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the picture")]
        let (column, row) = (x as usize, y as usize);
        let (right, down) = (x - column as f64, y - row as f64);
        let from = row * self.width + column;
        let [a, b] = [from, from + self.width].map(|at| {
            let [left, next] = [self.samples[at], self.samples[at + 1]].map(f64::from);
            left + right * (next - left)
        });
        Some(a + down * (b - a))
    }

    /// Half its size: means of two by two. An odd last row or column is left out.
    fn halved(&self) -> Plane<'static> {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut samples = vec![0; width * height];
        for (y, out) in samples.chunks_exact_mut(width).enumerate() {
            halve(self.row(2 * y), self.row(2 * y + 1), out);
        }
        Plane { width, height, samples: Cow::Owned(samples) }
    }

    /// Twice its size: between the pixels, as the half undoes it.
    pub(super) fn doubled(&self) -> Plane<'static> {
        let (width, height) = (2 * self.width, 2 * self.height);
        let mut samples = vec![0; width * height];
        let mut blend = vec![0_u16; self.width];
        for (y, out) in samples.chunks_exact_mut(width).enumerate() {
            let near = y / 2;
            let far = if y % 2 == 0 { near.saturating_sub(1) } else { (near + 1).min(self.height - 1) };
            let rows = self.row(near).iter().zip(self.row(far));
            blend.iter_mut().zip(rows).for_each(|(sum, (a, b))| *sum = 3 * u16::from(*a) + u16::from(*b));
            for (x, pair) in out.as_chunks_mut::<2>().0.iter_mut().enumerate() {
                let (left, here) = (blend[x.saturating_sub(1)], blend[x]);
                let right = blend[(x + 1).min(self.width - 1)];
                *pair = [left, right].map(|other| rounded(3 * here + other, 4));
            }
        }
        Plane { width, height, samples: Cow::Owned(samples) }
    }

    fn smoothed(&self) -> Plane<'static> {
        let (width, height) = (self.width, self.height);
        let mut samples = vec![0; width * height];
        let mut sums = vec![0_u16; width + 2];
        for (y, out) in samples.chunks_exact_mut(width).enumerate() {
            let rows = [self.row(y.saturating_sub(1)), self.row(y), self.row((y + 1).min(height - 1))];
            smooth_row(rows, &mut sums, out);
        }
        Plane { width, height, samples: Cow::Owned(samples) }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a mean of samples is a sample")]
const fn rounded(sum: u16, bits: u32) -> u8 {
    ((sum + (1 << (bits - 1))) >> bits) as u8
}

#[multiversion::multiversion(targets("x86_64+avx2", "x86_64+sse4.1+ssse3"))]
fn halve(above: &[u8], below: &[u8], out: &mut [u8]) {
    let pairs = above.as_chunks::<2>().0.iter().zip(below.as_chunks::<2>().0);
    for (out, ([a, b], [c, d])) in out.iter_mut().zip(pairs) {
        *out = rounded(u16::from(*a) + u16::from(*b) + u16::from(*c) + u16::from(*d), 2);
    }
}

#[multiversion::multiversion(targets("x86_64+avx2", "x86_64+sse4.1+ssse3"))]
fn smooth_row([above, here, below]: [&[u8]; 3], sums: &mut [u16], out: &mut [u8]) {
    let width = out.len();
    let rows = above.iter().zip(here).zip(below);
    for (sum, ((a, h), b)) in sums[1..=width].iter_mut().zip(rows) {
        *sum = u16::from(*a) + 2 * u16::from(*h) + u16::from(*b);
    }
    sums[0] = sums[1];
    sums[width + 1] = sums[width];
    let (left, middle, right) = (&sums[..width], &sums[1..=width], &sums[2..width + 2]);
    for x in 0..width {
        out[x] = rounded(left[x] + 2 * middle[x] + right[x], 4);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_stays_where_it_is_at_every_size() {
        let (width, height) = (200_usize, 150_usize);
        let samples = (0..height).flat_map(|y| (0..width).map(move |x| u8::try_from(x / 2 + y).expect("a slope")));
        let picture = Luma { width, height, samples: samples.collect() };
        let pyramid = Pyramid::of(&picture);
        assert_eq!(pyramid.levels.len(), 2);
        let twice = Level::of(pyramid.levels[0].plane.doubled(), 0.5);
        let pixel = Pixel::new(90.3, 61.7);
        for level in pyramid.levels.iter().chain([&twice]) {
            let place = level.of_picture(&pixel);
            assert!((level.to_picture(&place) - pixel).norm() < 1e-9);
            for plane in [&level.plane, level.smooth()] {
                let found = plane.at(place.x, place.y).expect("inside");
                // Rounding once or twice.
                assert!((found - 106.85).abs() < 0.8, "{} {found}", level.scale);
            }
        }
        assert_eq!(pyramid.levels[0].plane.at(-0.1, 3.0), None);
        assert_eq!(pyramid.levels[0].plane.at(3.0, 149.0), None);
        assert_eq!(pyramid.levels[0].plane.at(f64::NAN, 3.0), None);
    }
}
