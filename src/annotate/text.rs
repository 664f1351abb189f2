//! Letters of a fixed width on the canvas, any number of times their size.

use std::convert::Infallible;

use embedded_graphics::Drawable;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::iso_8859_1::{FONT_5X8, FONT_6X10, FONT_7X13, FONT_9X15, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::BinaryColor;
use embedded_graphics::text::{Baseline, Text};

use super::canvas::{Canvas, Ink};

/// A font and how often its pixels are repeated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lettering {
    font: &'static MonoFont<'static>,
    times: i32,
}

impl Lettering {
    /// Fonts by falling height.
    const FONTS: [&'static MonoFont<'static>; 5] = [&FONT_10X20, &FONT_9X15, &FONT_7X13, &FONT_6X10, &FONT_5X8];

    /// The largest letters of at most this height, px; where there are none, the smallest.
    #[expect(clippy::cast_possible_truncation, reason = "a frame's height divided by the letters'")]
    pub fn of_height(height_px: f64) -> Self {
        let largest = Self::FONTS[0];
        let times = (height_px / f64::from(largest.character_size.height)).floor() as i32;
        if times >= 1 {
            return Self { font: largest, times };
        }
        let fits = |font: &&&MonoFont<'_>| f64::from(font.character_size.height) <= height_px;
        let font = Self::FONTS.iter().find(fits).copied().unwrap_or(&FONT_5X8);
        Self { font, times: 1 }
    }

    /// Width of one letter, px.
    pub const fn advance_px(&self) -> i32 {
        (self.font.character_size.width + self.font.character_spacing).cast_signed() * self.times
    }

    /// Height of a line, px.
    pub const fn height_px(&self) -> i32 {
        self.font.character_size.height.cast_signed() * self.times
    }

    /// Width of `text`, px.
    pub fn width_px(&self, text: &str) -> i32 {
        let letters = i32::try_from(text.chars().count()).unwrap_or(i32::MAX);
        letters.saturating_mul(self.advance_px())
    }

    /// Writes one line with its upper left corner at `(x, y)`. What is not of Latin 1 becomes a question mark.
    pub fn write(&self, canvas: &mut Canvas, x: i32, y: i32, text: &str, ink: Ink) {
        let mut page = Page { canvas, x, y, times: self.times, ink };
        let style = MonoTextStyle::new(self.font, BinaryColor::On);
        let Ok(_) = Text::with_baseline(&one_line(text), Point::zero(), style, Baseline::Top).draw(&mut page);
    }
}

/// `text` without anything that would break the line.
fn one_line(text: &str) -> String {
    text.chars().map(|letter| if letter.is_control() { '?' } else { letter }).collect()
}

/// `text`, or its beginning and two dots if it has more than `limit` letters.
pub(super) fn shortened(text: &str, limit: usize) -> String {
    if text.chars().count() <= limit {
        return text.to_owned();
    }
    text.chars().take(limit.saturating_sub(2)).chain("..".chars()).collect()
}

/// The canvas from a corner on, in units of a letter's pixels.
struct Page<'a> {
    canvas: &'a mut Canvas,
    x: i32,
    y: i32,
    times: i32,
    ink: Ink,
}

impl OriginDimensions for Page<'_> {
    fn size(&self) -> Size {
        let all = self.canvas.bounds();
        Size::new(all.width.cast_unsigned(), all.height.cast_unsigned())
    }
}

impl DrawTarget for Page<'_> {
    type Color = BinaryColor;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = embedded_graphics::Pixel<BinaryColor>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Infallible> {
        for embedded_graphics::Pixel(place, colour) in pixels {
            if colour == BinaryColor::Off {
                continue;
            }
            let at = |origin: i32, steps: i32| origin.saturating_add(steps.saturating_mul(self.times));
            let (left, top) = (at(self.x, place.x), at(self.y, place.y));
            for y in top..top.saturating_add(self.times) {
                for x in left..left.saturating_add(self.times) {
                    self.canvas.dot(x, y, self.ink, 1.0);
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_grow_with_the_frame() {
        let heights = [0.0, 8.0, 11.0, 14.0, 17.0, 25.0, 52.0].map(|px| Lettering::of_height(px).height_px());
        assert_eq!(heights, [8, 8, 10, 13, 15, 20, 40]);
    }

    #[test]
    fn long_names_are_cut_and_letters_counted_not_bytes() {
        assert_eq!(shortened("müßig", 5), "müßig");
        assert_eq!(shortened("constellation", 6), "cons..");
        assert_eq!(one_line("a\nb\u{7}"), "a?b?");
        assert_eq!(Lettering::of_height(13.0).width_px("müßig"), 35);
    }
}
