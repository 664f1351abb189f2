//! Binary morphology: closing with a small disk, filling of holes, removal of small areas. Masks hold 0 and 1.

use super::components::{Components, Connectivity, Labeling, Run, area};
use crate::frame::Region;

/// A binary picture, one byte a pixel, 0 or 1.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mask {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Rows of pixels.
    pub pixels: Vec<u8>,
}

impl Mask {
    #[expect(clippy::cast_possible_truncation, reason = "sides come from a frame, which counts them in u32")]
    const fn window(&self) -> Region {
        Region { x: 0, y: 0, width: self.width as u32, height: self.height as u32 }
    }

    fn set(&mut self, runs: &[Run], value: u8) {
        for run in runs {
            let row = run.y as usize * self.width;
            self.pixels[row + run.start as usize..row + run.end as usize].fill(value);
        }
    }
}

/// Works on masks, one after the other in the same memory.
#[derive(Default)]
pub struct Morphology {
    labeling: Labeling,
    /// Pixels of another mask of the same size.
    spare: Vec<u8>,
}

impl Morphology {
    /// The 8-connected components of a mask's foreground.
    pub fn components(&mut self, mask: &Mask) -> &Components {
        self.labeling.of(&mask.pixels, mask.width, mask.window(), 1, Connectivity::Eight)
    }

    /// Clears every 8-connected component of fewer than `least` pixels.
    pub fn remove_areas_below(&mut self, mask: &mut Mask, least: usize) {
        for runs in self.components(mask).iter() {
            if area(runs) < least {
                mask.set(runs, 0);
            }
        }
    }

    /// Sets every 4-connected piece of background that does not reach the border.
    pub fn fill_holes(&mut self, mask: &mut Mask) {
        self.spare.clear();
        self.spare.extend(mask.pixels.iter().map(|pixel| 1 - pixel));
        let (last_x, last_y) = (mask.width, mask.height - 1);
        for runs in self.labeling.of(&self.spare, mask.width, mask.window(), 1, Connectivity::Four).iter() {
            let outside =
                runs.iter().any(|r| r.start == 0 || r.end as usize == last_x || r.y == 0 || r.y as usize == last_y);
            if !outside {
                mask.set(runs, 1);
            }
        }
    }

    /// Closing with the disk of radius 2 (thirteen pixels: a diamond): dilation, then erosion. What lies outside the picture
    /// neither grows into it nor eats from it.
    ///
    /// The diamond is a cross dilated by a cross, so each half is two passes with the five pixels of a cross.
    pub fn close_disk_2(&mut self, mask: &mut Mask) {
        self.cross(mask, u8::max);
        self.cross(mask, u8::max);
        self.cross(mask, u8::min);
        self.cross(mask, u8::min);
    }

    /// Combines each pixel with those of its four neighbours that lie in the picture.
    fn cross(&mut self, mask: &mut Mask, combine: impl Fn(u8, u8) -> u8) {
        let width = mask.width;
        self.spare.clone_from(&mask.pixels);
        let with = |out: &mut [u8], neighbours: &[u8]| {
            out.iter_mut().zip(neighbours).for_each(|(out, neighbour)| *out = combine(*out, *neighbour));
        };
        with(&mut self.spare[width..], &mask.pixels);
        with(&mut self.spare, &mask.pixels[width..]);
        for (out, here) in self.spare.chunks_exact_mut(width).zip(mask.pixels.chunks_exact(width)) {
            with(&mut out[1..], here);
            with(out, &here[1..]);
        }
        std::mem::swap(&mut mask.pixels, &mut self.spare);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::detect::components::tests::slow_components;

    fn masks() -> impl Strategy<Value = Mask> {
        (1_usize..24, 1_usize..16, 1_u32..9).prop_flat_map(|(width, height, density)| {
            proptest::collection::vec(0_u32..10, width * height).prop_map(move |draws| Mask {
                width,
                height,
                pixels: draws.into_iter().map(|d| u8::from(d < density)).collect(),
            })
        })
    }

    /// Closing by its definition with the offsets of Matlab's `strel('disk', 2)`.
    fn slow_close(mask: &Mask) -> Vec<u8> {
        let offsets: Vec<(isize, isize)> =
            (-2..=2).flat_map(|y| (-2..=2).map(move |x| (x, y))).filter(|(x, y)| x * x + y * y <= 4).collect();
        assert_eq!(offsets.len(), 13);
        let at = |pixels: &[u8], x: usize, y: usize, (dx, dy): (isize, isize)| {
            let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
            (x < mask.width && y < mask.height).then(|| pixels[y * mask.width + x])
        };
        let each = |pixels: &[u8], all: bool| -> Vec<u8> {
            (0..pixels.len())
                .map(|i| {
                    let mut values = offsets.iter().filter_map(|o| at(pixels, i % mask.width, i / mask.width, *o));
                    u8::from(if all { values.all(|v| v == 1) } else { values.any(|v| v == 1) })
                })
                .collect()
        };
        each(&each(&mask.pixels, false), true)
    }

    /// Holes by flooding the background from outside.
    fn slow_fill(mask: &Mask) -> Vec<u8> {
        let background: Vec<u8> = mask.pixels.iter().map(|p| 1 - p).collect();
        let mut filled = mask.pixels.clone();
        for piece in slow_components(&background, mask.width, Connectivity::Four) {
            let at_border = |(x, y): &(usize, usize)| *x == 0 || *y == 0 || x + 1 == mask.width || y + 1 == mask.height;
            if !piece.iter().any(at_border) {
                for (x, y) in piece {
                    filled[y * mask.width + x] = 1;
                }
            }
        }
        filled
    }

    proptest! {
        #[test]
        fn closing_is_that_of_the_definition(mask in masks()) {
            let mut closed = mask.clone();
            Morphology::default().close_disk_2(&mut closed);
            prop_assert_eq!(closed.pixels, slow_close(&mask));
        }

        #[test]
        fn filling_is_that_of_the_definition(mask in masks()) {
            let mut filled = mask.clone();
            Morphology::default().fill_holes(&mut filled);
            prop_assert_eq!(filled.pixels, slow_fill(&mask));
        }

        #[test]
        fn small_areas_go_and_large_ones_stay(mask in masks(), least in 1_usize..20) {
            let mut opened = mask.clone();
            Morphology::default().remove_areas_below(&mut opened, least);
            let mut expected = vec![0; mask.pixels.len()];
            for piece in slow_components(&mask.pixels, mask.width, Connectivity::Eight) {
                if piece.len() >= least {
                    for (x, y) in piece {
                        expected[y * mask.width + x] = 1;
                    }
                }
            }
            prop_assert_eq!(opened.pixels, expected);
        }
    }
}
