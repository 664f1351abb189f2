//! Lines of text at the foot of a picture: what is known beyond what the frame shows.

use image::RgbImage;

use super::canvas::{Box, Canvas, Ink};
use super::palette::DARK;
use super::scale::Scale;
use super::text::shortened;

/// The picture with these lines at its foot, each in its colour, sRGB.
#[must_use]
pub fn caption(picture: RgbImage, lines: &[(String, [u8; 3])]) -> RgbImage {
    let letters = Scale::of(picture.height()).headline;
    let mut canvas = Canvas::from(picture);
    let frame = canvas.bounds();
    let (margin, pitch) = (letters.height_px() / 3, letters.height_px() * 5 / 3);
    let limit = usize::try_from(frame.width / letters.advance_px().max(1) - 2).unwrap_or(0);
    let count = i32::try_from(lines.len()).unwrap_or(i32::MAX);
    let mut y = frame.height.saturating_sub(count.saturating_mul(pitch));
    for (text, rgb) in lines {
        let text = shortened(text, limit);
        let width = letters.width_px(&text).saturating_add(2 * margin).min(frame.width);
        canvas.fill(Box { x: 0, y, width, height: pitch }, Ink { rgb: DARK, opacity: 0.65 });
        letters.write(&mut canvas, margin, y + margin, &text, Ink::solid(*rgb));
        y = y.saturating_add(pitch);
    }
    canvas.into_image()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_stand_at_the_foot_and_nothing_else_changes() {
        let gray = RgbImage::from_pixel(320, 240, image::Rgb([128; 3]));
        let lines = [("range 43.2 m".to_owned(), [255; 3]), ("alarm".to_owned(), [255, 80, 70])];
        let drawn = caption(gray.clone(), &lines);
        assert_eq!(drawn.dimensions(), gray.dimensions());
        let changed = |rows: std::ops::Range<u32>| {
            rows.flat_map(|y| (0..320).map(move |x| (x, y)))
                .filter(|(x, y)| drawn.get_pixel(*x, *y).0 != [128; 3])
                .count()
        };
        assert_eq!(changed(0..200), 0);
        assert!(changed(200..240) > 1_000);
        assert!(drawn.pixels().any(|pixel| pixel.0 == [255, 80, 70]));
        assert_eq!(caption(gray.clone(), &[]), gray);
    }

    #[test]
    fn too_many_lines_and_too_small_a_picture_fail_nothing() {
        let lines: Vec<_> = (0..40).map(|line| (format!("a line of many words, number {line}"), [255; 3])).collect();
        assert_eq!(caption(RgbImage::new(8, 8), &lines).dimensions(), (8, 8));
    }
}
