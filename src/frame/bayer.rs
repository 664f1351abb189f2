//! Colour from a colour filter array.
//!
//! Malvar, He and Cutler 2004, "High-quality linear interpolation for demosaicing of Bayer-patterned color images": bilinear
//! interpolation corrected by the Laplacian of the colour that is known at the pixel, 5 x 5, in eighths.

use std::ops::Range;

use super::Region;

/// Which colours the top left 2 x 2 pixels carry, row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mosaic {
    /// R G / G B.
    Rggb,
    /// B G / G R.
    Bggr,
    /// G B / R G.
    Gbrg,
    /// G R / B G.
    Grbg,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Site {
    Red,
    /// Green in a row with red.
    GreenInRed,
    /// Green in a row with blue.
    GreenInBlue,
    Blue,
}

impl Mosaic {
    const fn site(self, x: usize, y: usize) -> Site {
        // Offset of the red site in the 2 x 2 tile.
        let (red_x, red_y) = match self {
            Self::Rggb => (0, 0),
            Self::Grbg => (1, 0),
            Self::Gbrg => (0, 1),
            Self::Bggr => (1, 1),
        };
        match ((x + red_x).is_multiple_of(2), (y + red_y).is_multiple_of(2)) {
            (true, true) => Site::Red,
            (false, true) => Site::GreenInRed,
            (true, false) => Site::GreenInBlue,
            (false, false) => Site::Blue,
        }
    }
}

/// Interleaved RGB from one sample a pixel, computed within `part`, which lies on the picture; black elsewhere. `samples` holds
/// `width * height` bytes.
#[must_use]
pub fn demosaic(mosaic: Mosaic, width: usize, height: usize, samples: &[u8], part: Region) -> Vec<u8> {
    let mut rgb = vec![0; width * height * 3];
    let (left, right) = (part.x as usize, (part.x + part.width) as usize);
    // Columns that have all their neighbours.
    let (first, last) = (left.max(REACH), right.min(width.saturating_sub(REACH)));
    for y in part.y as usize..(part.y + part.height) as usize {
        let mut border = |columns: Range<usize>| {
            for x in columns {
                rgb[(y * width + x) * 3..][..3].copy_from_slice(&at_border(mosaic, [width, height], samples, x, y));
            }
        };
        if y < REACH || y + REACH >= height || first >= last {
            border(left..right);
            continue;
        }
        border(left..first);
        border(last..right);
        inside(mosaic, width, samples, y, first..last, &mut rgb[(y * width + first) * 3..(y * width + last) * 3]);
    }
    rgb
}

/// Pixels to each side that a filter takes in.
const REACH: usize = 2;

/// A pixel whose neighbours may lie outside: mirrored about the border pixel, which keeps the mosaic's parity.
fn at_border(mosaic: Mosaic, [width, height]: [usize; 2], samples: &[u8], x: usize, y: usize) -> [u8; 3] {
    let at = |dx: isize, dy: isize| {
        let column = mirrored(x, dx, width);
        let row = mirrored(y, dy, height);
        i32::from(samples[row * width + column])
    };
    colour(mosaic.site(x, y), &at)
}

/// The pixels of a row in columns that have all their neighbours.
fn inside(mosaic: Mosaic, width: usize, samples: &[u8], y: usize, columns: Range<usize>, rgb: &mut [u8]) {
    let around = columns.start - REACH..columns.end + REACH;
    let row = |above: usize| samples[(y + above - REACH) * width..][around.clone()].windows(2 * REACH + 1);
    let windows = row(0).zip(row(1)).zip(row(2)).zip(row(3)).zip(row(4));
    let sites = [mosaic.site(columns.start, y), mosaic.site(columns.start + 1, y)];
    let pixels = rgb.chunks_exact_mut(3).zip(sites.into_iter().cycle());
    for (((((a, b), c), d), e), (pixel, site)) in windows.zip(pixels) {
        let five = |row: &[u8]| <[u8; 5]>::try_from(row).unwrap_or_default();
        let window = [five(a), five(b), five(c), five(d), five(e)];
        let at = |dx: isize, dy: isize| {
            i32::from(window[REACH.wrapping_add_signed(dy) % 5][REACH.wrapping_add_signed(dx) % 5])
        };
        pixel.copy_from_slice(&colour(site, &at));
    }
}

/// The three colours of a pixel, from the samples around it.
#[inline]
fn colour(site: Site, at: &impl Fn(isize, isize) -> i32) -> [u8; 3] {
    let own = at(0, 0).clamp(0, 255).to_le_bytes()[0];
    let turned = |x, y| at(y, x);
    match site {
        Site::Red => [own, green(at), opposite(at)],
        Site::Blue => [opposite(at), green(at), own],
        Site::GreenInRed => [beside(at), own, beside(&turned)],
        Site::GreenInBlue => [beside(&turned), own, beside(at)],
    }
}

/// Green at a red or blue site.
#[inline]
fn green(at: &impl Fn(isize, isize) -> i32) -> u8 {
    let near = at(-1, 0) + at(1, 0) + at(0, -1) + at(0, 1);
    let far = at(-2, 0) + at(2, 0) + at(0, -2) + at(0, 2);
    clamp8(2 * near + 4 * at(0, 0) - far)
}

/// Red at a blue site, or blue at a red one.
#[inline]
fn opposite(at: &impl Fn(isize, isize) -> i32) -> u8 {
    let diagonal = at(-1, -1) + at(1, -1) + at(-1, 1) + at(1, 1);
    let far = at(-2, 0) + at(2, 0) + at(0, -2) + at(0, 2);
    // In sixteenths: the paper's weights 6/8, 2/8 and -3/16.
    clamp8((12 * at(0, 0) + 4 * diagonal - 3 * far) / 2)
}

/// The colour of the left and right neighbours at a green site.
#[inline]
fn beside(at: &impl Fn(isize, isize) -> i32) -> u8 {
    let diagonal = at(-1, -1) + at(1, -1) + at(-1, 1) + at(1, 1);
    let along = at(-2, 0) + at(2, 0);
    let across = at(0, -2) + at(0, 2);
    let sixteenths = 10 * at(0, 0) + 8 * (at(-1, 0) + at(1, 0)) - 2 * diagonal - 2 * along + across;
    clamp8(sixteenths / 2)
}

/// From eighths, rounded and clamped.
#[expect(clippy::cast_sign_loss, reason = "clamped to 0..=255")]
fn clamp8(eighths: i32) -> u8 {
    ((eighths + 4) >> 3).clamp(0, 255) as u8
}

fn mirrored(position: usize, offset: isize, length: usize) -> usize {
    let moved = position.checked_add_signed(offset).unwrap_or_else(|| offset.unsigned_abs() - position);
    if moved < length { moved } else { (2 * (length - 1)).saturating_sub(moved) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn demosaic(mosaic: Mosaic, width: usize, height: usize, samples: &[u8]) -> Vec<u8> {
        super::demosaic(mosaic, width, height, samples, whole(width, height))
    }

    fn whole(width: usize, height: usize) -> Region {
        let side = |side: usize| u32::try_from(side).expect("small");
        Region { x: 0, y: 0, width: side(width), height: side(height) }
    }

    const ALL: [Mosaic; 4] = [Mosaic::Rggb, Mosaic::Bggr, Mosaic::Gbrg, Mosaic::Grbg];

    fn mosaic_of(mosaic: Mosaic, width: usize, height: usize, color: impl Fn(usize, usize) -> [u8; 3]) -> Vec<u8> {
        (0..width * height)
            .map(|i| {
                let (x, y) = (i % width, i / width);
                let [r, g, b] = color(x, y);
                match mosaic.site(x, y) {
                    Site::Red => r,
                    Site::Blue => b,
                    Site::GreenInRed | Site::GreenInBlue => g,
                }
            })
            .collect()
    }

    #[test]
    fn a_plain_colour_comes_back_everywhere() {
        for mosaic in ALL {
            let samples = mosaic_of(mosaic, 8, 6, |_, _| [200, 30, 90]);
            for pixel in demosaic(mosaic, 8, 6, &samples).chunks_exact(3) {
                assert_eq!(pixel, [200, 30, 90], "{mosaic:?}");
            }
        }
    }

    #[test]
    fn a_gray_ramp_comes_back_inside() {
        // The filters are exact on linear gray images.
        for mosaic in ALL {
            let ramp = |x: usize, y: usize| u8::try_from(40 + 10 * x + 5 * y).expect("small");
            let samples = mosaic_of(mosaic, 12, 10, |x, y| [ramp(x, y); 3]);
            let rgb = demosaic(mosaic, 12, 10, &samples);
            for y in 2..8 {
                for x in 2..10 {
                    assert_eq!(rgb[(y * 12 + x) * 3..][..3], [ramp(x, y); 3], "{mosaic:?} at {x}, {y}");
                }
            }
        }
    }

    #[test]
    fn inside_it_is_what_the_border_s_way_gives() {
        let noise = |i: usize| u8::try_from((i * i * 31 + i * 7) % 251).expect("small");
        for mosaic in ALL {
            for [width, height] in [[2, 2], [4, 4], [6, 4], [4, 6], [6, 6], [14, 10]] {
                let samples: Vec<u8> = (0..width * height).map(noise).collect();
                let slow: Vec<u8> = (0..width * height)
                    .flat_map(|i| at_border(mosaic, [width, height], &samples, i % width, i / width))
                    .collect();
                assert_eq!(demosaic(mosaic, width, height, &samples), slow, "{mosaic:?} {width} x {height}");
            }
        }
    }

    #[test]
    fn the_name_gives_the_order_of_the_first_row() {
        assert!(matches!(Mosaic::Rggb.site(0, 0), Site::Red));
        assert!(matches!(Mosaic::Bggr.site(0, 0), Site::Blue));
        assert!(matches!((Mosaic::Gbrg.site(0, 0), Mosaic::Gbrg.site(1, 0)), (Site::GreenInBlue, Site::Blue)));
        assert!(matches!((Mosaic::Grbg.site(0, 0), Mosaic::Grbg.site(1, 0)), (Site::GreenInRed, Site::Red)));
    }

    #[test]
    fn the_smallest_frame_is_demosaiced() {
        assert_eq!(demosaic(Mosaic::Rggb, 2, 2, &[100; 4]), [100; 12]);
    }
}
