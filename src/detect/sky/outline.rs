//! What belongs to a peak: the pixels around it that stand out from the background at least half as much.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, u16x32};

use super::level::Level;
use crate::detect::MACHINE;

/// How far a thing may reach from its peak, px of its level.
const REACH: usize = 12;
const SIDE: usize = 2 * REACH + 1;

/// A thing at one level, in px of that level.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outline {
    /// Mean position, weighted by contrast.
    pub place: [f32; 2],
    /// First column and row, and one past the last.
    pub bounds: [usize; 4],
    /// Pixels.
    pub area: f32,
    /// Height of the peak over the background, with its sign, in steps of the level.
    pub contrast: f32,
    /// Of the ring around the thing, the largest share of its contrast in any direction: near 0 stands alone, near 1 goes on.
    pub openness: f32,
    /// Mean deviation of that ring, as a share of the contrast.
    pub unrest: f32,
    /// Whether what hangs together with it at a quarter of its contrast goes on beyond the window.
    pub goes_on: bool,
}

/// Directions of the ring.
const DIRECTIONS: [[f32; 2]; 16] = {
    const A: f32 = 0.923_879_5;
    const B: f32 = core::f32::consts::FRAC_1_SQRT_2;
    const C: f32 = 0.382_683_43;
    [
        [1.0, 0.0],
        [A, C],
        [B, B],
        [C, A],
        [0.0, 1.0],
        [-C, A],
        [-B, B],
        [-A, C],
        [-1.0, 0.0],
        [-A, -C],
        [-B, -B],
        [-C, -A],
        [0.0, -1.0],
        [C, -A],
        [B, -B],
        [A, -C],
    ]
};

/// The thing whose peak is at `x`, `y`, bright or dark as the contrast there is. None if it is no more than its background.
#[must_use]
pub fn outline(level: &Level, x: usize, y: usize) -> Option<Outline> {
    let (width, height) = (level.width, level.height);
    let is_bright = level.contrast[y * width + x] > 0;
    let signed = |value: f32| if is_bright { value } else { -value };
    // The pixel that is nearest, of those of the level.
    let clamped = |dx: f32, dy: f32| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the level")]
        let nearest = |along: f32, side: usize| (along.clamp(0.0, (side - 1) as f32) + 0.5) as usize;
        f32::from(level.smooth[nearest(y as f32 + dy, height) * width + nearest(x as f32 + dx, width)])
    };
    let mut ring = DIRECTIONS.map(|[dx, dy]| clamped(dx * REACH as f32, dy * REACH as f32));
    ring.sort_by(f32::total_cmp);
    let background = 0.5 * (ring[7] + ring[8]);
    let peak = f32::from(level.smooth[y * width + x]);
    // A thing on a slope is no more than the slope over so wide a ring: then what is next to it is the background.
    let near = peak - f32::from(level.contrast[y * width + x]);
    let background = if signed(peak - background) > signed(peak - near) { background } else { near };
    let contrast = signed(peak - background);
    if contrast < 1.0 {
        return None;
    }
    let half = 0.5 * contrast;
    let window = Window::around(level, x, y);
    let filled = window.filled(level, [x, y], Beyond::of(background, 0.25 * contrast, is_bright));
    let (mut weight, mut sum) = (0.0_f32, [0.0_f32; 2]);
    let mut bounds = [x, y, x + 1, y + 1];
    let mut area = 0.0_f32;
    for (row, bits) in (window.top..window.bottom).zip(filled) {
        let line = &level.smooth[row * width..][..width];
        let mut left = bits;
        while left != 0 {
            let column = window.left + left.trailing_zeros() as usize;
            left &= left - 1;
            let here = signed(f32::from(line[column]) - background).min(1.5 * contrast);
            if here > half {
                let (u, v) = (column as f32 - x as f32, row as f32 - y as f32);
                area += 1.0;
                weight += here;
                sum[0] += here * u;
                sum[1] += here * v;
                bounds = [bounds[0].min(column), bounds[1].min(row), bounds[2].max(column + 1), bounds[3].max(row + 1)];
            }
        }
    }
    let goes_on = window.is_left(level, &filled);
    let (mu, mv) = (sum[0] / weight, sum[1] / weight);
    // Once around the thing, at a distance that its own blur does not reach.
    let (half_across, half_down) = (0.5 * (bounds[2] - bounds[0]) as f32, 0.5 * (bounds[3] - bounds[1]) as f32);
    let (cu, cv) =
        (0.5 * (bounds[0] + bounds[2] - 1) as f32 - x as f32, 0.5 * (bounds[1] + bounds[3] - 1) as f32 - y as f32);
    let (mut worst, mut unrest) = (0.0_f32, 0.0_f32);
    for [dx, dy] in DIRECTIONS {
        let value = clamped(cu + dx * (1.4 * half_across + 3.0), cv + dy * (1.4 * half_down + 3.0)) - background;
        worst = worst.max(signed(value));
        unrest += value.abs();
    }
    Some(Outline {
        place: [x as f32 + mu, y as f32 + mv],
        bounds,
        area,
        contrast: signed(contrast),
        openness: worst / contrast,
        unrest: unrest / (16.0 * contrast),
        goes_on,
    })
}

/// What stands out far enough.
#[derive(Clone, Copy, Debug)]
enum Beyond {
    Above(u16),
    Below(u16),
}

/// Values that are looked at together: a row of the window and more.
const WIDE: usize = 32;

impl Beyond {
    /// More than `contrast` above or below the background.
    fn of(background: f32, contrast: f32, is_bright: bool) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to what a pixel may be")]
        let whole = |limit: f32| limit.clamp(0.0, f32::from(u16::MAX)) as u16;
        if is_bright {
            Self::Above(whole((background + contrast).floor()))
        } else {
            Self::Below(whole((background - contrast).ceil()))
        }
    }

    /// A bit for each of the first values that is, the lowest for the very first.
    fn first(self, values: &[u16]) -> u32 {
        if let Some(line) = values.first_chunk() {
            return dispatch!(*MACHINE, simd => self.bits(simd, line));
        }
        let mut line = [0; WIDE];
        line[..values.len()].copy_from_slice(values);
        dispatch!(*MACHINE, simd => self.bits(simd, &line))
    }

    #[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
    #[inline(always)]
    fn bits<S: Simd>(self, simd: S, line: &[u16; WIDE]) -> u32 {
        let values = u16x32::from_slice(simd, line);
        let mask = match self {
            Self::Above(limit) => values.simd_gt(limit),
            Self::Below(limit) => values.simd_lt(limit),
        };
        #[expect(clippy::cast_possible_truncation, reason = "a bit for each of 32 values")]
        let bits = mask.to_bitmask() as u32;
        bits
    }
}

/// The pixels that a thing may reach. A row of it is a number whose lowest bit is the leftmost pixel.
#[derive(Clone, Copy)]
struct Window {
    left: usize,
    top: usize,
    right: usize,
    bottom: usize,
}

impl Window {
    fn around(level: &Level, x: usize, y: usize) -> Self {
        Self {
            left: x.saturating_sub(REACH),
            top: y.saturating_sub(REACH),
            right: (x + REACH + 1).min(level.width),
            bottom: (y + REACH + 1).min(level.height),
        }
    }

    /// What hangs together with a pixel, side by side, of those that are `beyond`; the pixel itself in any case.
    fn filled(&self, level: &Level, [x, y]: [usize; 2], beyond: Beyond) -> [u32; SIDE] {
        let rows = self.bottom - self.top;
        let columns = u32::MAX >> (u32::BITS as usize - (self.right - self.left));
        let mask = |row: usize| {
            let start = (self.top + row) * level.width + self.left;
            beyond.first(&level.smooth[start..]) & columns
        };
        let mut filled = [0_u32; SIDE];
        // Rows are looked at when a neighbour reaches them.
        let mut masks = [None; SIDE];
        let start = y - self.top;
        filled[start] = 1 << (x - self.left);
        masks[start] = Some(mask(start) | filled[start]);
        let mut open = [false; SIDE];
        open[start] = true;
        let mut row = start;
        loop {
            open[row] = false;
            let here = *masks[row].get_or_insert_with(|| mask(row));
            let spread = spread(filled[row] & here, here);
            filled[row] = spread;
            for next in [row.wrapping_sub(1), row + 1] {
                if next < rows {
                    let new = spread & *masks[next].get_or_insert_with(|| mask(next)) & !filled[next];
                    if new != 0 {
                        filled[next] |= new;
                        open[next] = true;
                    }
                }
            }
            match open.iter().position(|open| *open) {
                Some(next) => row = next,
                None => return filled,
            }
        }
    }

    /// Whether what is filled reaches a border of the window that is not the frame's.
    fn is_left(&self, level: &Level, filled: &[u32; SIDE]) -> bool {
        let columns = filled.iter().fold(0, |all, row| all | row);
        (self.left > 0 && columns & 1 != 0)
            || (self.right < level.width && columns >> (self.right - self.left - 1) != 0)
            || (self.top > 0 && filled[0] != 0)
            || (self.bottom < level.height && filled[self.bottom - self.top - 1] != 0)
    }
}

/// `bits` spread sideways as far as `mask` goes on.
const fn spread(mut bits: u32, mask: u32) -> u32 {
    loop {
        let wider = (bits | bits << 1 | bits >> 1) & mask;
        if wider == bits {
            return bits;
        }
        bits = wider;
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::random::case;

    /// One pixel after another.
    fn slow(window: &Window, level: &Level, [x, y]: [usize; 2], over: impl Fn(u16) -> bool) -> [u32; SIDE] {
        let mut filled = [0_u32; SIDE];
        let mut open = vec![(x, y)];
        while let Some((x, y)) = open.pop() {
            let bit = 1 << (x - window.left);
            if filled[y - window.top] & bit != 0 {
                continue;
            }
            filled[y - window.top] |= bit;
            let next = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
            open.extend(next.into_iter().filter(|(x, y)| {
                (window.left..window.right).contains(x)
                    && (window.top..window.bottom).contains(y)
                    && over(level.smooth[y * level.width + x])
            }));
        }
        filled
    }

    #[test]
    fn what_hangs_together_is_what_a_walk_from_pixel_to_pixel_reaches() {
        for index in 0..400 {
            let mut rng = case("filled windows", index);
            let (width, height) = (rng.random_range(4..60), rng.random_range(4..60));
            // From a few pixels over to nearly all of them: at six tenths of them ways are longest.
            let share = rng.random_range(0.2..0.95);
            let mut level = Level::default();
            (level.width, level.height) = (width, height);
            level.smooth = (0..width * height).map(|_| 700 + u16::from(rng.random_bool(share))).collect();
            let [x, y] = [rng.random_range(0..width), rng.random_range(0..height)];
            let window = Window::around(&level, x, y);
            for is_bright in [true, false] {
                let over = |value: u16| (value > 700) == is_bright;
                let beyond = Beyond::of(if is_bright { 700.0 } else { 701.0 }, 0.5, is_bright);
                let (found, truth) = (window.filled(&level, [x, y], beyond), slow(&window, &level, [x, y], over));
                assert_eq!(found, truth, "{index}: {width} x {height} from {x}, {y}, {beyond:?}");
            }
        }
    }
}
