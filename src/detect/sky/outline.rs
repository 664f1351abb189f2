//! What belongs to a peak: the pixels around it that stand out from the background at least half as much.

use super::level::Level;

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
    let clamped = |dx: f32, dy: f32| {
        let column = (x as f32 + dx).round().clamp(0.0, (width - 1) as f32);
        let row = (y as f32 + dy).round().clamp(0.0, (height - 1) as f32);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the level")]
        let index = row as usize * width + column as usize;
        f32::from(level.smooth[index])
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
    let (half, quarter) = (0.5 * contrast, 0.25 * contrast);
    let (left, top) = (x.saturating_sub(REACH), y.saturating_sub(REACH));
    let (right, bottom) = ((x + REACH + 1).min(width), (y + REACH + 1).min(height));
    let mut seen = [0_u32; SIDE];
    let mut open = [(0_u8, 0_u8); SIDE * SIDE];
    let mut count = 1;
    #[expect(clippy::cast_possible_truncation, reason = "inside the window")]
    {
        open[0] = ((x - left) as u8, (y - top) as u8);
    }
    seen[y - top] |= 1 << (x - left);
    let mut next = 0;
    let (mut weight, mut sum) = (0.0_f32, [0.0_f32; 2]);
    let mut bounds = [x, y, x + 1, y + 1];
    let (mut area, mut goes_on) = (0.0_f32, false);
    while next < count {
        let (column, row) = (open[next].0 as usize + left, open[next].1 as usize + top);
        next += 1;
        let here = signed(f32::from(level.smooth[row * width + column]) - background).min(1.5 * contrast);
        if here > half {
            let (u, v) = (column as f32 - x as f32, row as f32 - y as f32);
            area += 1.0;
            weight += here;
            sum[0] += here * u;
            sum[1] += here * v;
            bounds = [bounds[0].min(column), bounds[1].min(row), bounds[2].max(column + 1), bounds[3].max(row + 1)];
        }
        for (i, j) in [(0, 1), (1, 0), (1, 2), (2, 1)] {
            let (column, row) = (column + i, row + j);
            if column < left + 1 || row < top + 1 || column > right || row > bottom {
                // The window's border, not the frame's.
                goes_on |= (column < left + 1 && left > 0)
                    || (row < top + 1 && top > 0)
                    || (column > right && right < width)
                    || (row > bottom && bottom < height);
                continue;
            }
            let (column, row) = (column - 1, row - 1);
            let bit = 1 << (column - left);
            if seen[row - top] & bit == 0
                && signed(f32::from(level.smooth[row * width + column]) - background) > quarter
            {
                seen[row - top] |= bit;
                #[expect(clippy::cast_possible_truncation, reason = "inside the window")]
                {
                    open[count] = ((column - left) as u8, (row - top) as u8);
                }
                count += 1;
            }
        }
    }
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
