//! Smooth lines, rings and boxes on a picture. Nothing outside of it is touched, and no number makes it fail.

use std::collections::BTreeMap;

use image::RgbImage;
use nalgebra::Vector2;

use super::clip;
use crate::camera::Pixel;
use crate::frame::Frame;

/// A rectangle of whole pixels, which may lie outside of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Box {
    /// Left column.
    pub x: i32,
    /// Top row.
    pub y: i32,
    /// Columns.
    pub width: i32,
    /// Rows.
    pub height: i32,
}

impl Box {
    /// The square with this middle and half side, px.
    pub fn about(middle: &Pixel, half_px: f64) -> Self {
        let (x, y) = (whole(middle.x - half_px), whole(middle.y - half_px));
        let side = whole(2.0 * half_px) + 1;
        Self { x, y, width: side, height: side }
    }

    /// Its middle, px.
    pub fn middle(&self) -> Pixel {
        let at = |start: i32, size: i32| f64::from(start) + 0.5 * f64::from(size - 1);
        Pixel::new(at(self.x, self.width), at(self.y, self.height))
    }

    /// The place in it that is nearest to `point`, px.
    pub fn nearest(&self, point: &Pixel) -> Pixel {
        let within = |value: f64, start: i32, size: i32| {
            value.max(f64::from(start)).min(f64::from(start) + f64::from(size.max(1) - 1))
        };
        Pixel::new(within(point.x, self.x, self.width), within(point.y, self.y, self.height))
    }

    /// Number of pixels in both.
    pub fn overlap(&self, other: &Self) -> i64 {
        let shared = |a: i32, a_size: i32, b: i32, b_size: i32| {
            let end = a.saturating_add(a_size).min(b.saturating_add(b_size));
            i64::from(end) - i64::from(a.max(b))
        };
        let width = shared(self.x, self.width, other.x, other.width);
        let height = shared(self.y, self.height, other.y, other.height);
        if width > 0 && height > 0 { width * height } else { 0 }
    }
}

/// The nearest whole number, held where sums of a few cannot overflow; 0 for `NaN`.
#[expect(clippy::cast_possible_truncation, reason = "clamped")]
pub(super) const fn whole(value: f64) -> i32 {
    value.clamp(-1e8, 1e8).round() as i32
}

/// Colour, and how much of what is under it is covered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ink {
    /// sRGB.
    pub rgb: [u8; 3],
    /// 0 leaves everything, 1 covers it.
    pub opacity: f64,
}

impl Ink {
    /// Covers everything.
    pub const fn solid(rgb: [u8; 3]) -> Self {
        Self { rgb, opacity: 1.0 }
    }
}

/// A picture to draw on.
pub(super) struct Canvas {
    image: RgbImage,
}

impl From<RgbImage> for Canvas {
    fn from(image: RgbImage) -> Self {
        Self { image }
    }
}

impl Canvas {
    /// A copy of the frame.
    pub fn of(frame: &Frame) -> Self {
        let (width, height) = (frame.width(), frame.height());
        // A frame's samples always agree with its size.
        let image = RgbImage::from_raw(width, height, frame.rgb().into_owned());
        Self { image: image.unwrap_or_else(|| RgbImage::new(width, height)) }
    }

    /// The picture.
    pub fn into_image(self) -> RgbImage {
        self.image
    }

    /// All of it.
    pub fn bounds(&self) -> Box {
        let side = |px: u32| i32::try_from(px).unwrap_or(i32::MAX);
        Box { x: 0, y: 0, width: side(self.image.width()), height: side(self.image.height()) }
    }

    /// Covers `share` of one pixel, if there is such a one.
    pub fn dot(&mut self, x: i32, y: i32, ink: Ink, share: f64) {
        let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { return };
        let cover = ink.opacity * share;
        // Also false for NaN.
        if x < self.image.width() && y < self.image.height() && cover > 0.0 {
            let pixel = self.image.get_pixel_mut(x, y);
            for (sample, colour) in pixel.0.iter_mut().zip(ink.rgb) {
                let mixed = f64::from(*sample) + (f64::from(colour) - f64::from(*sample)) * cover.min(1.0);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two bytes")]
                let byte = (mixed + 0.5) as u8;
                *sample = byte;
            }
        }
    }

    /// A filled box.
    pub fn fill(&mut self, area: Box, ink: Ink) {
        let all = self.bounds();
        for y in area.y.max(0)..area.y.saturating_add(area.height).min(all.height) {
            for x in area.x.max(0)..area.x.saturating_add(area.width).min(all.width) {
                self.dot(x, y, ink, 1.0);
            }
        }
    }

    /// A straight line with round ends.
    pub fn line(&mut self, a: Pixel, b: Pixel, width_px: f64, ink: Ink) {
        self.lines([(a, b)], width_px, ink);
    }

    /// Several lines as one: where they overlap, what is under them is covered once.
    pub fn lines(&mut self, pieces: impl IntoIterator<Item = (Pixel, Pixel)>, width_px: f64, ink: Ink) {
        let mut cover = BTreeMap::new();
        for (a, b) in pieces {
            self.cover_line(a, b, width_px, &mut cover);
        }
        for ((y, x), share) in cover {
            self.dot(x, y, ink, share);
        }
    }

    /// Notes for each pixel, row first, the share of it that the line covers, if it is more than what was noted.
    fn cover_line(&self, a: Pixel, b: Pixel, width_px: f64, cover: &mut BTreeMap<(i32, i32), f64>) {
        let all = self.bounds();
        let reach = 0.5 * width_px.clamp(0.0, 100.0) + 1.0;
        let least = Vector2::repeat(-reach - 1.0);
        let most = Vector2::new(f64::from(all.width), f64::from(all.height)) - least;
        let Some((a, b)) = clip::segment(a, b, least, most) else { return };
        let along = b - a;
        let length_squared = along.norm_squared().max(f64::MIN_POSITIVE);
        // Along the longer axis, each column (or row) has a short run of pixels near the line.
        let (long, short) = if along.x.abs() >= along.y.abs() { (0, 1) } else { (1, 0) };
        let slope = if along[long] == 0.0 { 0.0 } else { along[short] / along[long] };
        let run = reach * 1.0_f64.hypot(slope) + 1.0;
        for i in whole(a[long].min(b[long]) - reach)..=whole(a[long].max(b[long]) + reach) {
            let middle = a[short] + slope * (f64::from(i) - a[long]);
            for j in whole(middle - run)..=whole(middle + run) {
                let (x, y) = if long == 0 { (i, j) } else { (j, i) };
                let from_a = Vector2::new(f64::from(x), f64::from(y)) - a;
                let share = (from_a.dot(&along) / length_squared).clamp(0.0, 1.0);
                let distance = (from_a - along * share).norm();
                let share = (0.5 * width_px + 0.5 - distance).clamp(0.0, 1.0);
                if share > 0.0 {
                    let noted = cover.entry((y, x)).or_insert(0.0);
                    *noted = share.max(*noted);
                }
            }
        }
    }

    /// A circle.
    pub fn ring(&mut self, centre: Pixel, radius_px: f64, width_px: f64, ink: Ink) {
        let all = self.bounds();
        let reach = radius_px + 0.5 * width_px + 1.0;
        let rows = whole(centre.y - reach).max(0)..=whole(centre.y + reach).min(all.height - 1);
        for y in rows {
            for x in whole(centre.x - reach).max(0)..=whole(centre.x + reach).min(all.width - 1) {
                let distance = (Vector2::new(f64::from(x), f64::from(y)) - centre).norm();
                self.dot(x, y, ink, (0.5 * width_px + 0.5 - (distance - radius_px).abs()).clamp(0.0, 1.0));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Coding, Pixels};

    fn black() -> Canvas {
        let frame = Frame::checked(60, 40, Pixels::Luma(vec![0; 2400]), Coding::LOSSLESS).expect("a frame");
        Canvas::of(&frame)
    }

    fn light(canvas: Canvas) -> f64 {
        canvas.into_image().as_raw().iter().map(|&s| f64::from(s)).sum::<f64>() / 255.0 / 3.0
    }

    const WHITE: Ink = Ink::solid([255; 3]);

    #[test]
    fn a_line_covers_its_length_times_its_width() {
        for (a, b) in [([10.0, 10.0], [40.0, 10.0]), ([12.5, 5.0], [31.0, 34.0]), ([40.0, 30.0], [15.0, 22.3])] {
            let (a, b) = (Pixel::from(a), Pixel::from(b));
            let mut canvas = black();
            canvas.line(a, b, 3.0, WHITE);
            let expected = 3.0 * (b - a).norm() + std::f64::consts::PI * 1.5 * 1.5;
            assert!((light(canvas) - expected).abs() < 0.05 * expected);
        }
    }

    #[test]
    fn lines_that_overlap_cover_once() {
        let (a, b, c) = (Pixel::new(5.0, 5.0), Pixel::new(25.0, 18.0), Pixel::new(45.0, 31.0));
        let gray = Ink { opacity: 0.4, ..WHITE };
        let (mut whole, mut pieces) = (black(), black());
        whole.line(a, c, 4.0, gray);
        pieces.lines([(a, b), (b, c)], 4.0, gray);
        assert!((light(whole) - light(pieces)).abs() < 0.1);
    }

    #[test]
    fn a_ring_covers_its_circumference_times_its_width() {
        let mut canvas = black();
        canvas.ring(Pixel::new(30.2, 19.7), 12.0, 2.0, WHITE);
        let expected = std::f64::consts::TAU * 12.0 * 2.0;
        assert!((light(canvas) - expected).abs() < 0.03 * expected);
    }

    #[test]
    fn numbers_without_sense_draw_nothing_and_fail_nothing() {
        for odd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300] {
            let mut canvas = black();
            let place = Pixel::new(odd, 10.0);
            canvas.line(place, Pixel::new(-5.0, -5.0), 2.0, WHITE);
            canvas.ring(place, 5.0, 2.0, WHITE);
            canvas.ring(Pixel::new(-50.0, 10.0), odd, 2.0, WHITE);
            canvas.fill(Box::about(&place, 3.0), Ink { opacity: odd, ..WHITE });
            canvas.fill(Box { x: i32::MAX, y: i32::MIN, width: i32::MAX, height: i32::MAX }, WHITE);
            canvas.dot(i32::MIN, i32::MAX, WHITE, odd);
        }
    }

    #[test]
    fn boxes_know_what_they_share() {
        let unit = Box { x: 0, y: 0, width: 10, height: 10 };
        assert_eq!(unit.overlap(&Box { x: 8, y: -5, width: 9, height: 8 }), 6);
        assert_eq!(unit.overlap(&Box { x: 10, y: 0, width: 5, height: 5 }), 0);
    }
}
